//! Other libraries beside ours: build time, cost by our module, speed by their fastest layout, disagreements.

use super::statistics::{minimum, range};
use super::traversal::distinct;
use super::{Output, Rows, display_name, over, text_table};
use crate::Error;
use crate::run::rows::{TraceRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A comparison with other libraries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What it belongs to.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods.
    pub methods: Vec<String>,
    /// Label of the method whose fastest layout is 1.
    pub ours: String,
}

/// A method on a scene with rays of one kind, as written to `timing_peers.csv`.
#[derive(Serialize)]
struct Comparison<'a> {
    scene: &'a str,
    method: &'a str,
    rays: &'a str,
    /// The fastest repetition.
    build_seconds: f64,
    cost_over_base: f64,
    /// The method's fastest layout for these rays.
    layout: &'a str,
    mrays_per_second: f64,
    /// Our speed over this method's.
    ours_over_this: f64,
    rays_traced: u64,
    missed_hits: u64,
    false_hits: u64,
    other_hits: u64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let kinds = distinct(&rows.traces, |row| &row.rays);
        let mut comparisons = Vec::new();
        for (scene, _) in rows.scenes() {
            for method in &self.methods {
                comparisons.extend(kinds.iter().filter_map(|&kind| self.compare(rows, scene, method, kind)));
            }
        }
        Ok(Output {
            csv: vec![("timing_peers".into(), to_bytes(&comparisons, Path::new("timing_peers.csv"))?)],
            text: self.text(rows, &comparisons, &kinds),
            reading: self.reading(&comparisons),
            ..Output::default()
        })
    }

    fn reading(&self, comparisons: &[Comparison]) -> String {
        let of = |method: &String| {
            let own = || comparisons.iter().filter(|row| row.method == method && row.method != self.ours);
            let (low, high) = range(own().map(|row| row.ours_over_this))?;
            let wrong: u64 = own().map(|row| row.missed_hits + row.false_hits + row.other_hits).sum();
            Some(format!("{method} {low:.2} to {high:.2} ({wrong} rays answered otherwise)"))
        };
        let ratios: Vec<String> = self.methods.iter().filter_map(of).collect();
        format!("Our rays per second over those of {}.", ratios.join(", "))
    }

    fn compare<'a>(
        &'a self,
        rows: &'a Rows,
        scene: &'a str,
        method: &'a str,
        kind: &'a str,
    ) -> Option<Comparison<'a>> {
        let (layout, ns) = fastest(rows, scene, method, kind)?;
        let (_, our_ns) = fastest(rows, scene, &self.ours, kind)?;
        let run = rows.first_run(scene, method)?;
        let own = |row: &&TraceRow| {
            row.scene == scene && row.method == method && row.layout == layout && row.rays == kind
        };
        let trace = rows.traces.iter().find(own)?;
        Some(Comparison {
            scene,
            method,
            rays: kind,
            build_seconds: build_seconds(rows, scene, method)?,
            cost_over_base: over(run.cost, run.base_cost),
            layout,
            mrays_per_second: 1e3 / ns,
            ours_over_this: ns / our_ns,
            rays_traced: trace.count,
            missed_hits: trace.missed_hits,
            false_hits: trace.false_hits,
            other_hits: trace.other_hits,
        })
    }

    fn text(&self, rows: &Rows, comparisons: &[Comparison], kinds: &[&str]) -> String {
        let columns = ["scene", "method", "build (ms)", "cost / base"].map(str::to_owned).into_iter();
        let columns: Vec<String> = columns
            .chain(kinds.iter().map(|kind| format!("{kind}: Mrays/s (ours is so many times faster)")))
            .chain(["wrong hits".to_owned()])
            .collect();
        let mut table = text_table(columns.iter().map(String::as_str));
        for (scene, scene_kind) in rows.scenes() {
            for method in &self.methods {
                let own: Vec<_> =
                    comparisons.iter().filter(|row| row.scene == scene && row.method == *method).collect();
                let Some(first) = own.first() else { continue };
                let mut cells = vec![
                    display_name(scene, scene_kind),
                    method.clone(),
                    format!("{:.1}", 1e3 * first.build_seconds),
                    format!("{:.3}", first.cost_over_base),
                ];
                let speed =
                    |row: &&Comparison| format!("{:.2}  ({:.2})", row.mrays_per_second, row.ours_over_this);
                cells.extend(own.iter().map(speed));
                let wrong = own.iter().map(|row| row.missed_hits + row.false_hits + row.other_hits);
                cells.push(wrong.sum::<u64>().to_string());
                table.add_row(cells);
            }
        }
        format!("{}: {}\nEach by its fastest layout, one thread:\n{table}\n", self.source, self.title)
    }
}

/// The method's layout that is fastest for these rays, with its nanoseconds per ray.
pub(super) fn fastest<'a>(rows: &'a Rows, scene: &str, method: &str, kind: &str) -> Option<(&'a str, f64)> {
    let layouts = distinct(&rows.traces, |row| &row.layout).into_iter();
    let timed = layouts.filter_map(|layout| Some((layout, rows.ns_per_ray(scene, method, layout, kind)?)));
    timed.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The seconds of the method's fastest repetition.
pub(super) fn build_seconds(rows: &Rows, scene: &str, method: &str) -> Option<f64> {
    minimum(rows.seconds_of(scene, method))
}
