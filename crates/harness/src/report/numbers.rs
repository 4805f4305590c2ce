//! The numbers behind the figures: medians and quartiles of costs and gaps, primal integrals, and the lower bound
//! beside them.

use super::progress::{Along, longest, series};
use super::statistics::{median, primal_integral, quantile};
use super::{Output, Rows, text_table};
use crate::Error;
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Numbers of every method on every scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Heading.
    pub title: String,
    /// Labels of the methods.
    pub methods: Vec<String>,
}

/// One method on one scene, as written to `numbers.csv`.
#[derive(Serialize)]
struct Numbers<'a> {
    scene: &'a str,
    method: &'a str,
    runs: usize,
    cost_over_base_quartile_1: f64,
    cost_over_base_median: f64,
    cost_over_base_quartile_3: f64,
    /// `exact optimum` or `best known`.
    reference: &'static str,
    reference_cost: f64,
    gap_quartile_1: f64,
    gap_median: f64,
    gap_quartile_3: f64,
    /// No binary tree costs less; empty where none is proven.
    lower_bound: Option<f64>,
    lower_bound_over_reference: Option<f64>,
    /// Median cost over the lower bound, minus 1: no tree is farther from the optimum.
    proven_gap_median: Option<f64>,
    /// Medians over runs, up to the end of the longest run of any method on the scene.
    primal_integral_evaluations: f64,
    primal_integral_work: f64,
}

/// Its seconds, as written to `timing_numbers.csv`.
#[derive(Serialize)]
struct Timing<'a> {
    scene: &'a str,
    method: &'a str,
    seconds_quartile_1: f64,
    seconds_median: f64,
    seconds_quartile_3: f64,
    horizon_seconds: f64,
    primal_integral: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (mut numbers, mut timing) = (Vec::new(), Vec::new());
        for (scene, _) in rows.scenes() {
            let Some(reference) = rows.reference(scene) else { continue };
            let horizon = |along| {
                self.methods.iter().map(|method| longest(rows, scene, method, along)).fold(0.0, f64::max)
            };
            let horizons = Along::ALL.map(horizon);
            for method in &self.methods {
                let costs: Vec<f64> = rows.runs_of(scene, method).map(|run| run.cost).collect();
                let base = rows.base_cost(scene);
                let over = |of: f64, q| quantile(&costs, q).map_or(f64::NAN, |cost| super::over(cost, of));
                let [seconds_integral, evaluations, work] = [0, 1, 2].map(|at| {
                    let runs = series(rows, scene, method, Along::ALL[at]);
                    let integrals: Vec<f64> = runs
                        .iter()
                        .filter_map(|run| primal_integral(run, reference.cost, horizons[at]))
                        .collect();
                    median(&integrals).unwrap_or(f64::NAN)
                });
                numbers.push(Numbers {
                    scene,
                    method,
                    runs: costs.len(),
                    cost_over_base_quartile_1: over(base, 0.25),
                    cost_over_base_median: over(base, 0.5),
                    cost_over_base_quartile_3: over(base, 0.75),
                    reference: if reference.is_optimum() { "exact optimum" } else { "best known" },
                    reference_cost: reference.cost,
                    gap_quartile_1: over(reference.cost, 0.25) - 1.0,
                    gap_median: over(reference.cost, 0.5) - 1.0,
                    gap_quartile_3: over(reference.cost, 0.75) - 1.0,
                    lower_bound: reference.lower_bound,
                    lower_bound_over_reference: reference
                        .lower_bound
                        .map(|bound| super::over(bound, reference.cost)),
                    proven_gap_median: reference.lower_bound.map(|bound| over(bound, 0.5) - 1.0),
                    primal_integral_evaluations: evaluations,
                    primal_integral_work: work,
                });
                let seconds: Vec<f64> = rows.seconds_of(scene, method).collect();
                let at = |q| quantile(&seconds, q).unwrap_or(f64::NAN);
                timing.push(Timing {
                    scene,
                    method,
                    seconds_quartile_1: at(0.25),
                    seconds_median: at(0.5),
                    seconds_quartile_3: at(0.75),
                    horizon_seconds: horizons[0],
                    primal_integral: seconds_integral,
                });
            }
        }
        Ok(Output {
            csv: vec![
                ("numbers".into(), to_bytes(&numbers, Path::new("numbers.csv"))?),
                ("timing_numbers".into(), to_bytes(&timing, Path::new("timing_numbers.csv"))?),
            ],
            text: self.text(rows, &numbers, &timing),
            ..Output::default()
        })
    }

    fn text(&self, rows: &Rows, numbers: &[Numbers], timing: &[Timing]) -> String {
        let header =
            ["scene", "method", "cost / base", "gap, quartiles (%)", "bound", "time (s)", "primal integral"];
        let mut table = text_table(header);
        for (row, timing) in numbers.iter().zip(timing) {
            let [low, middle, high] =
                [row.gap_quartile_1, row.gap_median, row.gap_quartile_3].map(|gap| 100.0 * gap);
            table.add_row([
                rows.shown(row.scene),
                row.method.into(),
                format!("{:.4}", row.cost_over_base_median),
                format!("{middle:.3}  ({low:.3} to {high:.3})"),
                row.lower_bound_over_reference.map_or_else(String::new, |ratio| format!("{ratio:.3}")),
                format!("{:.3}", timing.seconds_median),
                format!("{:.4}", timing.primal_integral),
            ]);
        }
        format!(
            "{}\nGaps are to the exact optimum or the best known cost, the bound is relative to that; the primal \
             integral is the mean gap over the longest run's time:\n{table}\n",
            self.title
        )
    }
}
