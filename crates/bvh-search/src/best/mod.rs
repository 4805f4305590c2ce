//! `best`: the methods that pay, in the order that pays, for any budget.
//!
//! The section "The portfolio `best`" of `docs/evidence/METHODS.md` shows the plan. In
//! short: the [exact solver](crate::exact) for a few objects; clustering and reinsertion of the
//! largest nodes in milliseconds (`small_budget`); one long run of
//! [annealed ruin and recreate](crate::ruin_recreate) and short runs after it if the end is known,
//! from the budget's work or the observer's [progress](crate::Observer::progress), and generations
//! of growing length if the end is open (`improve`).
//!
//! The result of an annealing run is recombined with the incumbent (`recombine`). The first run of
//! a plan is an exception: it replaces the incumbent if it ends better. If it ends worse under a
//! time limit, the time was too short for annealing, and for recombination, too.
//!
//! The thresholds between these phases are in one table, `tuning.rs`, and in [`Config`].

mod config;
mod improve;
mod recombine;
mod small_budget;

use crate::exact;
use crate::local::incumbent::Incumbent;
use crate::local::{construction, reinsertion};
use crate::run::{
    Budget, Found, Kept, Observer, Outcome, Problem, Run, SearchError, Splits, StopReason,
    built_unless_cancelled, solve, watched,
};
use crate::tree::{Metric, Working, search_by_metric};
use crate::tuning::{CLUSTERING, CLUSTERING_MUCH_CHEAPER, REINSERTED_BELOW, SECURED_FROM};
use bvh_build::ploc::{self, MortonOrder};
use bvh_build::{Builder, Watch, spatial};
use bvh_core::cost::Objective;
use bvh_core::{Aabb, Bvh};
pub use config::{Config, Horizon};
use improve::improve;

search_by_metric!(Config);

/// Returns the outcome of plain reinsertion within the same work, which `best` may end behind:
/// within little work, because it does not yet pay to anneal, and after an early stop of a long
/// search. A time-limited search keeps such a tree itself. A search limited by work does not,
/// because its bytes must follow from its plan alone. In a long search, reinsertion takes at most a
/// twentieth of the work. `None` if the work is neither little nor much.
pub(crate) fn fallback(
    problem: &Problem,
    work: u64,
    observer: &dyn Observer,
) -> Result<Option<Outcome>, SearchError> {
    let per_object = work as f64 / problem.boxes.len() as f64;
    let is_used = !(REINSERTED_BELOW..SECURED_FROM).contains(&per_object);
    let budget = Budget { max_work: Some(work), ..Budget::UNLIMITED };
    is_used
        .then(|| solve(&reinsertion::Config::default(), problem, 0, budget, observer))
        .transpose()
}

/// Returns the outcome of a search, with the [`fallback`]'s tree if it costs less, which happens
/// after an early stop.
pub(crate) fn unless_behind(found: Outcome, fallback: Option<Outcome>) -> Outcome {
    let better = fallback.filter(|other| other.cost < found.cost);
    match better {
        Some(Outcome { tree, cost, .. }) => Outcome { tree, cost, ..found },
        None => found,
    }
}

/// Divides objects from the top down with spatial splits, or copies the caller's division; `None` if
/// they may not be divided, or if the observer cancels first. If the result has no more references than
/// objects, no plane saves anything. A search would then hardly find a saving either, and would
/// spend its work on looking.
pub(crate) fn divided(
    splits: Option<Splits>,
    boxes: &[Aabb],
    observer: &dyn Observer,
) -> Result<Option<Bvh>, SearchError> {
    let Some(Splits { objects, most, divided }) = splits.filter(|s| s.most > boxes.len()) else {
        return Ok(None);
    };
    if let Some(divided) = divided {
        return Ok(Some(divided.clone()));
    }
    built_unless_cancelled(observer, |watch| spatial::build(most, boxes, objects, watch))
}

/// Builds a clustering whose larger neighbourhood pays where objects are as large as the scene.
fn thorough_clustering(problem: &Problem, run: &Run) -> Result<Kept, SearchError> {
    let config = ploc::Config::default();
    let build = |watch: &Watch| config.build_watched(problem.boxes, None, watch);
    Ok(Kept::new(watched(run.observer(), build)?, problem))
}

impl Config {
    /// Anneals several subtrees in parallel, each with a separate random stream.
    fn search_by(&self, metric: impl Metric, problem: &Problem, seed: u64, run: &mut Run) -> Found {
        if problem.splits.is_some() || problem.objective == Objective::Layout {
            let tree = self.initial(None, problem, run)?;
            let other = divided(problem.splits, problem.boxes, run.observer())?;
            let best = Incumbent::begin(tree, problem, run);
            return self.improved(best, other, metric, problem, seed, run);
        }
        let (_, work) = self.horizon(problem.boxes.len() as u64, run);
        if let Some(optimum) = exact::instead(problem, work, run)? {
            return Ok(optimum);
        }
        // The search for small budgets supports the area only.
        let mut morton = None;
        let small = match problem.measure {
            None => small_budget::search(problem, &mut morton, run)?,
            Some(_) => None,
        };
        let best = match small {
            Some((best, false)) => return Ok(best.tree),
            Some((best, true)) => best,
            None => Incumbent::begin(self.initial(morton, problem, run)?, problem, run),
        };
        self.improved(best, None, metric, problem, seed, run)
    }

    /// Builds the initial tree from the top down, and a clustering, which takes a fraction of the
    /// time. If the clustering or the caller's tree is cheaper, a
    /// more thorough clustering is built and kept aside, so no budget ends above it. If the first
    /// clustering is much cheaper, the cheapest of them becomes the initial tree. The work of a
    /// clustering counts only if it is used, like the work of the [`fallback`].
    fn initial(
        &self,
        morton: Option<MortonOrder>,
        problem: &Problem,
        run: &mut Run,
    ) -> Result<Kept, SearchError> {
        let boxes = problem.boxes;
        let build = |watch: &Watch| construction().build_watched(boxes, problem.measure, watch);
        let morton = morton.map_or_else(|| MortonOrder::new(boxes), Ok)?;
        let clustered = watched(run.observer(), |watch| morton.build(&CLUSTERING, None, watch))?;
        // Only the cheapest tree is kept, because the division of a large scene needs most of the
        // memory of the search.
        run.keep_aside(Kept::new(clustered, problem));
        // A cancelled search ends with the tree aside.
        let started = Kept::new(watched(run.observer(), build)?, problem);
        let Some(aside) = run.take_aside_below(started.cost) else {
            return Ok(started);
        };
        let is_much_cheaper = aside.cost < CLUSTERING_MUCH_CHEAPER * started.cost;
        run.keep_aside(aside);
        if !is_much_cheaper {
            run.keep_aside(thorough_clustering(problem, run)?);
            return Ok(started);
        }
        // A large scene has no memory for another tree beside the next clustering.
        drop(started);
        let thorough = thorough_clustering(problem, run)?;
        Ok(run.take_aside_below(thorough.cost).unwrap_or(thorough))
    }

    /// Improves a tree with one reference per leaf, and its references if they may change. If a
    /// trial shows that the other tree is better, improves the other tree instead.
    pub(crate) fn improved<A: Metric>(
        &self,
        mut best: Incumbent,
        other: Option<Bvh>,
        metric: A,
        problem: &Problem,
        seed: u64,
        run: &mut Run,
    ) -> Found {
        // The working form of a large tree takes half a second.
        if run.stopped() == Some(StopReason::Cancelled) {
            return Ok(best.tree);
        }
        let metric = if problem.splits.is_some() { metric.with_leaves() } else { metric };
        let mut tree = Working::from_bvh(&best.tree, metric)?;
        let working = other.as_ref().map(|tree| Working::from_bvh(tree, metric)).transpose()?;
        if let Some(other) = other {
            run.keep_aside(Kept::new(other, problem));
        }
        improve(self, &mut tree, working, seed, problem, &mut best, run);
        Ok(best.tree)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::scatter;

    #[test]
    fn reinsertion_stands_by_within_little_and_within_much_work() {
        let boxes = scatter(50);
        for (per_object, is_used) in
            [(299.9, true), (300.0, false), (19_999.9, false), (20_000.0, true)]
        {
            let found = fallback(&Problem::new(&boxes), (per_object * 50.0) as u64, &()).unwrap();
            assert_eq!(found.is_some(), is_used, "{per_object}");
        }
        let search = |work| fallback(&Problem::new(&boxes), work, &()).unwrap().unwrap();
        let (early, late) = (search(0), search(14_999));
        assert!(late.cost < early.cost);
        let [cost, work] = [late.cost, early.work as f64];
        let better = unless_behind(early.clone(), Some(late.clone()));
        assert_eq!([better.cost, better.work as f64], [cost, work]);
        assert_eq!(better.tree, late.tree);
        assert_eq!(unless_behind(late.clone(), Some(early)).tree, late.tree);
    }
}
