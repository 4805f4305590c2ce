//! A search in progress: the only place that counts evaluations and work, keeps the incumbent's
//! cost and the history, and decides when to stop.

mod budget;
#[cfg(feature = "std")]
mod deadline;
mod observer;
mod problem;
#[cfg(test)]
mod tests;

pub use budget::{Budget, Quota, StopReason, Tally};
use bvh_build::ploc::Config as Clustering;
use bvh_build::{BuildError, Builder, Watch};
use bvh_config::{Check, OutOfRange};
use bvh_core::{Bvh, InvalidBvh};
#[cfg(feature = "std")]
pub use deadline::Deadline;
pub use observer::{Event, Observer};
pub(crate) use observer::{WORK_PER_POLL, built_unless_cancelled, watched};
pub use problem::{Judge, Problem, Shortcut, Splits};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// A search. Every builder is a search of one evaluation.
pub trait Search: Check {
    /// Searches a good tree, reports every evaluation to `run`, and returns the incumbent. Stops as
    /// soon as [`Run::stopped`] reports a reason, but never before one tree has been evaluated. The
    /// caller has [checked](Check) the parameters.
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError>;
}

impl<B: Builder> Search for B {
    fn search(&self, problem: &Problem, _seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let tree = watched(run.observer(), |watch| {
            self.build_watched(problem.boxes, problem.measure, watch)
        })?;
        run.record(problem.cost(&tree), tree.nodes.len() as u64);
        Ok(tree)
    }
}

/// The state common to all searches.
pub struct Run<'a> {
    budget: Budget,
    observer: &'a dyn Observer,
    evaluations: u64,
    work: u64,
    incumbent: f64,
    /// The proof that no tree costs less than the incumbent, if there is one.
    optimal: Option<Shortcut>,
    /// The cheapest of the trees that the caller handed over, and that the search built and did not
    /// improve, with its cost. Dropped with the first incumbent that costs no more, because it
    /// cannot become the outcome then.
    aside: Option<Kept>,
    history: Vec<Event>,
}

/// A valid tree, and its cost by the problem's objective.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// The tree.
    pub tree: Bvh,
    /// The [cost](Problem::cost) of the tree.
    pub cost: f64,
}

impl Kept {
    /// Evaluates a valid tree. O(nodes).
    pub fn new(tree: Bvh, problem: &Problem) -> Self {
        let cost = problem.cost(&tree);
        Self { tree, cost }
    }
}

impl<'a> Run<'a> {
    /// Counts one evaluation that took `work` nodes and found `cost`. Returns whether it is the new
    /// incumbent, strictly cheaper than all before, so the first of equal trees is kept.
    pub fn record(&mut self, cost: f64, work: u64) -> bool {
        self.record_generation(1, cost, work)
    }

    /// Counts several evaluations as one event. They took `work` nodes together, and the best found
    /// `cost`. Returns whether it is the new incumbent.
    pub fn record_generation(&mut self, evaluations: u64, cost: f64, work: u64) -> bool {
        self.count(Tally { moves: evaluations, work, kept: 0 });
        let improved = cost < self.incumbent;
        if improved {
            self.lower_incumbent(cost);
        }
        self.report(cost);
        improved
    }

    fn lower_incumbent(&mut self, cost: f64) {
        self.incumbent = cost;
        self.drop_aside(cost);
    }

    /// Drops the tree kept aside, if it costs at least as much as a tree that the search has or is
    /// about to [improve](Self::improve) to.
    pub(crate) fn drop_aside(&mut self, cost: f64) {
        self.aside.take_if(|aside| aside.cost >= cost);
    }

    /// Counts moves without events. Searches that make millions of moves report improvements by
    /// [`improve`](Self::improve).
    pub fn count(&mut self, tally: Tally) {
        self.evaluations = self.evaluations.saturating_add(tally.moves);
        self.work = self.work.saturating_add(tally.work);
        self.observer.counted(self.evaluations, self.work);
    }

    /// Records an event if already counted moves led to a new incumbent of this cost. Returns
    /// whether they did.
    pub fn improve(&mut self, cost: f64) -> bool {
        let improved = cost < self.incumbent;
        if improved {
            self.lower_incumbent(cost);
            self.report(cost);
        }
        improved
    }

    fn report(&mut self, cost: f64) {
        let Self { evaluations, work, incumbent, .. } = *self;
        let event = Event { evaluations, work, cost, incumbent };
        self.history.push(event);
        self.observer.event(&event);
    }

    /// Keeps a tree that the search has built and does not improve. It becomes the outcome if it
    /// ends as the cheapest.
    pub fn keep_aside(&mut self, kept: Kept) {
        if self.aside.as_ref().is_none_or(|aside| kept.cost < aside.cost) {
            self.aside = Some(kept);
        }
    }

    pub(crate) fn take_aside_below(&mut self, cost: f64) -> Option<Kept> {
        self.aside.take_if(|aside| aside.cost < cost)
    }

    /// Returns the cheaper of the tree that the search `found` and the tree kept aside. Builds a
    /// tree with the fastest builder if a cancellation left none.
    fn cheapest(&mut self, found: Found, problem: &Problem) -> Found {
        let tree = match found {
            // A cancelled first construction leaves no tree; any other error is the caller's.
            Err(SearchError::Build(BuildError::Cancelled)) => None,
            found => Some(found?),
        };
        let aside = self.aside.take();
        // Strictly cheaper, so that equal trees do not depend on the order of the offers.
        if let Some(aside) = aside.filter(|aside| tree.is_none() || aside.cost < self.incumbent) {
            self.improve(aside.cost);
            return Ok(aside.tree);
        }
        if let Some(tree) = tree {
            return Ok(tree);
        }
        let tree = FASTEST.build_watched(problem.boxes, problem.measure, &Watch::default())?;
        self.record(problem.cost(&tree), tree.nodes.len() as u64);
        Ok(tree)
    }

    /// The lowest cost so far.
    pub fn incumbent(&self) -> f64 {
        self.incumbent
    }

    /// Ends the search, because this shortcut proved the incumbent optimal.
    pub fn proved_optimal(&mut self, by: Shortcut) {
        self.optimal = Some(by);
    }

    /// Returns the remaining budget: endless without a limit, nothing if the incumbent is optimal.
    pub fn left(&self) -> Quota {
        if self.optimal.is_some() {
            return Quota { work: 0, moves: 0 };
        }
        Quota {
            work: remaining(self.budget.max_work, self.work),
            moves: remaining(self.budget.max_evaluations, self.evaluations),
        }
    }

    /// The observer, which any thread may poll.
    pub fn observer(&self) -> &'a dyn Observer {
        self.observer
    }

    /// Returns the reason why the search must return now; `None` if it may continue.
    pub fn stopped(&self) -> Option<StopReason> {
        let Budget { max_evaluations, max_work } = self.budget;
        // No reason counts before the first tree: a search always returns one.
        if self.evaluations == 0 {
            None
        } else if self.observer.cancelled() {
            Some(StopReason::Cancelled)
        } else if self.optimal.is_some() {
            Some(StopReason::Optimal)
        } else if remaining(max_evaluations, self.evaluations) == 0 {
            Some(StopReason::Evaluations)
        } else if remaining(max_work, self.work) == 0 {
            Some(StopReason::Work)
        } else {
            None
        }
    }

    /// Returns the number of evaluations of `work` nodes each that remain in the budget, at least
    /// one before the first.
    pub fn evaluations_left(&self, work: u64) -> u64 {
        let left = self.left();
        left.moves.min(left.work.div_ceil(work.max(1))).max(u64::from(self.evaluations == 0))
    }
}

fn remaining(limit: Option<u64>, count: u64) -> u64 {
    limit.map_or(u64::MAX, |limit| limit.saturating_sub(count))
}

/// The builder for searches that were cancelled during their first construction.
const FASTEST: Clustering = Clustering { radius: 1, near_rounds: 0 };

/// The outcome of a search.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The incumbent.
    pub tree: Bvh,
    /// The incumbent's cost by the problem's objective.
    pub cost: f64,
    /// Trees or moves evaluated.
    pub evaluations: u64,
    /// Nodes created or visited.
    pub work: u64,
    /// Why the search returned.
    pub stop: StopReason,
    /// The shortcut that proved the tree optimal, if any. [`Shortcut::Tiny`] means that the exact
    /// solver replaced the search.
    pub proof: Option<Shortcut>,
    /// Every event, in order.
    pub history: Vec<Event>,
}

/// Runs one search within `budget`, after a [check](Check) of its parameters. All randomness comes
/// from `seed`. The outcome never costs more than any tree built during the search.
///
/// A cancelled search returns soon, even during a construction.
///
/// ```
/// use bvh_search::{grasp, prelude::*};
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// // The best of ten randomised divisions.
/// let search = grasp::Config { trials: 10, ..Default::default() };
/// let outcome = solve(&search, &Problem::new(&boxes), 7, Budget::UNLIMITED, &())?;
/// validate(&outcome.tree, &boxes)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn solve(
    search: &dyn Search,
    problem: &Problem,
    seed: u64,
    budget: Budget,
    observer: &dyn Observer,
) -> Result<Outcome, SearchError> {
    solve_or_keep(search, problem, None, seed, budget, observer)
}

/// Searches as [`solve`] does. The caller hands over a tree: the outcome never costs more, and the
/// memory of the tree is free as soon as the search has a tree that costs no more.
pub fn solve_or_keep(
    search: &dyn Search,
    problem: &Problem,
    kept: Option<Kept>,
    seed: u64,
    budget: Budget,
    observer: &dyn Observer,
) -> Result<Outcome, SearchError> {
    let incumbent = f64::INFINITY;
    let mut run = Run {
        budget,
        observer,
        evaluations: 0,
        work: 0,
        incumbent,
        optimal: None,
        aside: kept,
        history: Vec::new(),
    };
    search.check()?;
    // The first tree of a large scene takes seconds, which a search that is cancelled before it
    // begins does not need.
    let found = if run.aside.is_some() && observer.cancelled() {
        Err(BuildError::Cancelled.into())
    } else {
        search.search(problem, seed, &mut run)
    };
    let tree = run.cheapest(found, problem)?;
    // Before the first tree no reason counts, but the caller's tree needs none.
    let otherwise =
        if observer.cancelled() { StopReason::Cancelled } else { StopReason::Completed };
    let stop = run.stopped().unwrap_or(otherwise);
    let Run { evaluations, work, incumbent: cost, optimal: proof, history, .. } = run;
    Ok(Outcome { tree, cost, evaluations, work, stop, proof, history })
}

pub(crate) type Found = Result<Bvh, SearchError>;

/// The reason why a search did not start. A started search always returns a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// The builder rejects the scene.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The tree to optimise is not a valid tree over these boxes.
    #[error(transparent)]
    Invalid(#[from] InvalidBvh),
    /// Local search requires binary trees.
    #[error("inner node {node} has {children} children; local search accepts binary trees only")]
    NotBinary {
        /// Index of the node.
        node: usize,
        /// Its number of children.
        children: u32,
    },
    /// A parameter of the search is out of its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
}

/// ChaCha with 8 rounds: the same numbers on every machine and in every version.
pub type Stream = ChaCha8Rng;

/// Returns the stream `index` of the generator seeded by `seed`. Streams of one seed do not
/// overlap, so independent trials can draw in any order, or in parallel.
pub(crate) fn stream(seed: u64, index: u64) -> Stream {
    let mut rng = Stream::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}
