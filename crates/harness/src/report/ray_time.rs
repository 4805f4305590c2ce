//! What a tree's rays save for the time of its search: tests per ray against seconds.

use super::config::Labels;
use super::metric::Metric;
use super::prelude::*;
use crate::statistics::{geometric_mean, minimum};
use bvh_config::Nested;

bvh_config::config! { serde;
    /// Tests of rays of the cameras' path that trees were trained on, and of another path, against the time in which a tree is built.
    pub struct Config {
        /// What it belongs to.
        source: String;
        /// Heading.
        title: String;
        /// Label of the method that the others are compared with.
        base: String;
        /// Methods that differ in their budgets.
        series: Vec<Series>, in Nested;
    }
}

bvh_config::config! { serde;
    /// Methods that make one line of the figure.
    pub struct Series {
        /// Its name in the figure.
        name: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
    }
}

impl Labels for Series {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.methods.labels(&format!("{key}.methods"))
    }
}

/// A point, as written to `timing_ray_time.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Point<'a> {
    scene: &'a str,
    /// Name of the line in the figure.
    series: &'a str,
    method: &'a str,
    /// The path of cameras: `same` as the training's, on other rays, or `other`.
    camera: &'a str,
    /// The fastest repetition.
    build_seconds: f64,
    /// Tests over those of the base, the geometric mean over the kinds of rays.
    tests_over_base: f64,
}

/// The paths of cameras as rows name them, and as the figure does.
const PATHS: [(&str, &str); 2] = [("same", "trained path"), ("other", "another path")];

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut points = Vec::new();
        let mut panels = Vec::new();
        for scene in rows.scenes() {
            for (camera, title) in PATHS {
                let own: Vec<Point> = self
                    .series
                    .iter()
                    .flat_map(|series| self.line(rows, scene, series, camera))
                    .collect();
                panels.push(self.draw(&format!("{}: {title}", rows.shown(scene)), &own));
                points.extend(own);
            }
        }
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("timing_ray_time", &points)?;
        let caption = "Primary, bounce and shadow rays, geometric mean; tests of nodes and blocks in the wide layout. Left, the path of \
                       cameras that ‘by rays’ was trained on, by other rays; right, a path that no tree was trained on. One run, one \
                       thread; the time for rays includes tracing those of the training.";
        output.add_figure("timing_ray_time", caption, PATHS.len(), panels);
        let columns = "scene series method camera build_seconds tests_over_base";
        output.show("Tests per ray against time:", &points, columns)?;
        output.reading = self.reading(rows, &points);
        Ok(output)
    }

    /// The points of one line of the figure, by time.
    fn line<'a>(
        &self,
        rows: &'a Rows,
        scene: &'a str,
        series: &'a Series,
        camera: &'a str,
    ) -> Vec<Point<'a>> {
        let points = series
            .methods
            .iter()
            .filter_map(|method| self.point(rows, scene, series, method, camera));
        let mut points: Vec<Point> = points.collect();
        points.sort_by(|a, b| a.build_seconds.total_cmp(&b.build_seconds));
        points
    }

    fn draw(&self, title: &str, points: &[Point]) -> Panel {
        let mut layers = Vec::new();
        for series in &self.series {
            let own = points
                .iter()
                .filter(|point| point.series == series.name);
            let line: Vec<_> = own
                .map(|point| (point.build_seconds, point.tests_over_base))
                .collect();
            layers.push(Layer::new(&series.name, Marks::Line(line.clone())));
            layers.push(Layer::new(&series.name, Marks::Points(line)));
        }
        let y = Axis::linear(format!("tests per ray over {}", self.base));
        panel(title, Metric::BuildSeconds.axis(), y, layers)
    }

    /// The least tests of every line on both paths, geometric means over scenes.
    fn reading(&self, rows: &Rows, points: &[Point]) -> String {
        let of_path = |(camera, title): (&str, &str)| {
            let best = each(&self.series, |series| {
                let least = |scene: &&str| {
                    let own = points.iter().filter(|point| {
                        (point.scene, point.series, point.camera)
                            == (*scene, series.name.as_str(), camera)
                    });
                    minimum(own.map(|point| point.tests_over_base))
                };
                let least: Vec<f64> = rows.scenes().iter().filter_map(least).collect();
                (!least.is_empty())
                    .then(|| format!("{:.3} ({})", geometric_mean(&least), series.name))
            });
            Some(format!("{title}: {best}"))
        };
        let paths = PATHS
            .into_iter()
            .filter_map(of_path)
            .collect::<Vec<_>>()
            .join("; ");
        format!("Tests per ray over ‘{}’ at best, geometric means over scenes. {paths}.", self.base)
    }

    fn point<'a>(
        &self,
        rows: &'a Rows,
        scene: &'a str,
        series: &'a Series,
        method: &'a str,
        camera: &'a str,
    ) -> Option<Point<'a>> {
        let of_path = |method: &str| -> Vec<f64> {
            let own = rows
                .tests
                .iter()
                .filter(|row| (row.scene.as_str(), row.method.as_str()) == (scene, method));
            own.filter(|row| row.camera == camera)
                .map(|row| row.node_tests + row.block_tests)
                .collect()
        };
        let own = of_path(method);
        let base = of_path(&self.base);
        if own.is_empty() || own.len() != base.len() {
            return None;
        }
        let ratios: Vec<f64> = own
            .iter()
            .zip(&base)
            .map(|(own, base)| own / base)
            .collect();
        Some(Point {
            scene,
            series: &series.name,
            method,
            camera,
            build_seconds: rows.build_seconds(scene, method)?,
            tests_over_base: geometric_mean(&ratios),
        })
    }
}
