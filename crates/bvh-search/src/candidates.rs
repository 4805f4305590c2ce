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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::scatter;
    use bvh_build::top_down::Workspace;
    use bvh_build::{Presorted, Watch, muller_fellner};
    use bvh_core::Bvh;

    /// Counts what a rule asks for and chooses.
    struct Counted {
        rule: Randomised,
        best: f64,
        lists: f64,
        axes: [f64; 3],
        chosen: [f64; 5],
    }

    impl SplitRule for Counted {
        fn shortlist(&mut self) -> Shortlist {
            let list = self.rule.shortlist();
            self.lists += 1.0;
            self.best += f64::from(u8::from(list == Shortlist::Best));
            if let Shortlist::AxisBest(axis) = list {
                self.axes[usize::from(axis)] += 1.0;
            }
            list
        }

        fn choose(&mut self, list: &[Split]) -> usize {
            let chosen = self.rule.choose(list);
            if list.len() == 5 {
                self.chosen[chosen] += 1.0;
            }
            chosen
        }
    }

    fn counted(candidates: Candidates, noise: Option<f64>) -> Counted {
        let rule = Randomised::new(candidates, noise, stream(2, 0));
        let mut counted = Counted { rule, best: 0.0, lists: 0.0, axes: [0.0; 3], chosen: [0.0; 5] };
        let boxes = scatter(20_000);
        let scene = Presorted::new(&boxes).unwrap();
        let (mut workspace, mut tree) = <(Workspace, Bvh)>::default();
        let config = muller_fellner::Config::default();
        let watch = &Watch::default();
        let rule = Some(&mut counted as &mut dyn SplitRule);
        config.construct(&scene, None, rule, &mut workspace, &mut tree, watch).unwrap();
        counted
    }

    fn assert_equal(counts: &[f64]) {
        let expected = counts.iter().sum::<f64>() / counts.len() as f64;
        assert!(expected > 500.0, "{counts:?}");
        assert!(counts.iter().all(|n| (n - expected).abs() < 5.0 * expected.sqrt()), "{counts:?}");
    }

    #[test]
    fn noise_is_the_probability_of_another_candidate_than_the_best_each_equally_likely() {
        let noisy = counted(Candidates::KBest(5), Some(0.3));
        assert!((noisy.best / noisy.lists - 0.7).abs() < 0.02, "{} {}", noisy.best, noisy.lists);
        assert_eq!(noisy.chosen[0], 0.0);
        assert_equal(&noisy.chosen[1..]);
        let plain = counted(Candidates::KBest(5), None);
        assert_eq!(plain.best, 0.0);
        assert_equal(&plain.chosen);
        let axes = counted(Candidates::AxisBest, None);
        assert_eq!(axes.axes.iter().sum::<f64>(), axes.lists);
        assert_equal(&axes.axes);
        assert_eq!(counted(Candidates::AxisBest, Some(0.3)).axes, [0.0; 3]);
    }
}
