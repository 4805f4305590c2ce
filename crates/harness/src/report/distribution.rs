//! Distributions of the costs of independent trials.

use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::statistics::{mean, quantile, range, sorted, variance};
use bvh_config::above;
use bvh_scenes::SceneKind;

report! {
    /// The distribution of costs over trials.
    pub struct Config {
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Within which fraction of the greedy tree's cost the paper finds the majority of trials.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_majority_within: Option<f64>, in above(0.0);
    }
}

/// One method's trials on one scene, pooled over repetitions, as written to `distribution.csv`.
#[derive(Serialize)]
pub(super) struct Summary<'a> {
    scene: &'a str,
    method: &'a str,
    trials: usize,
    lowest_cost: f64,
    /// The lower quartile of the costs.
    quartile_1_cost: f64,
    median_cost: f64,
    /// The upper quartile of the costs.
    quartile_3_cost: f64,
    highest_cost: f64,
    /// The mean cost.
    mean_cost: f64,
    /// Standard deviation over mean.
    relative_deviation: f64,
    /// The greedy Müller–Fellner tree's, under the same objective.
    base_cost: f64,
    /// Fraction of trials that cost less than it.
    fraction_below_base: f64,
    /// Fraction of trials that cost less than 1.05 times as much.
    fraction_within_5_percent: f64,
}

pub(super) fn write(config: &Config, rows: &Rows) -> Result<Output, Error> {
    let mut summaries = Vec::new();
    for scene in rows.scenes() {
        for method in &config.methods {
            let costs = sorted(&rows.trial_costs(scene, method));
            summaries.push(summarise(scene, method, &costs, rows.base_cost(scene)));
        }
    }
    let paper = config.methods.iter().filter_map(|method| config.majority(rows, method)).collect();
    let mut output = Output { paper, ..Output::default() };
    output.add_csv("distribution", &summaries)?;
    Ok(output)
}

impl Config {
    /// Whether the majority of trials is where the paper finds it, on every stand-in for a scene of
    /// the paper: one statement, one row.
    fn majority(&self, rows: &Rows, method: &str) -> Option<PaperRow> {
        let within = self.paper_majority_within?;
        let mut scenes = rows.scenes();
        scenes.retain(|scene| rows.kind(scene) == SceneKind::StandIn.to_string());
        let (low, high) = range(scenes.into_iter().map(|scene| {
            let limit = (1.0 + within) * rows.base_cost(scene);
            fraction_below(&rows.trial_costs(scene, method), limit)
        }))?;
        let quantity = format!("{method}, fraction of trials within {} % of base", 100.0 * within);
        let row = PaperRow::new("all stand-ins", quantity);
        let verdict = if low > 0.5 { Verdict::Agrees } else { Verdict::Differs };
        let ours = format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high);
        let row = row.compare("the majority", ours, verdict, "above one half on every scene");
        Some(PaperRow { ours_low: Some(low), ours_high: Some(high), ..row })
    }
}

/// The fraction of costs that are less than `limit`.
fn fraction_below(costs: &[f64], limit: f64) -> f64 {
    costs.iter().filter(|&&cost| cost < limit).count() as f64 / costs.len() as f64
}

fn summarise<'a>(scene: &'a str, method: &'a str, costs: &[f64], base_cost: f64) -> Summary<'a> {
    let at = |q| quantile(costs, q).unwrap_or(f64::NAN);
    let mean_cost = mean(costs.iter().copied());
    Summary {
        scene,
        method,
        trials: costs.len(),
        lowest_cost: at(0.0),
        quartile_1_cost: at(0.25),
        median_cost: at(0.5),
        quartile_3_cost: at(0.75),
        highest_cost: at(1.0),
        mean_cost,
        relative_deviation: variance(costs).map_or(f64::NAN, f64::sqrt) / mean_cost,
        base_cost,
        fraction_below_base: fraction_below(costs, base_cost),
        fraction_within_5_percent: fraction_below(costs, 1.05 * base_cost),
    }
}
