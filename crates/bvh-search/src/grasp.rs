//! GRASP's randomised construction: Müller–Fellner that does not always choose the best split.
//!
//! Ng & Trifonov 2003, section 3.4; Feo & Resende 1995. The four candidate rules of the paper are
//!
//! | | `candidates` | `noise` |
//! |---|---|---|
//! | Table 3 | `axis_best` | none: each of the three equally likely |
//! | Table 4 | `axis_best` | 0.1 |
//! | Figure 1 | `k_best`, restricted by cardinality | 0.1 |
//! | section 3.4 | `within`, restricted by value | any |
//!
//! GRASP's second phase, which the paper leaves to future work (sections 3.4 and 5), is
//! `local_search`: every constructed tree is improved to its local optimum.
//!
//! Differs from the paper: not in the first two rules. For the others, the paper does not define
//! how noise acts; here it is the probability of choosing a candidate other than the best, each
//! equally likely.

pub use crate::candidates::Candidates;
use crate::candidates::Randomised;
use crate::local::reinsertion;
use crate::parallel::{KEPT_NODES, map_init};
use crate::run::{Found, Observer, Problem, Quota, Run, SearchError, stream, watched};
use crate::tree::{Metric, Working, search_by_metric};
use bvh_build::top_down::Workspace;
use bvh_build::{BuildError, Presorted, muller_fellner};
use bvh_config::Nested;
use bvh_core::Bvh;
use std::sync::{Mutex, PoisonError};

bvh_config::config! {
    /// The construction, and the number of trees.
    pub struct Config {
        /// Number of independent constructions.
        trials: u64 = 100, in 1..;
        /// The splits of a node that may be chosen.
        candidates: Candidates = Candidates::AxisBest, in Nested;
        /// The probability of choosing a candidate other than the best. Without it, all candidates
        /// are equally likely.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        noise: Option<f64>, in 0.0..=1.0;
        /// The local search that improves every constructed tree. The default is none, as in the
        /// paper, which ends far above every method with local search.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "LocalSearch::is_none"))]
        local_search: LocalSearch = LocalSearch::None;
        /// The heuristic that ranks splits, and the other parameters of the greedy builder.
        construction: muller_fellner::Config, in Nested;
    }
}

bvh_config::config! {
    /// A local search by name, which improves the trees that GRASP constructs.
    #[derive(Copy, Default, Eq)]
    pub enum LocalSearch {
        /// Leaves the tree as it is.
        #[default]
        None,
        /// By [reinsertion](crate::reinsertion).
        Reinsertion,
    }
}

impl LocalSearch {
    /// Returns whether the tree is left as it is.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }
}

search_by_metric!(Config);

#[derive(Debug)]
struct Trial {
    cost: f64,
    /// Nodes visited by the local search.
    work: u64,
    /// Kept if it was cheaper than the incumbent when the trial began.
    tree: Option<Bvh>,
}

impl Config {
    /// Runs trials in parallel. They are independent, because each draws from a separate stream.
    fn search_by(&self, metric: impl Metric, problem: &Problem, seed: u64, run: &mut Run) -> Found {
        let scene = Presorted::new(problem.boxes)?;
        let construction = (2 * problem.boxes.len() as u64).saturating_sub(1);
        let observer = run.observer();
        // The work of trials with local search is not known in advance. Smaller batches waste less
        // at the end of a budget.
        let most = if self.local_search.is_none() { BATCH } else { SMALL_BATCH };
        let most = most.min(KEPT_NODES / construction.max(1)).max(1);
        let mut next = 0;
        let mut best = Bvh::default();
        while next < self.trials && run.stopped().is_none() {
            let end =
                self.trials.min(next.saturating_add(run.evaluations_left(construction).min(most)));
            // Only trees below the incumbent, and below the trials before them, can win, so only
            // these are kept.
            let limit = run.incumbent();
            let costs = Mutex::default();
            let results = map_init((end - next) as usize, Default::default, |buffers, index| {
                let number = next + index as u64;
                if number > 0 && observer.cancelled() {
                    return Ok(None);
                }
                let rule = &mut Randomised::new(self.candidates, self.noise, stream(seed, number));
                let (workspace, tree): &mut (Workspace, Bvh) = buffers;
                let constructed = watched(observer, |watch| {
                    let Problem { measure, .. } = *problem;
                    self.construction.construct(&scene, measure, Some(rule), workspace, tree, watch)
                });
                match constructed {
                    // A trial is either complete or, without any other, an error.
                    Err(BuildError::Cancelled) if number > 0 => return Ok(None),
                    constructed => constructed?,
                }
                let work = self.improve(tree, metric, observer)?;
                let cost = problem.cost(tree);
                let is_kept = cost < limit && can_win(&costs, index, cost);
                Ok(Some(Trial { cost, work, tree: is_kept.then(|| std::mem::take(tree)) }))
            });
            for result in results {
                let result: Result<_, SearchError> = result;
                let Some(Trial { cost, work, tree }) = result? else { break };
                if run.record(cost, construction + work)
                    && let Some(tree) = tree
                {
                    best = tree;
                }
                // Later results of the batch are dropped, so that the outcome does not depend on
                // its size.
                if run.stopped().is_some() {
                    break;
                }
            }
            next = end;
        }
        Ok(best)
    }

    /// Improves a tree to a local optimum; leaves it unchanged if the observer cancels first.
    /// Returns the number of nodes visited.
    fn improve(
        &self,
        tree: &mut Bvh,
        metric: impl Metric,
        observer: &dyn Observer,
    ) -> Result<u64, SearchError> {
        if self.local_search.is_none() {
            return Ok(0);
        }
        let mut working = Working::from_bvh(tree, metric)?;
        let tally = reinsertion::to_local_optimum(&mut working, Quota::ENDLESS, observer);
        if !observer.cancelled() {
            *tree = working.to_bvh();
        }
        Ok(tally.work)
    }
}

/// Returns whether no trial before this one in its batch costs as little, as far as their `costs`
/// are known. A later trial may be dropped, because the budget ends before it.
fn can_win(costs: &Mutex<Vec<(usize, f64)>>, index: usize, cost: f64) -> bool {
    let mut costs = costs.lock().unwrap_or_else(PoisonError::into_inner);
    let loses = costs.iter().any(|&(other, of_other)| other < index && of_other <= cost);
    costs.push((index, cost));
    !loses
}

/// Number of trials between two checks of the budget, without local search.
const BATCH: u64 = 32;

/// Number of trials between two checks of the budget, with local search.
const SMALL_BATCH: u64 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::scatter;
    use crate::{Budget, solve};
    use bvh_core::validate;

    fn configs() -> [Config; 6] {
        let config =
            |candidates, noise| Config { trials: 12, candidates, noise, ..Config::default() };
        [
            config(Candidates::AxisBest, None),
            config(Candidates::AxisBest, Some(0.1)),
            config(Candidates::KBest(5), Some(0.1)),
            config(Candidates::KBest(5), None),
            config(Candidates::Within(0.05), Some(0.5)),
            Config {
                local_search: LocalSearch::Reinsertion,
                ..config(Candidates::AxisBest, Some(0.1))
            },
        ]
    }

    #[test]
    fn every_rule_constructs_different_valid_trees_whose_cost_is_the_recorded_one() {
        for boxes in
            [scatter(300), scatter(1), scatter(2), scatter(3), vec![scatter(1)[0]; 100], vec![]]
        {
            for config in configs() {
                let problem = Problem::new(&boxes);
                let outcome = solve(&config, &problem, 1, Budget::UNLIMITED, &()).unwrap();
                validate(&outcome.tree, &boxes).unwrap();
                assert_eq!(outcome.cost, problem.objective.cost(&outcome.tree), "{config:?}");
                assert_eq!(outcome.evaluations, 12);
                let differ = outcome.history.iter().any(|event| event.cost != outcome.cost);
                assert!(boxes.len() < 300 || differ, "{config:?}");
            }
        }
    }

    #[test]
    fn every_trial_has_the_stream_of_its_number_and_the_first_of_the_cheapest_wins() {
        let boxes = scatter(100);
        let problem = Problem::new(&boxes);
        // More than one batch.
        let config = Config { trials: 70, noise: Some(0.1), ..Config::default() };
        let outcome = solve(&config, &problem, 9, Budget::UNLIMITED, &()).unwrap();
        let scene = Presorted::new(&boxes).unwrap();
        let (mut workspace, mut tree) = <(Workspace, Bvh)>::default();
        let mut best: Option<(f64, Bvh)> = None;
        for (number, event) in (0..).zip(&outcome.history) {
            let rule = &mut Randomised::new(config.candidates, config.noise, stream(9, number));
            let watch = &bvh_build::Watch::default();
            let Config { construction, .. } = &config;
            construction
                .construct(&scene, None, Some(rule), &mut workspace, &mut tree, watch)
                .unwrap();
            let cost = problem.cost(&tree);
            assert_eq!((event.cost, event.evaluations), (cost, number + 1));
            if best.as_ref().is_none_or(|best| cost < best.0) {
                best = Some((cost, tree.clone()));
            }
        }
        assert_eq!((outcome.history.len(), outcome.work), (70, 70 * 199));
        assert_eq!(Some((outcome.cost, outcome.tree)), best);
        let costs = Mutex::default();
        let wins = [(5, 3.0), (2, 4.0), (6, 3.0), (3, 4.0), (1, 3.0), (9, 2.0)];
        let wins = wins.map(|(index, cost)| can_win(&costs, index, cost));
        assert_eq!(wins, [true, true, false, false, true, true]);
    }

    #[test]
    fn local_search_improves_every_trial_and_its_work_is_counted_on_any_number_of_threads() {
        let boxes = scatter(500);
        let run = |local_search, threads: usize, max_work| {
            let config = Config { trials: 20, local_search, ..Config::default() };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let budget = Budget { max_work, ..Budget::UNLIMITED };
            pool.install(|| solve(&config, &Problem::new(&boxes), 3, budget, &()).unwrap())
        };
        let plain = run(LocalSearch::None, 1, None);
        let improved = run(LocalSearch::Reinsertion, 1, None);
        let mut pairs = plain.history.iter().zip(&improved.history);
        assert!(pairs.all(|(before, after)| after.cost < before.cost && after.work > before.work));
        let cut = |threads| run(LocalSearch::Reinsertion, threads, Some(improved.work / 3));
        let one = cut(1);
        let three = cut(3);
        assert_eq!((&one.tree, &one.history), (&three.tree, &three.history));
        // The budget ends the search with the first trial that exceeds it.
        let within =
            improved.history.iter().take_while(|event| event.work < improved.work / 3).count();
        assert_eq!(one.history, improved.history[..=within]);
    }
}
