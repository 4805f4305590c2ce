//! Spatial splits of a node: the borders of bins, and the references on either side or on both.

use super::{BINS, Build, Reference, Sides, union};
use crate::top_down::presort::in_parallel;
use bvh_core::Aabb;

/// A candidate of a spatial split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    pub cost: f64,
    axis: usize,
    position: f32,
}

impl Build<'_> {
    /// Returns the border of bins where a spatial split costs least before unsplitting; the first
    /// among equal borders. `None` if no border costs less than `most`.
    pub(super) fn best_plane(
        &self,
        aabb: &Aabb,
        references: &[Reference],
        most: f64,
    ) -> Option<Plane> {
        let along = |axis| self.best_plane_along(axis, aabb, references, most);
        let found = in_parallel(references.len(), || along(0), || along(1), || along(2));
        found
            .into_iter()
            .flatten()
            .filter(|plane| plane.cost < most)
            .reduce(|best, plane| if plane.cost < best.cost { plane } else { best })
    }

    fn best_plane_along(
        &self,
        axis: usize,
        aabb: &Aabb,
        references: &[Reference],
        most: f64,
    ) -> Option<Plane> {
        let bins = BINS;
        let all = references.len();
        let low = f64::from(aabb.min[axis]);
        let extent = aabb.extent()[axis];
        let border = |bin: usize| (low + extent * (bin as f64 / bins as f64)) as f32;
        let bin_of = |x: f32| {
            let guess = ((f64::from(x) - low) / extent * bins as f64) as usize;
            guess.min(bins - 1)
        };
        if border(1) <= aabb.min[axis] || border(bins - 1) >= aabb.max[axis] {
            return None;
        }
        // The box around everything in a bin, how many references begin there, and how many end.
        let mut parts = vec![(Aabb::EMPTY, 0usize, 0usize); bins];
        let bins_of = |reference: &Reference| {
            [reference.aabb.min[axis], reference.aabb.max[axis]].map(bin_of)
        };
        // The boxes around the undivided references that begin in a bin, and that end there.
        let mut whole = vec![[Aabb::EMPTY; 2]; bins];
        for reference in references {
            let [first, last] = bins_of(reference);
            // A reference enters the left side of every plane after its first bin, and leaves the
            // right side of every plane after its last.
            parts[first].1 += 1;
            parts[last].2 += 1;
            whole[first][0] = whole[first][0].union(&reference.aabb);
            whole[last][1] = whole[last][1].union(&reference.aabb);
        }
        // A side costs at least as much as with the references alone that no plane cuts. If no
        // plane divides anything for less than `most` even so, the parts need not be clipped.
        let mut behind = vec![Aabb::EMPTY; bins + 1];
        for bin in (0..bins).rev() {
            behind[bin] = behind[bin + 1].union(&whole[bin][0]);
        }
        let mut before = Aabb::EMPTY;
        let mut entered = 0;
        let mut gone = 0;
        let may_pay = (1..bins).any(|bin| {
            before = before.union(&whole[bin - 1][1]);
            entered += parts[bin - 1].1;
            gone += parts[bin - 1].2;
            let left = all - gone;
            divides([entered, left], all)
                && self.cost(&before, entered) + self.cost(&behind[bin], left) < most
        });
        if !may_pay {
            return None;
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
        let mut best: Option<Plane> = None;
        let mut before = Aabb::EMPTY;
        let mut entered = 0;
        for bin in 1..bins {
            before = before.union(&parts[bin - 1].0);
            entered += parts[bin - 1].1;
            let (ref behind, left) = after[bin];
            if !divides([entered, left], all) || entered + left - all > self.extra {
                continue;
            }
            let cost = self.cost(&before, entered) + self.cost(behind, left);
            if best.is_none_or(|best| cost < best.cost) {
                best = Some(Plane { cost, axis, position: border(bin) });
            }
        }
        best
    }

    /// Divides the references at a plane. A reference that the plane cuts goes undivided to one
    /// side if that costs less. Returns `None` if a side would have all references, or if the tree
    /// would have too many.
    pub(super) fn spatial_split(
        &self,
        references: &[Reference],
        Plane { axis, position, .. }: Plane,
    ) -> Option<Sides> {
        let mut sides = [Vec::new(), Vec::new()];
        let mut cut = Vec::new();
        for reference in references {
            if reference.aabb.max[axis] <= position {
                sides[0].push(*reference);
            } else if reference.aabb.min[axis] >= position {
                sides[1].push(*reference);
            } else {
                let halves = reference.aabb.halves(axis, position);
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
        if !divides([left, right], all) || left + right - all > self.extra {
            return None;
        }
        // Unsplitting may have left a side with a smaller box than the decisions assumed.
        let boxes = sides.each_ref().map(|side| union(side));
        Some(Sides {
            cost: self.cost(&boxes[0], left) + self.cost(&boxes[1], right),
            boxes,
            references: sides,
        })
    }
}

/// Returns whether sides of so many references divide `all`: a side with all of them divides nothing.
fn divides(sides: [usize; 2], all: usize) -> bool {
    sides.iter().all(|side| (1..all).contains(side))
}
