//! The restricted candidate list of GRASP: the splits of a node that a random draw may choose.
//!
//! Ng & Trifonov 2003, section 3.4.

use crate::run::Stream;
use bvh_build::top_down::{Shortlist, Split, SplitRule};
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
    fn check(&self) -> Result<(), OutOfRange> {
        match self {
            Self::AxisBest => Ok(()),
            Self::KBest(k) => (1..).check("k_best", k),
            Self::Within(alpha) => (0.0..).check("within", alpha),
        }
    }
}

/// Draws a split from a node's restricted candidate list.
pub(crate) struct Randomised {
    candidates: Candidates,
    noise: Option<f64>,
    rng: Stream,
}

impl Randomised {
    pub fn new(candidates: Candidates, noise: Option<f64>, rng: Stream) -> Self {
        Self { candidates, noise, rng }
    }
}

impl SplitRule for Randomised {
    /// Draws before the node is scanned, so the scan finds only the candidates that the draw can
    /// choose.
    fn shortlist(&mut self) -> Shortlist {
        if self.noise.is_some_and(|noise| !self.rng.random_bool(noise)) {
            return Shortlist::Best;
        }
        match self.candidates {
            Candidates::AxisBest if self.noise.is_none() => {
                Shortlist::AxisBest(self.rng.random_range(0..3u8))
            }
            Candidates::AxisBest => Shortlist::AxisBests,
            Candidates::KBest(k) => Shortlist::KBest(k as usize),
            Candidates::Within(alpha) => Shortlist::Within(alpha),
        }
    }

    /// Draws one of the candidates. With noise, the draw is for candidates other than the best,
    /// unless the list has no other.
    fn choose(&mut self, list: &[Split]) -> usize {
        let first = u32::from(self.noise.is_some() && list.len() > 1);
        self.rng.random_range(first..list.len() as u32) as usize
    }
}
