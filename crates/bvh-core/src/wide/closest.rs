//! The points of the triangles closest to given points, and signed distances.

use super::layout::WideBvh;
use super::nearest::{Closest, Nearest};
use super::node::{Child, WideNode};
use super::vector;
use crate::Kernel;
use alloc::vec::Vec;
use glam::Vec3;

/// A child that is visited later, and a lower bound of the squared distances of its triangles.
#[derive(Clone, Copy)]
struct Pending {
    bound: f64,
    child: Child,
}

impl WideBvh {
    /// Returns the closest point of the triangles, in f64; among triangles at the same distance the
    /// lowest id wins. Returns `None` for a point that is not finite, and if no triangle has an
    /// area: the layout omits triangles without area.
    ///
    /// The point is the point of [`Triangle::closest_point`](crate::Triangle::closest_point), and no
    /// other triangle's point is closer as computed in f64. In a layout with divided triangles that
    /// are 10¹⁵ times as large as their distances, rounding decides which of them is the closest,
    /// and kernels may differ in it. About O(log n) for a point near triangles that are spread out.
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Node, Triangle, WideBvh};
    /// let triangle = Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    /// # let leaf = Node::leaf(triangle.aabb(), 0, 1);
    /// # let tree = Bvh { nodes: vec![leaf], prim_ids: vec![0] };
    /// let wide = WideBvh::new(&tree, &[triangle])?;
    /// let closest = wide.closest_point([0.25, 0.25, 3.0]).unwrap();
    /// assert_eq!((closest.object, closest.distance), (0, 3.0));
    /// assert_eq!(closest.point.to_array(), [0.25, 0.25, 0.0]);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    pub fn closest_point(&self, point: impl Into<Vec3>) -> Option<Closest> {
        let mut closest = [None];
        self.closest_points(&[point.into()], &mut closest);
        closest[0]
    }

    /// Writes the [closest point](Self::closest_point) of every point.
    ///
    /// # Panics
    /// Panics if `points` and `closest` are not equally many.
    pub fn closest_points(&self, points: &[Vec3], closest: &mut [Option<Closest>]) {
        assert_eq!(points.len(), closest.len(), "an answer for every point");
        if self.kernel != Kernel::Portable {
            // SAFETY: `kernel` is available, as those who set it saw.
            return unsafe { vector::closest_points(self, points, closest) };
        }
        let mut stack = Vec::new();
        for (&point, closest) in points.iter().zip(closest) {
            *closest = self.closest_portable(point, &mut stack);
        }
    }

    /// Writes the distance of every point from the [closest point](Self::closest_point), negative
    /// if the mesh [contains](Self::contains) the point: the sign follows from parity, and is right
    /// for closed meshes. Infinite where there is no closest point.
    ///
    /// # Panics
    /// Panics if `points` and `distances` are not equally many.
    pub fn signed_distances(&self, points: &[Vec3], distances: &mut [f64]) {
        assert_eq!(points.len(), distances.len(), "a distance for every point");
        let mut inside = alloc::vec![false; points.len()];
        self.contains(points, &mut inside);
        let mut closest = alloc::vec![None; points.len()];
        self.closest_points(points, &mut closest);
        for ((closest, inside), distance) in closest.iter().zip(inside).zip(distances) {
            let size = closest.map_or(f64::INFINITY, |closest| closest.distance);
            *distance = if inside { -size } else { size };
        }
    }

    /// Returns the closest point by code for any machine.
    fn closest_portable(&self, point: Vec3, stack: &mut Vec<Pending>) -> Option<Closest> {
        let mut child = self.root.filter(|_| point.is_finite())?;
        let mut nearest = Nearest::new(point);
        stack.clear();
        loop {
            if child.is_node() {
                let node = &self.nodes[child.index()];
                let first = stack.len();
                for (lane, bound) in bounds(node, point).into_iter().enumerate() {
                    // Unused lanes are infinitely far away.
                    if bound <= nearest.near.distance_squared.min(f64::MAX) {
                        stack.push(Pending { bound, child: node.children[lane] });
                    }
                }
                stack[first..].sort_by(|a, b| b.bound.total_cmp(&a.bound));
            } else {
                for block in &self.blocks[child.index()..] {
                    for (object, triangle) in block.triangles() {
                        nearest.offer(object, triangle.offset_from(nearest.target));
                    }
                    if block.is_last() {
                        break;
                    }
                }
            }
            child = loop {
                let Some(pending) = stack.pop() else { return nearest.closest() };
                if pending.bound <= nearest.near.distance_squared {
                    break pending.child;
                }
            };
        }
    }
}

/// Returns lower bounds of the squared distances of a point from the boxes of a node; ∞ for
/// unused lanes.
#[inline(always)]
fn bounds(node: &WideNode, point: Vec3) -> [f64; WideNode::LANES] {
    /// Covers the rounding in f64.
    const ROUNDING: f64 = 1.0 - 1.0 / (1 << 21) as f64;
    let mut bounds = [0.0; WideNode::LANES];
    for axis in 0..3 {
        let lower = &node.planes[axis];
        let upper = &node.planes[axis + 3];
        for lane in 0..WideNode::LANES {
            // In f32 differences of the largest coordinates would overflow.
            let below = f64::from(lower[lane]) - f64::from(point[axis]);
            let above = f64::from(point[axis]) - f64::from(upper[lane]);
            let outside = below.max(above).max(0.0);
            bounds[lane] += outside * outside;
        }
    }
    bounds.map(|bound| bound * ROUNDING)
}
