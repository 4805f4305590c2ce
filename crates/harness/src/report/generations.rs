//! Figures 2 to 4 of the paper: cost against generation, with the median run, the range of all
//! runs, and random picking.

use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::rows::TrialRow;
use crate::statistics::{expected_best_of, mean, median, range};
use bvh_config::above;
use std::collections::BTreeMap;

report! {
    /// Cost against generation.
    pub struct Config {
        /// Label of the genetic algorithm.
        method: String;
        /// Label of the random picking of orders that it is compared with.
        baseline: String;
        /// The paper's lowest and highest final cost over runs in either order, by scene.
        paper_final: BTreeMap<String, [f64; 2]>, in above(0.0);
        /// The paper's final cost over that of the average order.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_gain: Option<f64>, in above(0.0);
        /// The paper's words on the gain, where it gives no number.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_says: Option<String>;
    }
}

/// One generation, as written to `generations.csv`.
#[derive(Serialize)]
pub(super) struct Generation<'a> {
    scene: &'a str,
    /// Number of the generation, from 0.
    generation: usize,
    /// Lowest cost so far in the run whose final cost is the median.
    median_run_cost: f64,
    /// Lowest cost so far of the best run.
    lowest_cost: f64,
    /// Lowest cost so far of the worst run.
    highest_cost: f64,
    /// Expected lowest cost of as many random orders as one run has evaluated.
    random_picking_cost: Option<f64>,
}

/// A run, generation by generation: trees evaluated so far, and the lowest cost so far.
type Progress = Vec<(u64, f64)>;

/// The quantity that the paper reports as the gain.
const GAIN: &str = "final cost over the average order's";

/// Gains within this relative distance of the paper's agree with it, which says 'about a third'.
const GAIN_TOLERANCE: f64 = 0.05;

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        let mut generations = Vec::new();
        let mut panels = Vec::new();
        for scene in rows.scenes() {
            let trials = rows.trials_of(scene, &self.method);
            let mut runs: Vec<Progress> = trials.iter().map(|run| progress(run)).collect();
            runs.sort_by(|a, b| end(a).total_cmp(&end(b)));
            // Of an even number of runs there is no median run, so the lower one stands for it.
            let Some(middle) = runs.get(runs.len().saturating_sub(1) / 2) else { continue };
            let random = rows.trial_costs(scene, &self.baseline);
            let at = |(generation, &(evaluations, incumbent)): (usize, &(u64, f64))| {
                // A run that has ended keeps its best tree.
                let costs = runs.iter().map(|run| run.get(generation).map_or(end(run), |at| at.1));
                let (lowest_cost, highest_cost) = range(costs).unwrap_or((f64::NAN, f64::NAN));
                Generation {
                    scene,
                    generation,
                    median_run_cost: incumbent,
                    lowest_cost,
                    highest_cost,
                    random_picking_cost: expected_best_of(&random, evaluations as usize),
                }
            };
            let own: Vec<Generation> = middle.iter().enumerate().map(at).collect();
            let base = rows.base_cost(scene);
            panels.push(draw(&rows.shown(scene), runs.len(), &own, base));
            generations.extend(own);
            let ends: Vec<f64> = runs.iter().map(end).collect();
            let average = mean(random.iter().copied());
            output.paper.extend(self.compare(scene, rows, &ends, average));
        }
        let caption = "Goldsmith–Salmon cost of the best tree so far: the run whose final cost is the \
             median and, of several runs, the range. Random picking: the exact expectation for as \
             many orders, as far as so many were drawn.";
        output.add_csv("generations", &generations)?;
        output.add_figure("generations", caption, 1, panels);
        Ok(output)
    }

    /// Compares the final costs of all runs, in ascending order, with the paper's spread and gain,
    /// if the spec has them.
    fn compare(&self, scene: &str, rows: &Rows, ends: &[f64], average: f64) -> Vec<PaperRow> {
        let Some((middle, (low, high))) = median(ends).zip(range(ends.iter().copied())) else {
            return vec![];
        };
        let shown = &rows.shown(scene);
        let row = |quantity: &str| PaperRow::new(shown, quantity);
        let spread = self.paper_final.get(scene).map(|&[paper_low, paper_high]| {
            let spread = |low: f64, high: f64| 2.0 * (high - low).abs() / (high + low);
            let (paper, ours) = (spread(paper_low, paper_high), spread(low, high));
            let is_like = (ours / paper - 1.0).abs() <= 0.5;
            let verdict = if is_like { Verdict::Agrees } else { Verdict::Differs };
            let rule = "between half and one and a half times the paper's";
            row("spread of final costs over runs: (highest − lowest) / middle").compare(
                format!("{paper:.3}"),
                format!("{ours:.3}"),
                verdict,
                rule,
            )
        });
        let ours = middle / average;
        let says = self.paper_says.as_ref().map(|says| {
            let rule = "the paper gives no number";
            row(GAIN).compare(says, format!("{ours:.3}"), Verdict::NoVerdict, rule)
        });
        let interval = Some((low / average, high / average));
        let gain = self
            .paper_gain
            .map(|paper| row(GAIN).compare_ratios(paper, ours, interval, GAIN_TOLERANCE));
        let ours = middle / rows.base_cost(scene);
        let over_base = PaperRow {
            ours: format!("{ours:.3}"),
            ours_over_base: Some(ours),
            ..row("final cost over Müller–Fellner's, both Goldsmith–Salmon")
        };
        [gain, says, spread, Some(over_base)].into_iter().flatten().collect()
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

/// Draws one scene beside the cost of its greedy tree. The paper's costs are of other scenes and in
/// no unit that it names, so they are not drawn.
fn draw(shown: &str, runs: usize, generations: &[Generation], base: f64) -> Panel {
    let at = |generation: &Generation| generation.generation as f64;
    let over = |cost: f64| cost / base;
    let median: Vec<_> = generations.iter().map(|g| (at(g), over(g.median_run_cost))).collect();
    let range =
        generations.iter().map(|g| (at(g), over(g.lowest_cost), over(g.highest_cost))).collect();
    let random: Vec<_> =
        generations.iter().filter_map(|g| Some((at(g), over(g.random_picking_cost?)))).collect();
    let name = if runs > 1 { "median run" } else { "one run" };
    let mut layers = Vec::new();
    for (name, line) in [(name, median), ("random picking", random)] {
        layers.push(Layer::new(name, Marks::Line(line)));
    }
    layers.push(Layer::new("greedy", Marks::HLine(1.0)));
    // One run has no range, so it is drawn as one line.
    if runs > 1 {
        layers.push(Layer::new("range over runs", Marks::Band(range)));
    }
    panel(shown, Axis::linear("generation"), Axis::linear("cost / greedy"), layers)
}
