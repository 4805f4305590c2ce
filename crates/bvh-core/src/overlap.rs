//! End-point overlap: the surface that a node's box holds and the node does not.

use crate::cost::{SahConstants, Sum};
use crate::{Aabb, Bvh, NodeKind, Triangle};
use alloc::vec::Vec;
use core::ops::Range;
use glam::DVec3;

/// The end-point overlap, EPO = Σ over nodes of C(node) · A((S \ Q(node)) ∩ box(node)) / A(S), where S is the surface
/// of all triangles, Q(node) that of the triangles below the node, and C the traversal constant for an inner node, the
/// intersection constant times the number of objects for a leaf. Dimensionless multiple of the constants' unit: the
/// expected cost of nodes that a ray enters although it ends on a surface elsewhere. Together with the surface area
/// heuristic it predicts times better than that alone.
///
/// Areas are of triangles clipped against boxes, in f64, by Sutherland & Hodgman's algorithm, plane by plane: exact but
/// for rounding. Boxes are closed: a triangle within a face of a box counts. 0 by definition for triangles without
/// area.
///
/// Time: O(Σ over triangles of the nodes whose boxes they meet), some n log n on common scenes and n² at most; memory
/// O(n).
///
/// Source: Aila, Karras & Laine 2013, 'On quality metrics of bounding volume hierarchies', section 4.2. Differs from
/// the paper: constants 1 and 1 by default, there 1.2 and 1.
///
/// # Panics
/// May panic on a tree that [`validate`](crate::validate()) refuses for the triangles' boxes.
pub fn end_point_overlap(tree: &Bvh, triangles: &[Triangle], constants: &SahConstants) -> f64 {
    let parts = EndPointOverlap::new(tree, triangles, constants);
    let mut sum = Overlap::default();
    (0..parts.count()).for_each(|number| sum.add(&parts.part(number)));
    sum.value()
}

/// The [`end_point_overlap`] in parts, which can be computed in any order or in parallel.
///
/// Added in their order, they give the same bits as the whole.
#[derive(Clone, Debug)]
pub struct EndPointOverlap<'a> {
    tree: &'a Bvh,
    triangles: &'a [Triangle],
    constants: SahConstants,
    /// Per node, the range of the object ids below it, by their positions from the first leaf to the last.
    below: Vec<Range<u32>>,
    /// Pairs of an object and one of its positions, sorted.
    positions: Vec<(u32, u32)>,
    /// Every object once, neighbours in the tree next to each other, with the range of its `positions`.
    objects: Vec<(u32, Range<u32>)>,
}

/// What some triangles contribute to the end-point overlap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlap {
    /// Their area.
    surface: Sum,
    /// Their area in nodes that they do not belong to, times the costs of these nodes.
    weighted: Sum,
}

impl Overlap {
    /// Adds the contribution of other triangles.
    pub fn add(&mut self, other: &Self) {
        self.surface.add_sum(&other.surface);
        self.weighted.add_sum(&other.weighted);
    }

    /// The end-point overlap if all triangles have contributed.
    pub fn value(&self) -> f64 {
        let surface = self.surface.value();
        if surface > 0.0 { self.weighted.value() / surface } else { 0.0 }
    }
}

impl<'a> EndPointOverlap<'a> {
    /// Triangles per part.
    const PART: usize = 4096;

    /// Prepares the parts. O(nodes + n log n).
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) refuses for the triangles' boxes.
    pub fn new(tree: &'a Bvh, triangles: &'a [Triangle], constants: &SahConstants) -> Self {
        let mut below = alloc::vec![0..0; tree.nodes.len()];
        let mut positions = Vec::with_capacity(tree.prim_ids.len());
        let mut stack: Vec<(usize, bool)> = tree
            .nodes
            .first()
            .map(|_| (0, false))
            .into_iter()
            .collect();
        while let Some((at, children_done)) = stack.pop() {
            let node = &tree.nodes[at];
            if children_done {
                below[at].end = positions.len() as u32;
                continue;
            }
            below[at].start = positions.len() as u32;
            for &object in &tree.prim_ids[node.prims()] {
                positions.push((object, positions.len() as u32));
            }
            stack.push((at, true));
            stack.extend(node.children().rev().map(|child| (child, false)));
        }
        positions.sort_unstable();
        let mut objects: Vec<(u32, Range<u32>)> = Vec::with_capacity(triangles.len());
        for (at, &(object, _)) in (0..).zip(&positions) {
            match objects
                .last_mut()
                .filter(|(last, _)| *last == object)
            {
                Some((_, range)) => range.end = at + 1,
                None => objects.push((object, at..at + 1)),
            }
        }
        objects.sort_unstable_by_key(|(_, range)| positions[range.start as usize].1);
        Self { tree, triangles, constants: *constants, below, positions, objects }
    }

    /// Number of parts.
    pub fn count(&self) -> usize {
        self.objects.len().div_ceil(Self::PART)
    }

    /// The contribution of the triangles of one part.
    ///
    /// # Panics
    /// If there is no part of this number.
    pub fn part(&self, number: usize) -> Overlap {
        let mut sum = Overlap::default();
        let mut open = Vec::new();
        let start = number * Self::PART;
        for (object, positions) in &self.objects[start..self.objects.len().min(start + Self::PART)]
        {
            let positions = &self.positions[positions.start as usize..positions.end as usize];
            self.visit(&self.triangles[*object as usize], positions, &mut open, &mut sum);
        }
        sum
    }

    /// Adds the contribution of a triangle with these positions.
    fn visit(
        &self,
        triangle: &Triangle,
        positions: &[(u32, u32)],
        open: &mut Vec<usize>,
        sum: &mut Overlap,
    ) {
        let aabb = triangle.aabb();
        let polygon = Polygon::new(triangle.0.map(|corner| corner.as_dvec3()));
        let area = polygon.area();
        sum.surface.add(area);
        open.push(0);
        while let Some(index) = open.pop() {
            let node = &self.tree.nodes[index];
            let is_above = positions
                .iter()
                .any(|(_, position)| self.below[index].contains(position));
            if !is_above {
                let inside = polygon.area_inside(&node.aabb, &aabb, area);
                if inside == 0.0 {
                    // Nor is anything with an area inside a box below.
                    continue;
                }
                let cost = match node.kind() {
                    NodeKind::Inner { .. } => self.constants.traversal,
                    NodeKind::Leaf { count, .. } => self.constants.intersection * f64::from(count),
                };
                sum.weighted.add(inside * cost);
            }
            let meets = |child: &usize| {
                let child = &self.tree.nodes[*child].aabb;
                !(child.min.cmpgt(aabb.max) | child.max.cmplt(aabb.min)).any()
            };
            open.extend(node.children().filter(meets));
        }
    }
}

/// A convex planar polygon: a triangle cut by up to six planes, each of which adds one corner at most.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; 9],
    len: usize,
}

impl Polygon {
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let mut corners = [DVec3::ZERO; 9];
        corners[..3].copy_from_slice(&[a, b, c]);
        Self { corners, len: 3 }
    }

    /// The area, whole, not half.
    fn area(&self) -> f64 {
        let fan = self.corners[..self.len].windows(2).skip(1);
        let doubled: DVec3 = fan
            .map(|pair| (pair[0] - self.corners[0]).cross(pair[1] - self.corners[0]))
            .sum();
        libm::sqrt(doubled.length_squared()) / 2.0
    }

    /// The area inside a box, if `area` is that of the whole and `own` is the box around it. Planes that do not cut it are skipped,
    /// which changes no bit.
    fn area_inside(&self, aabb: &Aabb, own: &Aabb, area: f64) -> f64 {
        let mut part: Option<Self> = None;
        for axis in 0..3 {
            if own.min[axis] < aabb.min[axis] {
                let min = f64::from(aabb.min[axis]);
                part = Some(
                    part.as_ref()
                        .unwrap_or(self)
                        .cut(|p| p[axis] - min),
                );
            }
            if own.max[axis] > aabb.max[axis] {
                let max = f64::from(aabb.max[axis]);
                part = Some(
                    part.as_ref()
                        .unwrap_or(self)
                        .cut(|p| max - p[axis]),
                );
            }
        }
        part.map_or(area, |part| part.area())
    }

    /// The part where `height` is not negative.
    #[inline(always)]
    fn cut(&self, height: impl Fn(DVec3) -> f64) -> Self {
        let mut kept = Self { len: 0, corners: [DVec3::ZERO; 9] };
        let mut keep = |corner| {
            kept.corners[kept.len] = corner;
            kept.len += 1;
        };
        for at in 0..self.len {
            let from = self.corners[at];
            let to = self.corners[(at + 1) % self.len];
            let low = height(from);
            let high = height(to);
            if low >= 0.0 {
                keep(from);
            }
            if (low < 0.0) != (high < 0.0) && low != 0.0 && high != 0.0 {
                keep(from + (to - from) * (low / (low - high)));
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Node;
    use alloc::vec;

    /// Two unit right triangles side by side in the plane z = 0, the second moved by `x`, each in a leaf of its own.
    fn pair(x: f32) -> (Vec<Triangle>, Bvh) {
        let triangle = |x: f32| Triangle::from([[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]);
        let triangles = vec![triangle(0.0), triangle(x)];
        let [a, b] = [triangles[0].aabb(), triangles[1].aabb()];
        let nodes = vec![Node::inner(a.union(&b), 1, 2), Node::leaf(a, 0, 1), Node::leaf(b, 1, 1)];
        (triangles, Bvh { nodes, prim_ids: vec![0, 1] })
    }

    #[test]
    fn overlap_is_what_the_hand_computes() {
        let overlap = |x| {
            let (triangles, tree) = pair(x);
            end_point_overlap(
                &tree,
                &triangles,
                &SahConstants { traversal: 1.0, intersection: 2.0 },
            )
        };
        assert_eq!(overlap(2.0), 0.0);
        // Half of the first one's box holds the second without its corner, 1/2 − 1/8; the second's holds 1/8 of the
        // first.
        assert_eq!(overlap(0.5), 2.0 * (0.375 + 0.125) / 1.0);
        // Each holds the other.
        assert_eq!(overlap(0.0), 2.0);
    }

    #[test]
    fn clipped_areas_add_up_over_a_grid() {
        let corners =
            [DVec3::new(-0.3, 0.1, 2.2), DVec3::new(4.1, 3.3, -0.4), DVec3::new(1.0, 3.9, 3.7)];
        let whole = Polygon::new(corners);
        let own = Triangle(corners.map(|corner| corner.as_vec3())).aabb();
        let mut sum = 0.0;
        for cell in 0..6 * 6 * 6u8 {
            let min = [cell % 6, cell / 6 % 6, cell / 36].map(|i| f32::from(i) - 1.0);
            let cell = Aabb::from([min, min.map(|x| x + 1.0)]);
            sum += whole.area_inside(&cell, &own, whole.area());
        }
        assert!((sum - whole.area()).abs() < 1e-12 * whole.area(), "{sum} {}", whole.area());
    }

    #[test]
    fn a_tree_of_one_leaf_and_triangles_without_area_have_none() {
        let (triangles, _) = pair(0.5);
        let root = triangles[0].aabb().union(&triangles[1].aabb());
        let tree = Bvh { nodes: vec![Node::leaf(root, 0, 2)], prim_ids: vec![0, 1] };
        assert_eq!(end_point_overlap(&tree, &triangles, &SahConstants::default()), 0.0);
        let (mut triangles, tree) = pair(0.5);
        triangles.iter_mut().for_each(|t| t.0[2] = t.0[1]);
        assert_eq!(end_point_overlap(&tree, &triangles, &SahConstants::default()), 0.0);
        assert_eq!(end_point_overlap(&Bvh::default(), &[], &SahConstants::default()), 0.0);
    }
}
