//! Figures 2 to 4 of the paper: cost against generation, with the median run, the range of all
//! runs, and random picking.

use super::prelude::*;
use crate::rows::TrialRow;
use crate::statistics::{expected_best_of, range};

report! {
    /// Cost against generation.
    pub struct Config {
        /// Label of the genetic algorithm.
        method: String;
        /// Label of the random picking of orders that it is compared with.
        baseline: String;
    }
}

/// One generation on one line, as written to `generations.csv`.
#[derive(Serialize)]
pub(super) struct Generation<'a> {
    scene: &'a str,
    /// Number of the generation, from 0.
    generation: usize,
    /// `median run`, the run whose final cost is the median, or `random picking` of as many orders
    /// as that run has evaluated.
    line: &'static str,
    /// Lowest cost so far over the greedy tree's; of random picking, its expectation.
    cost_over_base: f64,
    /// The lowest of all runs; empty for one run.
    cost_over_base_low: Option<f64>,
    /// The highest of all runs.
    cost_over_base_high: Option<f64>,
}

/// A run, generation by generation: trees evaluated so far, and the lowest cost so far.
type Progress = Vec<(u64, f64)>;

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut generations = Vec::new();
        for scene in rows.scenes() {
            let trials = rows.trials_of(scene, &self.method);
            let mut runs: Vec<Progress> = trials.iter().map(|run| progress(run)).collect();
            runs.sort_by(|a, b| end(a).total_cmp(&end(b)));
            // Of an even number of runs there is no median run, so the lower one stands for it.
            let Some(middle) = runs.get(runs.len().saturating_sub(1) / 2) else { continue };
            let base = rows.base_cost(scene);
            let random = rows.trial_costs(scene, &self.baseline);
            for (generation, &(evaluations, incumbent)) in middle.iter().enumerate() {
                // A run that has ended keeps its best tree.
                let costs = runs.iter().map(|run| run.get(generation).map_or(end(run), |at| at.1));
                let ends = range(costs).filter(|_| runs.len() > 1).unzip();
                let picked = expected_best_of(&random, evaluations as usize);
                let lines = [
                    ("median run", Some(incumbent), ends),
                    ("random picking", picked, (None, None)),
                ];
                generations.extend(lines.into_iter().filter_map(|(line, cost, (low, high))| {
                    Some(Generation {
                        scene,
                        generation,
                        line,
                        cost_over_base: cost? / base,
                        cost_over_base_low: low.map(|low| low / base),
                        cost_over_base_high: high.map(|high| high / base),
                    })
                }));
            }
        }
        let mut output = Output::default();
        output.add_csv("generations", &generations)?;
        Ok(output)
    }
}

fn progress(run: &[&TrialRow]) -> Progress {
    let mut incumbent = f64::INFINITY;
    // Rows hold the best of each generation, which need not be the best so far.
    let at = |row: &&TrialRow| {
        incumbent = incumbent.min(row.cost);
        (row.evaluations, incumbent)
    };
    run.iter().map(at).collect()
}

/// The final cost of a run.
fn end(run: &Progress) -> f64 {
    run.last().map_or(f64::INFINITY, |end| end.1)
}
