//! The fraction of all pairs of scene and target that runs have solved within some time: one curve per method over
//! everything.
//!
//! The aggregated empirical cumulative distribution of run times of Hansen et al. 2021 ('COCO').

use super::progress::{Along, longest, reached, series};
use super::target::Target;
use super::{Output, Rows, looks, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use serde::{Deserialize, Serialize};

/// The aggregate distribution of run times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What it belongs to.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods.
    pub methods: Vec<String>,
    /// What is to be reached. Default base, base −1 %, best known +1 % and +0.1 %.
    #[serde(default = "Target::usual")]
    pub targets: Vec<Target>,
}

/// One step, as written to `timing_ecdf.csv`, `ecdf_evaluations.csv` and `ecdf_work.csv`.
#[derive(Serialize)]
struct Step<'a> {
    method: &'a str,
    x: f64,
    /// Of all runs, on all scenes, for all targets.
    solved_fraction: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        let (mut text, mut reached_by) = (text_table(["method", "solved at the end"]), Vec::new());
        for along in Along::ALL {
            let (mut steps, mut layers) = (Vec::new(), Vec::new());
            let ends = |method: &String| {
                let ends = rows.scenes().into_iter().map(|(scene, _)| longest(rows, scene, method, along));
                ends.fold(0.0, f64::max)
            };
            let end = self.methods.iter().map(ends).fold(0.0, f64::max);
            for method in &self.methods {
                let (solved, all) = self.solved(rows, method, along);
                let curve = staircase(&solved, all, end);
                steps.extend(curve.iter().map(|&(x, solved_fraction)| Step { method, x, solved_fraction }));
                layers.push(Layer::Steps { name: method.clone(), points: curve });
                if along == Along::Work {
                    reached_by.push(format!("{method} {:.0} %", 100.0 * solved.len() as f64 / all as f64));
                    text.add_row([method.clone(), format!("{} of {all}", solved.len())]);
                }
            }
            let y = Axis::linear("fraction solved").range(0.0, 1.02);
            let panel = Panel { title: String::new(), x: Axis::log(along.label()), y, layers };
            output.figures.push((along.file("ecdf"), self.figure(rows, panel)));
            output.csv.push((along.file("ecdf"), along.csv(&steps)?));
        }
        output.text = format!("{}: {}\n{text}\n", self.source, self.title);
        output.reading = format!("Of all runs and targets, reached at the end: {}.", reached_by.join(", "));
        Ok(output)
    }

    /// When a method's runs reached what they did, sorted, and how many triples of run, scene and target there are.
    fn solved(&self, rows: &Rows, method: &str, along: Along) -> (Vec<f64>, usize) {
        let (mut solved, mut all) = (Vec::new(), 0);
        for (scene, _) in rows.scenes() {
            let runs = series(rows, scene, method, along);
            for cost in self.targets.iter().filter_map(|target| target.cost(rows, scene)) {
                all += runs.len();
                solved.extend(runs.iter().filter_map(|run| reached(run, cost)));
            }
        }
        solved.sort_by(f64::total_cmp);
        (solved, all)
    }

    fn figure(&self, rows: &Rows, panel: Panel) -> Figure {
        let targets: Vec<String> = self.targets.iter().map(Target::name).collect();
        let scenes: Vec<String> = rows.scenes().into_iter().map(|(scene, _)| rows.shown(scene)).collect();
        Figure {
            title: format!("{}: {}", self.source, self.title),
            caption: format!(
                "Fraction of all runs and targets solved. Scenes: {}. Targets: {}.",
                scenes.join(", "),
                targets.join(", ")
            ),
            columns: 1,
            panels: vec![panel],
            looks: looks(&self.methods),
        }
    }
}

/// The fraction at every time at which it grows, and at the end.
fn staircase(solved: &[f64], all: usize, end: f64) -> Vec<(f64, f64)> {
    let mut steps = Vec::new();
    let mut count = 0;
    for together in solved.chunk_by(|a, b| a == b) {
        count += together.len();
        steps.push((together[0], count as f64 / all as f64));
    }
    if let (Some(&(first, _)), Some(&(_, last))) = (steps.first(), steps.last()) {
        steps.insert(0, (first, 0.0));
        steps.push((end, last));
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_solved_together_are_one_step() {
        assert_eq!(staircase(&[1.0, 1.0, 4.0], 6, 5.0), [(1.0, 0.0), (1.0, 2.0 / 6.0), (4.0, 0.5), (5.0, 0.5)]);
        assert_eq!(staircase(&[], 6, 5.0), []);
    }
}
