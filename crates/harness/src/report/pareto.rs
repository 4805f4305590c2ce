//! Which methods are worth their time: cost against build time, and against the time of a ray.

use super::peers::{build_seconds, fastest};
use super::traversal::distinct;
use super::{Output, Rows, display_name, over};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Cost against time.
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

/// A method on a scene, as written to `timing_pareto.csv`.
#[derive(Serialize)]
struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    /// The fastest repetition.
    build_seconds: f64,
    cost_over_base: f64,
    /// Of the method's fastest layout with rays of the first kind; empty where rays were not traced.
    ns_per_ray: Option<f64>,
    /// Whether no other method has a lower cost in no more build time.
    on_front: bool,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let kinds = distinct(&rows.traces, |row| &row.rays);
        let (mut points, mut builds, mut rays) = (Vec::new(), Vec::new(), Vec::new());
        for (scene, kind) in rows.scenes() {
            let point = |method: &'_ String| {
                let run = rows.first_run(scene, method)?;
                let ns = kinds.first().and_then(|kind| fastest(rows, scene, method, kind));
                Some((build_seconds(rows, scene, method)?, over(run.cost, run.base_cost), ns.map(|ns| ns.1)))
            };
            let own: Vec<_> = self.methods.iter().filter_map(|method| Some((method, point(method)?))).collect();
            let front = front(own.iter().map(|(_, (seconds, cost, _))| (*seconds, *cost)).collect());
            let panel = |x: Axis, y: Axis, layers| Panel { title: display_name(scene, kind), x, y, layers };
            let single =
                |method: &String, at: (f64, f64)| Layer::Points { name: method.clone(), points: vec![at] };
            let mut layers: Vec<Layer> =
                own.iter().map(|(method, (seconds, cost, _))| single(method, (*seconds, *cost))).collect();
            layers.push(Layer::Steps { name: "best so far".into(), points: front.clone() });
            builds.push(panel(Axis::log("build time (s)"), Axis::linear("cost / base"), layers));
            let traced = own.iter().filter_map(|(method, (_, cost, ns))| Some(single(method, ((*ns)?, *cost))));
            rays.push(panel(Axis::linear("ns per ray"), Axis::linear("cost / base"), traced.collect()));
            points.extend(own.iter().map(|&(method, (build_seconds, cost_over_base, ns_per_ray))| Point {
                scene,
                method,
                build_seconds,
                cost_over_base,
                ns_per_ray,
                on_front: front.contains(&(build_seconds, cost_over_base)),
            }));
        }
        let caption = "Cost is the total area of inner nodes over that of the greedy tree; one object per leaf, one \
                       thread.";
        let figure = |caption: &str, panels| Figure {
            title: format!("{}: {}", self.source, self.title),
            caption: caption.into(),
            columns: 2,
            panels,
            looks: vec![],
        };
        let mut figures = vec![("pareto".to_owned(), figure(caption, builds))];
        if let Some(kind) = kinds.first() {
            let caption = format!("{caption} Rays: {kind}, each method by its fastest layout.");
            figures.push(("pareto_rays".into(), figure(&caption, rays)));
        }
        let csv = vec![("timing_pareto".into(), to_bytes(&points, Path::new("timing_pareto.csv"))?)];
        Ok(Output { csv, figures, ..Output::default() })
    }
}

/// The points that have a lower y than all points of no greater x, by x.
fn front(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut lowest = f64::INFINITY;
    points.retain(|point| {
        let better = point.1 < lowest;
        lowest = lowest.min(point.1);
        better
    });
    points
}

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn the_front_has_what_nothing_faster_beats() {
        let points = vec![(3.0, 0.5), (1.0, 2.0), (2.0, 2.0), (1.0, 1.5), (4.0, 0.5), (5.0, 0.4)];
        assert_eq!(front(points), [(1.0, 1.5), (3.0, 0.5), (5.0, 0.4)]);
    }
}
