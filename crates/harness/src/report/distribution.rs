//! How the costs of independent trials are distributed.

use super::statistics::quantile;
use super::{Output, Rows, display_name, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The distribution of costs over trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper speaks of it.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods, whose trials are pooled over repetitions.
    pub methods: Vec<String>,
}

/// One method on one scene, as written to `distribution.csv`.
#[derive(Serialize)]
struct Summary<'a> {
    scene: &'a str,
    method: &'a str,
    trials: usize,
    lowest_cost: f64,
    quartile_1_cost: f64,
    median_cost: f64,
    quartile_3_cost: f64,
    highest_cost: f64,
    mean_cost: f64,
    /// Standard deviation over mean.
    relative_deviation: f64,
    /// The greedy Müller–Fellner tree's, under the same objective.
    base_cost: f64,
}

/// How far the trials reach.
fn reading(summaries: &[Summary]) -> String {
    let of = |row: &Summary| {
        let Summary { scene, method, lowest_cost, median_cost, base_cost, .. } = row;
        let (lowest, median) = (lowest_cost / base_cost, median_cost / base_cost);
        format!("{scene}, {method}: the median is {median:.3} of Müller–Fellner's cost, the lowest {lowest:.3}")
    };
    summaries.iter().map(of).collect::<Vec<_>>().join("; ") + "."
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (mut summaries, mut panels) = (Vec::new(), Vec::new());
        let mut text =
            text_table(["scene", "method", "lowest", "median", "highest", "deviation / mean", "base"]);
        for (scene, kind) in rows.scenes() {
            let (shown, base_cost) = (display_name(scene, kind), rows.base_cost(scene));
            let mut layers = Vec::new();
            for method in &self.methods {
                let mut costs: Vec<f64> =
                    rows.histories(scene, method).concat().iter().map(|row| row.cost).collect();
                costs.sort_by(f64::total_cmp);
                let (n, at) = (costs.len() as f64, |q| quantile(&costs, q).unwrap_or(f64::NAN));
                let mean_cost = costs.iter().sum::<f64>() / n;
                let variance = costs.iter().map(|cost| (cost - mean_cost).powi(2)).sum::<f64>() / (n - 1.0);
                let relative_deviation = variance.sqrt() / mean_cost;
                text.add_row([
                    shown.clone(),
                    method.clone(),
                    format!("{:.3}", at(0.0)),
                    format!("{:.3}", at(0.5)),
                    format!("{:.3}", at(1.0)),
                    format!("{relative_deviation:.4}"),
                    format!("{base_cost:.3}"),
                ]);
                summaries.push(Summary {
                    scene,
                    method,
                    trials: costs.len(),
                    lowest_cost: at(0.0),
                    quartile_1_cost: at(0.25),
                    median_cost: at(0.5),
                    quartile_3_cost: at(0.75),
                    highest_cost: at(1.0),
                    mean_cost,
                    relative_deviation,
                    base_cost,
                });
                let steps = costs.iter().zip(1..).map(|(&cost, rank)| (cost, f64::from(rank) / n)).collect();
                layers.push(Layer::Steps { name: method.clone(), points: steps });
            }
            layers.push(Layer::VLine { x: base_cost, label: "Müller–Fellner".into() });
            let y = Axis::linear("fraction of trials at most as costly").range(0.0, 1.0);
            panels.push(Panel { title: shown, x: Axis::linear("cost"), y, layers });
        }
        let caption = "Every trial of every repetition.".into();
        let title = format!("{}: {}", self.source, self.title);
        Ok(Output {
            csv: vec![("distribution".into(), to_bytes(&summaries, Path::new("distribution.csv"))?)],
            figures: vec![(
                "distribution".into(),
                Figure { title, caption, columns: 2, panels, looks: vec![] },
            )],
            paper: vec![],
            text: format!("{}: {}\n{text}\n", self.source, self.title),
            reading: reading(&summaries),
        })
    }
}
