//! The parameters of `best`, and whether the search knows its end.

use crate::run::Run;
use crate::tuning::MOST_SUBTREES;

bvh_config::config! {
    /// The length of the search, and its division.
    ///
    /// ```
    /// use bvh_search::prelude::*;
    /// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
    /// let budget = Budget { max_work: Some(100_000), ..Budget::UNLIMITED };
    /// let found = solve(&best::Config::default(), &Problem::new(&boxes), 7, budget, &())?;
    /// let again = solve(&best::Config::default(), &Problem::new(&boxes), 7, budget, &())?;
    /// assert_eq!(found.tree, again.tree, "the same seed and work");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub struct Config {
        /// Work per object of the whole search, unless the budget has less or the
        /// [`horizon`](Self::horizon) is known.
        work_per_object: u64 = 1_000_000;
        /// Number of disjoint subtrees that are annealed at once, which limits the number of useful
        /// threads. 1 is the whole tree. 0 means four subtrees per thread for a time limit with
        /// several threads, one per 32 768 objects for a budget of work if they are at least eight,
        /// and otherwise 1.
        pieces: u32 = 0, in 0..=MOST_SUBTREES;
        /// The plan for the end of the budget. By default the end is [`Known`](Horizon::Known) if
        /// the observer reports its progress, or if the budget has no more work than
        /// `work_per_object`.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        horizon: Option<Horizon>;
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, Observer, Problem, solve};
    use crate::scatter::{At, Does};
    use bvh_core::Bvh;

    #[test]
    fn the_end_is_known_by_a_clock_or_by_work_that_the_search_would_spend_anyway() {
        use Horizon::{Known, Open};
        let (clock, none): (&dyn Observer, &dyn Observer) = (&At(0.5), &());
        for (horizon, max_work, observer, expected) in [
            (None, None, none, (Open, 10_000)),
            (None, Some(10_000), none, (Known, 10_000)),
            (None, Some(10_001), none, (Open, 10_000)),
            (None, None, clock, (Known, 10_000)),
            (Some(Known), None, none, (Known, 10_000)),
            (Some(Known), Some(50_000), none, (Known, 50_000)),
            (Some(Known), None, clock, (Known, u64::MAX)),
            (Some(Open), Some(5), none, (Open, 5)),
        ] {
            let config = Config { work_per_object: 1000, horizon, ..Config::default() };
            let search = Does(|run: &mut Run| {
                assert_eq!(config.horizon(10, run), expected, "{horizon:?} {max_work:?}");
                Bvh::default()
            });
            let budget = Budget { max_work, ..Budget::UNLIMITED };
            solve(&search, &Problem::new(&[]), 1, budget, observer).unwrap();
        }
    }
}
