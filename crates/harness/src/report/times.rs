//! Times of methods against each other, pair by pair, in the same run.

use super::statistics::{median, quantile, range};
use super::{Output, Rows, display_name, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A comparison of times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper has it.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods; ratios are to the first.
    pub methods: Vec<String>,
    /// The paper's seconds by scene, in the order of `methods`.
    #[serde(default)]
    pub paper: BTreeMap<String, Vec<f64>>,
}

/// One comparison, as written to `timing_ratios.csv`.
#[derive(Serialize)]
struct Ratio<'a> {
    scene: &'a str,
    method: &'a str,
    repetitions: usize,
    median_seconds: f64,
    /// Quartiles and median of the ratios to the first method, repetition by repetition.
    ratio_low: f64,
    ratio_median: f64,
    ratio_high: f64,
    paper_ratio: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let seconds = |scene: &str, method: &str| rows.seconds_of(scene, method).collect::<Vec<f64>>();
        let scenes = rows.scenes();
        let mut ratios = Vec::new();
        let first = self.methods.first().map_or("", String::as_str);
        for (index, method) in self.methods.iter().enumerate() {
            for &(scene, _) in &scenes {
                let (base, own) = (seconds(scene, first), seconds(scene, method));
                let pairs: Vec<f64> = own.iter().zip(&base).map(|(own, base)| own / base).collect();
                let paper = self.paper.get(scene);
                let at = |q| quantile(&pairs, q).unwrap_or(f64::NAN);
                ratios.push(Ratio {
                    scene,
                    method,
                    repetitions: own.len(),
                    median_seconds: median(&own).unwrap_or(f64::NAN),
                    ratio_low: at(0.25),
                    ratio_median: at(0.5),
                    ratio_high: at(0.75),
                    paper_ratio: paper.and_then(|paper| Some(paper.get(index)? / paper.first()?)),
                });
            }
        }
        Ok(Output {
            csv: vec![("timing_ratios".into(), to_bytes(&ratios, Path::new("timing_ratios.csv"))?)],
            figures: vec![("times".into(), self.figure(&scenes, &ratios))],
            paper: vec![],
            text: self.text(&scenes, &ratios),
            reading: self.reading(&ratios),
        })
    }

    fn reading(&self, ratios: &[Ratio]) -> String {
        let first = self.methods.first().map_or("", String::as_str);
        let of = |method: &String| {
            let own = ratios.iter().filter(|ratio| ratio.method == method).map(|ratio| ratio.ratio_median);
            let (low, high) = range(own)?;
            Some(format!("'{method}' takes {low:.3} to {high:.3} times as long as '{first}', median by scene"))
        };
        self.methods.iter().skip(1).filter_map(of).collect::<Vec<_>>().join("; ") + "."
    }

    fn figure(&self, scenes: &[(&str, &str)], ratios: &[Ratio]) -> Figure {
        let names = scenes.iter().map(|&(scene, kind)| display_name(scene, kind)).collect();
        let mut layers = Vec::new();
        for method in self.methods.iter().skip(1) {
            let own: Vec<_> = ratios.iter().filter(|ratio| ratio.method == method).collect();
            layers.push(Layer::Bars {
                name: method.clone(),
                values: own.iter().map(|ratio| ratio.ratio_median).collect(),
                spread: own.iter().map(|ratio| (ratio.ratio_low, ratio.ratio_high)).collect(),
                base: 1.0,
            });
            let paper = own.iter().enumerate().filter_map(|(at, ratio)| Some((at as f64, ratio.paper_ratio?)));
            layers.push(Layer::Points { name: format!("{method}, paper"), points: paper.collect() });
        }
        let first = self.methods.first().map_or("", String::as_str);
        layers.push(Layer::HLine { y: 1.0, label: first.into() });
        let y = Axis::linear(format!("time / time of '{first}'"));
        let panel = Panel { title: String::new(), x: Axis::categories("", names), y, layers };
        let caption =
            "Median of the ratios repetition by repetition, whiskers from quartile to quartile.".into();
        Figure {
            title: format!("{}: {}", self.source, self.title),
            caption,
            columns: 1,
            panels: vec![panel],
            ..Default::default()
        }
    }

    fn text(&self, scenes: &[(&str, &str)], ratios: &[Ratio]) -> String {
        let mut table = text_table(["scene", "method", "median (ms)", "ratio, quartiles", "paper"]);
        for &(scene, kind) in scenes {
            for ratio in ratios.iter().filter(|ratio| ratio.scene == scene) {
                let Ratio { ratio_low, ratio_median, ratio_high, .. } = ratio;
                table.add_row([
                    display_name(scene, kind),
                    ratio.method.into(),
                    format!("{:.3}", ratio.median_seconds * 1e3),
                    format!("{ratio_median:.3}  ({ratio_low:.3} to {ratio_high:.3})"),
                    ratio.paper_ratio.map_or_else(String::new, |paper| format!("{paper:.3}")),
                ]);
            }
        }
        format!("{}: {}\n{table}\n", self.source, self.title)
    }
}
