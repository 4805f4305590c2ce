//! `best`: the methods that pay, in the order that pays, for any budget.
//!
//! 1. Greedy division with |L|^0.9, then reinsertion to a local optimum: most of the gain in the least time.
//! 2. Generations, each longer than the one before: several independent chains of annealed ruin and recreate start at
//!    the incumbent, and all that they end with is fused with it. Fusing keeps every part that became better and drops
//!    every part that became worse, so that nothing is ever lost to the heat.

use crate::cooling::{Cooling, anneal};
use crate::error::require;
use crate::fusing::fuse;
use crate::incumbent::Incumbent;
use crate::ruin_recreate::{Mover, Ruin, Scale};
use crate::start::Start;
use crate::stream::stream;
use crate::working::Working;
use crate::{Observer, Problem, Quota, Run, Search, SearchError, Tally, exact, reinsertion};
use bvh_core::Bvh;

/// How long the generations are and how hot.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Work per object of the first generation, at least 1. Default 1500. When the budget limits the work, all
    /// generations are stretched so that they fill it.
    pub first: f64,
    /// How many times longer every generation is than the one before, at least 1, when the budget does not limit the
    /// work, so that the search may be cancelled at any time. Default 2.
    pub growth: f64,
    /// The same when it does: few long generations are better if the end is known. Default 4.
    pub growth_to_end: f64,
    /// Work per object of all generations together, unless the budget has less. Default 1 000 000.
    pub work_per_object: u64,
    /// Independent chains per generation, which is also how many threads can help, 1 to 64. Default 2.
    pub chains: u32,
    /// First temperature of a chain per 1000 nodes of its work per object, above 0. Default 0.013.
    pub heat: f64,
    /// Highest temperature, above 0. Default 0.1.
    pub hottest: f64,
    /// Last temperature, above 0. Default 0.003.
    pub cold: f64,
    /// The move; its `scale` is the chain's, in turns `saved` and `top`.
    pub ruin: Ruin,
    /// The builder of the start.
    pub start: Start,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            first: 1500.0,
            growth: 2.0,
            growth_to_end: 4.0,
            work_per_object: 1_000_000,
            chains: 2,
            heat: 0.013,
            hottest: 0.1,
            cold: 0.003,
            ruin: Ruin::default(),
            start: Start::default(),
        }
    }
}

impl Config {
    pub(crate) fn check(&self) -> Result<(), SearchError> {
        require(self.first >= 1.0 && self.first.is_finite(), "first", self.first, "1 or more")?;
        for (name, found) in [("growth", self.growth), ("growth_to_end", self.growth_to_end)] {
            require(found >= 1.0 && found.is_finite(), name, found, "1 or more")?;
        }
        require((1..=64).contains(&self.chains), "chains", self.chains.into(), "1 to 64")?;
        for (name, found) in [("heat", self.heat), ("hottest", self.hottest), ("cold", self.cold)] {
            require(found > 0.0 && found.is_finite(), name, found, "above 0")?;
        }
        self.ruin.check()
    }

    /// Improves the incumbent until the work is done.
    pub(crate) fn improve(&self, tree: &mut Working, seed: u64, best: &mut Incumbent, run: &mut Run) {
        let n = tree.objects() as u64;
        if n < 3 {
            return;
        }
        best.descend(tree, u32::MAX, run, |tree, _, quota, observer| {
            reinsertion::sweep_by_area(tree, quota, observer)
        });
        let own = self.work_per_object.saturating_mul(n);
        let budget = run.left().work;
        let mut left = own.min(budget);
        let lengths = self.lengths(left as f64 / n as f64, budget <= own);
        let last = lengths.len() - 1;
        for (generation, length) in lengths.into_iter().enumerate() {
            if run.stopped().is_some() {
                break;
            }
            let work =
                if generation == last && budget <= own { left } else { left.min((length * n as f64) as u64) };
            let quota = Quota { work, moves: run.left().moves };
            let tally = self.generation(tree, generation as u64, quota, seed, run.observer());
            left = left.saturating_sub(tally.work);
            run.count(tally);
            best.offer(tree, run);
        }
    }

    /// The generations' lengths, per object, of `work` together, which they fill if it is limited.
    fn lengths(&self, work: f64, limited: bool) -> Vec<f64> {
        let growth = if limited { self.growth_to_end } else { self.growth };
        let mut lengths = vec![];
        let (mut next, mut sum) = (self.first, 0.0);
        while sum + next <= work && lengths.len() < MOST_GENERATIONS {
            lengths.push(next);
            sum += next;
            next *= growth;
        }
        if lengths.is_empty() {
            (lengths, sum) = (vec![work], work);
        }
        if limited && sum > 0.0 {
            lengths.iter_mut().for_each(|length| *length *= work / sum);
        }
        lengths
    }

    /// Anneals in chains and fuses.
    fn generation(
        &self,
        tree: &mut Working,
        generation: u64,
        Quota { work, moves }: Quota,
        seed: u64,
        observer: &dyn Observer,
    ) -> Tally {
        let chains = u64::from(self.chains);
        let share = work / chains;
        let hot = self.heat * (share as f64 / tree.objects() as f64 / 1000.0);
        let hot = hot.min(self.hottest).max(self.cold);
        let quota = Quota { work: share, moves: moves.div_ceil(chains) };
        let cooling = Cooling { hot, cold: self.cold, quota };
        let chain = |number: u64| {
            let mut rng = stream(seed, generation * chains + number);
            let (mut tree, mut done) = (tree.clone(), Tally::default());
            // Which scale of temperatures is the better one depends on the scene: every other chain takes the other.
            let scale = if number.is_multiple_of(2) { Scale::Saved } else { Scale::Top };
            let ruin = Ruin { scale, ..self.ruin.clone() };
            let mover = &mut Mover::new(&ruin);
            anneal(mover, &cooling, &mut tree, &mut rng, observer, &mut |_, tally| done += tally);
            (tree, done)
        };
        #[cfg(feature = "rayon")]
        let found: Vec<(Working, Tally)> = {
            use rayon::prelude::*;
            (0..chains).into_par_iter().map(chain).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let found: Vec<(Working, Tally)> = (0..chains).map(chain).collect();
        let mut tally = Tally::default();
        found.iter().for_each(|(_, done)| tally += *done);
        let mut trees = vec![&*tree];
        trees.extend(found.iter().map(|(tree, _)| tree));
        *tree = fuse(&trees);
        tally
    }
}

/// Ends the schedule when generations do not grow.
const MOST_GENERATIONS: usize = 10_000;

impl Search for Config {
    /// Chains run in parallel, each with a stream of its own.
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        self.check()?;
        let own = self.work_per_object.saturating_mul(problem.boxes.len() as u64);
        if let Some(optimum) = exact::instead(problem, own, run)? {
            return Ok(optimum);
        }
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, run)?;
        self.improve(&mut tree, seed, &mut best, run);
        Ok(best.tree)
    }
}
