//! Run-time distributions: how likely a randomised search has reached a target within some time.
//!
//! One distribution per target is Hoos & Stützle's qualified run-time distribution (1998); the fit is that of the
//! time-to-target plots of Aiex, Resende & Ribeiro (2007).

use super::progress::{Along, longest, median_reached, reached, series};
use super::statistics::time_to_target::ShiftedExponential;
use super::target::Target;
use super::{Output, Rows, looks, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Look, Panel};
use serde::{Deserialize, Serialize};

/// Run-time distributions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What it belongs to.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods. Every repetition is one run: 25 or more make a distribution.
    pub methods: Vec<String>,
    /// What is to be reached. Default base, base −1 %, best known +1 % and +0.1 %.
    #[serde(default = "Target::usual")]
    pub targets: Vec<Target>,
}

/// One step of a distribution, as written to `timing_run_times.csv`, `run_times_evaluations.csv` and
/// `run_times_work.csv`.
#[derive(Serialize)]
struct Step<'a> {
    scene: &'a str,
    target: String,
    target_cost: f64,
    method: &'a str,
    x: f64,
    solved_fraction: f64,
}

/// One fit, as written to `timing_run_times_fit.csv` and so on; shift, mean and median are in the unit of the file's
/// axis.
#[derive(Serialize)]
struct Fit<'a> {
    scene: &'a str,
    target: String,
    method: &'a str,
    runs: usize,
    solved: usize,
    /// Of all runs; empty if fewer than half were solved.
    median: Option<f64>,
    /// Of the shifted exponential distribution; empty if fewer than three quarters were solved, or all at once.
    shift: Option<f64>,
    mean: Option<f64>,
    /// The greatest difference between fit and distribution.
    kolmogorov_smirnov_distance: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        for along in Along::ALL {
            let (mut steps, mut fits, mut panels) = (Vec::new(), Vec::new(), Vec::new());
            for (scene, _) in rows.scenes() {
                for target in &self.targets {
                    let Some(cost) = target.cost(rows, scene) else { continue };
                    let (mut layers, mut laws) = (Vec::new(), Vec::new());
                    for method in &self.methods {
                        let runs = series(rows, scene, method, along);
                        let mut solved: Vec<f64> = runs.iter().filter_map(|run| reached(run, cost)).collect();
                        solved.sort_by(f64::total_cmp);
                        let curve = distribution(&solved, runs.len(), longest(rows, scene, method, along));
                        steps.extend(curve.iter().map(|&(x, solved_fraction)| Step {
                            scene,
                            target: target.name(),
                            target_cost: cost,
                            method,
                            x,
                            solved_fraction,
                        }));
                        let law = ShiftedExponential::fit(&solved, runs.len());
                        // What never happens has no curve.
                        let points = if solved.is_empty() { vec![] } else { curve };
                        layers.push(Layer::Steps { name: method.clone(), points });
                        laws.extend(law.map(|law| drawn(&law, &solved)));
                        fits.push(Fit {
                            scene,
                            target: target.name(),
                            method,
                            runs: runs.len(),
                            solved: solved.len(),
                            median: median_reached(&runs, cost),
                            shift: law.map(|law| law.shift),
                            mean: law.map(|law| law.mean),
                            kolmogorov_smirnov_distance: law.map(|law| law.distance(&solved, runs.len())),
                        });
                    }
                    layers.extend(laws);
                    let title = format!("{scene}: {}", target.name());
                    let y = Axis::linear("P(solved)").range(0.0, 1.02);
                    panels.push(Panel { title, x: Axis::log(along.label()), y, layers });
                }
            }
            output.figures.push((along.file("run_times"), self.figure(rows, panels)));
            output.csv.push((along.file("run_times"), along.csv(&steps)?));
            output.csv.push((along.file("run_times_fit"), along.csv(&fits)?));
            if along == Along::Seconds {
                output.text = self.text(rows, &fits);
            }
            if along == Along::Work {
                output.reading = self.reading(&fits);
            }
        }
        Ok(output)
    }

    fn figure(&self, rows: &Rows, panels: Vec<Panel>) -> Figure {
        let mut looks = looks(&self.methods);
        looks.push((FIT.into(), Look::Reference));
        let scenes: Vec<String> = rows.scenes().into_iter().map(|(scene, _)| rows.shown(scene)).collect();
        let caption = format!(
            "{}. Fraction of runs with an incumbent at or below the target. A curve ends where the longest run did; a \
             method without one never got there. Dashed black: time-to-target fits.",
            scenes.join(", ")
        );
        Figure { title: format!("{}: {}", self.source, self.title), caption, columns: 2, panels, looks }
    }

    /// How often each method reached the last target, which is the hardest in most specs.
    fn reading(&self, fits: &[Fit]) -> String {
        let Some(last) = self.targets.last().map(Target::name) else { return String::new() };
        let of = |method: &String| {
            let own = || fits.iter().filter(|fit| fit.method == method && fit.target == last);
            let (solved, runs) =
                own().fold((0, 0), |(solved, runs), fit| (solved + fit.solved, runs + fit.runs));
            format!("{method} in {solved} of {runs} runs")
        };
        let all: Vec<String> = self.methods.iter().map(of).collect();
        format!("{last} was reached by {}.", all.join(", "))
    }

    fn text(&self, rows: &Rows, fits: &[Fit]) -> String {
        let mut table = text_table(["scene", "target", "method", "solved", "median (s)", "shift + mean (s)"]);
        for fit in fits {
            let show = |value: f64| format!("{value:.3}");
            let law = fit.shift.zip(fit.mean).map(|(shift, mean)| format!("{shift:.3} + {mean:.3}"));
            table.add_row([
                rows.shown(fit.scene),
                fit.target.clone(),
                fit.method.into(),
                format!("{} of {}", fit.solved, fit.runs),
                fit.median.map_or_else(String::new, show),
                law.unwrap_or_default(),
            ]);
        }
        format!("{}: {}\n{table}\n", self.source, self.title)
    }
}

const FIT: &str = "shifted exponential";

/// The fraction of `runs` solved, at every sorted time at which it grows and at the end.
fn distribution(solved: &[f64], runs: usize, end: f64) -> Vec<(f64, f64)> {
    let fraction = |count: usize| count as f64 / runs as f64;
    let mut steps: Vec<(f64, f64)> = solved.iter().zip(1..).map(|(&x, count)| (x, fraction(count))).collect();
    if let Some(first) = steps.first().map(|step| step.0) {
        steps.insert(0, (first, 0.0));
        steps.push((end.max(steps.last().map_or(end, |step| step.0)), fraction(solved.len())));
    } else if runs > 0 {
        steps.push((end, 0.0));
    }
    steps
}

/// The distribution from the first run solved to the last.
fn drawn(law: &ShiftedExponential, solved: &[f64]) -> Layer {
    const POINTS: u32 = 60;
    let (first, last) = solved.first().zip(solved.last()).map_or((1.0, 1.0), |(first, last)| (*first, *last));
    let place = |step: u32| first * (last / first).powf(f64::from(step) / f64::from(POINTS));
    let points = (0..=POINTS).map(place).map(|x| (x, law.probability(x))).collect();
    Layer::Line { name: FIT.into(), points }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_rises_at_every_solved_run_and_stays_until_the_end() {
        let steps = distribution(&[2.0, 3.0], 4, 9.0);
        assert_eq!(steps, [(2.0, 0.0), (2.0, 0.25), (3.0, 0.5), (9.0, 0.5)]);
        assert_eq!(distribution(&[], 4, 9.0), [(9.0, 0.0)]);
        assert_eq!(distribution(&[], 0, 0.0), []);
    }
}
