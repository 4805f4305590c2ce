//! The error of the ray estimator against the number of rays, beside the slope −1/2 that it must have.

use super::config::Methods;
use super::prelude::*;
use crate::statistics::range;

/// One measurement of a method's first repetition, as written to `estimator.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    family: &'a str,
    query: &'a str,
    /// Number of rays.
    rays: u64,
    /// Standard error of the tests per ray over their mean.
    relative_error: f64,
}

/// The kind of rays whose numbers are varied.
const KIND: (&str, &str) = ("inside", "any");

pub(super) fn write(config: &Methods, rows: &Rows) -> Result<Output, Error> {
    let mut points = Vec::new();
    let mut panels = Vec::new();
    for scene in rows.scenes() {
        let mut layers = Vec::new();
        for method in &config.methods {
            let start = points.len();
            points.extend(measurements(rows, scene, method));
            let mut line: Vec<(f64, f64)> = points[start..]
                .iter()
                .map(|point| (point.rays as f64, point.relative_error))
                .collect();
            line.sort_by(|a, b| a.0.total_cmp(&b.0));
            if let (true, Some(&(x, y))) = (layers.is_empty(), line.first()) {
                let slope = line
                    .iter()
                    .map(|point| (point.0, y * (x / point.0).sqrt()))
                    .collect();
                layers.push(Layer::new("slope −1/2", Marks::Line(slope)));
            }
            layers.push(Layer::new(method, Marks::Points(line)));
        }
        let x = Axis::log("number of rays");
        let y = Axis::log("standard error / mean");
        panels.push(panel(rows.shown(scene), x, y, layers));
    }
    let mut output = Output::new(&config.source, &config.title);
    output.add_csv("estimator", &points)?;
    let caption =
        "Rays from inside, any hit. Two stable digits need an error below half a percent.";
    output.add_figure("estimator", caption, 2, panels);
    output.reading = reading(&points);
    Ok(output)
}

fn measurements<'a>(
    rows: &'a Rows,
    scene: &'a str,
    method: &'a str,
) -> impl Iterator<Item = Point<'a>> {
    let (family, query) = KIND;
    rows.rays_of(scene, method, KIND)
        .into_iter()
        .filter(|row| row.repetition == 0)
        .map(move |row| {
            let relative_error = row.boxes_standard_error / row.boxes_per_ray;
            Point { scene, method, family, query, rays: row.rays, relative_error }
        })
}

/// How the error falls with the number of rays, by the slope between the least and the greatest number.
fn reading(points: &[Point]) -> String {
    let slope = |line: &[Point]| {
        let first = line.first()?;
        let last = line
            .last()
            .filter(|last| last.rays > line[0].rays)?;
        Some(
            (last.relative_error / first.relative_error).ln()
                / (last.rays as f64 / first.rays as f64).ln(),
        )
    };
    let lines = points.chunk_by(|a, b| (a.scene, a.method) == (b.scene, b.method));
    range(lines.filter_map(slope)).map_or_else(String::new, |(low, high)| {
        format!("The error falls with the number of rays to the power {low:.2} to {high:.2}; theory: −1/2.")
    })
}
