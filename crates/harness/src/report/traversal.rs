//! Speed of rays by tree, layout and kind of rays, and how well the trees' cost predicts it.

use super::statistics::{pearson, quantile, range, spearman};
use super::{Output, Rows, display_name, over, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::{RunRow, TraceRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Rays through trees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What it belongs to.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods.
    pub methods: Vec<String>,
}

/// Cost against tests or time over the trees of a scene in one layout, as written to `rank.csv` and `timing_rank.csv`.
#[derive(Serialize)]
struct Rank<'a> {
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
#[derive(Serialize)]
struct Speed<'a> {
    scene: &'a str,
    method: &'a str,
    layout: &'a str,
    rays: &'a str,
    cost_over_base: f64,
    ns_per_ray: f64,
    mrays_per_second: f64,
}

/// The speeds of every layout, and how well the cost ranks them.
fn reading(speeds: &[Speed], ranks: &[Rank]) -> String {
    let layouts: std::collections::BTreeSet<&str> = speeds.iter().map(|row| row.layout).collect();
    let of = |layout: &&str| {
        let own = speeds.iter().filter(|row| row.layout == *layout).map(|row| row.mrays_per_second);
        let (low, high) = range(own)?;
        Some(format!("{layout} {low:.2} to {high:.2}"))
    };
    let layouts: Vec<String> = layouts.iter().filter_map(of).collect();
    let correlation = quantile(&ranks.iter().filter_map(|rank| rank.spearman).collect::<Vec<_>>(), 0.5);
    let correlation = correlation.map_or_else(String::new, |median| {
        format!(" Rank correlation of cost and time per ray over trees: {median:.2} (median over scenes, layouts and \
                 rays).")
    });
    format!("Million rays per second: {}.{correlation}", layouts.join(", "))
}

impl Rows {
    /// Nanoseconds per ray.
    pub(super) fn ns_per_ray(&self, scene: &str, method: &str, layout: &str, rays: &str) -> Option<f64> {
        let own = self
            .trace_times
            .iter()
            .find(|row| row.scene == scene && row.method == method && row.layout == layout && row.rays == rays);
        own.filter(|row| row.count > 0).map(|row| 1e9 * row.seconds / row.count as f64)
    }

    /// The first run of a method on a scene.
    pub(super) fn first_run(&self, scene: &str, method: &str) -> Option<&RunRow> {
        self.runs.iter().find(|run| run.scene == scene && run.method == method)
    }
}

/// The distinct values of a column, in the order of the rows.
pub(super) fn distinct<'a>(rows: &'a [TraceRow], column: impl Fn(&'a TraceRow) -> &'a str) -> Vec<&'a str> {
    let mut found = Vec::new();
    for row in rows {
        if !found.contains(&column(row)) {
            found.push(column(row));
        }
    }
    found
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (layouts, kinds) =
            (distinct(&rows.traces, |row| &row.layout), distinct(&rows.traces, |row| &row.rays));
        let (mut speeds, mut ranks, mut timed_ranks) = (Vec::new(), Vec::new(), Vec::new());
        let mut panels = Vec::new();
        for (scene, scene_kind) in rows.scenes() {
            for &kind in &kinds {
                let mut layers = Vec::new();
                for &layout in &layouts {
                    let (mut boxes, mut times) = (Vec::new(), Vec::new());
                    let own = |row: &&TraceRow| row.scene == scene && row.layout == layout && row.rays == kind;
                    for trace in rows.traces.iter().filter(own).filter(|row| self.methods.contains(&row.method))
                    {
                        let Some(run) = rows.first_run(scene, &trace.method) else { continue };
                        let cost_over_base = over(run.cost, run.base_cost);
                        boxes.extend(trace.boxes_per_ray.map(|tests| (cost_over_base, tests)));
                        let Some(ns) = rows.ns_per_ray(scene, &trace.method, layout, kind) else { continue };
                        times.push((cost_over_base, ns));
                        speeds.push(Speed {
                            scene,
                            method: &trace.method,
                            layout,
                            rays: kind,
                            cost_over_base,
                            ns_per_ray: ns,
                            mrays_per_second: 1e3 / ns,
                        });
                    }
                    let rank = |measure: &'static str, pairs: &[(f64, f64)]| Rank {
                        scene,
                        layout,
                        rays: kind,
                        measure,
                        trees: pairs.len(),
                        pearson: pearson(pairs),
                        spearman: spearman(pairs),
                    };
                    ranks.push(rank("boxes_per_ray", &boxes));
                    timed_ranks.push(rank("ns_per_ray", &times));
                    layers.push(Layer::Points { name: layout.into(), points: times });
                }
                panels.push(Panel {
                    title: format!("{}: {kind}", display_name(scene, scene_kind)),
                    x: Axis::linear("cost / base"),
                    y: Axis::linear("ns per ray"),
                    layers,
                });
            }
        }
        let figure = Figure {
            title: format!("{}: {}", self.source, self.title),
            caption:
                "One point per tree; one thread, the fastest of several turns. Cost is the total area of inner nodes \
                 over that of the greedy tree."
                    .into(),
            columns: 2,
            panels,
            looks: vec![],
        };
        Ok(Output {
            csv: vec![
                ("rank".into(), to_bytes(&ranks, Path::new("rank.csv"))?),
                ("timing_rank".into(), to_bytes(&timed_ranks, Path::new("timing_rank.csv"))?),
                ("timing_speed".into(), to_bytes(&speeds, Path::new("timing_speed.csv"))?),
            ],
            figures: vec![("traversal".into(), figure)],
            paper: vec![],
            text: self.text(rows, &layouts, &kinds, &timed_ranks),
            reading: reading(&speeds, &timed_ranks),
        })
    }

    fn text(&self, rows: &Rows, layouts: &[&str], kinds: &[&str], ranks: &[Rank]) -> String {
        let header = ["scene", "method", "layout"].into_iter().chain(kinds.iter().copied());
        let mut table = text_table(header);
        for (scene, scene_kind) in rows.scenes() {
            for method in &self.methods {
                for &layout in layouts {
                    let speed = |kind: &&str| {
                        let ns = rows.ns_per_ray(scene, method, layout, kind)?;
                        let same = |row: &&TraceRow| {
                            row.scene == scene
                                && row.method == *method
                                && row.layout == layout
                                && row.rays == **kind
                        };
                        let boxes = rows.traces.iter().find(same).and_then(|row| row.boxes_per_ray);
                        let boxes = boxes.map_or_else(String::new, |boxes| format!("  ({boxes:.1} boxes)"));
                        Some(format!("{:.2}{boxes}", 1e3 / ns))
                    };
                    let speeds: Vec<String> = kinds.iter().filter_map(speed).collect();
                    if speeds.len() == kinds.len() {
                        let names = [display_name(scene, scene_kind), method.clone(), layout.into()];
                        table.add_row(names.into_iter().chain(speeds).collect::<Vec<_>>());
                    }
                }
            }
        }
        let mut correlation = text_table(["layout", "rays", "rank correlation of cost and time, by scene"]);
        for &layout in layouts {
            for &kind in kinds {
                let own = ranks.iter().filter(|rank| rank.layout == layout && rank.rays == kind);
                let show = |rank: &Rank| rank.spearman.map_or_else(|| "-".into(), |rho| format!("{rho:.2}"));
                correlation.add_row([layout, kind, &own.map(show).collect::<Vec<String>>().join("  ")]);
            }
        }
        format!(
            "{}: {}\nMillion rays per second, one thread, and boxes tested per ray:\n{table}\n{correlation}\n",
            self.source, self.title
        )
    }
}
