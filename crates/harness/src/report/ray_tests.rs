//! Tests per random ray: what the paper calls the number of intersections, methods by scenes.

use super::config::{first, one_for_each};
use super::data::middle;
use super::metric::Metric;
use super::paper::{PaperRow, ratios};
use super::prelude::*;
use crate::rows::RayRow;
use crate::statistics::range;
use bvh_config::above;
use std::collections::BTreeMap;

bvh_config::config! { serde;
    /// A comparison of methods by tests per ray.
    pub struct Config {
        /// Where the paper has it.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods; ratios are to the first.
        methods: Vec<String>, in OneOrMore;
        /// The paper's numbers of tests by scene, in the order of `methods`, which may go on without them.
        paper: BTreeMap<String, Vec<f64>>, in above(0.0);
        /// Ratios within this relative distance of the paper's agree with it: it gives two digits.
        tolerance: f64 = 0.1, in 0.0..=1.0;
        /// Why ours differs, where it does.
        reason: String;
    }
    check |config: &Self| one_for_each(&config.paper, &config.methods);
}

/// One method on one scene by one measurement, as written to `ray_tests.csv`: the run of median cost.
#[derive(Serialize, JsonSchema)]
pub(super) struct Measured<'a> {
    scene: &'a str,
    method: &'a str,
    family: &'a str,
    query: &'a str,
    /// Number of rays.
    rays: u64,
    boxes_per_ray: f64,
    boxes_low: f64,
    boxes_high: f64,
    objects_per_ray: f64,
    goldsmith_salmon: f64,
    /// Tests against boxes over the first method's.
    boxes_over_first: f64,
    over_first_low: f64,
    over_first_high: f64,
    /// The paper's number, where it has one.
    paper_boxes_per_ray: Option<f64>,
}

/// The kind of rays that the paper sends: they start inside and end at any hit.
const OF_PAPER: (&str, &str) = ("inside", "any");

const PAPER: &str = "inside, any: the paper's, on its own scene";

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut table = Vec::new();
        for scene in rows.scenes() {
            for kind in rows.ray_kinds() {
                let methods = self.methods.iter().enumerate();
                table.extend(
                    methods.filter_map(|(at, method)| self.measured(rows, scene, method, kind, at)),
                );
            }
        }
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("ray_tests", &table)?;
        let caption = "Mean number of tests against boxes, whiskers the 95 % interval; of several runs the one of \
                       median tests. The paper's rays start inside and end at any hit.";
        let panels = rows
            .scenes()
            .into_iter()
            .map(|scene| self.draw(rows, scene, &table))
            .collect();
        output.add_figure("ray_tests", caption, 2, panels);
        output.set_reference(PAPER);
        output.paper = self.compare(rows, &table);
        output.answer = ratios(&output.paper);
        let columns = "scene method family query boxes_low boxes_per_ray boxes_high boxes_over_first paper_boxes_per_ray";
        output.show("Box tests per ray with 95 % intervals:", &table, columns)?;
        output.reading = self.reading(&table);
        Ok(output)
    }

    fn measured<'a>(
        &self,
        rows: &'a Rows,
        scene: &'a str,
        method: &'a str,
        kind: (&'a str, &'a str),
        index: usize,
    ) -> Option<Measured<'a>> {
        let of_first = middle_run(rows, scene, first(&self.methods), kind)?;
        let own = middle_run(rows, scene, method, kind)?;
        let run = rows
            .runs_of(scene, method)
            .find(|run| run.repetition == own.repetition)?;
        let paper = self.paper.get(scene).filter(|_| kind == OF_PAPER);
        let [own_range, first_range] = [method, first(&self.methods)].map(|method| {
            let boxes = most_rays(rows, scene, method, kind)
                .into_iter()
                .map(|row| row.boxes_per_ray);
            range(boxes).unwrap_or((f64::NAN, f64::NAN))
        });
        let over_first_low = own_range.0 / first_range.1;
        let over_first_high = own_range.1 / first_range.0;
        Some(Measured {
            scene,
            method,
            family: kind.0,
            query: kind.1,
            rays: own.rays,
            boxes_per_ray: own.boxes_per_ray,
            boxes_low: own.boxes_low,
            boxes_high: own.boxes_high,
            objects_per_ray: own.objects_per_ray,
            goldsmith_salmon: run.goldsmith_salmon,
            boxes_over_first: own.boxes_per_ray / of_first.boxes_per_ray,
            over_first_low,
            over_first_high,
            paper_boxes_per_ray: paper.and_then(|paper| paper.get(index).copied()),
        })
    }

    /// The paper's numbers beside ours, both over those of the first method, which itself is not compared.
    fn compare(&self, rows: &Rows, table: &[Measured]) -> Vec<PaperRow> {
        let compare = |row: &Measured| {
            let of_first =
                |of: &&Measured| of.scene == row.scene && of.method == first(&self.methods);
            let base = table.iter().find(of_first)?.paper_boxes_per_ray?;
            let paper = row
                .paper_boxes_per_ray
                .filter(|_| row.method != first(&self.methods))?;
            let quantity = format!("tests per ray, {} over {}", row.method, first(&self.methods));
            let compared =
                PaperRow::new(&self.source, rows.shown(row.scene), quantity, &self.reason);
            let interval = (row.over_first_low, row.over_first_high);
            Some(compared.compare_ratios(
                paper / base,
                row.boxes_over_first,
                Some(interval),
                self.tolerance,
            ))
        };
        table.iter().filter_map(compare).collect()
    }

    fn draw(&self, rows: &Rows, scene: &str, table: &[Measured]) -> Panel {
        let bars = |(family, query): (&str, &str)| {
            let own = table
                .iter()
                .filter(|row| (row.scene, row.family, row.query) == (scene, family, query));
            let bar = |row: &Measured| (row.boxes_per_ray, (row.boxes_low, row.boxes_high));
            let (values, spread) = own.map(bar).collect();
            Layer::new(format!("{family}, {query}"), Marks::Bars { values, spread, base: 0.0 })
        };
        let paper = |kind: &(&str, &str)| {
            let paper = self
                .paper
                .get(scene)
                .filter(|_| *kind == OF_PAPER)?;
            let values = (0..self.methods.len())
                .map(|at| paper.get(at).copied().unwrap_or(f64::NAN))
                .collect();
            Some(Layer::bars(PAPER, values, 0.0))
        };
        // The paper's bars stand beside ours for the same kind of rays.
        let with_paper = |kind: (&'_ str, &'_ str)| std::iter::once(bars(kind)).chain(paper(&kind));
        let layers = rows
            .ray_kinds()
            .into_iter()
            .flat_map(with_paper)
            .collect();
        let x = Axis::categories("", self.methods.clone());
        panel(rows.shown(scene), x, Metric::BoxesPerRay.axis(), layers)
    }

    fn reading(&self, table: &[Measured]) -> String {
        let others = self.methods.iter().skip(1).map(String::as_str);
        let ratios = spans(others, table, |row| row.method, |row| Some(row.boxes_over_first), 2);
        format!("Box tests per ray over those of {}: {ratios}.", first(&self.methods))
    }
}

/// The measurements of a method's runs on a scene with the most rays of the kind.
fn most_rays<'a>(rows: &'a Rows, scene: &str, method: &str, kind: (&str, &str)) -> Vec<&'a RayRow> {
    let mut own = rows.rays_of(scene, method, kind);
    let most = own.iter().map(|row| row.rays).max();
    own.retain(|row| Some(row.rays) == most);
    own
}

/// Of a method's runs on a scene, the one of median tests per ray, the lower of two.
fn middle_run<'a>(
    rows: &'a Rows,
    scene: &str,
    method: &str,
    kind: (&str, &str),
) -> Option<&'a RayRow> {
    middle(most_rays(rows, scene, method, kind), |row| row.boxes_per_ray)
}
