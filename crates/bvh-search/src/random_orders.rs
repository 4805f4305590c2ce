//! Random picking of insertion orders: the baseline of the genetic algorithm.
//!
//! Ng & Trifonov 2003, section 4: 'random picking of permutations (which was also tried)'.
//!
//! Differs from the paper: nothing known.

use crate::error::require;
use crate::insertion_orders::{Insertion, random_order};
use crate::stream::stream;
use crate::{Problem, Run, Search, SearchError};
use bvh_build::goldsmith_salmon;
use bvh_core::Bvh;

/// How many orders to try.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Number of independent random orders, at least 1. Default 100.
    pub trials: u64,
    /// How the objects are inserted.
    pub insertion: goldsmith_salmon::Config,
}

impl Default for Config {
    fn default() -> Self {
        Self { trials: 100, insertion: Default::default() }
    }
}

/// Orders between two looks at the budget.
const BATCH: u64 = 64;

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        require(self.trials >= 1, "trials", self.trials as f64, "1 or more")?;
        let insertion = Insertion::new(problem, &self.insertion)?;
        let order = |trial| random_order(insertion.len(), &mut stream(seed, trial));
        let (mut next, mut best) = (0, 0);
        while next < self.trials && run.stopped().is_none() {
            let end = self.trials.min(next.saturating_add(run.evaluations_left(insertion.work()).min(BATCH)));
            let orders: Vec<Vec<u32>> = (next..end).map(order).collect();
            let orders: Vec<&[u32]> = orders.iter().map(Vec::as_slice).collect();
            for (trial, cost) in (next..end).zip(insertion.costs(&orders)) {
                if run.record(cost, insertion.work()) {
                    best = trial;
                }
            }
            next = end;
        }
        Ok(insertion.tree(&order(best)))
    }
}
