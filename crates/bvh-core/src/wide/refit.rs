//! The wide layout over triangles that have moved, and what it then costs.

use super::layout::{Child, WideBvh, WideNode};
use super::triangles::TriangleBlock;
use crate::{Aabb, Corners, Triangle};

/// Why a layout cannot follow its triangles, and has to be made anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RefitError {
    /// A corner of a triangle is NaN or infinite, or its box in the frame is.
    #[error("triangle {0} has a corner that is not finite, or a box in the frame of the layout")]
    NotFinite(u32),
    /// The layout has a triangle that the new ones lack, or that has lost its area.
    #[error(
        "triangle {0} had an area, and is missing or has none now: make the layout or tracer anew"
    )]
    Lost(u32),
    /// A triangle has an area, and is not in the layout: it had none, or was not there.
    #[error(
        "triangle {0} has an area now, and had none or was missing: make the layout or tracer anew"
    )]
    Gained(u32),
}

impl WideBvh {
    /// Moves the layout to the same triangles at other places: corners and boxes are those of
    /// `triangles`, nodes and leaves remain. The answers are exact, as those of a new layout; the
    /// time to find them grows with the [cost](Self::expected_visits). Of split references every
    /// part gets the box of its whole triangle. O(n), and much faster than a new layout. A refused
    /// layout is unchanged.
    ///
    /// ```
    /// # use bvh_core::{Bvh, Hit, Node, Ray, Triangle, WideBvh};
    /// let triangles = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]].map(Triangle::from);
    /// # let tree = Bvh::new(vec![Node::leaf(triangles[0].aabb(), 0, 1)], vec![0]);
    /// let mut wide = WideBvh::new(&tree, &triangles)?;
    /// let moved = triangles.map(|triangle| Triangle(triangle.0.map(|corner| corner + 1.0)));
    /// wide.refit(&moved)?;
    /// let ray = Ray::half_line([1.2, 1.2, 3.0], [0.0, 0.0, -1.0])?;
    /// assert_eq!(wide.nearest_hit(&ray), Some(Hit { t: 2.0, object: 0 }));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn refit(&mut self, triangles: &[Triangle]) -> Result<(), RefitError> {
        let mut is_new = vec![true; triangles.len()];
        for block in self.blocks.iter() {
            for (id, _) in block.triangles() {
                let triangle =
                    triangles.get(id as usize).filter(|triangle| !triangle.is_degenerate());
                triangle.ok_or(RefitError::Lost(id))?;
                is_new[id as usize] = false;
            }
        }
        for (id, (triangle, is_new)) in (0..).zip(triangles.iter().zip(is_new)) {
            if triangle.aabb_in(self.frame()).check().is_err() {
                return Err(RefitError::NotFinite(id));
            }
            if is_new && !triangle.is_degenerate() {
                return Err(RefitError::Gained(id));
            }
        }
        for block in &mut self.blocks {
            block.move_to(triangles);
        }
        // Children come after their parents.
        let mut around = vec![Aabb::EMPTY; self.nodes.len()];
        for index in (0..self.nodes.len()).rev() {
            for lane in 0..WideNode::LANES {
                let child = self.nodes[index].children[lane];
                if self.nodes[index].lane_box(lane).is_some() {
                    let aabb = self.box_of(child, &around);
                    self.nodes[index].set_box(lane, &aabb);
                    around[index] = around[index].union(&aabb);
                }
            }
        }
        let bounds = self.root.map_or(Aabb::EMPTY, |root| self.box_of(root, &around));
        let Some(framed) = self.framed.take() else {
            self.set_bounds(None, &bounds, bounds);
            return Ok(());
        };
        let corners = triangles.iter().flat_map(|triangle| triangle.0);
        self.set_bounds(Some(framed.frame), &bounds, Aabb::around(corners));
        for index in 0..self.nodes.len() {
            for lane in 0..WideNode::LANES {
                if let Some(aabb) = self.nodes[index].lane_box(lane) {
                    let laid = self.laid(&aabb);
                    self.nodes[index].set_box(lane, &laid);
                }
            }
        }
        Ok(())
    }

    /// The box of a child: of a node that `around` has, or of a leaf's triangles.
    fn box_of(&self, child: Child, around: &[Aabb]) -> Aabb {
        if child.is_node() {
            return around[child.index()];
        }
        let frame = self.frame();
        let triangles = self.leaf(child).iter().flat_map(TriangleBlock::triangles);
        triangles.fold(Aabb::EMPTY, |aabb, (_, triangle)| aabb.union(&triangle.aabb_in(frame)))
    }

    pub(super) fn boxes(&self) -> impl Iterator<Item = (Aabb, Child)> {
        let lanes = self.nodes.iter().flat_map(|node| {
            let child = move |lane| Some((node.lane_box(lane)?, node.children[lane]));
            (0..WideNode::LANES).filter_map(child)
        });
        self.root.map(|root| (*self.root_box(), root)).into_iter().chain(lanes)
    }

    pub(super) fn leaf(&self, leaf: Child) -> &[TriangleBlock] {
        let blocks = &self.blocks[leaf.index()..];
        let end =
            blocks.iter().position(TriangleBlock::is_last).map_or(blocks.len(), |last| last + 1);
        &blocks[..end]
    }

    /// How many nodes and blocks of triangles a random line through the layout's box is expected to
    /// visit: what [`new`](Self::new) makes least. Its growth by [`refit`](Self::refit) says when a
    /// new or improved tree is worth its time. 0 for a scene without area. O(nodes + blocks).
    pub fn expected_visits(&self) -> f64 {
        let visits = |(aabb, child): (Aabb, Child)| {
            aabb.half_area() * if child.is_node() { 1.0 } else { self.leaf(child).len() as f64 }
        };
        let total: f64 = self.boxes().map(visits).sum();
        let area = self.root_box().half_area();
        if area > 0.0 { total / area } else { 0.0 }
    }
}
