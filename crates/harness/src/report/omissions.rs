//! The ablation of what scenes do not need: that leaving it out changes no cost, and what it saves.

use super::statistics::quantile;
use super::{Output, Rows, display_name, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// An ablation. Fails if leaving something out has made a cost higher, or different where it must not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Heading.
    pub title: String,
    /// What is compared.
    pub pairs: Vec<Pair>,
}

/// The same method with something left out and without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// What is left out.
    pub name: String,
    /// Label of the method that leaves it out.
    pub out: String,
    /// Label of the method that does not.
    pub kept: String,
    /// Whether the cost may be lower with it left out, an optimum being in the place of a search. Default false.
    #[serde(default)]
    pub may_be_lower: bool,
}

/// One comparison, as written to `omissions.csv`.
#[derive(Debug, Serialize)]
struct Compared<'a> {
    scene: &'a str,
    omission: &'a str,
    runs: usize,
    /// Whether all runs cost the same, bit for bit.
    same_cost: bool,
    /// The highest of cost with it left out / cost without; 1 when both are 0.
    cost_ratio: f64,
    /// Work with it left out / work without, over all runs.
    work_ratio: f64,
}

/// Times of one comparison, as written to `timing_omissions.csv`.
#[derive(Debug, Serialize)]
struct Times<'a> {
    scene: &'a str,
    omission: &'a str,
    /// Quartiles and median of the ratios of seconds, left out / not, repetition by repetition.
    ratio_low: f64,
    ratio_median: f64,
    ratio_high: f64,
}

impl Config {
    /// The labels of all methods.
    pub fn labels(&self) -> impl Iterator<Item = &String> {
        self.pairs.iter().flat_map(|pair| [&pair.out, &pair.kept])
    }

    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let (mut compared, mut times) = (Vec::new(), Vec::new());
        for pair in &self.pairs {
            for &(scene, _) in &scenes {
                compared.push(pair.compare(rows, scene)?);
                times.push(pair.times(rows, scene));
            }
        }
        Ok(Output {
            csv: vec![
                ("omissions".into(), to_bytes(&compared, Path::new("omissions.csv"))?),
                ("timing_omissions".into(), to_bytes(&times, Path::new("timing_omissions.csv"))?),
            ],
            figures: vec![("omissions".into(), self.figure(&scenes, &times))],
            text: self.text(&scenes, &compared, &times),
            ..Output::default()
        })
    }

    fn figure(&self, scenes: &[(&str, &str)], times: &[Times]) -> Figure {
        let names = scenes.iter().map(|&(scene, kind)| display_name(scene, kind)).collect();
        let points = |pair: &Pair| {
            let own = times.iter().filter(|times| times.omission == pair.name).enumerate();
            Layer::Points {
                name: pair.name.clone(),
                points: own.map(|(at, times)| (at as f64, times.ratio_median)).collect(),
            }
        };
        let mut layers: Vec<Layer> = self.pairs.iter().map(points).collect();
        layers.push(Layer::HLine { y: 1.0, label: "nothing left out".into() });
        let y = Axis::log("time / time without leaving it out");
        Figure {
            title: self.title.clone(),
            caption: "Median of the ratios repetition by repetition.".into(),
            columns: 1,
            panels: vec![Panel { title: String::new(), x: Axis::categories("", names), y, layers }],
            ..Default::default()
        }
    }

    fn text(&self, scenes: &[(&str, &str)], compared: &[Compared], times: &[Times]) -> String {
        let mut table = text_table(["left out", "scene", "cost", "work", "time, quartiles"]);
        for (Compared { omission, scene, same_cost, cost_ratio, work_ratio, .. }, times) in
            compared.iter().zip(times)
        {
            let kind = scenes.iter().find(|(name, _)| name == scene).map_or("", |&(_, kind)| kind);
            let Times { ratio_low, ratio_median, ratio_high, .. } = times;
            table.add_row([
                (*omission).to_owned(),
                display_name(scene, kind),
                if *same_cost { "same bits".into() } else { format!("{cost_ratio:.6}") },
                format!("{work_ratio:.4}"),
                format!("{ratio_median:.4}  ({ratio_low:.4} to {ratio_high:.4})"),
            ]);
        }
        format!("{}\n{table}\n", self.title)
    }
}

impl Pair {
    fn compare<'a>(&'a self, rows: &Rows, scene: &'a str) -> Result<Compared<'a>, Error> {
        let pairs: Vec<_> = rows.runs_of(scene, &self.out).zip(rows.runs_of(scene, &self.kept)).collect();
        let same = |(out, kept): &(&crate::run::rows::RunRow, &crate::run::rows::RunRow)| {
            out.cost.to_bits() == kept.cost.to_bits()
        };
        if let Some((out, kept)) =
            pairs.iter().find(|pair| !(same(pair) || self.may_be_lower && pair.0.cost < pair.1.cost))
        {
            return Err(Error::Ablation {
                scene: scene.into(),
                message: format!("{} left out: the cost is {}, and {} without", self.name, out.cost, kept.cost),
            });
        }
        let ratio = |out: f64, kept: f64| if kept > 0.0 { out / kept } else { 1.0 };
        let work = |side: fn(&(&crate::run::rows::RunRow, &crate::run::rows::RunRow)) -> u64| {
            pairs.iter().map(side).sum::<u64>() as f64
        };
        Ok(Compared {
            scene,
            omission: &self.name,
            runs: pairs.len(),
            same_cost: pairs.iter().all(same),
            cost_ratio: pairs.iter().map(|(out, kept)| ratio(out.cost, kept.cost)).fold(0.0, f64::max),
            work_ratio: ratio(work(|pair| pair.0.work), work(|pair| pair.1.work)),
        })
    }

    fn times<'a>(&'a self, rows: &Rows, scene: &'a str) -> Times<'a> {
        let seconds = |label: &'a str| {
            rows.timing
                .iter()
                .filter(move |row| row.scene == scene && row.method == label)
                .map(|row| row.seconds)
        };
        let ratios: Vec<f64> =
            seconds(&self.out).zip(seconds(&self.kept)).map(|(out, kept)| out / kept).collect();
        let at = |q| quantile(&ratios, q).unwrap_or(f64::NAN);
        Times { scene, omission: &self.name, ratio_low: at(0.25), ratio_median: at(0.5), ratio_high: at(0.75) }
    }
}
