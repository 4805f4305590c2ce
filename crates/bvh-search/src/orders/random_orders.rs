//! Random picking of insertion orders: the baseline of the genetic algorithm.
//!
//! Ng & Trifonov 2003, section 4: 'random picking of permutations (which was also tried)'.
//!
//! Differs from the paper: nothing known.

use super::{Evaluated, Insertion, random_order};
use crate::run::{Problem, Run, Search, SearchError, stream};
use bvh_build::goldsmith_salmon;
use bvh_config::Nested;
use bvh_core::Bvh;

bvh_config::config! {
    /// The number of orders to try, and the insertion.
    pub struct Config {
        /// Number of independent random orders.
        trials: u64 = 100, in 1..;
        /// The parameters of the insertion.
        insertion: goldsmith_salmon::Config, in Nested;
    }
}

/// Number of orders between two checks of the budget.
const BATCH: u64 = 64;

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let insertion = Insertion::new(problem, &self.insertion)?;
        let mut next = 0;
        let mut best = Bvh::default();
        while next < self.trials && run.stopped().is_none() {
            let end = self
                .trials
                .min(next.saturating_add(run.evaluations_left(insertion.work()).min(BATCH)));
            let orders: Vec<Vec<u32>> = (next..end)
                .map(|trial| random_order(insertion.len(), &mut stream(seed, trial)))
                .collect();
            let orders: Vec<&[u32]> = orders.iter().map(Vec::as_slice).collect();
            let Evaluated { costs, cheapest } = insertion.evaluate(&orders, run)?;
            let mut improved = false;
            for cost in costs.into_iter().flatten() {
                improved |= run.record(cost, insertion.work());
            }
            if let Some((_, tree)) = cheapest.filter(|_| improved) {
                best = tree;
            }
            next = end;
        }
        Ok(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, solve};
    use bvh_core::cost::Objective;

    #[test]
    fn every_trial_has_the_stream_of_its_number_and_the_cheapest_tree_is_returned() {
        let boxes = crate::scatter::scatter(60);
        for objective in [Objective::GoldsmithSalmon, Objective::InternalArea] {
            let problem = Problem { objective, ..Problem::new(&boxes) };
            // More than one batch.
            let config = Config { trials: 150, ..Config::default() };
            let outcome = solve(&config, &problem, 4, Budget::UNLIMITED, &()).unwrap();
            let insertion = Insertion::new(&problem, &config.insertion).unwrap();
            let costs: Vec<f64> = (0..150)
                .map(|trial| {
                    let order = random_order(60, &mut stream(4, trial));
                    problem.cost(&insertion.tree(&order, &()).unwrap())
                })
                .collect();
            let close = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-12;
            let found = outcome.history.iter().map(|event| event.cost);
            assert!(outcome.history.len() == 150 && found.zip(&costs).all(|(a, b)| close(a, *b)));
            let least = costs.into_iter().fold(f64::INFINITY, f64::min);
            assert!(close(outcome.cost, least) && close(problem.cost(&outcome.tree), least));
            assert_eq!(outcome.work, 150 * 120);
        }
    }
}
