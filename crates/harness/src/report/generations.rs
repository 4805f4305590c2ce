//! The paper's Figures 2 to 4: cost against generation, the median run and the range of all, with random picking.

use super::statistics::{expected_best_of, median};
use super::{Output, Rows, display_name};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Look, Panel};
use crate::run::rows::{PaperRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Cost against generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper has it, such as `Figure 2`.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Label of the genetic algorithm.
    pub method: String,
    /// Label of the random picking of orders that it is compared with.
    pub baseline: String,
    /// The paper's lowest and highest final cost over runs, by scene.
    #[serde(default)]
    pub paper_final: BTreeMap<String, [f64; 2]>,
    /// The paper's final cost over that of the average order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paper_gain: Option<f64>,
    /// The generation after which the paper still sees some improvement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paper_improves_after: Option<usize>,
    /// Why ours differs, where it does.
    #[serde(default)]
    pub reason: String,
}

/// One generation, as written to `generations.csv`.
#[derive(Serialize)]
struct Generation<'a> {
    scene: &'a str,
    generation: usize,
    /// Lowest cost so far in the run whose final cost is the median.
    median_run_cost: f64,
    /// Over all runs.
    lowest_cost: f64,
    highest_cost: f64,
    /// Expected lowest cost of as many random orders as one run has evaluated.
    random_picking_cost: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        let (mut generations, mut panels) = (Vec::new(), Vec::new());
        for (scene, kind) in rows.scenes() {
            let runs = rows.histories(scene, &self.method);
            let Some(middle) = middle_run(&runs) else { continue };
            let pool: Vec<f64> =
                rows.histories(scene, &self.baseline).concat().iter().map(|row| row.cost).collect();
            let start = generations.len();
            for (generation, row) in runs[middle].iter().enumerate() {
                let costs = || runs.iter().filter_map(|run| run.get(generation)).map(|row| row.incumbent);
                generations.push(Generation {
                    scene,
                    generation,
                    median_run_cost: row.incumbent,
                    lowest_cost: costs().fold(f64::INFINITY, f64::min),
                    highest_cost: costs().fold(f64::NEG_INFINITY, f64::max),
                    random_picking_cost: expected_best_of(&pool, row.evaluations as usize),
                });
            }
            let shown = display_name(scene, kind);
            panels.push(self.panel(scene, &shown, &generations[start..]));
            self.compare(scene, &shown, rows, &runs, &pool, &mut output);
        }
        let caption =
            "Goldsmith–Salmon cost of the best tree so far: the run whose final cost is the median, and the \
                       range of all runs. Random picking: the exact expectation for as many orders."
                .into();
        let title = format!("{}: {}", self.source, self.title);
        let looks = vec![(PAPER.into(), Look::Reference)];
        output.figures.push(("generations".into(), Figure { title, caption, columns: 1, panels, looks }));
        output.csv.push(("generations".into(), to_bytes(&generations, Path::new("generations.csv"))?));
        Ok(output)
    }

    fn panel(&self, scene: &str, shown: &str, generations: &[Generation]) -> Panel {
        let at = |generation: &Generation| generation.generation as f64;
        let median: Vec<_> = generations.iter().map(|g| (at(g), g.median_run_cost)).collect();
        let range = generations.iter().map(|g| (at(g), g.lowest_cost, g.highest_cost)).collect();
        let random = generations.iter().filter_map(|g| Some((at(g), g.random_picking_cost?))).collect();
        let mut layers = vec![
            Layer::Band { name: "range over runs".into(), points: range },
            Layer::Line { name: "median run".into(), points: median },
            Layer::Line { name: "random picking".into(), points: random },
        ];
        if let (Some([low, high]), Some(last)) = (self.paper_final.get(scene), generations.last()) {
            let points = vec![(at(last), *low, (low + high) / 2.0, *high)];
            layers.push(Layer::ErrorBars { name: PAPER.into(), points });
        }
        let y = Axis::linear("cost (Goldsmith–Salmon)");
        Panel { title: shown.into(), x: Axis::linear("generation"), y, layers }
    }

    fn compare(
        &self,
        scene: &str,
        shown: &str,
        rows: &Rows,
        runs: &[Vec<&crate::run::rows::HistoryRow>],
        pool: &[f64],
        output: &mut Output,
    ) {
        let finals: Vec<f64> = runs.iter().filter_map(|run| Some(run.last()?.incumbent)).collect();
        let (Some(middle), base) = (median(&finals), rows.base_cost(scene)) else { return };
        let low = finals.iter().copied().fold(f64::INFINITY, f64::min);
        let high = finals.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let average = pool.iter().sum::<f64>() / pool.len() as f64;
        output.text += &format!(
            "{}: {}\n{shown}: final cost {middle:.2} ({low:.2} to {high:.2} over {} runs), {:.3} of the average \
             order's {average:.2}, {:.3} of Müller–Fellner's {base:.2}\n\n",
            self.source,
            self.title,
            finals.len(),
            middle / average,
            middle / base,
        );
        output.reading += &format!(
            "{shown}: {:.3} of the average order's cost, {:.3} of Müller–Fellner's, over {} runs. ",
            middle / average,
            middle / base,
            finals.len()
        );
        let row = |quantity: &str, paper: String, ours: String, verdict: &str| PaperRow {
            source: self.source.clone(),
            scene: shown.into(),
            quantity: quantity.into(),
            paper,
            ours,
            paper_over_base: None,
            ours_over_base: None,
            verdict: verdict.into(),
            reason: self.reason.clone(),
        };
        if let Some(&[paper_low, paper_high]) = self.paper_final.get(scene) {
            let spread = |low: f64, high: f64| 2.0 * (high - low) / (high + low);
            let (theirs, ours) = (spread(paper_low, paper_high), spread(low, high));
            let verdict = if ours > theirs { "wider" } else { "narrower" };
            output.paper.push(row(
                "final costs over runs, lowest to highest, and (highest − lowest) / middle",
                format!("{paper_low} to {paper_high}, {theirs:.3}"),
                format!("{low:.2} to {high:.2}, {ours:.3}"),
                verdict,
            ));
        }
        if let Some(gain) = self.paper_gain {
            let ours = middle / average;
            output.paper.push(PaperRow {
                paper_over_base: Some(gain),
                ours_over_base: Some(ours),
                ..row(
                    "median final cost over the average order's",
                    format!("{gain:.3}"),
                    format!("{ours:.3}"),
                    &super::verdict(gain, ours, 0.05),
                )
            });
        }
        if let Some(after) = self.paper_improves_after
            && let Some(before) = middle_run(runs).and_then(|run| runs[run].get(after))
        {
            let ratio = middle / before.incumbent;
            output.paper.push(PaperRow {
                ours_over_base: Some(ratio),
                ..row(
                    &format!("final cost over that of generation {after}"),
                    "some improvement".into(),
                    format!("{ratio:.4}"),
                    if ratio < 1.0 { "agrees" } else { "differs" },
                )
            });
        }
        output.paper.push(PaperRow {
            ours_over_base: Some(middle / base),
            ..row(
                "median final cost over Müller–Fellner's, both Goldsmith–Salmon",
                String::new(),
                format!("{:.3}", middle / base),
                "not in the paper by cost",
            )
        });
    }
}

const PAPER: &str = "paper, range of final costs over runs";

/// The run whose final cost is the median, the lower of two.
fn middle_run(runs: &[Vec<&crate::run::rows::HistoryRow>]) -> Option<usize> {
    let mut order: Vec<usize> = (0..runs.len()).filter(|&run| !runs[run].is_empty()).collect();
    let last = |run: usize| runs[run].last().map_or(f64::INFINITY, |row| row.incumbent);
    order.sort_by(|&a, &b| last(a).total_cmp(&last(b)));
    order.get(order.len().checked_sub(1)? / 2).copied()
}
