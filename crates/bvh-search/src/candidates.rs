//! The restricted candidate list of GRASP: the splits of a node that a random draw may choose.
//!
//! Ng & Trifonov 2003, section 3.4.

use crate::run::Stream;
use bvh_build::top_down::{Split, SplitCost, SplitRule, Sweep};
use bvh_config::{Accepts, Check, OutOfRange};
use rand::RngExt;

bvh_config::config! {
    /// The restricted candidate list of a node.
    #[derive(Copy)]
    pub enum Candidates {
        /// The best split of each of the three axes.
        AxisBest,
        /// The k best splits of all axes, k ≥ 1.
        KBest(u32),
        /// The best split and all splits that cost less than (1 + α) times as much, α ≥ 0.
        Within(f64),
    }
}

impl Check for Candidates {
    fn faults(&self) -> Vec<OutOfRange> {
        match self {
            Self::AxisBest => vec![],
            Self::KBest(k) => (1..).faults("k_best", k),
            Self::Within(alpha) => (0.0..).faults("within", alpha),
        }
    }
}

/// Draws a split from a node's restricted candidate list.
pub(crate) struct Randomised {
    candidates: Candidates,
    noise: Option<f64>,
    rng: Stream,
    list: Vec<Split>,
}

impl Randomised {
    pub fn new(candidates: Candidates, noise: Option<f64>, rng: Stream) -> Self {
        Self { candidates, noise, rng, list: Vec::new() }
    }
}

impl SplitRule for Randomised {
    /// Draws before scanning the node, so the scan finds only the candidates that the draw can
    /// choose.
    #[inline(always)]
    fn choose<C: SplitCost>(&mut self, node: &mut Sweep<'_, C>) -> Split {
        let Self { candidates, noise, rng, list } = self;
        if noise.is_some_and(|noise| !rng.random_bool(noise)) {
            return node.best();
        }
        match *candidates {
            Candidates::AxisBest if noise.is_none() => {
                return node.axis_best(rng.random_range(0..3u8));
            }
            Candidates::AxisBest => node.axis_bests(list),
            Candidates::KBest(k) => node.k_best(k as usize, list),
            Candidates::Within(alpha) => node.within(alpha, list),
        }
        // With noise, this draw is for candidates other than the best, unless the list has no
        // other.
        let first = u32::from(noise.is_some() && list.len() > 1);
        list[rng.random_range(first..list.len() as u32) as usize]
    }
}
