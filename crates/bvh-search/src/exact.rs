//! The exact optimum of small scenes, by dynamic programming over subsets: the measure of every other method.
//!
//! The class is *binary trees with one object per leaf*, over which all objectives of a [`Problem`] have the same
//! optima: they grow with the internal area. Wider nodes would make it meaningless: merging an inner node into its
//! parent removes a term that is never negative, so that a single node over all objects would always be the cheapest.
//!
//! The best subtree below a node does not depend on the rest of the tree. The least internal area of a tree over the set S is
//! therefore best(S) = A(S) + min over the divisions of S in two of best(L) + best(S ∖ L), with best = 0 for single
//! objects: the recurrence of Karras & Aila 2013 for treelets, here for the whole tree.

use crate::run::{Problem, Run, Search, SearchError, Shortcut};
use bvh_build::BuildError;
use bvh_build::config::Accepts;
use bvh_core::{Aabb, Bvh, Node, check_boxes};

/// The most objects a scene may have: 3¹⁶ / 2 divisions take a few hundredths of a second and 2¹⁶ sets 2.5 MB.
pub const MOST_OBJECTS: usize = 16;

bvh_build::config! {
    /// Without parameters.
    pub struct Config {}
}

impl Search for Config {
    /// One evaluation, whose work is the number of divisions compared. The tree is optimal up to the rounding of 15
    /// additions. Of equal divisions the one is taken whose part with the first object is the least as a bit set.
    ///
    /// Refuses scenes of more than [`MOST_OBJECTS`] objects. O(3ⁿ) time, O(2ⁿ) memory.
    fn search(&self, problem: &Problem, _seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let n = problem.boxes.len();
        (..=MOST_OBJECTS).check("objects", &n)?;
        check_boxes(problem.boxes).map_err(BuildError::from)?;
        let (part, work) = divisions(problem.boxes);
        let tree = if n == 0 { Bvh::default() } else { tree(problem.boxes, &part) };
        run.record(problem.objective.cost(&tree), work);
        Ok(tree)
    }
}

/// The optimum in place of a search, if the scene is [tiny](most_work_of_tiny) and the optimum takes no more work than
/// `work` and the rest of the run's budget. Ends the run.
pub(crate) fn instead(problem: &Problem, work: u64, run: &mut Run) -> Result<Option<Bvh>, SearchError> {
    let least = most_work_of_tiny(problem.boxes.len());
    let worth = least.is_some_and(|least| least <= work.min(run.left().work));
    if !worth || !problem.allows(Shortcut::Tiny) {
        return Ok(None);
    }
    let tree = Config {}.search(problem, 0, run)?;
    run.proved_optimal();
    Ok(Some(tree))
}

/// An upper bound of the work of the optimum where it may replace a search: the number of divisions, those with an empty
/// part included. `None` for more than [`MOST_OBJECTS`], and for two objects or fewer, which have only one tree.
pub(crate) fn most_work_of_tiny(objects: usize) -> Option<u64> {
    (3..=MOST_OBJECTS).contains(&objects).then(|| 3u64.pow(objects as u32) / 2)
}

/// For every set of two objects or more, the part with the lowest object in the best division of the set; and the number
/// of divisions compared.
fn divisions(boxes: &[Aabb]) -> (Vec<u32>, u64) {
    let sets = 1usize << boxes.len();
    let mut aabb = vec![Aabb::EMPTY; sets];
    let mut best = vec![0.0; sets];
    let mut part = vec![0; sets];
    let mut work = 0;
    // A set comes after all of its subsets.
    for set in 1..sets {
        let lowest = set & set.wrapping_neg();
        let others = set ^ lowest;
        aabb[set] = aabb[others].union(&boxes[set.trailing_zeros() as usize]);
        if others == 0 {
            continue;
        }
        // `with` is the rest of the part with the lowest object: any proper subset of the others, so that every division
        // is tried once.
        let (mut least, mut taken, mut with) = (f64::INFINITY, 0, 0);
        while with != others {
            let cost = best[with | lowest] + best[others ^ with];
            if cost < least {
                (least, taken) = (cost, with | lowest);
            }
            with = with.wrapping_sub(others) & others;
        }
        work += (1u64 << others.count_ones()) - 1;
        best[set] = aabb[set].half_area() + least;
        part[set] = taken as u32;
    }
    (part, work)
}

/// The tree of these divisions, over one object or more.
fn tree(boxes: &[Aabb], part: &[u32]) -> Bvh {
    let mut tree = Bvh { nodes: vec![Node::leaf(Aabb::EMPTY, 0, 1)], prim_ids: vec![] };
    let mut stack = vec![(0, part.len() as u32 - 1)];
    while let Some((node, set)) = stack.pop() {
        let left = part[set as usize];
        if left == 0 {
            tree.nodes[node] = Node::leaf(Aabb::EMPTY, tree.prim_ids.len() as u32, 1);
            tree.prim_ids.push(set.trailing_zeros());
        } else {
            let first = tree.nodes.len();
            tree.nodes[node] = Node::inner(Aabb::EMPTY, first as u32, 2);
            tree.nodes.extend([Node::leaf(Aabb::EMPTY, 0, 1); 2]);
            stack.extend([(first + 1, set ^ left), (first, left)]);
        }
    }
    tree.refit(boxes);
    tree
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, solve};
    use bvh_core::validate;

    fn scatter(n: usize, salt: usize) -> Vec<Aabb> {
        let at =
            |i: usize, k: usize| ((i * 7 + salt * 13 + 1) * (k * 31 + 17) * 2_654_435 % 1009) as f32 / 100.0;
        let point = |i: usize| [at(i, 0), at(i, 1), at(i, 2)];
        (0..n).map(|i| Aabb::from((point(i), point(i).map(|c| c + at(i, 3) / 5.0)))).collect()
    }

    /// The least internal area of all binary trees over these sets, by merging every two of them in turn.
    fn brute_force(sets: &[Aabb]) -> f64 {
        let mut least = if sets.len() < 2 { 0.0 } else { f64::INFINITY };
        for i in 0..sets.len() {
            for j in 0..i {
                let union = sets[i].union(&sets[j]);
                let mut merged: Vec<Aabb> = sets.to_vec();
                merged.swap_remove(i);
                merged[j] = union;
                least = least.min(union.half_area() + brute_force(&merged));
            }
        }
        least
    }

    #[test]
    fn no_binary_tree_at_all_is_cheaper() {
        for n in 0..=7 {
            for salt in 0..6 {
                let boxes = scatter(n, salt);
                let found = solve(&Config {}, &Problem::new(&boxes), 1, Budget::default(), &()).unwrap();
                validate(&found.tree, &boxes).unwrap();
                let least = brute_force(&boxes);
                assert!((found.cost - least).abs() <= 1e-14 * least, "{n} {salt}: {} {least}", found.cost);
            }
        }
    }

    #[test]
    fn too_many_objects_and_bad_boxes_are_refused() {
        let refused = |boxes: &[Aabb]| {
            solve(&Config {}, &Problem::new(boxes), 1, Budget::default(), &()).unwrap_err().to_string()
        };
        assert_eq!(refused(&scatter(17, 0)), format!("objects is 17; accepted: at most {MOST_OBJECTS}"));
        let mut boxes = scatter(5, 0);
        boxes[3].max.x = f32::NAN;
        assert!(refused(&boxes).contains("object 3"));
    }

    #[test]
    fn every_division_is_compared_once() {
        for n in 2..10u32 {
            let work = divisions(&scatter(n as usize, 1)).1;
            // Pairs of disjoint sets that are not empty.
            assert_eq!(work, 3u64.pow(n).div_ceil(2) - 2u64.pow(n));
        }
    }
}
