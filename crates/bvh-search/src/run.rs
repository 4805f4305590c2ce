//! One search at work: the only place that counts evaluations and work, keeps the incumbent's cost and the history,
//! and decides when to stop.

use crate::{Budget, Omission, SearchError, StopReason};
use bvh_build::Builder;
use bvh_core::{Aabb, Bvh, cost::Objective};
use std::ops::AddAssign;

/// What is searched for: the tree over `boxes` of least cost.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// One box per object.
    pub boxes: &'a [Aabb],
    /// The cost to minimise.
    pub objective: Objective,
    /// What is done although it changes no cost, to measure what leaving it out saves. Nothing if empty.
    pub keep: &'a [Omission],
}

impl<'a> Problem<'a> {
    /// The paper's problem: least total area of inner nodes.
    pub fn new(boxes: &'a [Aabb]) -> Self {
        Self { boxes, objective: Objective::default(), keep: &[] }
    }

    /// Whether to leave this out where the scene does not need it.
    pub fn leaves_out(&self, omission: Omission) -> bool {
        !self.keep.contains(&omission)
    }
}

/// A search, or a builder seen as a search of one evaluation.
pub trait Search {
    /// Looks for a good tree, reports every evaluation to `run`, and returns the incumbent. Stops as soon as
    /// [`Run::stopped`] says so, but never before one tree has been evaluated.
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError>;
}

impl<B: Builder> Search for B {
    fn search(&self, problem: &Problem, _seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let tree = self.build(problem.boxes)?;
        run.record(problem.objective.cost(&tree), tree.nodes.len() as u64);
        Ok(tree)
    }
}

/// Follows a search from outside, from any thread. `()` watches nothing.
pub trait Observer: Sync {
    /// Called after every event of the history, in order.
    fn event(&self, _event: &Event) {}
    /// Asked often; the search returns its incumbent soon after this is true.
    fn cancelled(&self) -> bool {
        false
    }
    /// The part of the time that has passed, 0 to 1, if the search will be cancelled at a time that is known: the
    /// search then plans to be done when it is 1. Such runs cannot be repeated exactly.
    fn progress(&self) -> Option<f64> {
        None
    }
}

impl Observer for () {}

/// One point of a search's history: a trial, a generation, or an improvement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Trees or moves evaluated so far, this one included.
    pub evaluations: u64,
    /// Nodes made or visited so far.
    pub work: u64,
    /// The cost found now.
    pub cost: f64,
    /// The lowest cost so far.
    pub incumbent: f64,
}

/// What was done to a tree, for [`Run::count`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Moves evaluated.
    pub moves: u64,
    /// Those of them that were kept.
    pub kept: u64,
    /// Nodes made or visited.
    pub work: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.moves += other.moves;
        self.kept += other.kept;
        self.work += other.work;
    }
}

/// How much may still be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quota {
    /// Moves to evaluate.
    pub moves: u64,
    /// Nodes to make or visit.
    pub work: u64,
}

impl Quota {
    /// No limit.
    pub const ENDLESS: Self = Self { moves: u64::MAX, work: u64::MAX };

    /// Whether what was done is at least that.
    #[inline(always)]
    pub fn is_reached(&self, done: &Tally) -> bool {
        done.moves >= self.moves || done.work >= self.work
    }

    /// No more work than that.
    #[must_use]
    pub fn at_most(self, work: u64) -> Self {
        Self { work: self.work.min(work), ..self }
    }

    /// What is left after something was done.
    #[must_use]
    pub fn less(&self, done: &Tally) -> Self {
        Self { moves: self.moves.saturating_sub(done.moves), work: self.work.saturating_sub(done.work) }
    }
}

/// The state that is common to all searches.
pub struct Run<'a> {
    budget: Budget,
    observer: &'a dyn Observer,
    evaluations: u64,
    work: u64,
    incumbent: f64,
    optimal: bool,
    history: Vec<Event>,
}

impl<'a> Run<'a> {
    /// Counts one evaluation that took `work` nodes and found `cost`. Returns whether it is the new incumbent:
    /// strictly cheaper than all before, so that of equal trees the first is kept.
    pub fn record(&mut self, cost: f64, work: u64) -> bool {
        self.record_generation(1, cost, work)
    }

    /// Counts several evaluations that took `work` nodes together and whose best found `cost`, as one event.
    /// Returns whether it is the new incumbent.
    pub fn record_generation(&mut self, evaluations: u64, cost: f64, work: u64) -> bool {
        self.count(Tally { moves: evaluations, work, kept: 0 });
        let improved = cost < self.incumbent;
        if improved {
            self.incumbent = cost;
        }
        self.report(cost);
        improved
    }

    /// Counts moves without an event each: searches that make millions of moves report what comes of them by
    /// [`improve`](Self::improve).
    pub fn count(&mut self, tally: Tally) {
        self.evaluations = self.evaluations.saturating_add(tally.moves);
        self.work = self.work.saturating_add(tally.work);
    }

    /// An event if moves already counted have led to a new incumbent of this cost. Returns whether they have.
    pub fn improve(&mut self, cost: f64) -> bool {
        let improved = cost < self.incumbent;
        if improved {
            self.incumbent = cost;
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

    /// Ends the search: no tree costs less than the incumbent.
    pub fn settle(&mut self) {
        self.optimal = true;
    }

    /// What the budget still has, without end where it has no limit; nothing if the incumbent is optimal.
    pub fn left(&self) -> Quota {
        if self.optimal {
            return Quota { work: 0, moves: 0 };
        }
        let left = |limit: Option<u64>, count| limit.map_or(u64::MAX, |limit| limit.saturating_sub(count));
        Quota {
            work: left(self.budget.max_work, self.work),
            moves: left(self.budget.max_evaluations, self.evaluations),
        }
    }

    /// The one who watches, to be asked from other threads.
    pub fn observer(&self) -> &'a dyn Observer {
        self.observer
    }

    /// Why the search must return now, if it must.
    pub fn stopped(&self) -> Option<StopReason> {
        let reached = |limit: Option<u64>, count| limit.is_some_and(|limit| count >= limit);
        if self.evaluations == 0 {
            None
        } else if self.observer.cancelled() {
            Some(StopReason::Cancelled)
        } else if self.optimal {
            Some(StopReason::Optimal)
        } else if reached(self.budget.max_evaluations, self.evaluations) {
            Some(StopReason::Evaluations)
        } else if reached(self.budget.max_work, self.work) {
            Some(StopReason::Work)
        } else {
            None
        }
    }

    /// How many evaluations of `work` nodes each the budget still has, at least one while not stopped.
    pub fn evaluations_left(&self, work: u64) -> u64 {
        let left = self.left();
        left.moves.min(left.work.div_ceil(work.max(1))).max(u64::from(self.evaluations == 0))
    }
}

/// What a search found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The incumbent.
    pub tree: Bvh,
    /// Its cost by the problem's objective.
    pub cost: f64,
    /// Trees or moves evaluated.
    pub evaluations: u64,
    /// Nodes made or visited.
    pub work: u64,
    /// Why the search returned.
    pub stop: StopReason,
    /// Every event, in order.
    pub history: Vec<Event>,
}

/// Runs one search within `budget`; randomness comes from `seed` alone.
pub fn solve(
    search: &dyn Search,
    problem: &Problem,
    seed: u64,
    budget: Budget,
    observer: &dyn Observer,
) -> Result<Outcome, SearchError> {
    let incumbent = f64::INFINITY;
    let mut run =
        Run { budget, observer, evaluations: 0, work: 0, incumbent, optimal: false, history: Vec::new() };
    let tree = search.search(problem, seed, &mut run)?;
    let stop = run.stopped().unwrap_or(StopReason::Completed);
    let Run { evaluations, work, incumbent: cost, history, .. } = run;
    Ok(Outcome { tree, cost, evaluations, work, stop, history })
}
