//! How well costs predict the tests that random rays take, over many trees of one scene.

use super::config::Methods;
use super::data::Rows;
use super::metric::Metric;
use super::output::{Output, each, panel};
use crate::Error;
use crate::figures::{Layer, Panel};
use crate::run::rows::{RayRow, RunRow};
use crate::statistics::{pearson, range, spearman};
use schemars::JsonSchema;
use serde::Serialize;

/// One cost against one kind of rays over the trees of one set, as written to `correlation.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Correlation<'a> {
    scene: &'a str,
    /// `all`, or the label of the method whose trees alone are compared.
    method: &'a str,
    /// Which cost.
    cost: &'a str,
    family: &'a str,
    query: &'a str,
    trees: usize,
    pearson: Option<f64>,
    spearman: Option<f64>,
}

const ALL: &str = "all";

/// A tree's costs, and the tests that rays took in it.
type Tree<'a> = (&'a RunRow, &'a RayRow);

pub(super) fn write(config: &Methods, rows: &Rows) -> Result<Output, Error> {
    let (mut correlations, mut panels) = (Vec::new(), Vec::new());
    for scene in rows.scenes() {
        for kind in rows.ray_kinds() {
            let methods =
                config.methods.iter().map(|method| (method.as_str(), trees(rows, scene, method, kind)));
            let methods: Vec<(&str, Vec<Tree>)> = methods.collect();
            let all = methods.iter().flat_map(|(_, trees)| trees.iter().copied()).collect();
            let start = correlations.len();
            for (method, trees) in [(ALL, all)].iter().chain(&methods) {
                correlations.extend(Metric::COSTS.map(|cost| correlate(scene, method, kind, cost, trees)));
            }
            panels.push(draw(&rows.shown(scene), kind, &methods, correlations[start].spearman));
        }
    }
    let mut output = Output::new(&config.source, &config.title);
    output.add_csv("correlation", &correlations)?;
    let caption = "One point per tree, the same rays for all. ρ is Spearman's rank correlation.";
    output.add_figure("correlation", caption, 2, panels);
    let over_all: Vec<&Correlation> = correlations.iter().filter(|row| row.method == ALL).collect();
    let columns = ["scene", "trees", "cost", "family", "query", "pearson", "spearman"];
    output.show(
        "Correlation of costs and box tests per ray over all trees of a scene:",
        &over_all,
        &columns,
    )?;
    output.reading = reading(&over_all);
    Ok(output)
}

/// The method's trees through which rays of the kind were sent.
fn trees<'a>(rows: &'a Rows, scene: &str, method: &str, kind: (&str, &str)) -> Vec<Tree<'a>> {
    let run_of = |row: &'a RayRow| {
        Some((rows.runs_of(scene, method).find(|run| run.repetition == row.repetition)?, row))
    };
    rows.rays_of(scene, method, kind).into_iter().filter_map(run_of).collect()
}

fn correlate<'a>(
    scene: &'a str,
    method: &'a str,
    (family, query): (&'a str, &'a str),
    cost: Metric,
    trees: &[Tree],
) -> Correlation<'a> {
    let pair = |(run, row): &Tree| Some((cost.of_run(run)?, row.boxes_per_ray));
    let pairs: Vec<(f64, f64)> = trees.iter().filter_map(pair).collect();
    let (pearson, spearman) = (pearson(&pairs), spearman(&pairs));
    Correlation { scene, method, cost: cost.column(), family, query, trees: pairs.len(), pearson, spearman }
}

fn draw(scene: &str, (family, query): (&str, &str), methods: &[(&str, Vec<Tree>)], rank: Option<f64>) -> Panel {
    let points = |(method, trees): &(&str, Vec<Tree>)| Layer::Points {
        name: (*method).to_owned(),
        points: trees.iter().map(|(run, row)| (run.goldsmith_salmon, row.boxes_per_ray)).collect(),
    };
    let rank = rank.map_or_else(String::new, |rank| format!(", ρ = {rank:.3}"));
    let (x, y) = (Metric::GoldsmithSalmon.axis(), Metric::BoxesPerRay.axis());
    panel(format!("{scene}: {family}, {query}{rank}"), x, y, methods.iter().map(points).collect())
}

/// How well every cost ranks the trees, over scenes and kinds of rays.
fn reading(over_all: &[&Correlation]) -> String {
    let costs = each(Metric::COSTS.map(Metric::column), |cost| {
        let own = over_all.iter().filter(|row| row.cost == cost);
        let (low, high) = range(own.filter_map(|row| row.spearman))?;
        Some(format!("{cost} {low:.3} to {high:.3}"))
    });
    format!("Rank correlation of box tests per ray over all trees of a scene: with {costs}.")
}
