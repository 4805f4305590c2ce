//! The second document's table: one picture by brute force, by a KD-tree and by trees; tests, and apart from them
//! seconds.

use super::statistics::median;
use super::{Output, Rows, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Look, Panel};
use crate::render::experiment::BASELINES;
use crate::run::rows::{RenderRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A comparison of structures by the picture of each scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the document has it.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods; brute force and the KD-tree come before them.
    pub methods: Vec<String>,
    /// The document's scene.
    pub scene: String,
    /// The document's seconds for it, by label.
    pub document: BTreeMap<String, f64>,
}

/// One structure on one scene, as written to `pictures.csv`: the run of median tests.
#[derive(Serialize)]
struct Row<'a> {
    scene: &'a str,
    method: &'a str,
    objects: usize,
    rays: u64,
    boxes_per_ray: f64,
    objects_per_ray: f64,
    tests_per_ray: f64,
    /// How many times fewer tests than brute force.
    brute_force_over_tests: f64,
    /// How many times faster than brute force the document's was.
    document_speed_up: Option<f64>,
    /// Whether the picture is that of brute force, bit by bit.
    same_picture: bool,
}

/// The same, as written to `timing_pictures.csv`: the fastest run.
#[derive(Serialize)]
struct TimeRow<'a> {
    scene: &'a str,
    method: &'a str,
    build_seconds: f64,
    render_seconds: f64,
    million_rays_per_second: f64,
    speed_up: f64,
    document_seconds: Option<f64>,
    document_speed_up: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let (mut table, mut times) = (Vec::new(), Vec::new());
        for (scene, _) in rows.scenes() {
            let Some(brute) = self.row(rows, scene, BASELINES[0].0) else { continue };
            let brute_seconds = seconds(rows, scene, BASELINES[0].0);
            for method in self.structures() {
                let Some(own) = self.row(rows, scene, method) else { continue };
                let document_seconds = self.document.get(method).filter(|_| scene == self.scene).copied();
                let document_speed_up =
                    document_seconds.and_then(|own| Some(self.document.get(BASELINES[0].0)? / own));
                let tests_per_ray = own.boxes_per_ray + own.objects_per_ray;
                table.push(Row {
                    scene,
                    method,
                    objects: own.objects,
                    rays: own.rays,
                    boxes_per_ray: own.boxes_per_ray,
                    objects_per_ray: own.objects_per_ray,
                    tests_per_ray,
                    brute_force_over_tests: (brute.boxes_per_ray + brute.objects_per_ray) / tests_per_ray,
                    document_speed_up,
                    same_picture: own.picture == brute.picture && own.rays == brute.rays,
                });
                let (build_seconds, render_seconds) = seconds(rows, scene, method);
                times.push(TimeRow {
                    scene,
                    method,
                    build_seconds,
                    render_seconds,
                    million_rays_per_second: own.rays as f64 * 1e-6 / render_seconds,
                    speed_up: brute_seconds.1 / render_seconds,
                    document_seconds,
                    document_speed_up,
                });
            }
        }
        Ok(Output {
            csv: vec![
                ("pictures".into(), to_bytes(&table, Path::new("pictures.csv"))?),
                ("timing_pictures".into(), to_bytes(&times, Path::new("timing_pictures.csv"))?),
            ],
            figures: vec![
                ("pictures".into(), self.tests_figure(rows, &table)),
                ("timing_pictures".into(), self.time_figure(rows, &times)),
            ],
            paper: vec![],
            text: self.text(rows, &table, &times),
            reading: reading(&table, &times),
        })
    }

    /// The labels of all that is compared, in order.
    fn structures(&self) -> impl Iterator<Item = &str> {
        BASELINES.iter().map(|(label, _)| *label).chain(self.methods.iter().map(String::as_str))
    }

    /// Of a structure's pictures of a scene, the one of median tests, the lower of two.
    fn row<'a>(&self, rows: &'a Rows, scene: &str, method: &str) -> Option<&'a RenderRow> {
        let own = || rows.renders.iter().filter(|row| row.scene == scene && row.method == method);
        let tests = |row: &RenderRow| row.boxes_per_ray + row.objects_per_ray;
        let middle = median(&own().map(tests).collect::<Vec<_>>())?;
        own().min_by(|a, b| (tests(a) - middle).abs().total_cmp(&(tests(b) - middle).abs()))
    }

    fn tests_figure(&self, rows: &Rows, table: &[Row]) -> Figure {
        let panel = |(scene, _): (&str, &str)| {
            let own: Vec<&Row> = table.iter().filter(|row| row.scene == scene).collect();
            let bars = |name: &str, value: fn(&Row) -> f64| {
                let values: Vec<f64> = own.iter().map(|row| value(row)).collect();
                Layer::Bars { name: name.into(), spread: vec![], values, base: 0.1 }
            };
            let layers = vec![
                bars("boxes or cells", |row| row.boxes_per_ray),
                bars("objects", |row| row.objects_per_ray),
            ];
            let x = Axis::categories("", own.iter().map(|row| row.method.to_owned()).collect());
            Panel { title: rows.shown(scene), x, y: Axis::log("tests per ray").starting_at(0.1), layers }
        };
        Figure {
            title: format!("{}: {}", self.source, self.title),
            caption: "Mean number of tests over all rays of one picture: through pixels, to lights, and mirrored. The \
                      picture is the same, bit by bit, whatever it is made with."
                .into(),
            columns: 3,
            panels: rows.scenes().into_iter().map(panel).collect(),
            looks: vec![],
        }
    }

    fn time_figure(&self, rows: &Rows, times: &[TimeRow]) -> Figure {
        let panel = |(scene, _): (&str, &str)| {
            let own: Vec<&TimeRow> = times.iter().filter(|row| row.scene == scene).collect();
            let theirs =
                own.iter().enumerate().filter_map(|(at, row)| Some((at as f64, row.document_speed_up?)));
            let layers = vec![
                Layer::Bars {
                    name: "ours".into(),
                    values: own.iter().map(|row| row.speed_up).collect(),
                    spread: vec![],
                    base: 1.0,
                },
                Layer::Points { name: DOCUMENT.into(), points: theirs.collect() },
            ];
            let x = Axis::categories("", own.iter().map(|row| row.method.to_owned()).collect());
            Panel { title: rows.shown(scene), x, y: Axis::log("speed-up over brute force"), layers }
        };
        Figure {
            title: format!("{}: {}, time", self.source, self.title),
            caption: "Seconds of brute force over seconds, one thread, each the least of several.".into(),
            columns: 3,
            panels: rows.scenes().into_iter().map(panel).collect(),
            looks: vec![(DOCUMENT.into(), Look::Reference)],
        }
    }

    fn text(&self, rows: &Rows, table: &[Row], times: &[TimeRow]) -> String {
        let header = ["scene", "structure", "boxes", "objects", "fewer", "seconds", "speed-up", "document's"];
        let mut text = text_table(header);
        for (row, time) in table.iter().zip(times) {
            let theirs = row.document_speed_up.zip(time.document_seconds);
            text.add_row([
                rows.shown(row.scene),
                row.method.into(),
                format!("{:.2}", row.boxes_per_ray),
                format!("{:.2}", row.objects_per_ray),
                format!("{:.1}", row.brute_force_over_tests),
                format!("{:.4}", time.render_seconds),
                format!("{:.1}", time.speed_up),
                theirs.map_or_else(String::new, |(speed_up, seconds)| format!("{speed_up:.1} ({seconds} s)")),
            ]);
        }
        let verdict = match table.iter().find(|row| !row.same_picture) {
            Some(row) => format!("{}: {} gives ANOTHER PICTURE than brute force", row.scene, row.method),
            None => "All structures give the same picture of a scene, bit by bit.".into(),
        };
        format!("{}: {}\n{text}\n{verdict}\n", self.source, self.title)
    }
}

const DOCUMENT: &str = "the document's";

/// The fastest structure of every scene.
fn reading(table: &[Row], times: &[TimeRow]) -> String {
    let fastest = times.chunk_by(|a, b| a.scene == b.scene).filter_map(|scene| {
        let best = scene.iter().max_by(|a, b| a.speed_up.total_cmp(&b.speed_up))?;
        Some(format!("{}: {}, {:.1} times faster than brute force", best.scene, best.method, best.speed_up))
    });
    let same = if table.iter().all(|row| row.same_picture) { "the same" } else { "NOT the same" };
    format!("{}. All pictures of a scene are {same}.", fastest.collect::<Vec<_>>().join("; "))
}

/// Seconds to build and to draw, of the repetition that drew fastest.
fn seconds(rows: &Rows, scene: &str, method: &str) -> (f64, f64) {
    let own = rows.render_times.iter().filter(|row| row.scene == scene && row.method == method);
    let fastest = own.min_by(|a, b| a.render_seconds.total_cmp(&b.render_seconds));
    fastest.map_or((f64::NAN, f64::NAN), |row| (row.build_seconds, row.render_seconds))
}
