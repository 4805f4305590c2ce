//! The error of the ray estimator against the number of rays, beside the slope −1/2 that it must have.

use super::statistics::range;
use super::{Output, Rows, display_name};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The error of the ray estimator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper speaks of it.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods, of which the first repetition is shown.
    pub methods: Vec<String>,
}

/// One measurement, as written to `estimator.csv`.
#[derive(Serialize)]
struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    family: &'a str,
    query: &'a str,
    rays: u64,
    /// Standard error of the tests per ray over their mean.
    relative_error: f64,
}

/// How the error falls with the number of rays, by the slope between the least and the greatest number.
fn reading(points: &[Point]) -> String {
    let slope = |line: &[Point]| {
        let (first, last) = (line.first()?, line.last().filter(|last| last.rays > line[0].rays)?);
        Some((last.relative_error / first.relative_error).ln() / (last.rays as f64 / first.rays as f64).ln())
    };
    let lines = points.chunk_by(|a, b| (a.scene, a.method) == (b.scene, b.method));
    range(lines.filter_map(slope)).map_or_else(String::new, |(low, high)| {
        format!("The error falls with the number of rays to the power {low:.2} to {high:.2}; theory: −1/2.")
    })
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (mut points, mut panels) = (Vec::new(), Vec::new());
        for (scene, kind) in rows.scenes() {
            let mut layers = Vec::new();
            for method in &self.methods {
                let own = rows.rays.iter().filter(|row| {
                    row.scene == scene && row.method == *method && row.repetition == 0 && row.family == "inside"
                });
                let mut line: Vec<(f64, f64)> = Vec::new();
                for row in own.filter(|row| row.query == "any") {
                    let relative_error = row.boxes_standard_error / row.boxes_per_ray;
                    line.push((row.rays as f64, relative_error));
                    let (family, query) = (&row.family, &row.query);
                    points.push(Point { scene, method, family, query, rays: row.rays, relative_error });
                }
                line.sort_by(|a, b| a.0.total_cmp(&b.0));
                if let (true, Some(&(x, y))) = (layers.is_empty(), line.first()) {
                    let slope = line.iter().map(|point| (point.0, y * (x / point.0).sqrt())).collect();
                    layers.push(Layer::Line { name: "slope −1/2".into(), points: slope });
                }
                layers.push(Layer::Points { name: method.clone(), points: line });
            }
            let (x, y) = (Axis::log("number of rays"), Axis::log("standard error / mean"));
            panels.push(Panel { title: display_name(scene, kind), x, y, layers });
        }
        let caption = "Rays from inside, any hit. Two stable digits need an error below half a percent.".into();
        let title = format!("{}: {}", self.source, self.title);
        Ok(Output {
            csv: vec![("estimator".into(), to_bytes(&points, Path::new("estimator.csv"))?)],
            figures: vec![("estimator".into(), Figure { title, caption, columns: 2, panels, looks: vec![] })],
            reading: reading(&points),
            ..Output::default()
        })
    }
}
