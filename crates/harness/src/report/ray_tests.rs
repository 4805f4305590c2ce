//! Tests per random ray: what the paper calls the number of intersections, methods by scenes.

use super::statistics::{median, range};
use super::{Output, Rows, display_name, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Look, Panel};
use crate::run::rows::{PaperRow, RayRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A comparison of methods by tests per ray.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper has it.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods; ratios are to the first.
    pub methods: Vec<String>,
    /// The paper's numbers of tests by scene, in the order of `methods`, which may go on without them.
    #[serde(default)]
    pub paper: BTreeMap<String, Vec<f64>>,
    /// Ratios within this relative distance of the paper's agree with it. Default 0.1: it gives two digits.
    #[serde(default = "a_tenth")]
    pub tolerance: f64,
    /// Why ours differs, where it does.
    #[serde(default)]
    pub reason: String,
}

fn a_tenth() -> f64 {
    0.1
}

/// One method on one scene by one measurement, as written to `ray_tests.csv`: the run of median cost.
#[derive(Serialize)]
struct Row<'a> {
    scene: &'a str,
    method: &'a str,
    family: &'a str,
    query: &'a str,
    rays: u64,
    boxes_per_ray: f64,
    boxes_low: f64,
    boxes_high: f64,
    objects_per_ray: f64,
    goldsmith_salmon: f64,
    boxes_over_first: f64,
    paper_boxes_per_ray: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        let mut table = Vec::new();
        for (scene, kind) in rows.scenes() {
            let start = table.len();
            for measurement in measurements(rows) {
                for (index, method) in self.methods.iter().enumerate() {
                    table.extend(self.row(rows, scene, method, measurement, index));
                }
            }
            self.compare(&display_name(scene, kind), &table[start..], &mut output);
        }
        output.text = self.text(rows, &table);
        output.reading = self.reading(&table);
        output.figures.push(("ray_tests".into(), self.figure(rows, &table)));
        output.csv.push(("ray_tests".into(), to_bytes(&table, Path::new("ray_tests.csv"))?));
        Ok(output)
    }

    fn row<'a>(
        &'a self,
        rows: &'a Rows,
        scene: &'a str,
        method: &'a str,
        (family, query): (&'a str, &'a str),
        index: usize,
    ) -> Option<Row<'a>> {
        let first = middle_run(rows, scene, self.methods.first()?, family, query)?;
        let own = middle_run(rows, scene, method, family, query)?;
        let same_run = |run: &&crate::run::rows::RunRow| {
            run.scene == scene && run.method == method && run.repetition == own.repetition
        };
        let paper = (family == "inside" && query == "any").then(|| self.paper.get(scene)).flatten();
        Some(Row {
            scene,
            method,
            family,
            query,
            rays: own.rays,
            boxes_per_ray: own.boxes_per_ray,
            boxes_low: own.boxes_low,
            boxes_high: own.boxes_high,
            objects_per_ray: own.objects_per_ray,
            goldsmith_salmon: rows.runs.iter().find(same_run)?.goldsmith_salmon,
            boxes_over_first: own.boxes_per_ray / first.boxes_per_ray,
            paper_boxes_per_ray: paper.and_then(|paper| paper.get(index).copied()),
        })
    }

    fn compare(&self, shown: &str, table: &[Row], output: &mut Output) {
        let theirs = || table.iter().filter_map(|row| Some((row, row.paper_boxes_per_ray?)));
        let Some((_, base)) = theirs().next() else { return };
        for (row, paper) in theirs() {
            let (paper_ratio, ours) = (paper / base, row.boxes_over_first);
            output.paper.push(PaperRow {
                source: self.source.clone(),
                scene: shown.into(),
                quantity: format!("tests per ray, {}, over the first method's", row.method),
                paper: format!("{paper}"),
                ours: format!("{:.2}", row.boxes_per_ray),
                paper_over_base: Some(paper_ratio),
                ours_over_base: Some(ours),
                verdict: super::verdict(paper_ratio, ours, self.tolerance),
                reason: self.reason.clone(),
            });
        }
    }

    fn figure(&self, rows: &Rows, table: &[Row]) -> Figure {
        let panel = |(scene, kind): (&str, &str)| {
            let bars = |(family, query): (&str, &str)| {
                let own =
                    table.iter().filter(|row| (row.scene, row.family, row.query) == (scene, family, query));
                let (values, spread) = own
                    .map(|row| (row.boxes_per_ray, (row.boxes_low, row.boxes_high)))
                    .collect::<(Vec<_>, Vec<_>)>();
                Layer::Bars { name: format!("{family}, {query}"), values, spread, base: 0.0 }
            };
            let mut layers: Vec<Layer> = measurements(rows).into_iter().map(bars).collect();
            let paper = self.paper.get(scene).into_iter().flatten().enumerate().map(|(at, &y)| (at as f64, y));
            layers.push(Layer::Points { name: PAPER.into(), points: paper.collect() });
            let x = Axis::categories("", self.methods.clone());
            Panel { title: display_name(scene, kind), x, y: Axis::linear("box tests per ray"), layers }
        };
        Figure {
            title: format!("{}: {}", self.source, self.title),
            caption:
                "Mean number of tests against boxes, whiskers the 95 % interval; of several runs the one of \
                 median tests. The paper's rays start inside and end at any hit."
                    .into(),
            columns: 2,
            panels: rows.scenes().into_iter().map(panel).collect(),
            looks: vec![(PAPER.into(), Look::Reference)],
        }
    }

    fn reading(&self, table: &[Row]) -> String {
        let first = self.methods.first().map_or("", String::as_str);
        let of = |method: &String| {
            let own = table.iter().filter(|row| row.method == method).map(|row| row.boxes_over_first);
            let (low, high) = range(own)?;
            Some(format!("{method} {low:.2} to {high:.2}"))
        };
        let ratios: Vec<String> = self.methods.iter().skip(1).filter_map(of).collect();
        format!("Box tests per ray over those of {first}: {}.", ratios.join(", "))
    }

    fn text(&self, rows: &Rows, table: &[Row]) -> String {
        let mut text = text_table(["scene", "method", "rays", "boxes per ray (95 %)", "over first", "paper"]);
        for row in table {
            text.add_row([
                rows.shown(row.scene),
                row.method.into(),
                format!("{}, {}", row.family, row.query),
                format!("{:.2}  ({:.2} to {:.2})", row.boxes_per_ray, row.boxes_low, row.boxes_high),
                format!("{:.3}", row.boxes_over_first),
                row.paper_boxes_per_ray.map_or_else(String::new, |paper| format!("{paper}")),
            ]);
        }
        format!("{}: {}\n{text}\n", self.source, self.title)
    }
}

const PAPER: &str = "paper";

/// The kinds of rays sent, in order.
fn measurements(rows: &Rows) -> Vec<(&str, &str)> {
    let mut kinds: Vec<(&str, &str)> = Vec::new();
    for row in &rows.rays {
        let kind = (row.family.as_str(), row.query.as_str());
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    kinds
}

/// Of a method's runs on a scene, with the most rays of the kind, the one of median tests per ray, the lower of two.
fn middle_run<'a>(rows: &'a Rows, scene: &str, method: &str, family: &str, query: &str) -> Option<&'a RayRow> {
    let of_kind = |row: &&RayRow| {
        row.scene == scene && row.method == method && row.family == family && row.query == query
    };
    let most = rows.rays.iter().filter(of_kind).map(|row| row.rays).max()?;
    let own: Vec<&RayRow> = rows.rays.iter().filter(of_kind).filter(|row| row.rays == most).collect();
    let middle = median(&own.iter().map(|row| row.boxes_per_ray).collect::<Vec<_>>())?;
    own.into_iter().min_by(|a, b| (a.boxes_per_ray - middle).abs().total_cmp(&(b.boxes_per_ray - middle).abs()))
}
