//! How well costs predict the tests that rays take, over many trees of one scene.

use super::config::Methods;
use super::data::distinct;
use super::metric::Metric;
use super::prelude::*;
use crate::run::rows::{RunRow, RunTestRow, VisitRow};
use crate::statistics::{pearson, spearman};

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

/// A tree, and the tests per ray of one kind in it.
type Tree<'a> = (&'a RunRow, f64);

/// A cost: its name in the table, and its value for the tree of a run.
type Cost<'a> = (String, Box<dyn Fn(&RunRow) -> Option<f64> + 'a>);

/// The costs by area, and the one by the density of each kind of rays.
fn costs(rows: &Rows) -> Vec<Cost<'_>> {
    let of_area =
        Metric::COSTS.map(|cost| -> Cost { (cost.column().into(), Box::new(move |run| cost.of_run(run))) });
    let of_rays = |rays| -> Cost {
        let own = move |run: &RunRow, row: &VisitRow| {
            (&row.scene, &row.method, row.repetition) == (&run.scene, &run.method, run.repetition)
                && row.rays == rays
        };
        let of = move |run: &RunRow| Some(rows.visits.iter().find(|row| own(run, row))?.goldsmith_salmon);
        (format!("goldsmith_salmon_{rays}"), Box::new(of))
    };
    let rays = distinct(rows.visits.iter().map(|row| row.rays.as_str()));
    of_area.into_iter().chain(rays.into_iter().map(of_rays)).collect()
}

pub(super) fn write(config: &Methods, rows: &Rows) -> Result<Output, Error> {
    let (mut correlations, mut panels, costs) = (Vec::new(), Vec::new(), costs(rows));
    let of_layouts = distinct(rows.run_tests.iter().map(|row| (row.judged_on.as_str(), row.camera.as_str())));
    let random = rows.ray_kinds().len();
    for scene in rows.scenes() {
        for (number, kind) in rows.ray_kinds().into_iter().chain(of_layouts.clone()).enumerate() {
            let methods =
                config.methods.iter().map(|method| (method.as_str(), trees(rows, scene, method, kind)));
            let methods: Vec<(&str, Vec<Tree>)> = methods.collect();
            let all = methods.iter().flat_map(|(_, trees)| trees.iter().copied()).collect();
            let start = correlations.len();
            for (method, trees) in [(ALL, all)].iter().chain(&methods) {
                correlations.extend(costs.iter().map(|cost| correlate(scene, method, kind, cost, trees)));
            }
            if number < random {
                panels.push(draw(&rows.shown(scene), kind, &methods, correlations[start].spearman));
            }
        }
    }
    let mut output = Output::new(&config.source, &config.title);
    output.add_csv("correlation", &correlations)?;
    let caption = "One point per tree, the same rays for all. ρ is Spearman's rank correlation.";
    output.add_figure("correlation", caption, 2, panels);
    let over_all: Vec<&Correlation> = correlations.iter().filter(|row| row.method == ALL).collect();
    let columns = "scene trees cost family query pearson spearman";
    output.show("Correlation of costs and tests per ray over all trees of a scene:", &over_all, columns)?;
    output.reading = reading(&over_all, &costs);
    Ok(output)
}

/// The method's trees through which rays of the kind were sent: random ones through the binary tree, others through its wide layout.
fn trees<'a>(rows: &'a Rows, scene: &str, method: &str, kind: (&str, &str)) -> Vec<Tree<'a>> {
    let random = rows.rays_of(scene, method, kind).into_iter().map(|row| (row.repetition, row.boxes_per_ray));
    let own = |row: &&RunTestRow| {
        row.scene == scene && row.method == method && (row.judged_on.as_str(), row.camera.as_str()) == kind
    };
    let of_layouts = rows.run_tests.iter().filter(own).map(|row| (row.repetition, row.tests));
    let run = |repetition| rows.runs_of(scene, method).find(|run| run.repetition == repetition);
    random.chain(of_layouts).filter_map(|(repetition, tests)| Some((run(repetition)?, tests))).collect()
}

fn correlate<'a>(
    scene: &'a str,
    method: &'a str,
    (family, query): (&'a str, &'a str),
    (cost, of): &'a Cost,
    trees: &[Tree],
) -> Correlation<'a> {
    let pair = |(run, tests): &Tree| Some((of(run)?, *tests));
    let pairs: Vec<(f64, f64)> = trees.iter().filter_map(pair).collect();
    let (pearson, spearman) = (pearson(&pairs), spearman(&pairs));
    Correlation { scene, method, cost, family, query, trees: pairs.len(), pearson, spearman }
}

fn draw(scene: &str, (family, query): (&str, &str), methods: &[(&str, Vec<Tree>)], rank: Option<f64>) -> Panel {
    let points = |(method, trees): &(&str, Vec<Tree>)| {
        let points = trees.iter().map(|(run, tests)| (run.goldsmith_salmon, *tests));
        Layer::new(*method, Marks::Points(points.collect()))
    };
    let rank = rank.map_or_else(String::new, |rank| format!(", ρ = {rank:.3}"));
    let (x, y) = (Metric::GoldsmithSalmon.axis(), Metric::BoxesPerRay.axis());
    panel(format!("{scene}: {family}, {query}{rank}"), x, y, methods.iter().map(points).collect())
}

/// How well every cost ranks the trees, over scenes and kinds of rays.
fn reading(over_all: &[&Correlation], costs: &[Cost]) -> String {
    let costs = costs.iter().map(|(cost, _)| cost.as_str());
    let costs = spans(costs, over_all, |row| row.cost, |row| row.spearman, 3);
    format!("Rank correlation of tests per ray over all trees of a scene: with {costs}.")
}
