//! `best`: the methods that pay, in the order that pays, for any budget.
//!
//! The available time decides which method ends lowest, from the milliseconds of a build to the
//! minutes of a bake:
//!
//! ```text
//!   budget          milliseconds              seconds                    minutes
//!   ───────────────────────────────────────────────────────────────────────────────────────────►
//!   initial tree    clustering (PLOC)         top-down division with |L|^0.9
//!   then            reinsertion of the        ┌─ end known ──────────────────────────────────┐
//!                   largest nodes, as         │ hot                                          │
//!                   many as there is          │   \            long annealing run            │
//!                   time for                  │     \                                        │
//!                                             │        \      |\   |\   |\    short runs,    │
//!                                             │             \ | \  | \  | \   each recombined│
//!                                             │ cold         \|  \ |  \ |  \  with the best  │
//!                                             ├─ end open ───────────────────────────────────┤
//!                                             │ local optimum, then generations of doubling  │
//!                                             │ length:  |\  |_\  |____\  |_________\  ...   │
//!                                             └──────────────────────────────────────────────┘
//! ```
//!
//! *A few objects.* If the budget has enough work for the [exact solver](crate::exact), the result
//! is the optimum.
//!
//! *Milliseconds* (`small_budget`). A clustering along the Morton curve is the fastest build with a
//! good tree to start from. Reinsertion begins with the largest nodes, which hold most of the area
//! that can be saved, and stops when the time is over. If it reaches a local optimum earlier, the
//! search continues as below.
//!
//! *The end is known*, from the budget's work or the observer's
//! [progress](crate::Observer::progress). One long run of
//! [annealed ruin and recreate](crate::ruin_recreate) follows a greedy top-down division at once. A
//! local search in between would be lost at the first temperature, and at equal work one long run
//! ends lower than several short runs, sequential or parallel. With much work, several short runs
//! from a lower temperature follow. Each loosens everything except the top of the tree and finds
//! another optimum, better in some places and worse in others. A time-limited search of a minute or
//! more, which the user may stop early, first keeps a local optimum of reinsertion.
//!
//! *The end is open.* Reinsertion leads to a local optimum. Generations follow, each annealed from
//! the incumbent and longer than the previous one. Whenever the search is stopped, a constant
//! fraction of the work has gone into the last generation.
//!
//! *Recombination.* The result of an annealing run is recombined with the incumbent, which keeps
//! every subtree that became better and drops every subtree that became worse. The first run of a
//! plan is an exception: it replaces the incumbent if it ends better. If it ends worse under a time
//! limit, the time was too short for annealing, and for recombination, too.
//!
//! The thresholds between these phases are in one table, `tuning.rs`, and in [`Config`].

mod config;
mod improve;
mod plan;
mod recombine;
mod small_budget;

use crate::exact;
use crate::local::incumbent::Incumbent;
use crate::local::reinsertion;
use crate::run::{Budget, Found, Observer, Outcome, Problem, Run, SearchError, solve, watched};
use crate::tree::{Metric, WithLeaves, Working, search_by_metric};
use crate::tuning::{CLUSTERING, CLUSTERING_MUCH_CHEAPER, SECURED_FROM};
use bvh_build::ploc::MortonOrder;
use bvh_build::{BuildError, Builder, Watch};
use bvh_core::Bvh;
use bvh_core::cost::Objective;
pub use config::{Config, Horizon};
pub(crate) use improve::improve;
use small_budget::SmallBudget;

search_by_metric!(Config);

/// Returns the outcome of plain reinsertion, for callers who may stop a search of this much work
/// early and want no worse tree. Reinsertion takes at most a twentieth of the work; `None` if the
/// work is too little. A time-limited search keeps such a tree itself. A search limited by work
/// does not, because its bytes must follow from its plan alone.
pub fn fallback(
    problem: &Problem,
    work: u64,
    observer: &dyn Observer,
) -> Result<Option<Outcome>, SearchError> {
    if (work as f64) < SECURED_FROM * problem.boxes.len() as f64 {
        return Ok(None);
    }
    solve(&reinsertion::Config::default(), problem, 0, Budget::UNLIMITED, observer).map(Some)
}

/// Returns the outcome of a search, with the [`fallback`]'s tree if it costs less, which happens
/// after an early stop.
pub fn unless_behind(found: Outcome, fallback: Option<Outcome>) -> Outcome {
    let better = fallback.filter(|other| other.cost < found.cost);
    match better {
        Some(Outcome { tree, cost, .. }) => Outcome { tree, cost, ..found },
        None => found,
    }
}

/// Returns the division with spatial splits, if the problem allows them: the caller's division or a
/// new one. `None` if the observer cancels first.
fn division(problem: &Problem, observer: &dyn Observer) -> Result<Option<Bvh>, SearchError> {
    let Some(splits) = problem
        .splits
        .filter(|splits| splits.most > problem.boxes.len())
    else {
        return Ok(None);
    };
    if let Some(division) = splits.division {
        return Ok(Some(division.clone()));
    }
    match watched(observer, |watch| splits.divide(problem.boxes, watch)) {
        Err(BuildError::Cancelled) => Ok(None),
        divided => Ok(Some(divided?)),
    }
}

impl Config {
    /// Anneals several subtrees in parallel, each with a separate random stream.
    fn search_by<A: Metric>(
        &self,
        metric: A,
        problem: &Problem,
        seed: u64,
        run: &mut Run,
    ) -> Found {
        if problem.splits.is_some() || problem.objective == Objective::Layout {
            let tree = self.initial(None, problem, run)?;
            let other = division(problem, run.observer())?;
            return self.improved((tree, other), metric, problem, seed, run);
        }
        let (_, work) = self.horizon(problem.boxes.len() as u64, run);
        if let Some(optimum) = exact::instead(problem, work, run)? {
            return Ok(optimum);
        }
        // The search for small budgets supports the area only.
        let small = match problem.measure {
            None if self.start.is_none() => small_budget::search(problem, metric, run)?,
            _ => SmallBudget::Large(None),
        };
        let (mut best, mut tree) = match small {
            SmallBudget::Tree(tree) => return Ok(tree),
            SmallBudget::LocalOptimum(best, tree) => (best, tree),
            SmallBudget::Large(morton) => {
                let best = Incumbent::begin(self.initial(morton, problem, run)?, problem, run);
                let tree = best.working(metric)?;
                (best, tree)
            }
        };
        improve(self, (&mut tree, None), seed, problem, &mut best, run);
        Ok(best.tree)
    }

    /// Builds the initial tree. Unless the configuration names a builder, also builds a clustering,
    /// which takes a fraction of the time. A much cheaper clustering becomes the initial tree;
    /// otherwise it is kept aside, so no budget ends above the start of the smallest budgets. Its
    /// work counts only if it is used, like the work of the [`fallback`].
    fn initial(
        &self,
        morton: Option<MortonOrder>,
        problem: &Problem,
        run: &mut Run,
    ) -> Result<Bvh, SearchError> {
        let boxes = problem.boxes;
        let start = self.start.clone().unwrap_or_default();
        let build = |watch: &Watch| start.build_watched(boxes, problem.measure, watch);
        if self.start.is_some() {
            return Ok(watched(run.observer(), build)?);
        }
        let morton = morton.map_or_else(|| MortonOrder::new(boxes), Ok)?;
        let clustered =
            watched(run.observer(), |watch| morton.build_watched(&CLUSTERING, None, watch))?;
        let started = match watched(run.observer(), build) {
            Err(BuildError::Cancelled) => return Ok(clustered),
            started => started?,
        };
        // Both are evaluated by the problem's objective, also where the clustering was built by
        // area.
        let [other, first] = [&clustered, &started].map(|tree| problem.cost(tree));
        if other < CLUSTERING_MUCH_CHEAPER * first {
            run.keep_aside(problem, started);
            return Ok(clustered);
        }
        run.keep_aside(problem, clustered);
        Ok(started)
    }

    /// Improves a tree with one reference per leaf, and its references if they may change. If a
    /// trial shows that the other tree is better, improves the other tree instead.
    pub(crate) fn improved<A: Metric>(
        &self,
        (tree, other): (Bvh, Option<Bvh>),
        metric: A,
        problem: &Problem,
        seed: u64,
        run: &mut Run,
    ) -> Found {
        let mut best = Incumbent::begin(tree, problem, run);
        if problem.splits.is_some() {
            let metric = WithLeaves(metric);
            let mut tree = best.working(metric)?;
            let working = |tree: &Bvh| Working::from_bvh(tree, metric.internal(tree), metric);
            let other_working = other.as_ref().map(working).transpose()?;
            if let Some(other) = other {
                run.keep_aside(problem, other);
            }
            improve(self, (&mut tree, other_working), seed, problem, &mut best, run);
        } else {
            improve(self, (&mut best.working(metric)?, None), seed, problem, &mut best, run);
        }
        Ok(best.tree)
    }
}
