//! Speed of rays by tree, layout and kind of rays, and how well the trees' cost predicts it.

use super::config::Methods;
use super::metric::Metric;
use super::prelude::*;
use crate::rows::TraceRow;
use crate::statistics::{median, pearson, spearman};
use std::collections::BTreeSet;

/// Cost against tests or time over the trees of a scene in one layout, as written to `rank.csv` and `timing_rank.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Rank<'a> {
    scene: &'a str,
    layout: &'a str,
    rays: &'a str,
    /// What the cost is compared with.
    measure: &'a str,
    trees: usize,
    pearson: Option<f64>,
    spearman: Option<f64>,
}

/// A speed, as written to `timing_speed.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Speed<'a> {
    scene: &'a str,
    method: &'a str,
    layout: &'a str,
    rays: &'a str,
    cost_over_base: f64,
    ns_per_ray: f64,
    mrays_per_second: f64,
}

/// A scene, a layout and a kind of rays.
type Setting<'a> = [&'a str; 3];

pub(super) fn write(config: &Methods, rows: &Rows) -> Result<Output, Error> {
    let mut speeds = Vec::new();
    let mut ranks = Vec::new();
    let mut timed_ranks = Vec::new();
    let mut panels = Vec::new();
    for scene in rows.scenes() {
        for kind in rows.traced_kinds() {
            let mut layers = Vec::new();
            for layout in rows.layouts() {
                let setting = [scene, layout, kind];
                ranks.push(rank(setting, Metric::BoxesPerRay, &box_tests(config, rows, setting)));
                let own = speeds_in(config, rows, setting);
                let points: Vec<_> = own
                    .iter()
                    .map(|speed| (speed.cost_over_base, speed.ns_per_ray))
                    .collect();
                timed_ranks.push(rank(setting, Metric::NsPerRay, &points));
                let mut line = points.clone();
                line.sort_by(|a, b| a.0.total_cmp(&b.0));
                layers.push(Layer::new(layout, Marks::Line(line)));
                layers.push(Layer::new(layout, Marks::Points(points)));
                speeds.extend(own);
            }
            let title = format!("{}: {kind}", rows.shown(scene));
            panels.push(panel(title, Metric::CostOverBase.axis(), Metric::NsPerRay.axis(), layers));
        }
    }
    let mut output = Output::new(&config.source, &config.title);
    output.add_csv("rank", &ranks)?;
    output.add_csv("timing_rank", &timed_ranks)?;
    output.add_csv("timing_speed", &speeds)?;
    let caption = "One point per tree, those of a layout joined; one thread, the fastest of several turns. Cost is the \
                   total area of inner nodes over that of the greedy tree, which is too low for trees whose nodes have \
                   more than two children, as Goldsmith–Salmon's.";
    output.add_figure("timing_traversal", caption, 2, panels);
    let columns = "scene method layout rays cost_over_base mrays_per_second";
    output.show("Million rays per second on one thread:", &speeds, columns)?;
    let columns = "scene layout rays trees spearman";
    output.show("Rank correlation of cost and time per ray over trees:", &timed_ranks, columns)?;
    output.reading = reading(&speeds, &timed_ranks);
    Ok(output)
}

/// The methods' measurements in a setting, with the trees' costs over base.
fn traces<'a>(
    config: &Methods,
    rows: &'a Rows,
    [scene, layout, kind]: Setting<'a>,
) -> impl Iterator<Item = (f64, &'a TraceRow)> {
    let own = move |row: &&TraceRow| row.scene == scene && row.layout == layout && row.rays == kind;
    let traces = rows
        .traces
        .iter()
        .filter(own)
        .filter(|row| config.methods.contains(&row.method));
    traces.filter_map(move |row| {
        Some((Metric::CostOverBase.of_run(rows.runs_of(scene, &row.method).next()?)?, row))
    })
}

fn box_tests(config: &Methods, rows: &Rows, setting: Setting) -> Vec<(f64, f64)> {
    traces(config, rows, setting)
        .filter_map(|(cost, row)| Some((cost, row.boxes_per_ray?)))
        .collect()
}

fn speeds_in<'a>(config: &Methods, rows: &'a Rows, setting: Setting<'a>) -> Vec<Speed<'a>> {
    let [scene, layout, rays] = setting;
    let speed = |(cost_over_base, row): (f64, &'a TraceRow)| {
        let ns_per_ray = rows.ns_per_ray(scene, &row.method, layout, rays)?;
        let method = row.method.as_str();
        let mrays_per_second = 1e3 / ns_per_ray;
        Some(Speed { scene, method, layout, rays, cost_over_base, ns_per_ray, mrays_per_second })
    };
    traces(config, rows, setting)
        .filter_map(speed)
        .collect()
}

fn rank<'a>([scene, layout, rays]: Setting<'a>, measure: Metric, pairs: &[(f64, f64)]) -> Rank<'a> {
    let pearson = pearson(pairs);
    let spearman = spearman(pairs);
    Rank { scene, layout, rays, measure: measure.column(), trees: pairs.len(), pearson, spearman }
}

/// The speeds of every layout, and how well the cost ranks them.
fn reading(speeds: &[Speed], ranks: &[Rank]) -> String {
    let layouts: BTreeSet<&str> = speeds.iter().map(|row| row.layout).collect();
    let layouts = spans(layouts, speeds, |row| row.layout, |row| Some(row.mrays_per_second), 2);
    let correlation = median(
        &ranks
            .iter()
            .filter_map(|rank| rank.spearman)
            .collect::<Vec<_>>(),
    );
    let correlation = correlation.map_or_else(String::new, |median| {
        format!(" Rank correlation of cost and time per ray over trees: {median:.2} (median over scenes, layouts and \
                 rays).")
    });
    format!("Million rays per second: {layouts}.{correlation}")
}
