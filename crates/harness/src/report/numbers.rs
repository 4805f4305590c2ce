//! Medians and quartiles of costs and gaps, primal integrals, lower bounds, and times until targets
//! are reached, by method and scene.

use super::data::ratio;
use super::prelude::*;
use super::progress::{ProgressAxis, Series, longest_of_all, series};
use super::target::Target;
use super::to_target;
use crate::rows::ReferenceRow;
use crate::statistics::{median, primal_integral, quartiles, range};
use bvh_config::Nested;

bvh_config::config! { serde;
    /// Numbers of every method on every scene.
    pub struct Config {
        /// Heading.
        title: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Costs to be reached, for a table of the seconds and the work that the methods need.
        /// Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        targets: Vec<Target> = vec![], in Nested;
    }
}

/// One method on one scene, as written to `numbers.csv`.
#[derive(Serialize)]
pub(super) struct Numbers<'a> {
    scene: &'a str,
    method: &'a str,
    runs: usize,
    /// Lower quartile of cost over base, over repetitions.
    cost_over_base_quartile_1: f64,
    /// Median of cost over base.
    cost_over_base_median: f64,
    /// Upper quartile of cost over base.
    cost_over_base_quartile_3: f64,
    /// `exact optimum` or `best known`.
    reference: &'static str,
    /// The cost that gaps are measured from.
    reference_cost: f64,
    /// The method that found the reference. If it did so in this experiment, its own gaps are too
    /// small.
    reference_method: String,
    /// True if the reference was found in this experiment.
    reference_of_this_experiment: bool,
    gap_quartile_1: f64,
    gap_median: f64,
    gap_quartile_3: f64,
    /// Proven lower bound of the cost of binary trees, if there is one.
    lower_bound: Option<f64>,
    /// `lower_bound` over `reference_cost`.
    lower_bound_over_reference: Option<f64>,
    /// Median cost over the lower bound, minus 1; the gap to the optimum is at most this.
    proven_gap_median: Option<f64>,
    /// Mean gap over the evaluations of the longest run of any method on the scene; median over
    /// runs.
    primal_integral_evaluations: f64,
    /// The same mean gap over work.
    primal_integral_work: f64,
}

/// The seconds of one method on one scene, as written to `timing_numbers.csv`.
#[derive(Serialize)]
pub(super) struct Timing<'a> {
    scene: &'a str,
    method: &'a str,
    seconds_quartile_1: f64,
    seconds_median: f64,
    seconds_quartile_3: f64,
    /// The end of the longest run of any method on the scene.
    horizon_seconds: f64,
    /// Mean gap up to `horizon_seconds`; median over runs.
    primal_integral: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut numbers = Vec::new();
        let mut timing = Vec::new();
        for scene in rows.scenes() {
            // Without a reference there are neither gaps nor integrals to report.
            let Some(reference) = rows.reference(scene) else { continue };
            let horizons =
                ProgressAxis::ALL.map(|axis| longest_of_all(rows, scene, &self.methods, axis));
            for method in &self.methods {
                let integral = |at: usize| {
                    let runs = series(rows, scene, method, ProgressAxis::ALL[at]);
                    let integral =
                        |run: &Series| primal_integral(run, reference.cost, horizons[at]);
                    median(
                        &runs
                            .iter()
                            .filter_map(integral)
                            .collect::<Vec<_>>(),
                    )
                    .unwrap_or(f64::NAN)
                };
                let [primal_integral, evaluations, work] = [0, 1, 2].map(integral);
                numbers.push(of_costs(rows, scene, method, reference, [evaluations, work]));
                let [seconds_quartile_1, seconds_median, seconds_quartile_3] =
                    quartiles(&rows.seconds_of(scene, method));
                timing.push(Timing {
                    scene,
                    method,
                    seconds_quartile_1,
                    seconds_median,
                    seconds_quartile_3,
                    horizon_seconds: horizons[0],
                    primal_integral,
                });
            }
        }
        let mut output = Output::new("", &self.title);
        output.add_csv("numbers", &numbers)?;
        output.add_csv("timing_numbers", &timing)?;
        let explanation = "Gaps are to the exact optimum or the best known cost; the lower bound is relative to that:";
        let columns = "scene method runs cost_over_base_median gap_quartile_1 gap_median gap_quartile_3 \
                       lower_bound_over_reference";
        output.show(explanation, &numbers, columns)?;
        let explanation = "The primal integral is the mean gap over the longest run's time:";
        output.show(explanation, &timing, "scene method seconds_median primal_integral")?;
        // The figure shows bounds; medians alone are in the table.
        if !rows.bounds.is_empty() {
            let caption = "Over the least known cost of the scene: the proven lower bound, below which no tree is, and the median \
                           cost of every method's runs.";
            output.add_figure("numbers", caption, 1, vec![self.draw(rows, &numbers)]);
        }
        let proven = rows.scenes().into_iter().filter_map(|scene| {
            let reference = rows.reference(scene)?;
            Some(100.0 * (ratio(reference.cost, reference.lower_bound?) - 1.0))
        });
        output.reading = range(proven).map_or_else(String::new, |(low, high)| {
            format!(
                "The best known trees cost at most {low:.0} to {high:.0} % more than the optimum, by scene."
            )
        });
        if !self.targets.is_empty() {
            let firsts = to_target::add(&mut output, &self.methods, &self.targets, rows)?;
            output.reading = format!("{} {firsts}", output.reading);
        }
        Ok(output)
    }

    /// Draws the lower bound and every method's cost on every scene, over the least known cost.
    fn draw(&self, rows: &Rows, numbers: &[Numbers]) -> Panel {
        let bound = |scene: &str| {
            rows.reference(scene)
                .and_then(|row| Some(ratio(row.lower_bound?, row.cost)))
        };
        let bounds = rows
            .scenes()
            .into_iter()
            .map(|scene| bound(scene).unwrap_or(f64::NAN))
            .collect();
        let cost = |method: &String| {
            let own = |scene: &str| {
                numbers
                    .iter()
                    .find(|row| row.scene == scene && row.method == method)
            };
            let scenes = rows.scenes().into_iter();
            let values =
                scenes.map(|scene| own(scene).map_or(f64::NAN, |row| 1.0 + row.gap_median));
            Layer::bars(method, values.collect(), 0.0)
        };
        let bounds = Layer::bars("lower bound", bounds, 0.0);
        let layers = std::iter::once(bounds)
            .chain(self.methods.iter().map(cost))
            .collect();
        panel(
            "",
            Axis::categories("", rows.all_shown()),
            Axis::linear("cost / least known"),
            layers,
        )
    }
}

/// Returns the costs of a method's runs on a scene. `integrals` are over evaluations and over work.
fn of_costs<'a>(
    rows: &Rows,
    scene: &'a str,
    method: &'a str,
    reference: &ReferenceRow,
    integrals: [f64; 2],
) -> Numbers<'a> {
    let costs: Vec<f64> = rows
        .runs_of(scene, method)
        .map(|run| run.cost)
        .collect();
    let quartiles = quartiles(&costs);
    let over_base = quartiles.map(|cost| ratio(cost, rows.base_cost(scene)));
    let gaps = quartiles.map(|cost| ratio(cost, reference.cost) - 1.0);
    Numbers {
        scene,
        method,
        runs: costs.len(),
        cost_over_base_quartile_1: over_base[0],
        cost_over_base_median: over_base[1],
        cost_over_base_quartile_3: over_base[2],
        reference: if reference.is_optimum() { "exact optimum" } else { "best known" },
        reference_cost: reference.cost,
        reference_method: reference.method.clone(),
        reference_of_this_experiment: rows
            .runs_of(scene, &reference.method)
            .any(|run| run.seed == reference.seed && run.cost <= reference.cost),
        gap_quartile_1: gaps[0],
        gap_median: gaps[1],
        gap_quartile_3: gaps[2],
        lower_bound: reference.lower_bound,
        lower_bound_over_reference: reference
            .lower_bound
            .map(|bound| ratio(bound, reference.cost)),
        proven_gap_median: reference
            .lower_bound
            .map(|bound| ratio(quartiles[1], bound) - 1.0),
        primal_integral_evaluations: integrals[0],
        primal_integral_work: integrals[1],
    }
}
