//! The best tree of a local search, kept cheaply: converted only when one is really better.

use crate::reinsertion::TOLERANCE;
use crate::working::Working;
use crate::{Observer, Omission, Problem, Quota, Run, SearchError, Tally, lower_bound};
use bvh_build::Builder;
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective};

/// The best tree so far. Local search lowers the internal area; for binary trees with one object per leaf every
/// objective of a [`Problem`] grows with it, so that lowering it lowers them all.
pub(crate) struct Incumbent<'p> {
    problem: Problem<'p>,
    pub tree: Bvh,
    area: f64,
    /// An area that no tree is below.
    floor: f64,
}

impl<'p> Incumbent<'p> {
    /// Builds the start, the first evaluation of the run; also in its working form.
    pub fn build(
        builder: &dyn Builder,
        problem: &Problem<'p>,
        run: &mut Run,
    ) -> Result<(Self, Working), SearchError> {
        let incumbent = Self::begin(builder.build(problem.boxes)?, problem, run);
        let working = incumbent.working()?;
        Ok((incumbent, working))
    }

    /// The working form of the best tree. No box is wider than it must be: builders leave none, and moves none.
    pub fn working(&self) -> Result<Working, SearchError> {
        Working::from_tight(&self.tree, self.area)
    }

    /// Begins with a valid tree, whose boxes are tight.
    pub fn begin(tree: Bvh, problem: &Problem<'p>, run: &mut Run) -> Self {
        let mut incumbent = Self::begin_unbounded(tree, problem, run);
        incumbent.bound(run);
        incumbent
    }

    /// Looks whether the tree meets a bound, from now on.
    pub fn bound(&mut self, run: &mut Run) {
        if self.problem.leaves_out(Omission::BoundMet) {
            self.floor = lower_bound::of_largest(self.problem.boxes);
        }
        self.settle(run);
    }

    /// As [`begin`](Self::begin), without looking whether the tree meets a bound: for when there is no time.
    pub fn begin_unbounded(tree: Bvh, problem: &Problem<'p>, run: &mut Run) -> Self {
        let (cost, area) = costs(problem, &tree);
        run.record(cost, tree.nodes.len() as u64);
        Self { problem: *problem, area, tree, floor: f64::NEG_INFINITY }
    }

    /// Ends the run if nothing can be better but for rounding.
    fn settle(&self, run: &mut Run) {
        if self.area <= self.floor * (1.0 + TOLERANCE) {
            run.settle();
        }
    }

    /// The internal area of the best tree.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Keeps `tree` if it is better than all before. O(n).
    pub fn offer(&mut self, tree: &Working, run: &mut Run) -> bool {
        tree.area() < self.area && self.offer_tree(tree.to_bvh(), run)
    }

    /// As [`offer`](Self::offer), for a valid tree that needs no conversion.
    pub fn offer_tree(&mut self, candidate: Bvh, run: &mut Run) -> bool {
        let (cost, area) = costs(&self.problem, &candidate);
        let improved = run.improve(cost);
        if improved {
            self.area = area;
            self.tree = candidate;
            self.settle(run);
        }
        improved
    }

    /// Sweeps `tree` until a sweep keeps nothing, `sweeps` times at most; `sweep` is told how many were before.
    pub fn descend(
        &mut self,
        tree: &mut Working,
        sweeps: u32,
        run: &mut Run,
        mut sweep: impl FnMut(&mut Working, u32, Quota, &dyn Observer) -> Tally,
    ) {
        for number in 0..sweeps {
            if run.stopped().is_some() {
                break;
            }
            let swept = sweep(tree, number, run.left(), run.observer());
            run.count(swept);
            self.offer(tree, run);
            if swept.kept == 0 {
                break;
            }
        }
    }
}

/// The tree's cost by the problem's objective, and its internal area.
fn costs(problem: &Problem, tree: &Bvh) -> (f64, f64) {
    let cost = problem.objective.cost(tree);
    let area = if problem.objective == Objective::InternalArea { cost } else { cost::internal_area(tree) };
    (cost, area)
}

/// Sweeps until a sweep keeps nothing, the quota is reached, or the observer says so.
pub(crate) fn until_still(
    quota: Quota,
    observer: &dyn Observer,
    mut sweep: impl FnMut(Quota) -> Tally,
) -> Tally {
    let mut total = Tally::default();
    loop {
        let swept = sweep(quota.less(&total));
        total += swept;
        if swept.kept == 0 || quota.is_reached(&total) || observer.cancelled() {
            return total;
        }
    }
}
