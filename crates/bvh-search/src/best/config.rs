//! The parameters of `best`, and whether the search knows its end.

use crate::annealing::ruin_recreate::{Ruin, Scale};
use crate::run::Run;
use crate::tuning::MOST_SUBTREES;
use bvh_config::{Nested, above};
use std::ops::Bound::{Excluded, Included};

bvh_config::config! {
    /// The lengths and temperatures of the annealing runs.
    pub struct Config {
        /// Work per object of the first generation if the end is not known.
        first: f64 = 1500.0, in 1.0..;
        /// Length of every generation relative to the previous one, if the end is not known.
        growth: f64 = 2.0, in 1.0..;
        /// Maximum work per object of an annealing run if the end is known, also limited to 200
        /// times the number of objects. More work is divided into equal runs.
        longest: f64 = 100_000.0, in 1.0..;
        /// Work per object of the whole search, unless the budget has less or the
        /// [`horizon`](Self::horizon) is known.
        work_per_object: u64 = 1_000_000;
        /// First temperature per 1000 nodes of an annealing run's work per object.
        heat: f64 = 0.02, in above(0.0);
        /// Highest temperature.
        hottest: f64 = 0.2, in above(0.0);
        /// Last temperature.
        cold: f64 = 0.003, in above(0.0);
        /// First temperature of the short annealing runs after a long one.
        reheat: f64 = 0.07, in above(0.0);
        /// Number of short annealing runs after a long one.
        reheats: u32 = 6, in 0..=1000;
        /// Fraction of the work or time reserved for the short annealing runs.
        reheated: f64 = 0.3, in (Excluded(0.0), Excluded(1.0));
        /// Minimum work per object of a long annealing run, which short runs follow.
        reheats_from: f64 = 7000.0, in (Excluded(0.0), Included(f64::INFINITY));
        /// Number of disjoint subtrees that are annealed at once, which limits the number of useful
        /// threads. 1 is the whole tree. 0 means four subtrees per thread for a time limit with
        /// several threads, one per 32 768 objects for a budget of work if they are at least eight,
        /// and otherwise 1.
        pieces: u32 = 0, in 0..=MOST_SUBTREES;
        /// Minimum work per object of an annealing run whose temperatures are relative to the
        /// [top](Scale::Top) of a move, overriding the move's `scale`. Long runs end lower with it,
        /// short runs higher.
        top_from: f64 = 20_000.0, in (Excluded(0.0), Included(f64::INFINITY));
        /// The plan for the end of the budget. By default the end is [`Known`](Horizon::Known) if
        /// the observer reports its progress, or if the budget has no more work than
        /// `work_per_object`.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        horizon: Option<Horizon>;
        /// The move.
        ruin: Ruin, in Nested;
    }
}

bvh_config::config! {
    /// The search's knowledge of its end.
    #[derive(Copy, Eq)]
    pub enum Horizon {
        /// The search ends with the budget's work or the observer's time, or after
        /// `work_per_object` if there is neither. It plans one long annealing run until then.
        Known,
        /// The search may be stopped at any moment, and otherwise ends after `work_per_object`.
        /// Generations of growing length keep a good tree available.
        Open,
    }
}

impl Config {
    /// Returns the horizon, and the work until the end, for `n` objects.
    pub(super) fn horizon(&self, n: u64, run: &Run) -> (Horizon, u64) {
        let configured = self.work_per_object.saturating_mul(n);
        let left = run.left().work;
        let timed = run.observer().progress().is_some();
        match self.horizon {
            Some(Horizon::Known) if timed || left < u64::MAX => (Horizon::Known, left),
            Some(horizon) => (horizon, configured.min(left)),
            None if timed || left <= configured => (Horizon::Known, configured.min(left)),
            None => (Horizon::Open, configured.min(left)),
        }
    }

    /// Returns the first temperature of an annealing run of `length` work per object, unless the
    /// last temperature is higher.
    pub(super) fn hot(&self, length: f64) -> f64 {
        (self.heat * length / 1000.0).min(self.hottest)
    }

    /// Returns the move of an annealing run of `length` work per object.
    pub(super) fn ruin(&self, length: f64) -> Ruin {
        let scale = if length < self.top_from { self.ruin.scale } else { Scale::Top };
        Ruin { scale, ..self.ruin.clone() }
    }
}
