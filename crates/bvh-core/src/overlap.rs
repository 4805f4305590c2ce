//! End-point overlap: the surface that a node's box holds and the node does not.

use crate::cost::{SahConstants, Sum};
use crate::{Aabb, Bvh, NodeKind, Triangle};
use alloc::vec::Vec;
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
    let (mut parent, mut leaf_of) = (alloc::vec![0; tree.nodes.len()], alloc::vec![0; triangles.len()]);
    for (index, node) in tree.nodes.iter().enumerate() {
        parent[node.children()].fill(index);
        tree.prim_ids[node.prims()].iter().for_each(|&object| leaf_of[object as usize] = index);
    }
    // Which triangle a node was last found to be above of, by number + 1.
    let mut above = alloc::vec![0; tree.nodes.len()];
    let (mut total, mut overlap) = (Sum::default(), Sum::default());
    let mut open = Vec::new();
    for (object, triangle) in triangles.iter().enumerate() {
        let mut node = leaf_of[object];
        above[node] = object + 1;
        while node != 0 {
            node = parent[node];
            above[node] = object + 1;
        }
        let (aabb, corners) = (triangle.aabb(), triangle.0.map(|corner| corner.as_dvec3()));
        let area = Polygon::new(corners).area();
        total.add(area);
        open.push(0);
        while let Some(index) = open.pop() {
            let node = &tree.nodes[index];
            if above[index] != object + 1 {
                let inside = if node.aabb.contains(&aabb) {
                    area
                } else {
                    if (node.aabb.min.cmpgt(aabb.max) | node.aabb.max.cmplt(aabb.min)).any() {
                        continue;
                    }
                    let clipped = Polygon::new(corners).clipped(&node.aabb);
                    if clipped.len == 0 {
                        continue;
                    }
                    clipped.area()
                };
                overlap.add(
                    inside
                        * match node.kind() {
                            NodeKind::Inner { .. } => constants.traversal,
                            NodeKind::Leaf { count, .. } => constants.intersection * f64::from(count),
                        },
                );
            }
            open.extend(node.children());
        }
    }
    if total.value() > 0.0 { overlap.value() / total.value() } else { 0.0 }
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
        let doubled: DVec3 = fan.map(|pair| (pair[0] - self.corners[0]).cross(pair[1] - self.corners[0])).sum();
        libm::sqrt(doubled.length_squared()) / 2.0
    }

    /// The part inside a box; no corners if there is none.
    fn clipped(self, aabb: &Aabb) -> Self {
        let (min, max) = (aabb.min.as_dvec3(), aabb.max.as_dvec3());
        (0..3).fold(self, |polygon, axis| polygon.cut(|p| p[axis] - min[axis]).cut(|p| max[axis] - p[axis]))
    }

    /// The part where `height` is not negative.
    fn cut(self, height: impl Fn(DVec3) -> f64) -> Self {
        let mut kept = Self { len: 0, ..self };
        let mut keep = |corner| {
            kept.corners[kept.len] = corner;
            kept.len += 1;
        };
        for at in 0..self.len {
            let (from, to) = (self.corners[at], self.corners[(at + 1) % self.len]);
            let (low, high) = (height(from), height(to));
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
            end_point_overlap(&tree, &triangles, &SahConstants { traversal: 1.0, intersection: 2.0 })
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
        let corners = [DVec3::new(-0.3, 0.1, 2.2), DVec3::new(4.1, 3.3, -0.4), DVec3::new(1.0, 3.9, 3.7)];
        let whole = Polygon::new(corners);
        let mut sum = 0.0;
        for cell in 0..6 * 6 * 6u8 {
            let min = [cell % 6, cell / 6 % 6, cell / 36].map(|i| f32::from(i) - 1.0);
            sum += whole.clipped(&Aabb::from([min, min.map(|x| x + 1.0)])).area();
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
