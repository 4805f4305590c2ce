//! Treelet restructuring: gives one small part of the tree after the other its optimal shape, until
//! a local optimum.
//!
//! Karras & Aila 2013, 'Fast parallel construction of high-quality bounding volume hierarchies',
//! section 3: a treelet is grown from its root by opening the leaf of largest area; dynamic
//! programming over the subsets of its leaves finds the best of all shapes. Domingues & Pedrini
//! 2015 use other sizes.
//!
//! Differs from them: any size from 3 to 12 at every node, bottom-up, until a full pass changes
//! nothing. A treelet whose nodes have not changed since it was last optimal is not solved again.

use crate::local::TOLERANCE;
use crate::local::incumbent::Incumbent;
use crate::run::{Found, Observer, Problem, Quota, Run, Tally};
use crate::tree::{Metric, NONE, Subsets, Working, search_by_metric};
use bvh_core::with_vector_instructions;

bvh_config::config! {
    /// The size of treelets.
    pub struct Config {
        /// Leaves of a treelet. Solving one takes O(3^size) time. The paper uses 7.
        size: u32 = 7, in 3..=12;
    }
}

search_by_metric!(Config);

impl Config {
    fn search_by(&self, metric: impl Metric, problem: &Problem, _: u64, run: &mut Run) -> Found {
        let (mut best, mut tree) = Incumbent::build(problem, metric, run)?;
        let mut solver = Solver::new(self.size, &tree);
        best.improve(&mut tree, run, |tree, quota, observer| {
            pass(tree, &mut solver, quota, observer)
        });
        Ok(best.tree)
    }
}

with_vector_instructions! {
    /// Restructures the treelet of every node if that pays, children before parents. Stops early
    /// when the quota is used up or the observer cancels.
    pass = pass_plain(tree: &mut Working<impl Metric>, solver: &mut Solver, quota: Quota, observer: &dyn Observer) -> Tally
}

#[inline(always)]
fn pass_plain(
    tree: &mut Working<impl Metric>,
    solver: &mut Solver,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    for root in tree.preorder().into_iter().rev() {
        if tree.nodes[root as usize].is_leaf() {
            continue;
        }
        if quota.is_reached(&done) || done.moves % 64 == 63 && observer.cancelled() {
            break;
        }
        // Growing is cheap compared with solving, so unchanged treelets are grown but not solved
        // again.
        let fresh = solver.grow(tree, root);
        done.work += 2 * solver.inner.len() as u64;
        if !fresh || solver.leaves.len() < 3 {
            continue;
        }
        done.moves += 1;
        // One unit per subset for its box, and one per 16 divisions of a subset, which take about
        // as long.
        let size = solver.leaves.len() as u32;
        done.work += 2u64.pow(size) + 3u64.pow(size) / 16;
        if solver.solve(tree) {
            tree.begin();
            solver.restructure(tree);
            done.kept += 1;
        }
        // Recorded after the change, so that the treelet's own nodes do not count as changed.
        solver.solved[root as usize] = tree.changes();
    }
    done
}

/// One treelet and the best shapes of its subsets.
#[derive(Debug)]
struct Solver {
    size: usize,
    /// Per node of the tree, the number of changes begun when the treelet below it was last made
    /// optimal; initially `NEVER`.
    solved: Vec<u64>,
    leaves: Vec<u32>,
    /// The inner nodes, the root first.
    inner: Vec<u32>,
    subsets: Subsets,
}

/// Later than any change.
const NEVER: u64 = u64::MAX;

impl Solver {
    fn new(size: u32, tree: &Working<impl Metric>) -> Self {
        Self {
            size: size as usize,
            solved: vec![NEVER; tree.nodes.len()],
            leaves: Vec::new(),
            inner: Vec::new(),
            subsets: Subsets::new(size),
        }
    }

    /// Opens the leaf of largest area until the treelet has enough leaves. Returns whether any node
    /// of the treelet has changed since it was solved.
    #[inline(always)]
    fn grow(&mut self, tree: &Working<impl Metric>, root: u32) -> bool {
        self.inner.clear();
        self.leaves.clear();
        self.leaves.push(root);
        let mut last = 0;
        while self.leaves.len() < self.size {
            let mut largest = (-1.0, NONE as usize);
            for (position, &leaf) in self.leaves.iter().enumerate() {
                let node = &tree.nodes[leaf as usize];
                if !node.is_leaf() && node.area > largest.0 {
                    largest = (node.area, position);
                }
            }
            let Some(place) = self.leaves.get_mut(largest.1) else { break };
            let node = &tree.nodes[*place as usize];
            last = last.max(node.stamp);
            self.inner.push(*place);
            *place = node.children[0];
            self.leaves.push(node.children[1]);
        }
        let last =
            self.leaves.iter().fold(last, |last, &leaf| last.max(tree.nodes[leaf as usize].stamp));
        let solved = self.solved[root as usize];
        solved == NEVER || last > solved
    }

    /// Finds the best shape. Returns whether it is better than the present shape.
    #[inline(always)]
    fn solve(&mut self, tree: &Working<impl Metric>) -> bool {
        let least = self
            .subsets
            .solve(self.leaves.iter().map(|&leaf| tree.nodes[leaf as usize].aabb), tree.metric());
        let before: f64 = self.inner.iter().map(|&node| tree.nodes[node as usize].area).sum();
        least < before * (1.0 - TOLERANCE)
    }

    #[inline(always)]
    fn restructure(&mut self, tree: &mut Working<impl Metric>) {
        let all = (1usize << self.leaves.len()) - 1;
        // Subsets and children of the inner nodes, from the root down.
        let mut joints: [(usize, [u32; 2]); 12] = [(0, [NONE; 2]); 12];
        joints[0].0 = all;
        let mut used = 1;
        for index in 0..self.inner.len() {
            joints[index].1 = self.subsets.division(joints[index].0).map(|part| {
                if part.is_power_of_two() {
                    self.leaves[part.trailing_zeros() as usize]
                } else {
                    joints[used].0 = part;
                    used += 1;
                    self.inner[used - 1]
                }
            });
        }
        for (&node, &(_, children)) in self.inner.iter().zip(&joints).rev() {
            tree.join(node, children);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local::reinsertion::repeat;
    use crate::scatter::{built, scatter};
    use crate::{Budget, exact, solve};
    use bvh_build::median_cut;
    use bvh_core::validate;

    #[test]
    fn boxes_and_areas_stay_exact_and_a_local_optimum_is_one() {
        for size in [3, 5, 7, 12] {
            let boxes = scatter(150);
            let mut tree = built(&median_cut::Config::default(), &boxes);
            let mut solver = Solver::new(size, &tree);
            let start = tree.area();
            repeat(Quota::ENDLESS, &(), |quota| {
                let done = pass(&mut tree, &mut solver, quota, &());
                let area = tree.internal_area();
                assert!((tree.area() - area).abs() <= 1e-12 * area);
                done
            });
            assert!(tree.area() < start);
            let found = tree.to_bvh();
            validate(&found, &boxes).unwrap();
            assert!(found.is_tight(&boxes));
            // The pass skipped no treelet that would have paid.
            let again = pass(&mut tree.clone(), &mut Solver::new(size, &tree), Quota::ENDLESS, &());
            assert_eq!(again.kept, 0);
        }
    }

    #[test]
    fn a_treelet_that_spans_the_tree_makes_it_optimal() {
        for n in 3..=9 {
            let boxes = scatter(n);
            let mut tree = built(&median_cut::Config::default(), &boxes);
            let mut solver = Solver::new(n, &tree);
            repeat(Quota::ENDLESS, &(), |quota| pass(&mut tree, &mut solver, quota, &()));
            let problem = Problem::new(&boxes);
            let optimum = solve(&exact::Config {}, &problem, 1, Budget::UNLIMITED, &()).unwrap();
            let least = optimum.cost;
            assert!((tree.area() - least).abs() <= 1e-12 * least, "{n}: {} {least}", tree.area());
        }
    }
}
