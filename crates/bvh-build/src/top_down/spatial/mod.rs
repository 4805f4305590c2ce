//! Top-down division with spatial splits: an object that a plane cuts may go to both sides, each
//! with a part of it.
//!
//! Stich, Friedrich & Dietrich 2009, 'Spatial splits in bounding volume hierarchies', with its
//! reference unsplitting.
//!
//! Differs from the source: the node with the largest box is divided next, so the limited number of
//! references is spent where it saves most. Nodes are divided down to single references. The cost
//! of a side grows with |side|^0.9, like the start of searches (see
//! [`muller_fellner::Heuristic`](crate::muller_fellner::Heuristic)). Every position between two
//! objects is a candidate for object splits; only spatial splits use bins.

mod object_split;
mod plane;

use super::stall::{LEAST_STALLED, is_stall};
use crate::error::check_scene;
use crate::watch::Pace;
use crate::{BuildError, Watch};
use bvh_core::{Aabb, Bvh, Clip, Node};
use object_split::{Axis, Candidates};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Bins along every axis. Their borders are the candidates of spatial splits.
const BINS: usize = 32;

/// Least common area of the sides of the best object split, relative to the root's box, for which
/// spatial splits are tried.
const OVERLAP: f64 = 1e-5;

/// The power of the number of references in the cost of a side.
const POWER: f64 = 0.9;

/// Number of stalls above a node after which a balanced split replaces a split that would stall.
const MOST_STALLS: u8 = 8;

/// Builds a tree over `boxes`, one per object, with at most `most` references, but at least one per
/// object, unless the `watch` cancels. Objects may be in several leaves, and each leaf has one
/// reference. [`validate_references`](bvh_core::validate_references) accepts the tree, and boxes are
/// the boxes of the parts. O(r log² r) time for r references and balanced splits, not counting the
/// clipping.
pub fn build(
    most: usize,
    boxes: &[Aabb],
    objects: &dyn Clip,
    watch: &Watch,
) -> Result<Bvh, BuildError> {
    check_scene(boxes)?;
    let extra = most.saturating_sub(boxes.len());
    Build::new(objects, extra, boxes.len()).divide(boxes, Pace::new(watch))
}

/// A part of an object, for one leaf.
#[derive(Clone, Copy, Debug)]
struct Reference {
    aabb: Aabb,
    object: u32,
}

#[derive(Debug)]
struct Open {
    references: Vec<Reference>,
    /// Number of splits between the root and the node that have stalled.
    stalls: u8,
}

#[derive(Debug)]
struct Sides {
    cost: f64,
    boxes: [Aabb; 2],
    references: [Vec<Reference>; 2],
}

impl Sides {
    /// Returns whether the split of a node of this size [stalls](is_stall).
    fn stall(&self, node_size: f64) -> bool {
        let counts = self.references.each_ref().map(Vec::len);
        let larger = usize::from(counts[1] > counts[0]);
        is_stall(counts, self.boxes[larger].half_area(), node_size)
    }
}

struct Build<'a> {
    objects: &'a dyn Clip,
    /// Number of references that may be added.
    extra: usize,
    least_overlap: f64,
    /// The powers |side|^power, indexed by |side|.
    powers: Vec<f64>,
    axes: [Axis; 3],
}

impl<'a> Build<'a> {
    fn new(objects: &'a dyn Clip, extra: usize, count: usize) -> Self {
        let powers = (0..=count).map(|n| libm::pow(n as f64, POWER)).collect();
        Self { objects, extra, least_overlap: 0.0, powers, axes: Default::default() }
    }

    fn divide(&mut self, boxes: &[Aabb], mut pace: Pace) -> Result<Bvh, BuildError> {
        let mut tree = Bvh::default();
        if boxes.is_empty() {
            return Ok(tree);
        }
        let references: Vec<Reference> =
            boxes.iter().zip(0..).map(|(&aabb, object)| Reference { aabb, object }).collect();
        let root = union(&references);
        self.least_overlap = OVERLAP * root.half_area();
        tree.nodes.push(Node::leaf(root, 0, 1));
        // By node, and the largest node first, of equal ones the first.
        let mut open = vec![Some(Open { references, stalls: 0 })];
        let mut order = BinaryHeap::from([(root.half_area().to_bits(), Reverse(0))]);
        while let Some((_, Reverse(node))) = order.pop() {
            let Some(Open { references, mut stalls }) = open[node].take() else { continue };
            if pace.ends_after(references.len()) {
                return Err(BuildError::Cancelled);
            }
            let aabb = tree.nodes[node].aabb;
            if let [one] = references.as_slice() {
                tree.nodes[node] = Node::leaf(aabb, tree.prim_ids.len() as u32, 1);
                tree.prim_ids.push(one.object);
                continue;
            }
            let Sides { boxes, references: sides, .. } =
                self.split(&aabb, &references, &mut stalls);
            // The sides hold copies, so the parent's references are freed at once.
            drop(references);
            tree.nodes[node] = Node::inner(aabb, tree.nodes.len() as u32, 2);
            for (aabb, references) in boxes.into_iter().zip(sides) {
                // No area is negative, so that areas are ordered as their bits are.
                order.push((aabb.half_area().to_bits(), Reverse(open.len())));
                tree.nodes.push(Node::leaf(aabb, 0, 1));
                open.push(Some(Open { references, stalls }));
            }
        }
        Ok(tree)
    }

    fn cost(&self, aabb: &Aabb, count: usize) -> f64 {
        aabb.half_area() * self.powers[count]
    }

    /// Divides two references or more by the better of the best object split and the best spatial
    /// split, or by a balanced split after [`MOST_STALLS`] stalls.
    fn split(&mut self, aabb: &Aabb, references: &[Reference], stalled: &mut u8) -> Sides {
        let extra = self.extra;
        let sides = self.cheapest_split(aabb, references);
        let node_area = aabb.half_area();
        let is_last = *stalled == MOST_STALLS;
        if (is_last || references.len() >= LEAST_STALLED) && sides.stall(node_area) {
            if is_last {
                // The rejected spatial split must give back its references.
                self.extra = extra;
                return self.object_split(references, Candidates::Balanced);
            }
            *stalled += 1;
        }
        sides
    }

    fn cheapest_split(&mut self, aabb: &Aabb, references: &[Reference]) -> Sides {
        let by_objects = self.object_split(references, Candidates::All);
        let [left, right] = &by_objects.boxes;
        if self.extra == 0 || left.intersection(right).half_area() <= self.least_overlap {
            return by_objects;
        }
        let plane = self.best_plane(aabb, references, by_objects.cost);
        let by_plane = plane.and_then(|plane| self.spatial_split(references, plane));
        match by_plane {
            Some(by_plane) if by_plane.cost < by_objects.cost => {
                let [left, right] = by_plane.references.each_ref().map(Vec::len);
                self.extra -= left + right - references.len();
                by_plane
            }
            _ => by_objects,
        }
    }
}

fn union(references: &[Reference]) -> Aabb {
    Aabb::union_of(references.iter().map(|reference| &reference.aabb))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Builder, muller_fellner};
    use bvh_core::{Triangle, cost, validate_references};
    use glam::Vec3;

    /// Returns long triangles in many directions, which cross each other.
    fn needles(n: u32) -> Vec<Triangle> {
        let coordinate = |i: u32, salt: u32| {
            (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 4093) as f32 / 41.0
        };
        let point = |i, salt| {
            Vec3::new(coordinate(i, salt), coordinate(i, salt + 7), coordinate(i, salt + 13))
        };
        (0..n)
            .map(|i| Triangle([point(i, 3), point(i, 5), point(i, 3) + Vec3::splat(0.5)]))
            .collect()
    }

    #[test]
    fn every_limit_of_references_gives_a_valid_tree_and_more_leave_a_cheaper_one() {
        let triangles = needles(400);
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        let objects = &triangles.as_slice();
        let mut before = f64::INFINITY;
        for references in [1.0, 1.1, 1.5, 3.0] {
            let most = (references * 400.0) as usize;
            let tree = build(most, &boxes, objects, &Watch::default()).unwrap();
            validate_references(&tree, &boxes, objects).unwrap();
            let count = tree.prim_ids.len();
            assert!(count <= most && (count > 400) == (references > 1.0), "{count}");
            let cost = cost::total_area(&tree);
            assert!(cost <= before, "{cost} {before}");
            before = cost;
        }
        let whole = muller_fellner::Config::default().build(&boxes).unwrap();
        let whole_cost = cost::total_area(&whole);
        assert!(before < 0.97 * whole_cost, "{before} of {whole_cost}");
    }

    #[test]
    fn planes_that_cannot_cost_less_than_the_object_split_are_skipped_and_no_other() {
        let triangles = needles(2000);
        let objects = &triangles.as_slice();
        let build = Build::new(objects, usize::MAX, 8);
        let mut kept = 0;
        for (group, first) in triangles.chunks(8).zip((0..).step_by(8)) {
            let references: Vec<Reference> = group
                .iter()
                .zip(first..)
                .map(|(triangle, object)| Reference { aabb: triangle.aabb(), object })
                .collect();
            let aabb = union(&references);
            let all = build.best_plane(&aabb, &references, f64::INFINITY);
            for part in [0.5, 0.6, 0.7, 0.8, 0.9, 1.0] {
                let most = part * build.cost(&aabb, references.len());
                let expected = all.filter(|plane| plane.cost < most);
                assert_eq!(build.best_plane(&aabb, &references, most), expected);
                kept += usize::from(expected.is_some());
            }
        }
        assert!((100..1400).contains(&kept), "{kept}");
    }

    /// Returns how many splits from the root down separate one object from all others.
    fn separated(tree: &Bvh) -> usize {
        let mut node = &tree.nodes[0];
        let mut count = 0;
        loop {
            let inner: Vec<&Node> =
                tree.nodes[node.children()].iter().filter(|child| !child.is_leaf()).collect();
            let [next] = inner.as_slice() else { return count };
            node = next;
            count += 1;
        }
    }

    #[test]
    fn objects_as_large_as_the_scene_are_halved_after_eight_splits_that_separate_one() {
        let corner = |x, y, z, size| Vec3::new(x, y, z) * size;
        let triangles: Vec<Triangle> = (31_000..32_000u16)
            .map(f32::from)
            .map(|size| {
                Triangle([Vec3::ZERO, corner(1.0, 1.0, 0.0, size), corner(1.0, 0.0, 1.0, size)])
            })
            .collect();
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        let whole = build(1000, &boxes, &triangles.as_slice(), &Watch::default()).unwrap();
        assert_eq!(separated(&whole), 8);
        let heuristic = muller_fellner::Heuristic::AreaTimesPower(POWER);
        let config = muller_fellner::Config { heuristic, ..Default::default() };
        assert_eq!(separated(&config.build(&boxes).unwrap()), 8);
    }

    #[test]
    fn scenes_of_points_of_one_object_and_of_none_are_built_and_bad_boxes_are_rejected() {
        for triangles in
            [vec![], needles(1), vec![Triangle([Vec3::ONE; 3]); 30], vec![needles(1)[0]; 3000]]
        {
            let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
            let most = 2 * boxes.len();
            let tree = build(most, &boxes, &triangles.as_slice(), &Watch::default()).unwrap();
            validate_references(&tree, &boxes, &triangles.as_slice()).unwrap();
            assert_eq!(tree.prim_ids.len(), triangles.len(), "there is nothing to split");
            assert!(tree.depth() <= 12, "objects in one place are not halved: {}", tree.depth());
        }
        let wrong = [Aabb::from([[f32::NAN; 3], [1.0; 3]])];
        assert!(build(1, &wrong, &needles(1).as_slice(), &Watch::default()).is_err());
    }

    #[test]
    fn a_triangle_in_thousands_of_leaves_is_checked_without_too_many_comparisons() {
        let [a, b, c] = [[0.0; 3], [30.0, 0.0, 3.0], [9.0, 30.0, 0.6]].map(Vec3::from);
        for (small, expected) in [(12_000, 2000..10_000), (40_000, 14_000..20_000)] {
            let mut triangles = vec![Triangle([a, b, c])];
            triangles.extend((0..small).map(|i: u32| {
                let spread = |salt: u32| {
                    (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 4093) as f32 / 4093.0
                };
                let (u, v) = (spread(3), spread(11));
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let at = a + (b - a) * u + (c - a) * v;
                Triangle([at, at + Vec3::new(0.1, 0.0, 0.01), at + Vec3::new(0.0, 0.1, 0.02)])
            }));
            let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
            let objects = &triangles.as_slice();
            let tree = build(2 * boxes.len(), &boxes, objects, &Watch::default()).unwrap();
            let leaves = tree.prim_ids.iter().filter(|&&object| object == 0).count();
            assert!(expected.contains(&leaves), "{leaves}");
            assert_eq!(validate_references(&tree, &boxes, objects), Ok(()));
        }
    }
}
