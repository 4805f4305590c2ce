//! The exact optimum of small scenes, by dynamic programming over subsets: the reference for every
//! other method.
//!
//! The search space is *binary trees with one object per leaf*. All objectives of a [`Problem`]
//! have the same optima there, because they grow with the internal area. Wider nodes would make the
//! problem meaningless: merging an inner node into its parent removes a term that is never
//! negative, so a single node over all objects would always be cheapest.
//!
//! The recurrence comes from Karras & Aila 2013, who use it for treelets (`Subsets`); here it
//! covers the whole tree.

use crate::run::{Problem, Run, Search, SearchError, Shortcut};
use crate::tree::{HalfArea, Measured, Subsets};
use bvh_build::BuildError;
use bvh_config::Accepts;
use bvh_core::{Aabb, Bvh, Node, PackedAabb, check_boxes};

/// The maximum number of objects. 3¹⁶ / 2 divisions take a few hundredths of a second, and 2¹⁶ sets
/// take 2.8 MB.
pub const MOST_OBJECTS: usize = 16;

bvh_config::config! {
    /// Without parameters.
    pub struct Config {}
}

impl Search for Config {
    /// Makes one evaluation, whose work is the number of divisions compared. The tree is optimal up
    /// to the rounding of 15 additions. Among equal divisions, the search chooses the one whose
    /// part with the first object is the least as a bit set.
    ///
    /// Rejects scenes with more than [`MOST_OBJECTS`] objects. O(3ⁿ) time, O(2ⁿ) memory.
    fn search(&self, problem: &Problem, _seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let n = problem.boxes.len();
        (..=MOST_OBJECTS).check("objects", &n)?;
        // NaN would make every comparison of divisions false.
        check_boxes(problem.boxes).map_err(BuildError::from)?;
        let mut subsets = Subsets::new(n as u32);
        let leaves = problem.boxes.iter().map(PackedAabb::from);
        match problem.measure {
            Some(measure) => subsets.solve(leaves, Measured::new(measure)),
            None => subsets.solve(leaves, HalfArea::default()),
        };
        let tree = if n == 0 { Bvh::default() } else { tree(problem.boxes, &subsets) };
        run.record(problem.cost(&tree), 3u64.pow(n as u32).div_ceil(2) - (1 << n));
        Ok(tree)
    }
}

/// Returns the optimum and ends the run, if the scene is [tiny](most_work_of_tiny) and the optimum
/// takes no more work than `work` and the rest of the run's budget.
pub(crate) fn instead(
    problem: &Problem,
    work: u64,
    run: &mut Run,
) -> Result<Option<Bvh>, SearchError> {
    let least = most_work_of_tiny(problem.boxes.len());
    let worth = least.is_some_and(|least| least <= work.min(run.left().work));
    if !worth || !problem.allows(Shortcut::Tiny) {
        return Ok(None);
    }
    let tree = Config {}.search(problem, 0, run)?;
    run.proved_optimal(Shortcut::Tiny);
    Ok(Some(tree))
}

/// Returns an upper bound of the optimum's work, where the optimum may replace a search: the number
/// of divisions, including divisions with an empty part. `None` for more than [`MOST_OBJECTS`], and
/// for two objects or fewer, which have only one tree.
pub(crate) fn most_work_of_tiny(objects: usize) -> Option<u64> {
    (3..=MOST_OBJECTS).contains(&objects).then(|| 3u64.pow(objects as u32) / 2)
}

/// Builds the tree of the best divisions, over one object or more.
fn tree(boxes: &[Aabb], subsets: &Subsets) -> Bvh {
    let mut tree = Bvh::new(vec![Node::leaf(Aabb::EMPTY, 0, 1)], vec![]);
    let mut stack = vec![(0, (1usize << boxes.len()) - 1)];
    while let Some((node, set)) = stack.pop() {
        if set.is_power_of_two() {
            tree.nodes[node] = Node::leaf(Aabb::EMPTY, tree.prim_ids.len() as u32, 1);
            tree.prim_ids.push(set.trailing_zeros());
        } else {
            let first = tree.nodes.len();
            tree.nodes[node] = Node::inner(Aabb::EMPTY, first as u32, 2);
            tree.nodes.extend([Node::leaf(Aabb::EMPTY, 0, 1); 2]);
            let [left, right] = subsets.division(set);
            // The left side is popped first, so objects are in leaf order from left to right.
            stack.extend([(first + 1, right), (first, left)]);
        }
    }
    tree.refit(boxes);
    tree
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, solve};
    use crate::scatter::{density, scatter};
    use bvh_core::cost::{Area, Measure};
    use bvh_core::validate;

    /// The least total size of inner nodes of all binary trees over these sets, by merging every
    /// pair.
    fn brute_force(sets: &[Aabb], size: &dyn Measure) -> f64 {
        let mut least = if sets.len() < 2 { 0.0 } else { f64::INFINITY };
        for i in 0..sets.len() {
            for j in 0..i {
                let union = sets[i].union(&sets[j]);
                let mut merged: Vec<Aabb> = sets.to_vec();
                merged.swap_remove(i);
                merged[j] = union;
                least = least.min(size.of(&PackedAabb::from(&union)) + brute_force(&merged, size));
            }
        }
        least
    }

    #[test]
    fn no_binary_tree_at_all_is_cheaper_by_area_or_by_the_density_of_rays() {
        for n in 0..=7 {
            for salt in 0..6 {
                let boxes = scatter(100)[10 * salt..10 * salt + n].to_vec();
                let measures = [None, density(&boxes)];
                for measure in
                    measures.iter().map(|of| of.as_ref().map(|density| density as &dyn Measure))
                {
                    let problem = Problem { measure, ..Problem::new(&boxes) };
                    let found = solve(&Config {}, &problem, 1, Budget::UNLIMITED, &()).unwrap();
                    validate(&found.tree, &boxes).unwrap();
                    let least = brute_force(&boxes, measure.unwrap_or(&Area));
                    let off = (found.cost - least).abs();
                    assert!(off <= 1e-14 * least, "{n} {salt}: {off} of {least}");
                }
            }
        }
    }

    #[test]
    fn too_many_objects_and_bad_boxes_are_rejected() {
        fn error(boxes: &[Aabb]) -> String {
            solve(&Config {}, &Problem::new(boxes), 1, Budget::UNLIMITED, &())
                .unwrap_err()
                .to_string()
        }
        assert_eq!(error(&scatter(17)), format!("objects is 17; accepted: at most {MOST_OBJECTS}"));
        let mut boxes = scatter(5);
        boxes[3].max.x = f32::NAN;
        assert!(error(&boxes).contains("object 3"));
    }
}
