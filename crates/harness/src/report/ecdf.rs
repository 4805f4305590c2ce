//! The fraction of all pairs of scene and target that runs have solved within some time: one curve per method over
//! everything.
//!
//! The aggregated empirical cumulative distribution of run times of Hansen et al. 2021 ('COCO').

use super::attempt::{Attempt, attempts, staircase};
use super::config::Targets;
use super::prelude::*;
use super::progress::{ProgressAxis, longest_of_all};

/// One step, as written to `timing_ecdf.csv`, `ecdf_evaluations.csv` and `ecdf_work.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Step<'a> {
    method: &'a str,
    x: f64,
    /// Of all runs, on all scenes, for all targets.
    solved_fraction: f64,
}

pub(super) fn write(config: &Targets, rows: &Rows) -> Result<Output, Error> {
    let mut output = Output::new(&config.source, &config.title);
    let targets = each(&config.targets, |target| Some(target.to_string()));
    let scenes = rows.all_shown().join(", ");
    let caption = format!(
        "Fraction of all runs and targets solved. A method runs for its own budget, after which its line is flat: compare methods where \
         all still run. Scenes: {scenes}. Targets: {targets}."
    );
    for axis in ProgressAxis::of(rows, &config.methods) {
        let attempts = attempts(config, rows, axis);
        let ends = rows
            .scenes()
            .into_iter()
            .map(|scene| longest_of_all(rows, scene, &config.methods, axis));
        let end = ends.fold(0.0, f64::max);
        let mut steps = Vec::new();
        let mut layers = Vec::new();
        for method in &config.methods {
            let points = curve(&attempts, method, end);
            steps.extend(points.iter().map(|&(x, solved_fraction)| Step {
                method,
                x,
                solved_fraction,
            }));
            layers.push(Layer::new(method, Marks::Steps(points)));
        }
        axis.add_csv(&mut output, "ecdf", &steps)?;
        let y = Axis::linear("fraction solved").range(0.0, 1.02);
        let panels = vec![panel("", axis.axis(), y, layers)];
        output.add_figure(axis.file("ecdf"), caption.as_str(), 1, panels);
        // What is solved at the end is the same along every axis, and is said once.
        if axis == ProgressAxis::Work {
            let reached = each(&config.methods, |method| {
                let (solved, runs) = solved(&attempts, method);
                Some(format!("{method} {:.0} %", 100.0 * solved.len() as f64 / runs as f64))
            });
            output.reading = format!("Of all runs and targets, reached at the end: {reached}.");
        }
    }
    Ok(output)
}

/// When a method's runs reached what they did, sorted, and how many runs there were over all problems.
fn solved(attempts: &[Attempt], method: &str) -> (Vec<f64>, usize) {
    let own = || {
        attempts
            .iter()
            .filter(|attempt| attempt.method == method)
    };
    let mut solved: Vec<f64> = own()
        .flat_map(|attempt| attempt.solved.iter().copied())
        .collect();
    solved.sort_by(f64::total_cmp);
    (solved, own().map(|attempt| attempt.runs).sum())
}

/// The fraction that a method has solved, with one step for all runs that solve something at the same time.
fn curve(attempts: &[Attempt], method: &str, end: f64) -> Vec<(f64, f64)> {
    let (solved, runs) = solved(attempts, method);
    let mut count = 0;
    let rise = |together: &[f64]| {
        count += together.len();
        (together[0], count as f64 / runs as f64)
    };
    staircase(solved.chunk_by(|a, b| a == b).map(rise).collect(), end)
}
