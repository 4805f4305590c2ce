//! Which methods are worth their time: cost against build time, and against the time of a ray.

use super::config::Methods;
use super::metric::Metric;
use super::prelude::*;

/// A method on a scene, as written to `timing_pareto.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Point<'a> {
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

pub(super) fn write(config: &Methods, rows: &Rows) -> Result<Output, Error> {
    let kind = rows.traced_kinds().first().copied();
    let mut points = Vec::new();
    let mut builds = Vec::new();
    let mut rays = Vec::new();
    for scene in rows.scenes() {
        let mut own: Vec<Point> = config
            .methods
            .iter()
            .filter_map(|method| point(rows, scene, method, kind))
            .collect();
        let front = front(
            own.iter()
                .map(|point| (point.build_seconds, point.cost_over_base))
                .collect(),
        );
        for point in &mut own {
            point.on_front = front.contains(&(point.build_seconds, point.cost_over_base));
        }
        let layer = |point: &Point, x| {
            Layer::new(point.method, Marks::Points(vec![(x, point.cost_over_base)]))
        };
        let mut layers: Vec<Layer> = own
            .iter()
            .map(|point| layer(point, point.build_seconds))
            .collect();
        layers.push(Layer::new("best so far", Marks::Steps(front)));
        let cost = || Metric::CostOverBase.axis();
        builds.push(panel(rows.shown(scene), Metric::BuildSeconds.axis(), cost(), layers));
        let traced = own
            .iter()
            .filter_map(|point| Some(layer(point, point.ns_per_ray?)))
            .collect();
        rays.push(panel(rows.shown(scene), Metric::NsPerRay.axis(), cost(), traced));
        points.extend(own);
    }
    let mut output = Output::new(&config.source, &config.title);
    output.add_csv("timing_pareto", &points)?;
    let caption = "Cost is the total area of inner nodes over that of the greedy tree; one object per leaf, one thread.";
    output.add_figure("pareto", caption, 2, builds);
    if let Some(kind) = kind {
        let caption =
            format!("{caption} Rays: {kind}, each method by its fastest layout, ray by ray.");
        output.add_figure("pareto_rays", caption, 2, rays);
    }
    Ok(output)
}

fn point<'a>(
    rows: &Rows,
    scene: &'a str,
    method: &'a str,
    kind: Option<&str>,
) -> Option<Point<'a>> {
    Some(Point {
        scene,
        method,
        build_seconds: rows.build_seconds(scene, method)?,
        cost_over_base: Metric::CostOverBase.of_run(rows.runs_of(scene, method).next()?)?,
        ns_per_ray: kind
            .and_then(|kind| rows.fastest_layout(scene, method, kind))
            .map(|(_, ns)| ns),
        on_front: false,
    })
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
