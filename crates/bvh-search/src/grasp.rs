//! GRASP's randomised construction: Müller–Fellner, now and then not taking the best split.
//!
//! Ng & Trifonov 2003, section 3.4; Feo & Resende 1995. The four candidate rules of the paper are
//!
//! | | `candidates` | `noise` |
//! |---|---|---|
//! | Table 3 | `axis_best` | none: any of the three alike |
//! | Table 4 | `axis_best` | 0.1 |
//! | Figure 1 | `k_best`, restricted by cardinality | 0.1 |
//! | section 3.4 | `within`, restricted by value | any |
//!
//! Differs from the paper: nothing in the first two rules; for the others it does not say how noise acts, and here
//! it is the probability of taking one of the candidates other than the best, all alike.

use crate::error::require;
use crate::stream::{Stream, stream};
use crate::{Problem, Run, Search, SearchError};
use bvh_build::division::Workspace;
use bvh_build::evaluation::Evaluation;
use bvh_build::sweep::{Split, SplitRule, Sweep};
use bvh_build::{Presorted, muller_fellner};
use bvh_core::Bvh;
use rand::RngExt;

/// How to construct, and how often.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Number of independent constructions, at least 1. Default 100.
    pub trials: u64,
    /// The splits of a node that may be chosen. Default `axis_best`.
    pub candidates: Candidates,
    /// The probability, 0 to 1, of taking one of the candidates other than the best. Without it every candidate is
    /// as likely as any other. Default none.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub noise: Option<f64>,
    /// The heuristic that ranks splits, and the rest of the greedy builder's configuration.
    pub construction: muller_fellner::Config,
}

impl Default for Config {
    fn default() -> Self {
        Self { trials: 100, candidates: Candidates::AxisBest, noise: None, construction: Default::default() }
    }
}

/// The restricted candidate list of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Candidates {
    /// The best split of each of the three axes.
    AxisBest,
    /// The k best splits of all axes, k ≥ 1.
    KBest(u32),
    /// The best split and all that cost less than (1 + α) times as much, α ≥ 0.
    Within(f64),
}

impl Config {
    fn check(&self) -> Result<(), SearchError> {
        require(self.trials >= 1, "trials", self.trials as f64, "1 or more")?;
        if let Some(noise) = self.noise {
            require((0.0..=1.0).contains(&noise), "noise", noise, "0 to 1")?;
        }
        match self.candidates {
            Candidates::AxisBest => {}
            Candidates::KBest(k) => require(k >= 1, "k_best", k.into(), "1 or more")?,
            Candidates::Within(alpha) => {
                require(alpha >= 0.0 && alpha.is_finite(), "within", alpha, "0 or more")?;
            }
        }
        Ok(self.construction.heuristic.check()?)
    }

    /// Construction number `trial`, into `tree`.
    fn construct(&self, scene: &Presorted, seed: u64, trial: u64, workspace: &mut Workspace, tree: &mut Bvh) {
        let Self { candidates, noise, .. } = *self;
        let mut rule = Randomised { candidates, noise, rng: stream(seed, trial), list: Vec::new() };
        self.construction.construct(scene, &mut rule, workspace, tree);
    }
}

impl Search for Config {
    /// Trials are independent: each draws from a stream of its own, so they run in parallel.
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        self.check()?;
        let scene = Presorted::new(problem.boxes)?;
        let work = (2 * scene.len() as u64).saturating_sub(1);
        let cost_of = |(workspace, tree): &mut (Workspace, Bvh), trial: u64| {
            self.construct(&scene, seed, trial, workspace, tree);
            problem.objective.cost(tree)
        };
        let (mut next, mut best) = (0, 0);
        while next < self.trials && run.stopped().is_none() {
            let end = self.trials.min(next.saturating_add(run.evaluations_left(work).min(BATCH)));
            for (trial, cost) in (next..end).zip(map_trials(next..end, cost_of)) {
                if run.record(cost, work) {
                    best = trial;
                }
            }
            next = end;
        }
        // Only costs were kept; the incumbent is constructed once more.
        let mut tree = Bvh::default();
        self.construct(&scene, seed, best, &mut Workspace::default(), &mut tree);
        Ok(tree)
    }
}

/// Trials between two looks at the budget.
const BATCH: u64 = 32;

/// `cost_of` every trial, in order, each thread with buffers of its own.
fn map_trials(
    trials: std::ops::Range<u64>,
    cost_of: impl Fn(&mut (Workspace, Bvh), u64) -> f64 + Send + Sync,
) -> Vec<f64> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        trials.into_par_iter().map_init(Default::default, cost_of).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut buffers = Default::default();
        trials.map(|trial| cost_of(&mut buffers, trial)).collect()
    }
}

/// Draws a split from a node's restricted candidate list.
struct Randomised {
    candidates: Candidates,
    noise: Option<f64>,
    rng: Stream,
    list: Vec<Split>,
}

impl SplitRule for Randomised {
    /// The dice are cast before the node is scanned: what will not be chosen need not be known.
    #[inline(always)]
    fn choose<E: Evaluation>(&mut self, node: &mut Sweep<'_, E>) -> Split {
        let Self { candidates, noise, rng, list } = self;
        if noise.is_some_and(|noise| !rng.random_bool(noise)) {
            return node.best();
        }
        match *candidates {
            Candidates::AxisBest if noise.is_none() => return node.axis_best(rng.random_range(0..3u8)),
            Candidates::AxisBest => node.axis_bests(list),
            Candidates::KBest(k) => node.k_best(k as usize, list),
            Candidates::Within(alpha) => node.within(alpha, list),
        }
        let first = u32::from(noise.is_some() && list.len() > 1);
        list[rng.random_range(first..list.len() as u32) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::scatter;
    use crate::{Budget, solve};
    use bvh_build::Builder;
    use bvh_core::validate;

    fn configs() -> [Config; 5] {
        let config = |candidates, noise| Config { trials: 12, candidates, noise, ..Config::default() };
        [
            config(Candidates::AxisBest, None),
            config(Candidates::AxisBest, Some(0.1)),
            config(Candidates::KBest(5), Some(0.1)),
            config(Candidates::KBest(5), None),
            config(Candidates::Within(0.05), Some(0.5)),
        ]
    }

    #[test]
    fn rules_that_leave_no_choice_construct_the_greedy_tree() {
        let boxes = scatter(700);
        let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
        let every = [Candidates::AxisBest, Candidates::KBest(1), Candidates::KBest(9), Candidates::Within(0.0)];
        for (candidates, noise) in every.map(|candidates| (candidates, Some(0.0))).into_iter().chain([
            (Candidates::KBest(1), None),
            (Candidates::KBest(1), Some(1.0)),
            (Candidates::Within(0.0), None),
        ]) {
            let config = Config { trials: 2, candidates, noise, ..Config::default() };
            let outcome = solve(&config, &Problem::new(&boxes), 7, Budget::default(), &()).unwrap();
            assert_eq!(outcome.tree, greedy, "{config:?}");
        }
    }

    #[test]
    fn every_rule_constructs_valid_trees_whose_cost_is_the_recorded_one() {
        for boxes in [scatter(300), scatter(1), scatter(2), scatter(3), vec![scatter(1)[0]; 100], vec![]] {
            for config in configs() {
                let problem = Problem::new(&boxes);
                let outcome = solve(&config, &problem, 1, Budget::default(), &()).unwrap();
                validate(&outcome.tree, &boxes).unwrap();
                assert_eq!(outcome.cost, problem.objective.cost(&outcome.tree), "{config:?}");
                assert_eq!(outcome.evaluations, 12);
            }
        }
    }

    #[test]
    fn trials_do_not_depend_on_the_number_of_threads_or_of_trials() {
        let boxes = scatter(500);
        for config in configs() {
            let on = |threads, trials| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let config = Config { trials, ..config.clone() };
                pool.install(|| solve(&config, &Problem::new(&boxes), 3, Budget::default(), &()).unwrap())
            };
            let one = on(1, 50);
            assert_eq!(one.history, on(3, 50).history, "{config:?}");
            assert_eq!(one.tree, on(2, 50).tree, "{config:?}");
            assert_eq!(one.history[..20], on(2, 20).history, "{config:?}");
        }
    }

    #[test]
    fn noise_makes_trials_differ() {
        let boxes = scatter(500);
        for config in configs() {
            let history = solve(&config, &Problem::new(&boxes), 3, Budget::default(), &()).unwrap().history;
            assert!(history.iter().any(|event| event.cost != history[0].cost), "{config:?}");
        }
    }

    #[test]
    fn parameters_outside_their_range_are_named() {
        let refused = |config: Config| {
            solve(&config, &Problem::new(&[]), 1, Budget::default(), &()).unwrap_err().to_string()
        };
        let default = Config::default();
        assert_eq!(refused(Config { trials: 0, ..default.clone() }), "trials is 0; accepted: 1 or more");
        assert_eq!(
            refused(Config { noise: Some(f64::NAN), ..default.clone() }),
            "noise is NaN; accepted: 0 to 1"
        );
        let k_best = Config { candidates: Candidates::KBest(0), ..default.clone() };
        assert_eq!(refused(k_best), "k_best is 0; accepted: 1 or more");
        let within = Config { candidates: Candidates::Within(-1.0), ..default };
        assert_eq!(refused(within), "within is -1; accepted: 0 or more");
    }
}
