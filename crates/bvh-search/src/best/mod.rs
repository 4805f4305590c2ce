//! `best`: the methods that pay, in the order that pays, for any budget.
//!
//! Which method ends lowest depends on the time there is, from the few milliseconds of a build to the minutes of a bake:
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
//! *A few objects.* Where the [exact solver](crate::exact) takes less work than the budget has, its optimum is the answer.
//!
//! *Milliseconds* (`small_budget`). A clustering along the Morton curve is the fastest build that is worth starting from.
//! Reinsertion then begins with the largest nodes, in which most of the area that can be saved lies, and stops when the
//! time does. If a local optimum comes first, the search goes on as below.
//!
//! *The end is known*, from the budget's work or the observer's [progress](crate::Observer::progress). A greedy top-down
//! division is followed at once by one long run of [annealed ruin and recreate](crate::ruin_recreate): a local search
//! before it would be forgotten at its first temperature, and at equal work one long run ends lower than several short
//! ones, one after another or side by side. If there is much to be done, several short runs from a lower temperature
//! follow. Each loosens everything except the top of the tree and finds other optima, better in some places and worse in
//! others. A search of a minute or more by a clock, which somebody may stop early, first keeps the local optimum of
//! reinsertion aside.
//!
//! *The end is open.* Reinsertion to a local optimum, then generations, each annealed from the incumbent and longer than
//! the one before, so that whenever the search is stopped, a constant fraction of the work has gone into the last
//! generation.
//!
//! *Recombination.* The result of an annealing run is recombined with the incumbent, which keeps every subtree that became
//! better and drops every subtree that became worse. Only the first run of a known end is not, if it ends better; if it
//! ends worse under a clock, there was no time to do anything, nor is there any for recombination.
//!
//! The numbers that decide between all these are in one table, `tuning.rs`, and in [`Config`].

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

/// What whoever stops a search of this much work early can have in place of a worse tree: the outcome of plain reinsertion, before the
/// search. It takes a twentieth of the work at most; none if there is too little. By the clock, a search keeps such a tree
/// itself; by work it does not, because its bytes are to follow from its plan alone.
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

/// What a search found, with the [`fallback`]'s tree where that costs less, as it may after a search that was stopped early.
pub fn unless_behind(found: Outcome, fallback: Option<Outcome>) -> Outcome {
    let better = fallback.filter(|other| other.cost < found.cost);
    match better {
        Some(Outcome { tree, cost, .. }) => Outcome { tree, cost, ..found },
        None => found,
    }
}

/// The division with spatial splits, if the problem allows them: the one that the caller has, or a new one, unless the observer
/// cancels before it is made.
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
    /// Subtrees, if there are several, are annealed in parallel, each with a random stream of its own.
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
        // Small budgets go by area.
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

    /// Builds the initial tree. Unless that is chosen by the configuration, a clustering is built as well, which takes a fraction of the
    /// time: it is the initial tree where it is much cheaper, and otherwise kept aside, so that no budget ends above what the smallest
    /// ones begin with. Like that of the [`fallback`], its work counts only where it is used.
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
        let [other, first] = [&clustered, &started].map(|tree| problem.cost(tree));
        if other < CLUSTERING_MUCH_CHEAPER * first {
            run.keep_aside(problem, started);
            return Ok(clustered);
        }
        run.keep_aside(problem, clustered);
        Ok(started)
    }

    /// Improves a tree with one reference per leaf, and its references if they may change; or another one, where a trial shows that
    /// to be better.
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
