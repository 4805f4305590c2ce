//! Top-down division with spatial splits: an object that a plane cuts may go to both sides, each with its part of it.
//!
//! Stich, Friedrich & Dietrich 2009, 'Spatial splits in bounding volume hierarchies', with its reference unsplitting.
//!
//! Differs from the source: the node with the largest box is divided next, so that a limit on the number of references is
//! spent where it saves most; nodes are divided down to single references; the cost of a side grows with |side|^0.9, which
//! searches start from (see [`muller_fellner::Heuristic`](crate::muller_fellner::Heuristic)); every position between two
//! objects is a candidate, not those of bins. Spatial splits have bins.

use crate::error::check_scene;
use crate::{BuildError, Check};
use bvh_core::{Aabb, Bvh, Clip, Node};
use std::collections::BinaryHeap;

crate::config! {
    /// How many references, and where to look for spatial splits.
    pub struct Config {
        /// Maximum number of references per object, 1 or more. With 1 nothing is split.
        references: f64 = 1.2, in 1.0..=16.0;
        /// Least area that the sides of the best object split have in common for a spatial split to be looked for, relative to the
        /// root's box.
        overlap: f64 = 1e-5, in 0.0..=1.0;
        /// Bins along every axis, whose borders are the candidates of spatial splits.
        bins: u32 = 32, in 2..=1024;
        /// The power of the number of references in the cost of a side.
        power: f64 = 0.9, in 0.0..=1.0;
    }
}

/// The part of an object in a leaf.
#[derive(Clone, Copy, Debug)]
struct Reference {
    aabb: Aabb,
    object: u32,
}

/// A node that is to be divided: the largest first, equal ones in the order in which they were made.
#[derive(Debug)]
struct Open {
    area: f64,
    node: u32,
    references: Vec<Reference>,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.area.total_cmp(&other.area).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

/// Two sides of a node, and what they cost.
#[derive(Debug)]
struct Sides {
    cost: f64,
    boxes: [Aabb; 2],
    references: [Vec<Reference>; 2],
}

impl Config {
    /// Builds a tree over `boxes`, one per object, whose objects may lie in several leaves. One reference per leaf;
    /// [`validate_references`](bvh_core::validate_references) holds, and boxes are those of the parts. O(r log² r) time for
    /// r references and balanced splits, beside the clipping.
    pub fn build(&self, boxes: &[Aabb], objects: &dyn Clip) -> Result<Bvh, BuildError> {
        self.check()?;
        self.build_at_most((self.references * boxes.len() as f64) as usize, boxes, objects)
    }

    /// As [`build`](Self::build), with at most so many references, at least one per object.
    pub fn build_at_most(&self, most: usize, boxes: &[Aabb], objects: &dyn Clip) -> Result<Bvh, BuildError> {
        self.check()?;
        check_scene(boxes)?;
        let mut build = Build {
            config: self,
            objects,
            extra: most.saturating_sub(boxes.len()),
            least_overlap: 0.0,
            powers: Vec::new(),
            keys: Vec::new(),
            areas: Vec::new(),
        };
        Ok(build.divide(boxes))
    }
}

/// A build at work.
struct Build<'a> {
    config: &'a Config,
    objects: &'a dyn Clip,
    /// References that may still be added.
    extra: usize,
    /// Least common area for which a spatial split is looked for.
    least_overlap: f64,
    /// |side|^power by |side|.
    powers: Vec<f64>,
    keys: Vec<(f64, u32)>,
    areas: Vec<f64>,
}

impl Build<'_> {
    fn divide(&mut self, boxes: &[Aabb]) -> Bvh {
        let mut tree = Bvh::default();
        if boxes.is_empty() {
            return tree;
        }
        self.powers = (0..=boxes.len()).map(|n| libm::pow(n as f64, self.config.power)).collect();
        let references: Vec<Reference> =
            boxes.iter().zip(0..).map(|(&aabb, object)| Reference { aabb, object }).collect();
        let root = union(&references);
        self.least_overlap = self.config.overlap * root.half_area();
        tree.nodes.push(Node::leaf(root, 0, 1));
        let mut open = BinaryHeap::from([Open { area: root.half_area(), node: 0, references }]);
        while let Some(Open { node, references, .. }) = open.pop() {
            let aabb = tree.nodes[node as usize].aabb;
            if let [one] = references.as_slice() {
                tree.nodes[node as usize] = Node::leaf(aabb, tree.prim_ids.len() as u32, 1);
                tree.prim_ids.push(one.object);
                continue;
            }
            let Sides { boxes, references: sides, .. } = self.split(&aabb, references);
            let first = tree.nodes.len() as u32;
            tree.nodes[node as usize] = Node::inner(aabb, first, 2);
            for ((node, aabb), references) in (first..).zip(boxes).zip(sides) {
                tree.nodes.push(Node::leaf(aabb, 0, 1));
                open.push(Open { area: aabb.half_area(), node, references });
            }
        }
        tree
    }

    /// The cost of a side.
    fn cost(&self, aabb: &Aabb, count: usize) -> f64 {
        aabb.half_area() * self.powers[count]
    }

    /// Divides two references or more by the better of the best object split and the best spatial split.
    fn split(&mut self, aabb: &Aabb, references: Vec<Reference>) -> Sides {
        let by_objects = self.object_split(references.clone());
        let [left, right] = &by_objects.boxes;
        if self.extra == 0 || left.intersection(right).half_area() <= self.least_overlap {
            return by_objects;
        }
        let spatial = self.best_plane(aabb, &references).filter(|plane| plane.cost < by_objects.cost);
        let spatial = spatial.and_then(|plane| self.spatial_split(&references, plane));
        match spatial.filter(|spatial| spatial.cost < by_objects.cost) {
            Some(spatial) => {
                let [left, right] = spatial.references.each_ref().map(Vec::len);
                self.extra -= left + right - references.len();
                spatial
            }
            None => by_objects,
        }
    }

    /// The best of all object splits in the orders of the centres along the axes; ties go to the lower axis and position.
    fn object_split(&mut self, mut references: Vec<Reference>) -> Sides {
        let count = references.len();
        let (mut least, mut axis, mut left) = (f64::INFINITY, 0, 1);
        for candidate in 0..3 {
            self.sort(&references, candidate);
            let mut aabb = Aabb::EMPTY;
            self.areas.clear();
            for &(_, at) in self.keys.iter().rev() {
                aabb = aabb.union(&references[at as usize].aabb);
                self.areas.push(aabb.half_area());
            }
            aabb = Aabb::EMPTY;
            for (before, &(_, at)) in (1..count).zip(&self.keys) {
                aabb = aabb.union(&references[at as usize].aabb);
                let after = count - before;
                let cost = self.cost(&aabb, before) + self.areas[after - 1] * self.powers[after];
                if cost < least {
                    (least, axis, left) = (cost, candidate, before);
                }
            }
        }
        self.sort(&references, axis);
        let ordered: Vec<Reference> = self.keys.iter().map(|&(_, at)| references[at as usize]).collect();
        if union(&ordered[..left]) == union(&ordered[left..]) {
            // Nothing is gained, and the power would take off one reference after the other.
            left = count / 2;
        }
        references.clear();
        references.extend_from_slice(&ordered[left..]);
        let sides = [ordered[..left].to_vec(), references];
        let boxes = sides.each_ref().map(|side| union(side));
        Sides {
            cost: self.cost(&boxes[0], left) + self.cost(&boxes[1], count - left),
            boxes,
            references: sides,
        }
    }

    /// Fills `keys` with the centres along an axis and the references' positions, in order.
    fn sort(&mut self, references: &[Reference], axis: usize) {
        self.keys.clear();
        self.keys.extend(references.iter().zip(0..).map(|(r, at)| (r.aabb.doubled_centroid()[axis], at)));
        self.keys.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// The border of bins where a spatial split costs least, by its cost before unsplitting.
    fn best_plane(&self, aabb: &Aabb, references: &[Reference]) -> Option<Plane> {
        let (bins, all) = (self.config.bins as usize, references.len());
        let mut best: Option<Plane> = None;
        for axis in 0..3 {
            let (low, extent) = (f64::from(aabb.min[axis]), aabb.extent()[axis]);
            let border = |bin: usize| (low + extent * (bin as f64 / bins as f64)) as f32;
            let bin_of = |x: f32| {
                let guess = ((f64::from(x) - low) / extent * bins as f64) as usize;
                guess.min(bins - 1)
            };
            if border(1) <= aabb.min[axis] || border(bins - 1) >= aabb.max[axis] {
                continue;
            }
            let mut parts = vec![(Aabb::EMPTY, 0usize, 0usize); bins];
            let bins_of =
                |reference: &Reference| [reference.aabb.min[axis], reference.aabb.max[axis]].map(bin_of);
            for [first, last] in references.iter().map(bins_of) {
                parts[first].1 += 1;
                parts[last].2 += 1;
            }
            // Where every plane cuts all that is on one side of it, there are no parts to look at.
            let (mut entered, mut gone) = (0, 0);
            let divides = parts[..bins - 1].iter().any(|part| {
                (entered, gone) = (entered + part.1, gone + part.2);
                (1..all).contains(&entered) && (1..all).contains(&(all - gone))
            });
            if !divides {
                continue;
            }
            for reference in references {
                let [first, last] = bins_of(reference);
                if first == last {
                    parts[first].0 = parts[first].0.union(&reference.aabb);
                    continue;
                }
                for (bin, part) in parts.iter_mut().enumerate().take(last + 1).skip(first) {
                    let mut region = reference.aabb;
                    if bin > first {
                        region.min[axis] = border(bin);
                    }
                    if bin < last {
                        region.max[axis] = border(bin + 1);
                    }
                    part.0 = part.0.union(&self.objects.clip(reference.object, &region));
                }
            }
            let mut after = vec![(Aabb::EMPTY, 0usize); bins + 1];
            for bin in (0..bins).rev() {
                after[bin] = (after[bin + 1].0.union(&parts[bin].0), after[bin + 1].1 + parts[bin].2);
            }
            let (mut before, mut entered) = (Aabb::EMPTY, 0);
            for bin in 1..bins {
                before = before.union(&parts[bin - 1].0);
                entered += parts[bin - 1].1;
                let (behind, left) = &after[bin];
                // A side with all references divides nothing.
                if entered == 0
                    || *left == 0
                    || entered >= all
                    || *left >= all
                    || entered + left - all > self.extra
                {
                    continue;
                }
                let cost = self.cost(&before, entered) + self.cost(behind, *left);
                if best.is_none_or(|best| cost < best.cost) {
                    best = Some(Plane { cost, axis, at: border(bin) });
                }
            }
        }
        best
    }

    /// Divides the references at a plane. One that the plane cuts goes whole to one side where that costs less. `None` if a side
    /// would have all of them, or more references than there may be.
    fn spatial_split(&self, references: &[Reference], Plane { axis, at, .. }: Plane) -> Option<Sides> {
        let (mut sides, mut cut) = ([Vec::new(), Vec::new()], Vec::new());
        for reference in references {
            if reference.aabb.max[axis] <= at {
                sides[0].push(*reference);
            } else if reference.aabb.min[axis] >= at {
                sides[1].push(*reference);
            } else {
                let halves = reference.aabb.halves(axis, at);
                let parts = halves.map(|region| self.objects.clip(reference.object, &region));
                match parts.map(|part| part != Aabb::EMPTY) {
                    [true, true] => cut.push((*reference, parts)),
                    [left, _] => sides[usize::from(!left)].push(*reference),
                }
            }
        }
        let mut boxes = sides.each_ref().map(|side| union(side));
        let mut counts = sides.each_ref().map(|side| side.len() + cut.len());
        for (_, parts) in &cut {
            boxes = [boxes[0].union(&parts[0]), boxes[1].union(&parts[1])];
        }
        for (whole, parts) in cut {
            let divided = self.cost(&boxes[0], counts[0]) + self.cost(&boxes[1], counts[1]);
            let [left, right] = [0, 1].map(|side| {
                let grown = boxes[side].union(&whole.aabb);
                self.cost(&grown, counts[side]) + self.cost(&boxes[1 - side], counts[1 - side] - 1)
            });
            if divided <= left.min(right) {
                for (side, aabb) in sides.iter_mut().zip(parts) {
                    side.push(Reference { aabb, ..whole });
                }
                continue;
            }
            let side = usize::from(right < left);
            boxes[side] = boxes[side].union(&whole.aabb);
            counts[1 - side] -= 1;
            sides[side].push(whole);
        }
        let [left, right] = sides.each_ref().map(Vec::len);
        let all = references.len();
        if left == 0 || right == 0 || left >= all || right >= all || left + right - all > self.extra {
            return None;
        }
        // Unsplitting may have left a side smaller than it was when the others were decided on.
        let boxes = sides.each_ref().map(|side| union(side));
        Some(Sides { cost: self.cost(&boxes[0], left) + self.cost(&boxes[1], right), boxes, references: sides })
    }
}

/// A candidate of a spatial split.
#[derive(Clone, Copy, Debug)]
struct Plane {
    cost: f64,
    axis: usize,
    at: f32,
}

fn union(references: &[Reference]) -> Aabb {
    references.iter().fold(Aabb::EMPTY, |aabb, reference| aabb.union(&reference.aabb))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Builder, muller_fellner};
    use bvh_core::{Triangle, cost, validate_references};
    use glam::Vec3;

    /// Long triangles in many directions, which cross each other.
    fn needles(n: u32) -> Vec<Triangle> {
        let coordinate =
            |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 4093) as f32 / 41.0;
        let point = |i, salt| Vec3::new(coordinate(i, salt), coordinate(i, salt + 7), coordinate(i, salt + 13));
        (0..n).map(|i| Triangle([point(i, 3), point(i, 5), point(i, 3) + Vec3::splat(0.5)])).collect()
    }

    #[test]
    fn every_limit_of_references_gives_a_valid_tree_and_more_leave_a_cheaper_one() {
        let triangles = needles(400);
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        let objects = &triangles.as_slice();
        let mut before = f64::INFINITY;
        for references in [1.0, 1.1, 1.5, 3.0] {
            let tree = Config { references, ..Config::default() }.build(&boxes, objects).unwrap();
            validate_references(&tree, &boxes, objects).unwrap();
            let count = tree.prim_ids.len();
            assert!(count <= (references * 400.0) as usize && (count > 400) == (references > 1.0), "{count}");
            let cost = cost::total_area(&tree);
            assert!(cost <= before, "{cost} {before}");
            before = cost;
        }
        let whole = muller_fellner::Config::default().build(&boxes).unwrap();
        let whole = cost::total_area(&whole);
        assert!(before < 0.97 * whole, "{before} of {whole}");
    }

    #[test]
    fn scenes_of_points_of_one_object_and_of_none_are_built_and_bad_boxes_refused() {
        for triangles in [vec![], needles(1), vec![Triangle([Vec3::ONE; 3]); 30], vec![needles(1)[0]; 3000]] {
            let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
            let tree = Config::default().build(&boxes, &triangles.as_slice()).unwrap();
            validate_references(&tree, &boxes, &triangles.as_slice()).unwrap();
            assert_eq!(tree.prim_ids.len(), triangles.len(), "there is nothing to split");
            assert!(tree.depth() <= 12, "objects in one place are not halved: {}", tree.depth());
        }
        let wrong = [Aabb::from([[f32::NAN; 3], [1.0; 3]])];
        assert!(Config::default().build(&wrong, &needles(1).as_slice()).is_err());
        assert!(Config { references: 0.5, ..Config::default() }.build(&[], &needles(1).as_slice()).is_err());
    }
}
