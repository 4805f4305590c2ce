//! Iterated local search: kick the incumbent with a few random moves, descend again, keep the better one.
//!
//! Lourenço, Martin & Stützle 2003, acceptance 'better'. The plainest use of a descent beyond its first local optimum,
//! and what [`rebuild`](crate::rebuild) and [`ruin_recreate`](crate::ruin_recreate) are to be measured against: they
//! kick and descend in one small part of the tree at a time.

use crate::annealing::{Move, Mover, Target};
use crate::cooling::Move as _;
use crate::error::require;
use crate::incumbent::Incumbent;
use crate::start::Start;
use crate::stream::stream;
use crate::{LocalSearch, Problem, Run, Search, SearchError, Tally};
use bvh_core::Bvh;

/// How hard to kick, how to descend, and for how long.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Random moves of a kick per object, above 0 to 1; at least one move. Default 0.01.
    pub strength: f64,
    /// Most levels up and down of a random move, at least 1. Default 4.
    pub climb: u32,
    /// What follows every kick. Default `reinsertion`.
    pub local_search: LocalSearch,
    /// Work per object, unless the budget has less. Default 10 000.
    pub work_per_object: u64,
    /// The builder of the start, which is first led to a local optimum.
    pub start: Start,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            strength: 0.01,
            climb: 4,
            local_search: LocalSearch::Reinsertion,
            work_per_object: 10_000,
            start: Start::default(),
        }
    }
}

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        require(self.strength > 0.0 && self.strength <= 1.0, "strength", self.strength, "above 0, to 1")?;
        require((1..u32::MAX).contains(&self.climb), "climb", self.climb.into(), "1 to 4294967294")?;
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, run)?;
        let n = problem.boxes.len() as u64;
        let quota = run.left().at_most(self.work_per_object.saturating_mul(n));
        let mut total = self.local_search.descend(&mut tree, quota, run.observer());
        run.count(total);
        best.offer(&tree, run);
        let kick = Move { climb: self.climb, target: Target::Random };
        let kicks = ((self.strength * n as f64) as u64).max(1);
        let mut number = 0;
        while n > 2 && run.stopped().is_none() && !quota.is_reached(&total) {
            let (mut other, mut rng, mut mover) = (tree.clone(), stream(seed, number), Mover::new(&kick));
            number += 1;
            // As hot as can be: every move is kept.
            let kept = (0..kicks).filter(|_| mover.step(&mut other, f64::MAX, &mut rng)).count() as u64;
            // The copy is work, too.
            let mut tally = Tally { moves: kicks, kept, work: mover.work() + 2 * n };
            let left = quota.less(&total).less(&tally);
            tally += self.local_search.descend(&mut other, left, run.observer());
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
    use crate::{Budget, reinsertion, solve};

    #[test]
    fn kicks_lead_below_the_first_local_optimum_and_never_above() {
        let boxes = crate::scatter::scatter(600);
        let problem = Problem::new(&boxes);
        let first = solve(&reinsertion::Config::default(), &problem, 1, Budget::default(), &()).unwrap();
        let config = Config { work_per_object: 3000, ..Config::default() };
        let found = solve(&config, &problem, 1, Budget::default(), &()).unwrap();
        assert!(found.cost < first.cost, "{} {}", found.cost, first.cost);
        assert!(found.history.windows(2).all(|pair| pair[1].incumbent <= pair[0].incumbent));
    }
}
