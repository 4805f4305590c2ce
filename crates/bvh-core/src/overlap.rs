//! End-point overlap: the surface inside a node's box that does not belong to the node.

use crate::cost::{SahConstants, Sum};
use crate::polygon::{Plane, Polygon};
use crate::{Aabb, Bvh, NodeKind, Triangle};
use alloc::vec::Vec;
use core::ops::Range;

/// Computes the end-point overlap, EPO = Σ over nodes of C(node) · A((S \ Q(node)) ∩ box(node)) /
/// A(S). S is the surface of all triangles, Q(node) is the surface of the triangles below the node,
/// and C is the traversal constant for an inner node, and the intersection constant times the
/// number of objects for a leaf.
///
/// The result is the expected cost, in the constants' unit, of nodes that a ray enters although it
/// ends on a surface elsewhere. Together with the surface area heuristic it predicts times better
/// than the heuristic alone.
///
/// Triangles are clipped against boxes in f64, so that areas are exact except for rounding. Boxes
/// are closed: a triangle within a face of a box counts. Triangles without area have the overlap 0
/// by definition.
///
/// Takes O(Σ over triangles of the nodes whose boxes they meet) time, which is about n log n on
/// common scenes and n² at most, and O(n) memory.
///
/// Source: Aila, Karras & Laine 2013, 'On quality metrics of bounding volume hierarchies', section
/// 4.2. Differs from the paper: both constants are 1 by default; the paper has 1.2 and 1.
///
/// # Panics
/// May panic on a tree that [`validate`](crate::validate()) rejects for the triangles' boxes.
pub fn end_point_overlap(tree: &Bvh, triangles: &[Triangle], constants: &SahConstants) -> f64 {
    let parts = EndPointOverlap::new(tree, triangles, constants);
    let mut sum = Overlap::default();
    for number in 0..parts.count() {
        sum.add(&parts.part(number));
    }
    sum.value()
}

/// The [`end_point_overlap`] in parts, which can be computed in any order or in parallel.
///
/// The sum of the parts in their order has the same bits as the result of [`end_point_overlap`].
#[derive(Clone, Debug)]
pub struct EndPointOverlap<'a> {
    tree: &'a Bvh,
    triangles: &'a [Triangle],
    constants: SahConstants,
    /// For each node, the range of the object ids below it, counted from the first leaf to the
    /// last.
    below: Vec<Range<u32>>,
    /// Pairs of an object and one of its positions, sorted.
    positions: Vec<(u32, u32)>,
    /// Every object once, with the range of its `positions`. Neighbours in the tree are adjacent.
    objects: Vec<(u32, Range<u32>)>,
}

/// The contribution of some triangles to the end-point overlap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlap {
    /// The triangles' area.
    surface: Sum,
    /// The triangles' area in foreign nodes, times the costs of these nodes.
    weighted: Sum,
}

impl Overlap {
    /// Adds the contribution of other triangles.
    pub fn add(&mut self, other: &Self) {
        self.surface.add_sum(&other.surface);
        self.weighted.add_sum(&other.weighted);
    }

    /// Returns the end-point overlap if all triangles have contributed.
    pub fn value(&self) -> f64 {
        let surface = self.surface.value();
        if surface > 0.0 { self.weighted.value() / surface } else { 0.0 }
    }
}

impl<'a> EndPointOverlap<'a> {
    /// The number of triangles per part.
    const PART: usize = 4096;

    /// Prepares the parts. O(nodes + n log n).
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) rejects for the triangles' boxes.
    pub fn new(tree: &'a Bvh, triangles: &'a [Triangle], constants: &SahConstants) -> Self {
        let mut below = alloc::vec![0..0; tree.nodes.len()];
        let mut positions = Vec::with_capacity(tree.prim_ids.len());
        let mut stack: Vec<(usize, bool)> =
            tree.nodes.first().map(|_| (0, false)).into_iter().collect();
        // A node is on the stack twice: before its children, and again when they are done.
        while let Some((index, children_done)) = stack.pop() {
            let node = &tree.nodes[index];
            if children_done {
                below[index].end = positions.len() as u32;
                continue;
            }
            below[index].start = positions.len() as u32;
            for &object in &tree.prim_ids[node.prims()] {
                positions.push((object, positions.len() as u32));
            }
            stack.push((index, true));
            stack.extend(node.children().rev().map(|child| (child, false)));
        }
        positions.sort_unstable();
        let mut objects: Vec<(u32, Range<u32>)> = Vec::with_capacity(triangles.len());
        for (index, &(object, _)) in (0..).zip(&positions) {
            match objects.last_mut() {
                Some((last, range)) if *last == object => range.end = index + 1,
                _ => objects.push((object, index..index + 1)),
            }
        }
        // Objects in the order of the leaves visit the same nodes one after the other.
        objects.sort_unstable_by_key(|(_, range)| positions[range.start as usize].1);
        Self { tree, triangles, constants: *constants, below, positions, objects }
    }

    /// Returns the number of parts.
    pub fn count(&self) -> usize {
        self.objects.len().div_ceil(Self::PART)
    }

    /// Returns the contribution of the triangles of one part.
    ///
    /// # Panics
    /// Panics if `number` is not below [`count`](Self::count).
    pub fn part(&self, number: usize) -> Overlap {
        let mut sum = Overlap::default();
        let mut open = Vec::new();
        let start = number * Self::PART;
        let end = self.objects.len().min(start + Self::PART);
        for (object, positions) in &self.objects[start..end] {
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
            let is_above =
                positions.iter().any(|(_, position)| self.below[index].contains(position));
            if !is_above {
                let inside = area_inside(&polygon, &node.aabb, &aabb, area);
                if inside == 0.0 {
                    // The boxes of all descendants are inside this box, and contain no area either.
                    continue;
                }
                let cost = match node.kind() {
                    NodeKind::Inner { .. } => self.constants.traversal,
                    NodeKind::Leaf { count, .. } => self.constants.intersection * f64::from(count),
                };
                sum.weighted.add(inside * cost);
            }
            open.extend(node.children().filter(|&child| {
                let child = &self.tree.nodes[child].aabb;
                !(child.min.cmpgt(aabb.max) | child.max.cmplt(aabb.min)).any()
            }));
        }
    }
}

/// Returns the area of a polygon inside a box. `bounds` is the box around the polygon, and `area`
/// is its whole area.
fn area_inside(polygon: &Polygon, aabb: &Aabb, bounds: &Aabb, area: f64) -> f64 {
    let below = bounds.min.cmplt(aabb.min);
    let above = bounds.max.cmpgt(aabb.max);
    if !(below | above).any() {
        return area;
    }
    let mut part = *polygon;
    for axis in 0..3 {
        // Planes that do not cut the polygon are skipped, which changes no bit.
        if below.test(axis) {
            let position = f64::from(aabb.min[axis]);
            part.cut(Plane { axis, position, side: 1.0 }, |corner| corner);
        }
        if above.test(axis) {
            let position = f64::from(aabb.max[axis]);
            part.cut(Plane { axis, position, side: -1.0 }, |corner| corner);
        }
    }
    part.area()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Node;
    use alloc::vec;
    use glam::DVec3;

    /// Returns two right triangles with legs of length 1 in the plane z = 0, the second moved by
    /// `x`, and a tree with one leaf for each.
    fn pair(x: f32) -> (Vec<Triangle>, Bvh) {
        let triangle = |x: f32| Triangle::from([[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]);
        let triangles = vec![triangle(0.0), triangle(x)];
        let [a, b] = [triangles[0].aabb(), triangles[1].aabb()];
        let nodes = vec![Node::inner(a.union(&b), 1, 2), Node::leaf(a, 0, 1), Node::leaf(b, 1, 1)];
        (triangles, Bvh { nodes, prim_ids: vec![0, 1] })
    }

    #[test]
    fn the_overlap_of_two_triangles_equals_the_result_by_hand() {
        let constants = SahConstants { traversal: 1.0, intersection: 2.0 };
        // At 0.5 the first box contains the second triangle without its corner, 1/2 − 1/8, and the
        // second box contains 1/8 of the first triangle. At 0 each box contains both triangles.
        for (x, expected) in [(2.0, 0.0), (0.5, 2.0 * (0.375 + 0.125) / 1.0), (0.0, 2.0)] {
            let (triangles, tree) = pair(x);
            assert_eq!(end_point_overlap(&tree, &triangles, &constants), expected, "{x}");
        }
    }

    #[test]
    fn clipped_areas_add_up_over_a_grid() {
        let corners =
            [DVec3::new(-0.3, 0.1, 2.2), DVec3::new(4.1, 3.3, -0.4), DVec3::new(1.0, 3.9, 3.7)];
        let whole = Polygon::new(corners);
        let bounds = Triangle(corners.map(|corner| corner.as_vec3())).aabb();
        let mut sum = 0.0;
        for cell in 0..6 * 6 * 6u8 {
            let min = [cell % 6, cell / 6 % 6, cell / 36].map(|i| f32::from(i) - 1.0);
            let cell = Aabb::from([min, min.map(|x| x + 1.0)]);
            sum += area_inside(&whole, &cell, &bounds, whole.area());
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
        for triangle in &mut triangles {
            triangle.0[2] = triangle.0[1];
        }
        assert_eq!(end_point_overlap(&tree, &triangles, &SahConstants::default()), 0.0);
        assert_eq!(end_point_overlap(&Bvh::default(), &[], &SahConstants::default()), 0.0);
    }
}
