//! Limits of a search, the work done, and the reason to stop.

use std::ops::AddAssign;

/// Limits in machine-independent units; `None` is no limit. A limit in seconds is a
/// [`Deadline`](crate::Deadline), or any other [`Observer`](crate::Observer) that cancels. There is
/// no default: without any limit, [`best`](crate::best) takes hours.
///
/// ```
/// use bvh_search::prelude::*;
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// // The same tree on every machine.
/// let budget = Budget { max_work: Some(100_000), ..Budget::UNLIMITED };
/// let outcome = solve(&best::Config::default(), &Problem::new(&boxes), 7, budget, &())?;
/// assert!(outcome.work <= 100_000);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct Budget {
    /// Maximum number of trees or moves to evaluate.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub max_evaluations: Option<u64>,
    /// Maximum work, in nodes created or visited.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub max_work: Option<u64>,
}

impl Budget {
    /// No limit: for searches that end by themselves, and for observers that cancel.
    pub const UNLIMITED: Self = Self { max_evaluations: None, max_work: None };
}

bvh_config::config! {
    /// Why a search returned.
    #[derive(Copy, Eq)]
    pub enum StopReason {
        /// The search completed everything that its configuration requests.
        Completed,
        /// No tree costs less than the incumbent.
        Optimal,
        /// [`Budget::max_evaluations`] was reached.
        Evaluations,
        /// [`Budget::max_work`] was reached.
        Work,
        /// The observer cancelled the search.
        Cancelled,
    }
}

/// Counts of moves and work, for [`Run::count`](crate::Run::count).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Moves evaluated.
    pub moves: u64,
    /// Number of those moves that were kept.
    pub kept: u64,
    /// Nodes created or visited.
    pub work: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.moves += other.moves;
        self.kept += other.kept;
        self.work += other.work;
    }
}

/// The moves and the work that remain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quota {
    /// Moves to evaluate.
    pub moves: u64,
    /// Nodes to create or visit.
    pub work: u64,
}

impl Quota {
    /// No limit.
    pub const ENDLESS: Self = Self { moves: u64::MAX, work: u64::MAX };

    /// Returns whether `done` has used up either limit.
    #[inline(always)]
    pub fn is_reached(&self, done: &Tally) -> bool {
        done.moves >= self.moves || done.work >= self.work
    }

    /// Returns the same quota, limited to this work.
    #[must_use]
    pub fn at_most(self, work: u64) -> Self {
        Self { work: self.work.min(work), ..self }
    }

    /// Returns the remaining quota after `done`.
    #[must_use]
    pub fn less(&self, done: &Tally) -> Self {
        Self {
            moves: self.moves.saturating_sub(done.moves),
            work: self.work.saturating_sub(done.work),
        }
    }
}
