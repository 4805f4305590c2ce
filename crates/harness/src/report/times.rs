//! Times of methods against each other, pair by pair, in the same run.

use super::config::{first, one_for_each};
use super::prelude::*;
use crate::statistics::{median, quartiles, range};
use bvh_build::config::above;
use std::collections::BTreeMap;

bvh_build::config! { serde;
    /// A comparison of times.
    pub struct Config {
        /// Where the paper has it.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods; ratios are to the first.
        methods: Vec<String>, in OneOrMore;
        /// The paper's seconds by scene, in the order of `methods`.
        paper: BTreeMap<String, Vec<f64>>, in above(0.0);
    }
    check |config: &Self| one_for_each(&config.paper, &config.methods);
}

/// One comparison, as written to `timing_ratios.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Ratio<'a> {
    scene: &'a str,
    method: &'a str,
    /// Number of repetitions.
    repetitions: usize,
    /// The median wall time.
    median_seconds: f64,
    /// Lower quartile of the ratios to the first method, repetition by repetition.
    ratio_low: f64,
    /// Their median.
    ratio_median: f64,
    /// The upper quartile.
    ratio_high: f64,
    /// The paper's ratio, where it has one.
    paper_ratio: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let methods = self.methods.iter().enumerate();
        let ratios: Vec<Ratio> = methods
            .flat_map(|(index, method)| {
                scenes.iter().map(move |scene| self.compare(rows, scene, index, method))
            })
            .collect();
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("timing_ratios", &ratios)?;
        let caption = "Median of the ratios repetition by repetition, whiskers from quartile to quartile.";
        output.add_figure("timing_times", caption, 1, vec![self.draw(rows, &ratios)]);
        let explanation = format!("Time over that of '{}', median and quartiles:", first(&self.methods));
        let columns = "scene method median_seconds ratio_low ratio_median ratio_high paper_ratio";
        output.show(&explanation, &ratios, columns)?;
        output.reading = self.reading(&ratios);
        Ok(output)
    }

    fn compare<'a>(&self, rows: &Rows, scene: &'a str, index: usize, method: &'a str) -> Ratio<'a> {
        let (base, own) = (rows.seconds_of(scene, first(&self.methods)), rows.seconds_of(scene, method));
        let pairs: Vec<f64> = own.iter().zip(&base).map(|(own, base)| own / base).collect();
        let [ratio_low, ratio_median, ratio_high] = quartiles(&pairs);
        let paper = self.paper.get(scene);
        Ratio {
            scene,
            method,
            repetitions: own.len(),
            median_seconds: median(&own).unwrap_or(f64::NAN),
            ratio_low,
            ratio_median,
            ratio_high,
            paper_ratio: paper.and_then(|paper| Some(paper.get(index)? / paper.first()?)),
        }
    }

    fn reading(&self, ratios: &[Ratio]) -> String {
        let first = first(&self.methods);
        let of = |method: &String| {
            let own = ratios.iter().filter(|ratio| ratio.method == method).map(|ratio| ratio.ratio_median);
            let (low, high) = range(own)?;
            Some(format!("'{method}' takes {low:.3} to {high:.3} times as long as '{first}', median by scene"))
        };
        self.methods.iter().skip(1).filter_map(of).collect::<Vec<_>>().join("; ") + "."
    }

    fn draw(&self, rows: &Rows, ratios: &[Ratio]) -> Panel {
        let mut layers = Vec::new();
        for method in self.methods.iter().skip(1) {
            let own: Vec<_> = ratios.iter().filter(|ratio| ratio.method == method).collect();
            let values = own.iter().map(|ratio| ratio.ratio_median).collect();
            let spread = own.iter().map(|ratio| (ratio.ratio_low, ratio.ratio_high)).collect();
            layers.push(Layer::new(method, Marks::Bars { values, spread, base: 1.0 }));
            let paper = own.iter().enumerate().filter_map(|(at, ratio)| Some((at as f64, ratio.paper_ratio?)));
            layers.push(Layer::new(format!("{method}, paper"), Marks::Points(paper.collect())));
        }
        let first = first(&self.methods);
        layers.push(Layer::new(first, Marks::HLine(1.0)));
        let y = Axis::linear(format!("time / time of '{first}'"));
        panel("", Axis::categories("", rows.all_shown()), y, layers)
    }
}
