//! Error against run time: the gap of the incumbent to the exact optimum or the best known cost, along all three axes.

use super::progress::{Along, Series, series};
use super::statistics::quantile;
use super::{Output, Rows, looks, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use serde::{Deserialize, Serialize};

/// Error against run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What it belongs to.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Name of the files; several such reports of one experiment need different ones. Default `anytime`.
    #[serde(default = "anytime")]
    pub file: String,
    /// Labels of the methods. One event per run, as a builder has, is shown as a point.
    pub methods: Vec<String>,
    /// Seconds at which the table for the terminal reads the curves. Default 0.1, 1, 10 and 60.
    #[serde(default = "decades")]
    pub at_seconds: Vec<f64>,
}

fn anytime() -> String {
    "anytime".into()
}

fn decades() -> Vec<f64> {
    vec![0.1, 1.0, 10.0, 60.0]
}

/// One point of a curve, as written to `timing_anytime.csv`, `anytime_evaluations.csv` and `anytime_work.csv`.
#[derive(Serialize)]
struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    x: f64,
    /// The gap to the reference, over repetitions.
    gap_quartile_1: f64,
    gap_median: f64,
    gap_quartile_3: f64,
}

/// Points per factor of ten along a curve.
const PER_DECADE: f64 = 20.0;

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        for along in Along::ALL {
            let (mut points, mut panels) = (Vec::new(), Vec::new());
            for (scene, _) in rows.scenes() {
                let Some(reference) = rows.reference(scene) else { continue };
                let mut layers = Vec::new();
                for method in &self.methods {
                    let runs = series(rows, scene, method, along);
                    let start = points.len();
                    points.extend(curve(scene, method, &runs, reference.cost));
                    layers.extend(draw(method, &points[start..]));
                }
                let (x, y) = (Axis::log(along.label()), Axis::log("gap to the best known"));
                panels.push(Panel { title: rows.shown(scene), x, y, layers });
            }
            output.figures.push((along.file(&self.file), self.figure(panels)));
            output.csv.push((along.file(&self.file), along.csv(&points)?));
        }
        output.text = self.text(rows);
        output.reading = self.reading(rows);
        Ok(output)
    }

    fn figure(&self, panels: Vec<Panel>) -> Figure {
        Figure {
            title: format!("{}: {}", self.source, self.title),
            caption: "Cost of the incumbent over the best known cost of the scene, minus 1: median and quartiles over \
                      repetitions. Points are builders. A curve falls through the floor where it is the best known."
                .into(),
            columns: 2,
            panels,
            looks: looks(&self.methods),
        }
    }

    /// Which method ends lowest where, and how far below the greedy tree.
    fn reading(&self, rows: &Rows) -> String {
        let lowest = |(scene, _): (&str, _)| {
            let base = rows.base_cost(scene);
            let median = |method: &String| {
                let costs: Vec<f64> = rows.runs_of(scene, method).map(|run| run.cost).collect();
                Some((quantile(&costs, 0.5)?, method.clone()))
            };
            let (cost, method) = self.methods.iter().filter_map(median).min_by(|a, b| a.0.total_cmp(&b.0))?;
            Some(format!("{scene}: {method}, {:+.2} %", 100.0 * (cost / base - 1.0)))
        };
        let lowest: Vec<String> = rows.scenes().into_iter().filter_map(lowest).collect();
        format!(
            "The lowest median cost against the greedy tree's at the end of the runs, {}.",
            lowest.join("; ")
        )
    }

    fn text(&self, rows: &Rows) -> String {
        let seconds = self.at_seconds.iter().map(|seconds| format!("{seconds} s"));
        let header: Vec<String> = ["scene".into(), "method".into()].into_iter().chain(seconds).collect();
        let mut table = text_table(header.iter().map(String::as_str));
        for (scene, _) in rows.scenes() {
            let base = rows.base_cost(scene);
            for method in &self.methods {
                let runs = series(rows, scene, method, Along::Seconds);
                let cell = |&at: &f64| {
                    let cost = quantile(&incumbents(&runs, at), 0.5);
                    cost.map_or_else(String::new, |cost| format!("{:+.2} %", 100.0 * (cost / base - 1.0)))
                };
                let name = [rows.shown(scene), method.clone()];
                table.add_row(name.into_iter().chain(self.at_seconds.iter().map(cell)).collect::<Vec<_>>());
            }
        }
        format!(
            "{}: {}\nMedian cost against the greedy tree's, after so many seconds:\n{table}\n",
            self.source, self.title
        )
    }
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
