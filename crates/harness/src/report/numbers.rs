//! Medians and quartiles of costs and gaps, lower bounds, and times until targets are reached, by
//! method and scene.

use super::data::ratio;
use super::prelude::*;
use super::to_target;
use crate::rows::ReferenceRow;
use crate::statistics::{minimum, quartiles};

bvh_config::config! { serde;
    /// Numbers of every method on every scene.
    pub struct Config {
        /// Heading.
        title: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Distances above the best known cost or exact optimum in per cent, for a table of the
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
    /// `exact optimum` or `best known`.
    reference: &'static str,
    /// The cost that gaps are measured from.
    reference_cost: f64,
    gap_quartile_1: f64,
    gap_median: f64,
    gap_quartile_3: f64,
    /// Proven lower bound of the cost of binary trees, if there is one.
    lower_bound: Option<f64>,
    /// `lower_bound` over `reference_cost`.
    lower_bound_over_reference: Option<f64>,
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

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut numbers = Vec::new();
        let mut timing = Vec::new();
        for scene in rows.scenes() {
            // Without a reference there are no gaps to report.
            let Some(reference) = rows.reference(scene) else { continue };
            for method in &self.methods {
                numbers.push(of_costs(rows, scene, method, reference));
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
        }
        let mut output = Output::new("", &self.title);
        let bounds = numbers.iter().filter_map(|row| row.lower_bound_over_reference);
        // Rounded up, so that no scene is above it.
        output.finding = minimum(bounds).map(|least| {
            let most = (10.0 / least).ceil() / 10.0;
            format!("Where a bound is proven, the best known cost at most {most} times the optimum")
        });
        output.add_csv("numbers", &numbers)?;
        output.add_csv("timing_numbers", &timing)?;
        let explanation = "Gaps are to the best known cost; the lower bound is relative to that:";
        let columns = "scene method runs cost_over_base_median gap_quartile_1 gap_median gap_quartile_3 \
                       lower_bound_over_reference";
        output.show(explanation, &numbers, columns)?;
        let columns = "scene method seconds_quartile_1 seconds_median seconds_quartile_3";
        output.show("Seconds of the runs:", &timing, columns)?;
        if !self.targets.is_empty() {
            to_target::add(&mut output, &self.methods, &self.targets, rows)?;
        }
        Ok(output)
    }
}

/// Returns the costs of a method's runs on a scene.
fn of_costs<'a>(
    rows: &Rows,
    scene: &'a str,
    method: &'a str,
    reference: &ReferenceRow,
) -> Numbers<'a> {
    let costs: Vec<f64> = rows.runs_of(scene, method).map(|run| run.cost).collect();
    let quartiles = quartiles(&costs);
    let gaps = quartiles.map(|cost| ratio(cost, reference.cost) - 1.0);
    Numbers {
        scene,
        method,
        runs: costs.len(),
        cost_over_base_median: ratio(quartiles[1], rows.base_cost(scene)),
        reference: if reference.is_optimum() { "exact optimum" } else { "best known" },
        reference_cost: reference.cost,
        gap_quartile_1: gaps[0],
        gap_median: gaps[1],
        gap_quartile_3: gaps[2],
        lower_bound: reference.lower_bound,
        lower_bound_over_reference: reference.lower_bound.map(|bound| ratio(bound, reference.cost)),
    }
}
