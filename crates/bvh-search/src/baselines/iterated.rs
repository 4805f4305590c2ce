//! Iterated local search: perturbs the incumbent by a few random moves, repeats the local search,
//! and keeps the better tree.
//!
//! Lourenço, Martin & Stützle 2003, acceptance 'better'. It is the simplest way beyond the first
//! local optimum, and the baseline for [`rebuild`](crate::rebuild) and
//! [`ruin_recreate`](crate::ruin_recreate), which perturb one small part of the tree at a time.

use super::LocalSearch;
use crate::annealing::{Mover as _, SingleMove, SingleMover, Target};
use crate::local::incumbent::Incumbent;
use crate::local::initial::Start;
use crate::run::{Found, Problem, Run, Tally, stream};
use crate::tree::{Metric, search_by_metric};
use bvh_config::Nested;
use std::ops::Bound::{Excluded, Included};

bvh_config::config! {
    /// The strength of perturbations, the local search, and the amount of work.
    pub struct Config {
        /// Random moves of a perturbation per object; at least one is made.
        strength: f64 = 0.01, in (Excluded(0.0), Included(1.0));
        /// Maximum number of levels up and down of a random move.
        climb: u32 = 4, in 1..=u32::MAX - 1;
        /// The local search after every perturbation.
        local_search: LocalSearch = LocalSearch::Reinsertion;
        /// Work per object, unless the budget has less.
        work_per_object: u64 = 10_000;
        /// The builder of the initial tree, which is first improved to a local optimum.
        start: Start, in Nested;
    }
}

search_by_metric!(Config);

impl Config {
    fn search_by<A: Metric>(
        &self,
        metric: A,
        problem: &Problem,
        seed: u64,
        run: &mut Run,
    ) -> Found {
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, metric, run)?;
        let n = problem.boxes.len() as u64;
        let quota = run.left().at_most(self.work_per_object.saturating_mul(n));
        let mut total = self.local_search.improve(&mut tree, quota, run.observer());
        run.count(total);
        best.offer(&tree, run);
        let kick = SingleMove { climb: self.climb, target: Target::Random };
        let kicks = ((self.strength * n as f64) as u64).max(1);
        let mut number = 0;
        while n > 2 && run.stopped().is_none() && !quota.is_reached(&total) {
            let mut other = tree.clone();
            let mut rng = stream(seed, number);
            let mut mover = SingleMover::new(&kick);
            number += 1;
            let mut tally = Tally::default();
            let observer = run.observer();
            if !mover.begin(&other, Vec::new(), &|| observer.cancelled()) {
                break;
            }
            while tally.moves < kicks && (tally.moves % 1024 > 0 || !observer.cancelled()) {
                // The highest temperature accepts every move, so the move becomes a perturbation.
                tally.kept += u64::from(mover.step(&mut other, f64::MAX, &mut rng));
                tally.moves += 1;
            }
            // The copy of the tree counts as work, too.
            tally.work = mover.work() + 2 * n;
            let left = quota.less(&total).less(&tally);
            tally += self.local_search.improve(&mut other, left, run.observer());
            total += tally;
            run.count(tally);
            if other.area() <= tree.area() {
                tree = other;
                best.offer(&tree, run);
            }
        }
        Ok(best.tree)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local::reinsertion;
    use crate::run::{Budget, solve};

    #[test]
    fn perturbations_lead_below_the_first_local_optimum_and_never_above() {
        let boxes = crate::scatter::scatter(600);
        let problem = Problem::new(&boxes);
        let first =
            solve(&reinsertion::Config::default(), &problem, 1, Budget::UNLIMITED, &()).unwrap();
        let config = Config { work_per_object: 3000, ..Config::default() };
        let found = solve(&config, &problem, 1, Budget::UNLIMITED, &()).unwrap();
        assert!(found.cost < first.cost, "{} {}", found.cost, first.cost);
        assert!(found.history.windows(2).all(|pair| pair[1].incumbent <= pair[0].incumbent));
    }
}
