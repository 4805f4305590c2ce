//! Error against run time, and against work: the gap of the incumbent, over seconds and over nodes visited.

use super::statistics::quantile;
use super::{Output, Rows, display_name, text_table};
use crate::Error;
use crate::chart::{Axis, Figure, Layer, Panel};
use crate::record::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Error against run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What it belongs to.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods. One event per run, as a builder has, is shown as a point.
    pub methods: Vec<String>,
    /// Seconds at which the table for the terminal reads the curves. Default 0.1, 1 and 10.
    #[serde(default = "decades")]
    pub at_seconds: Vec<f64>,
}

fn decades() -> Vec<f64> {
    vec![0.1, 1.0, 10.0]
}

/// One point of a curve, as written to `timing_anytime.csv` and `anytime_work.csv`.
#[derive(Serialize)]
struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    /// Seconds, or nodes made or visited, as the file's name says.
    x: f64,
    /// The gap to the lowest cost of this experiment on this scene, over repetitions.
    gap_quartile_1: f64,
    gap_median: f64,
    gap_quartile_3: f64,
}

/// A run's incumbents: when, or after how much work, and how costly.
type Series = Vec<(f64, f64)>;

/// Points per factor of ten along a curve.
const PER_DECADE: f64 = 20.0;

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        let mut text = text_table(
            ["scene", "method"]
                .into_iter()
                .map(str::to_owned)
                .chain(self.at_seconds.iter().map(|s| format!("{s} s")))
                .collect::<Vec<_>>()
                .iter()
                .map(String::as_str),
        );
        for (name, label, by_seconds) in
            [("timing_anytime", "time (s)", true), ("anytime_work", "nodes made or visited", false)]
        {
            let (mut points, mut panels) = (Vec::new(), Vec::new());
            for (scene, kind) in rows.scenes() {
                let lowest = rows.history.iter().filter(|row| row.scene == scene).map(|row| row.incumbent);
                let reference = lowest.fold(f64::INFINITY, f64::min);
                let mut layers = Vec::new();
                for method in &self.methods {
                    let runs = series(rows, scene, method, by_seconds);
                    let start = points.len();
                    points.extend(curve(scene, method, &runs, reference));
                    layers.extend(draw(method, &points[start..]));
                    if by_seconds {
                        let base = rows.base_cost(scene);
                        let cell = |&at: &f64| {
                            quantile(&incumbents(&runs, at), 0.5).map_or_else(String::new, |cost| {
                                format!("{:+.2} %", 100.0 * (cost / base - 1.0))
                            })
                        };
                        let name = [display_name(scene, kind), method.clone()];
                        text.add_row(
                            name.into_iter().chain(self.at_seconds.iter().map(cell)).collect::<Vec<_>>(),
                        );
                    }
                }
                let y = Axis::log("gap to the best found");
                panels.push(Panel { title: display_name(scene, kind), x: Axis::log(label), y, layers });
            }
            let title = format!("{}: {}", self.source, self.title);
            let caption = "Cost of the incumbent over the lowest cost of this experiment, minus 1: median and quartiles over \
                           repetitions. A curve ends where it is the best found."
                .into();
            output.figures.push((name.into(), Figure { title, caption, columns: 2, panels, looks: vec![] }));
            output.csv.push((name.into(), to_bytes(&points, Path::new(name))?));
        }
        output.text = format!(
            "{}: {}\nMedian cost against the greedy tree's, after so many seconds:\n{text}\n",
            self.source, self.title
        );
        Ok(output)
    }
}

/// The incumbents of every run of a method on a scene.
fn series(rows: &Rows, scene: &str, method: &str, by_seconds: bool) -> Vec<Series> {
    let own: Vec<(u32, (f64, f64))> = rows
        .history
        .iter()
        .enumerate()
        .filter(|(_, row)| row.scene == scene && row.method == method)
        .map(|(at, row)| {
            let seconds = rows.clock.get(at).map_or(f64::NAN, |clock| clock.seconds);
            (row.repetition, (if by_seconds { seconds } else { row.work as f64 }, row.incumbent))
        })
        .collect();
    own.chunk_by(|a, b| a.0 == b.0).map(|run| run.iter().map(|(_, point)| *point).collect()).collect()
}

/// What the runs that have an incumbent by then have it cost.
fn incumbents(runs: &[Series], at: f64) -> Vec<f64> {
    runs.iter().filter_map(|run| Some(run.iter().take_while(|(x, _)| *x <= at).last()?.1)).collect()
}

/// Median and quartiles of the gap from the first x at which every run has an incumbent to the last event.
fn curve<'a>(scene: &'a str, method: &'a str, runs: &[Series], reference: f64) -> Vec<Point<'a>> {
    let first = runs.iter().filter_map(|run| Some(run.first()?.0)).fold(0.0, f64::max);
    let last = runs.iter().filter_map(|run| Some(run.last()?.0)).fold(0.0, f64::max);
    if first <= 0.0 || !last.is_finite() {
        return Vec::new();
    }
    let steps = ((last / first).log10() * PER_DECADE).ceil().max(0.0) as u32;
    let place = |step: u32| if step == steps { last } else { first * 10f64.powf(f64::from(step) / PER_DECADE) };
    (0..=steps)
        .map(place)
        .map(|x| {
            let costs = incumbents(runs, x);
            let gap = |q| quantile(&costs, q).map_or(f64::NAN, |cost| super::over(cost, reference) - 1.0);
            Point {
                scene,
                method,
                x,
                gap_quartile_1: gap(0.25),
                gap_median: gap(0.5),
                gap_quartile_3: gap(0.75),
            }
        })
        .collect()
}

/// A staircase with its band, or a marker for a single point.
fn draw(method: &str, points: &[Point]) -> Vec<Layer> {
    let name = || method.to_owned();
    let medians: Vec<(f64, f64)> = points.iter().map(|point| (point.x, point.gap_median)).collect();
    if points.len() == 1 {
        return vec![Layer::Points { name: name(), points: medians }];
    }
    let band = points.iter().map(|point| (point.x, point.gap_quartile_1, point.gap_quartile_3)).collect();
    vec![Layer::StepBand { name: name(), points: band }, Layer::Steps { name: name(), points: medians }]
}
