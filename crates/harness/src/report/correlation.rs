//! How well costs predict the tests that rays take, over many trees of one scene.

use super::statistics::{pearson, range, spearman};
use super::{Output, Rows, display_name, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::{RayRow, RunRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Costs against tests per ray.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper speaks of it.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods; every repetition is one tree.
    pub methods: Vec<String>,
}

/// One cost against one kind of rays over the trees of one set, as written to `correlation.csv`.
#[derive(Serialize)]
struct Correlation<'a> {
    scene: &'a str,
    /// `all`, or the label of the method whose trees alone are compared.
    method: &'a str,
    cost: &'a str,
    family: &'a str,
    query: &'a str,
    trees: usize,
    pearson: Option<f64>,
    spearman: Option<f64>,
}

type Cost = (&'static str, fn(&RunRow) -> f64);

/// The costs that are compared.
const COSTS: [Cost; 3] = [
    ("goldsmith_salmon", |run| run.goldsmith_salmon),
    ("cost_over_root_area", |run| run.cost_over_root_area),
    ("sah", |run| run.sah),
];

/// How well every cost ranks the trees, over scenes and kinds of rays.
fn reading(correlations: &[Correlation]) -> String {
    let of = |(cost, _): Cost| {
        let own = correlations.iter().filter(|row| row.method == "all" && row.cost == cost);
        let (low, high) = range(own.filter_map(|row| row.spearman))?;
        Some(format!("{cost} {low:.3} to {high:.3}"))
    };
    let costs: Vec<String> = COSTS.into_iter().filter_map(of).collect();
    format!("Rank correlation of box tests per ray over all trees of a scene with {}.", costs.join(", with "))
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (mut correlations, mut panels) = (Vec::new(), Vec::new());
        let mut text = text_table(["scene", "trees of", "cost", "rays", "Pearson", "Spearman"]);
        for (scene, kind) in rows.scenes() {
            let mut kinds: Vec<(&str, &str)> = Vec::new();
            for row in rows.rays.iter().filter(|row| row.scene == scene) {
                if !kinds.contains(&(row.family.as_str(), row.query.as_str())) {
                    kinds.push((&row.family, &row.query));
                }
            }
            for (family, query) in kinds {
                let trees = |method: &str| -> Vec<(&RunRow, &RayRow)> {
                    let of_kind = |row: &&RayRow| {
                        row.scene == scene && row.method == method && row.family == family && row.query == query
                    };
                    let run_of = |row: &RayRow| {
                        rows.runs.iter().find(|run| {
                            run.scene == scene && run.method == row.method && run.repetition == row.repetition
                        })
                    };
                    rows.rays.iter().filter(of_kind).filter_map(|row| Some((run_of(row)?, row))).collect()
                };
                let by_method: Vec<_> =
                    self.methods.iter().map(|method| (method.as_str(), trees(method))).collect();
                let all: Vec<_> = by_method.iter().flat_map(|(_, trees)| trees.iter().copied()).collect();
                let sets = std::iter::once(("all", all)).chain(by_method.iter().cloned());
                let mut rank = String::new();
                for (method, trees) in sets {
                    for (cost, value) in COSTS {
                        let pairs: Vec<_> =
                            trees.iter().map(|(run, row)| (value(run), row.boxes_per_ray)).collect();
                        let (pearson, spearman) = (pearson(&pairs), spearman(&pairs));
                        let show =
                            |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.4}"));
                        if method == "all" {
                            if let Some(spearman) = spearman.filter(|_| cost == COSTS[0].0) {
                                rank = format!(", ρ = {spearman:.3}");
                            }
                            let rays = format!("{family}, {query}");
                            text.add_row([
                                &rows.shown(scene),
                                method,
                                cost,
                                &rays,
                                &show(pearson),
                                &show(spearman),
                            ]);
                        }
                        let trees = pairs.len();
                        correlations.push(Correlation {
                            scene,
                            method,
                            cost,
                            family,
                            query,
                            trees,
                            pearson,
                            spearman,
                        });
                    }
                }
                let layers = by_method.iter().map(|(method, trees)| Layer::Points {
                    name: (*method).to_owned(),
                    points: trees.iter().map(|(run, row)| (run.goldsmith_salmon, row.boxes_per_ray)).collect(),
                });
                panels.push(Panel {
                    title: format!("{}: {family}, {query}{rank}", display_name(scene, kind)),
                    x: Axis::linear("Goldsmith–Salmon cost"),
                    y: Axis::linear("box tests per ray"),
                    layers: layers.collect(),
                });
            }
        }
        let caption = "One point per tree, the same rays for all. ρ is Spearman's rank correlation.".into();
        let title = format!("{}: {}", self.source, self.title);
        Ok(Output {
            csv: vec![("correlation".into(), to_bytes(&correlations, Path::new("correlation.csv"))?)],
            figures: vec![("correlation".into(), Figure { title, caption, columns: 2, panels, looks: vec![] })],
            paper: vec![],
            text: format!("{}: {}\n{text}\n", self.source, self.title),
            reading: reading(&correlations),
        })
    }
}
