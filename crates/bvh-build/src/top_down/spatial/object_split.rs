//! Object splits of a node: every position between two references in the orders of their centres
//! along the axes.

use super::{Build, Reference, Sides, union};
use crate::top_down::presort::in_parallel;
use bvh_core::Aabb;

/// The candidates of object splits along one axis.
#[derive(Debug, Default)]
pub(super) struct Axis {
    /// The references' centres along the axis and their positions, sorted.
    keys: Vec<(f64, u32)>,
    /// The half areas of the boxes around the last references: `areas[i]` covers i + 1 references.
    areas: Vec<f64>,
}

/// The candidates among object splits, and the cost of a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Candidates {
    /// All splits, by area times a power of the number of references.
    All,
    /// Splits with at least one in eight references on either side, by area times number.
    Balanced,
}

impl Axis {
    /// Sorts the references by their centres along the axis `number`; equal centres keep their
    /// order.
    fn sort(&mut self, references: &[Reference], number: usize) {
        self.keys.clear();
        self.keys.extend(
            references.iter().zip(0..).map(|(r, index)| (r.aabb.doubled_centroid()[number], index)),
        );
        if references.len() >= RADIX_SORTED {
            radsort::sort_by_key(&mut self.keys, |&(centre, _)| centre);
        } else {
            self.keys.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
    }

    /// Returns the least cost of the candidates and the number of references on the left side; the
    /// first among equal candidates.
    fn best(
        &mut self,
        references: &[Reference],
        powers: &[f64],
        candidates: Candidates,
    ) -> (f64, usize) {
        let count = references.len();
        let side_cost = |area: f64, side: usize| match candidates {
            Candidates::All => area * powers[side],
            Candidates::Balanced => area * side as f64,
        };
        let least_side = if candidates == Candidates::All { 1 } else { (count / 8).max(1) };
        let mut aabb = Aabb::EMPTY;
        self.areas.clear();
        for &(_, index) in self.keys.iter().rev() {
            aabb = aabb.union(&references[index as usize].aabb);
            self.areas.push(aabb.half_area());
        }
        // The second pass grows the left side, with the areas of all right sides known.
        aabb = Aabb::EMPTY;
        let mut best = (f64::INFINITY, 1);
        for (before, &(_, index)) in (1..count).zip(&self.keys) {
            aabb = aabb.union(&references[index as usize].aabb);
            let after = count - before;
            let cost =
                side_cost(aabb.half_area(), before) + side_cost(self.areas[after - 1], after);
            if cost < best.0 && before.min(after) >= least_side {
                best = (cost, before);
            }
        }
        best
    }
}

/// Least number of references for which a radix sort is faster.
const RADIX_SORTED: usize = 2048;

impl Build<'_> {
    /// Returns the best object split in the orders of the centres along the axes; ties go to the
    /// lower axis and position.
    pub(super) fn object_split(
        &mut self,
        references: &[Reference],
        candidates: Candidates,
    ) -> Sides {
        let count = references.len();
        let Self { powers, axes: [x, y, z], .. } = self;
        let best = |axis: &mut Axis, number: usize| {
            axis.sort(references, number);
            axis.best(references, powers, candidates)
        };
        let found = in_parallel(count, || best(x, 0), || best(y, 1), || best(z, 2));
        let mut least = f64::INFINITY;
        let mut axis = 0;
        let mut left = 1;
        for (number, (cost, position)) in found.into_iter().enumerate() {
            if cost < least {
                (least, axis, left) = (cost, number, position);
            }
        }
        let keys = &self.axes[axis].keys;
        let mut ordered: Vec<Reference> =
            keys.iter().map(|&(_, index)| references[index as usize]).collect();
        if union(&ordered[..left]) == union(&ordered[left..]) {
            // Such a split gains nothing, and the power would separate one reference after the
            // other.
            left = count / 2;
        }
        let sides = [ordered[..left].to_vec(), ordered.split_off(left)];
        let boxes = sides.each_ref().map(|side| union(side));
        let cost = self.cost(&boxes[0], left) + self.cost(&boxes[1], count - left);
        Sides { cost, boxes, references: sides }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::Triangle;
    use proptest::prelude::*;

    /// Returns the objects on the left side of the first of the cheapest splits, found by trying
    /// all of them.
    fn brute_force(build: &Build, references: &[Reference], candidates: Candidates) -> Vec<u32> {
        let count = references.len();
        let mut least = f64::INFINITY;
        let mut objects = vec![];
        for axis in 0..3 {
            let centre = |reference: &Reference| reference.aabb.doubled_centroid()[axis];
            let mut sorted = references.to_vec();
            sorted.sort_by(|a, b| centre(a).total_cmp(&centre(b)));
            for left in 1..count {
                if candidates == Candidates::Balanced && left.min(count - left) < count / 8 {
                    continue;
                }
                let sides = [&sorted[..left], &sorted[left..]];
                let [first, second] = sides.map(|side| {
                    let load = match candidates {
                        Candidates::All => build.powers[side.len()],
                        Candidates::Balanced => side.len() as f64,
                    };
                    union(side).half_area() * load
                });
                if first + second < least {
                    least = first + second;
                    let is_equal = union(sides[0]) == union(sides[1]);
                    let left = if is_equal { count / 2 } else { left };
                    objects = sorted[..left].iter().map(|reference| reference.object).collect();
                }
            }
        }
        objects
    }

    proptest! {
        #[test]
        fn no_object_split_costs_less_than_the_chosen_one(
            boxes in prop::collection::vec([0u8..12, 0u8..12, 0u8..12, 0u8..4, 0u8..4, 0u8..4], 2..60),
        ) {
            let references: Vec<Reference> = (0..).zip(&boxes).map(|(object, sides)| {
                let [x, y, z, a, b, c] = sides.map(f32::from);
                Reference { aabb: Aabb::from([[x, y, z], [x + a, y + b, z + c]]), object }
            }).collect();
            let triangles: &[Triangle] = &[];
            let mut build = Build::new(&triangles, 0, boxes.len());
            for candidates in [Candidates::All, Candidates::Balanced] {
                let expected = brute_force(&build, &references, candidates);
                let Sides { references: [left, right], .. } = build.object_split(&references, candidates);
                let found: Vec<u32> = left.iter().map(|reference| reference.object).collect();
                prop_assert_eq!(found, expected);
                prop_assert_eq!(left.len() + right.len(), boxes.len());
            }
        }
    }
}
