//! What a tree's rays save for the time of its search: tests per ray against seconds.

use super::config::Labels;
use super::metric::Metric;
use super::prelude::*;
use crate::statistics::{geometric_mean, minimum};
use bvh_build::config::Itself;

bvh_build::config! { serde;
    /// Tests of the rays of the trained path of cameras against the time in which a tree is made.
    pub struct Config {
        /// What it belongs to.
        source: String;
        /// Heading.
        title: String;
        /// Label of the method that the others are compared with.
        base: String;
        /// Methods that differ in their budgets.
        series: Vec<Series>, in Itself;
    }
}

bvh_build::config! { serde;
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
    /// The fastest repetition.
    build_seconds: f64,
    /// Tests over those of the base, the geometric mean over the kinds of rays.
    tests_over_base: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (mut points, mut panels) = (Vec::new(), Vec::new());
        for scene in rows.scenes() {
            let mut layers = Vec::new();
            for series in &self.series {
                let own = series.methods.iter().filter_map(|method| self.point(rows, scene, series, method));
                let mut own: Vec<Point> = own.collect();
                own.sort_by(|a, b| a.build_seconds.total_cmp(&b.build_seconds));
                let line: Vec<_> =
                    own.iter().map(|point| (point.build_seconds, point.tests_over_base)).collect();
                layers.push(Layer::new(&series.name, Marks::Line(line.clone())));
                layers.push(Layer::new(&series.name, Marks::Points(line)));
                points.extend(own);
            }
            let y = Axis::linear("tests per ray over greedy");
            panels.push(panel(rows.shown(scene), Metric::BuildSeconds.axis(), y, layers));
        }
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("timing_ray_time", &points)?;
        let caption = "Primary, bounce and shadow rays of a path of cameras, none of which any tree was trained on; tests of nodes \
                       and blocks in the wide layout. One thread; the time for rays includes tracing those of the training.";
        output.add_figure("timing_ray_time", caption, 2, panels);
        let columns = "scene series method build_seconds tests_over_base";
        output.show("Tests per ray against time:", &points, columns)?;
        let best = each(&self.series, |series| {
            let own = |scene: &&str| {
                let own = points.iter().filter(|point| point.scene == *scene && point.series == series.name);
                minimum(own.map(|point| point.tests_over_base))
            };
            let least: Vec<f64> = rows.scenes().iter().filter_map(own).collect();
            (!least.is_empty()).then(|| format!("{:.3} ({})", geometric_mean(&least), series.name))
        });
        output.reading =
            format!("Tests per ray over ‘{}’ at best, geometric means over scenes: {best}.", self.base);
        Ok(output)
    }

    fn point<'a>(
        &self,
        rows: &'a Rows,
        scene: &'a str,
        series: &'a Series,
        method: &'a str,
    ) -> Option<Point<'a>> {
        let of_path = |method: &str| -> Vec<f64> {
            let own =
                rows.tests.iter().filter(|row| (row.scene.as_str(), row.method.as_str()) == (scene, method));
            own.filter(|row| row.camera == "same").map(|row| row.node_tests + row.block_tests).collect()
        };
        let (own, base) = (of_path(method), of_path(&self.base));
        if own.is_empty() || own.len() != base.len() {
            return None;
        }
        let ratios: Vec<f64> = own.iter().zip(&base).map(|(own, base)| own / base).collect();
        Some(Point {
            scene,
            series: &series.name,
            method,
            build_seconds: rows.build_seconds(scene, method)?,
            tests_over_base: geometric_mean(&ratios),
        })
    }
}
