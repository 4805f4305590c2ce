//! Medians and quartiles of costs and gaps, and times until targets are reached, by
//! method and scene.

use super::data::{Series, ratio};
use super::prelude::*;
use crate::statistics::{order_quantile, quartiles};

report! {
    /// Numbers of every method on every scene.
    pub struct Config {
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Distances above the best known cost in per cent, for a table of the
        /// seconds that the methods need to get there. Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        targets: Vec<f64> = vec![], in 0.0..=1e6;
    }
}

/// One method on one scene, as written to `numbers.csv`.
#[derive(Serialize)]
pub(super) struct Numbers<'a> {
    scene: &'a str,
    method: &'a str,
    runs: usize,
    /// Median of cost over base, over repetitions.
    cost_over_base_median: f64,
    /// The best known cost, that gaps are measured from.
    reference_cost: f64,
    gap_quartile_1: f64,
    gap_median: f64,
    gap_quartile_3: f64,
}

/// The seconds of one method on one scene, as written to `timing_numbers.csv`.
#[derive(Serialize)]
pub(super) struct Timing<'a> {
    scene: &'a str,
    method: &'a str,
    seconds_quartile_1: f64,
    seconds_median: f64,
    seconds_quartile_3: f64,
}

/// One method and target on one scene, as written to `timing_to_target.csv`.
#[derive(Serialize)]
pub(super) struct Reached<'a> {
    scene: &'a str,
    target: String,
    method: &'a str,
    /// All runs.
    runs: usize,
    /// Runs that reach the target.
    solved: usize,
    /// Median over all runs, counting runs that never reach the target as last; empty if such a run
    /// is the median.
    median: Option<f64>,
    /// The same for the quantile 0.9.
    quantile_90: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut numbers = Vec::new();
        let mut timing = Vec::new();
        let mut reached = Vec::new();
        for scene in rows.scenes() {
            // Without a reference there are no gaps to report.
            let Some(reference) = rows.reference(scene) else { continue };
            for method in &self.methods {
                let costs: Vec<f64> = rows.runs_of(scene, method).map(|run| run.cost).collect();
                let of_costs = quartiles(&costs);
                let [gap_quartile_1, gap_median, gap_quartile_3] =
                    of_costs.map(|cost| ratio(cost, reference.cost) - 1.0);
                numbers.push(Numbers {
                    scene,
                    method,
                    runs: costs.len(),
                    cost_over_base_median: ratio(of_costs[1], rows.base_cost(scene)),
                    reference_cost: reference.cost,
                    gap_quartile_1,
                    gap_median,
                    gap_quartile_3,
                });
                let [seconds_quartile_1, seconds_median, seconds_quartile_3] =
                    quartiles(&rows.seconds_of(scene, method));
                timing.push(Timing {
                    scene,
                    method,
                    seconds_quartile_1,
                    seconds_median,
                    seconds_quartile_3,
                });
            }
            if self.targets.is_empty() {
                continue;
            }
            let series = |method: &String| rows.series(scene, method);
            let runs_of_methods: Vec<Vec<Series>> = self.methods.iter().map(series).collect();
            for percent in &self.targets {
                let cost = reference.cost * (1.0 + percent / 100.0);
                let target = match percent {
                    0.0 => "best known".to_owned(),
                    percent => format!("best known +{percent} %"),
                };
                for (method, runs) in self.methods.iter().zip(&runs_of_methods) {
                    reached.push(Reached::new(scene, target.clone(), method, runs, cost));
                }
            }
        }
        let mut output = Output::default();
        output.add_csv("numbers", &numbers)?;
        output.add_csv("timing_numbers", &timing)?;
        if !self.targets.is_empty() {
            output.add_csv("timing_to_target", &reached)?;
        }
        Ok(output)
    }
}

impl<'a> Reached<'a> {
    fn new(scene: &'a str, target: String, method: &'a str, runs: &[Series], cost: f64) -> Self {
        // Runs without success must count: dropping them would favour methods that rarely succeed.
        let time = |run: &Series| {
            run.iter().find(|(_, incumbent)| *incumbent <= cost).map_or(f64::INFINITY, |at| at.0)
        };
        let times: Vec<f64> = runs.iter().map(time).collect();
        let quantile = |q| order_quantile(&times, q).filter(|time| time.is_finite());
        Self {
            scene,
            target,
            method,
            runs: runs.len(),
            solved: times.iter().filter(|time| time.is_finite()).count(),
            median: quantile(0.5),
            quantile_90: quantile(0.9),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_reached_by_the_first_incumbent_at_or_below_it_or_never() {
        let runs = [vec![(1.0, 9.0), (2.0, 7.0), (5.0, 6.0)], vec![(3.0, 7.0)]];
        let when = [9.5, 7.0, 6.0, 1.0].map(|cost| {
            let reached = Reached::new("", String::new(), "", &runs, cost);
            (reached.solved, reached.median)
        });
        assert_eq!(when, [(2, Some(1.0)), (2, Some(2.0)), (1, Some(5.0)), (0, None)]);
    }
}
