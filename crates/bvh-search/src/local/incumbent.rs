//! The best tree of a local search. The working form is converted only when it is better.

use super::{TOLERANCE, construction};
use crate::lower_bound;
use crate::run::{Kept, Observer, Problem, Quota, Run, SearchError, Shortcut, Tally, watched};
use crate::tree::{Metric, Working};
use bvh_build::{Builder, Watch};
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective};

/// A relative difference of areas that is far above all rounding errors.
const CERTAIN: f64 = 1e-9;

/// The best tree so far. Local search lowers the internal area. For binary trees with one object
/// per leaf, every objective of a [`Problem`] grows with the internal area, so all of them fall
/// together.
pub(crate) struct Incumbent<'p> {
    problem: Problem<'p>,
    pub tree: Bvh,
    /// The total that its working form calls the area.
    pub area: f64,
    /// A lower bound of the internal area of all trees.
    lower_bound: f64,
}

impl<'p> Incumbent<'p> {
    /// Builds the initial tree, the first evaluation of the run. Also returns its working form.
    pub fn build<A: Metric>(
        problem: &Problem<'p>,
        metric: A,
        run: &mut Run,
    ) -> Result<(Self, Working<A>), SearchError> {
        let build =
            |watch: &Watch| construction().build_watched(problem.boxes, problem.measure, watch);
        let tree = watched(run.observer(), build)?;
        let incumbent = Self::begin(Kept::new(tree, problem), problem, run);
        let working = Working::from_bvh(&incumbent.tree, metric)?;
        Ok((incumbent, working))
    }

    /// Starts with a valid tree whose boxes are tight. Ends the run if it meets the lower bound.
    pub fn begin(kept: Kept, problem: &Problem<'p>, run: &mut Run) -> Self {
        let Kept { tree, cost } = kept;
        let area = area(problem, &tree, cost);
        run.record(cost, tree.nodes.len() as u64);
        // The bound holds for areas and undivided objects only.
        let Problem { boxes, measure, splits, objective, .. } = *problem;
        let of_areas = measure.is_none() && splits.is_none() && objective != Objective::Layout;
        let is_bounded = of_areas && problem.allows(Shortcut::BoundMet);
        let lower_bound =
            if is_bounded { lower_bound::of_largest(boxes) } else { f64::NEG_INFINITY };
        let incumbent = Self { problem: *problem, area, tree, lower_bound };
        incumbent.stop_if_optimal(run);
        incumbent
    }

    /// Ends the run if no tree is better by more than rounding errors.
    fn stop_if_optimal(&self, run: &mut Run) {
        if self.area <= self.lower_bound * (1.0 + TOLERANCE) {
            run.proved_optimal(Shortcut::BoundMet);
        }
    }

    /// Keeps `tree` if it is the best so far. O(n).
    pub fn offer(&mut self, tree: &Working<impl Metric>, run: &mut Run) {
        let Problem { objective, measure, splits, judge, .. } = self.problem;
        if objective == Objective::Layout && judge.is_none() {
            // The nodes have their sizes already, so the cost is known before the conversion.
            let cost = tree.layout_cost();
            if cost < run.incumbent() {
                let tree = tree.to_bvh_in(std::mem::take(&mut self.tree));
                debug_assert_eq!(cost.to_bits(), self.problem.cost(&tree).to_bits());
                self.keep(tree, cost, run);
            }
            return;
        }
        // The incremental area rejects most trees without the conversion.
        if tree.area() >= self.area && objective != Objective::Layout {
            return;
        }
        // A tree that is better by more than rounding errors is certain to be kept, so it takes the
        // memory of the tree that it replaces.
        let is_plain = measure.is_none() && splits.is_none() && judge.is_none();
        let is_certain = is_plain
            && objective == Objective::InternalArea
            && tree.area() < run.incumbent().min(self.area) * (1.0 - CERTAIN);
        let memory = if is_certain {
            run.drop_aside(tree.area() * (1.0 + CERTAIN));
            std::mem::take(&mut self.tree)
        } else {
            Bvh::default()
        };
        let tree = tree.to_bvh_in(memory);
        let cost = self.problem.cost(&tree);
        self.keep(tree, cost, run);
    }

    fn keep(&mut self, tree: Bvh, cost: f64, run: &mut Run) {
        if run.improve(cost) {
            self.area = area(&self.problem, &tree, cost);
            self.tree = tree;
            // Only a new incumbent can meet the bound.
            self.stop_if_optimal(run);
        }
    }

    /// Repeats a pass over `tree` until it keeps no move, and keeps the best tree.
    pub fn improve<A: Metric>(
        &mut self,
        tree: &mut Working<A>,
        run: &mut Run,
        mut pass: impl FnMut(&mut Working<A>, Quota, &dyn Observer) -> Tally,
    ) {
        while run.stopped().is_none() {
            let done = pass(tree, run.left(), run.observer());
            run.count(done);
            self.offer(tree, run);
            if done.kept == 0 {
                break;
            }
        }
    }
}

/// Returns the [area](Incumbent::area) of a tree of this cost.
fn area(problem: &Problem, tree: &Bvh, cost: f64) -> f64 {
    match *problem {
        Problem { splits: Some(_), measure, .. } => {
            cost::total_measure(tree, measure.unwrap_or(&cost::Area))
        }
        Problem { objective: Objective::InternalArea, judge: None, .. } => cost,
        Problem { measure: Some(measure), .. } => cost::internal_measure(tree, measure),
        _ => cost::internal_area(tree),
    }
}
