//! Final costs of variations of one method over those of the method itself.

use super::config::first;
use super::paper::{PaperRow, ratios};
use super::prelude::*;
use crate::statistics::{median, range};
use bvh_config::above;
use std::collections::BTreeMap;

bvh_config::config! { serde;
    /// Variations of a method.
    pub struct Config {
        /// Where the paper has it.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods; ratios are to the first.
        methods: Vec<String>, in OneOrMore;
        /// The paper's final cost over the first method's, by method.
        paper: BTreeMap<String, f64>, in above(0.0);
        /// Ratios within this relative distance of the paper's agree with it.
        tolerance: f64 = 0.05, in 0.0..=1.0;
        /// Why ours differs, where it does.
        reason: String;
    }
}

/// One method on one scene, as written to `variations.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Variation<'a> {
    scene: &'a str,
    method: &'a str,
    runs: usize,
    lowest_cost: f64,
    median_cost: f64,
    highest_cost: f64,
    /// Median over the first method's.
    cost_over_first: f64,
    over_first_low: f64,
    over_first_high: f64,
    cost_over_base: f64,
    /// The paper's ratio, where it has one.
    paper_over_first: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let of = |scene| {
            self.methods
                .iter()
                .filter_map(move |method| self.variation(rows, scene, method))
        };
        let table: Vec<Variation> = rows.scenes().into_iter().flat_map(of).collect();
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("variations", &table)?;
        let caption = "Median final cost over that of the first, whiskers over all pairs of runs.";
        output.add_figure("variations", caption, 1, vec![self.draw(rows, &table)]);
        output.paper = table
            .iter()
            .filter_map(|row| self.compare(rows, row))
            .collect();
        output.answer = ratios(&output.paper);
        let columns =
            "scene method runs over_first_low cost_over_first over_first_high paper_over_first";
        output.show("Final costs over those of the first:", &table, columns)?;
        output.reading = self.reading(&table);
        Ok(output)
    }

    fn variation<'a>(
        &'a self,
        rows: &Rows,
        scene: &'a str,
        method: &'a str,
    ) -> Option<Variation<'a>> {
        let costs = |method: &str| {
            rows.runs_of(scene, method)
                .map(|run| run.cost)
                .collect::<Vec<f64>>()
        };
        let own = costs(method);
        let of_first = costs(first(&self.methods));
        let (lowest_cost, highest_cost) = range(own.iter().copied())?;
        let (first_low, first_high) = range(of_first.iter().copied())?;
        let median_cost = median(&own)?;
        let first_median = median(&of_first)?;
        Some(Variation {
            scene,
            method,
            runs: own.len(),
            lowest_cost,
            median_cost,
            highest_cost,
            cost_over_first: median_cost / first_median,
            over_first_low: lowest_cost / first_high,
            over_first_high: highest_cost / first_low,
            cost_over_base: median_cost / rows.base_cost(scene),
            paper_over_first: self.paper.get(method).copied(),
        })
    }

    fn compare(&self, rows: &Rows, row: &Variation) -> Option<PaperRow> {
        let quantity = format!("final cost, {} over {}", row.method, first(&self.methods));
        let compared = PaperRow::new(&self.source, rows.shown(row.scene), quantity, &self.reason);
        let interval = (row.over_first_low, row.over_first_high);
        Some(compared.compare_ratios(
            row.paper_over_first?,
            row.cost_over_first,
            Some(interval),
            self.tolerance,
        ))
    }

    fn draw(&self, rows: &Rows, table: &[Variation]) -> Panel {
        let bars = |scene: &str| {
            let own = || table.iter().filter(move |row| row.scene == scene);
            let values = own().map(|row| row.cost_over_first).collect();
            let spread = own()
                .map(|row| (row.over_first_low, row.over_first_high))
                .collect();
            Layer::new(rows.shown(scene), Marks::Bars { values, spread, base: 1.0 })
        };
        let layers = rows.scenes().into_iter().map(bars).collect();
        let y = Axis::linear(format!("final cost / {}", first(&self.methods)));
        panel("", Axis::categories("", self.methods.clone()), y, layers)
    }

    fn reading(&self, table: &[Variation]) -> String {
        let others = self.methods.iter().skip(1).map(String::as_str);
        let ratios = spans(others, table, |row| row.method, |row| Some(row.cost_over_first), 3);
        format!("Final cost over that of {}, over scenes: {ratios}.", first(&self.methods))
    }
}
