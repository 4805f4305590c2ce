//! Run-time distributions: how likely a randomised search has reached a target within some time.
//!
//! One distribution per target is Hoos & Stützle's qualified run-time distribution (1998); the fit
//! is that of the time-to-target plots of Aiex, Resende & Ribeiro (2007).

use super::attempt::{Attempt, attempts, staircase};
use super::config::Targets;
use super::prelude::*;
use super::progress::ProgressAxis;
use crate::statistics::time_to_target::ShiftedExponential;

/// One step of a distribution, as written to `timing_run_times.csv`, `run_times_evaluations.csv`
/// and `run_times_work.csv`.
#[derive(Serialize)]
pub(super) struct Step<'a> {
    scene: &'a str,
    target: String,
    target_cost: f64,
    method: &'a str,
    x: f64,
    solved_fraction: f64,
}

/// One fit, as written to `timing_run_times_fit.csv`, `run_times_fit_evaluations.csv` and
/// `run_times_fit_work.csv`; shift, mean and median are in the unit of the file's
/// axis.
#[derive(Serialize)]
pub(super) struct Fit<'a> {
    scene: &'a str,
    target: String,
    method: &'a str,
    runs: usize,
    solved: usize,
    /// Median over all runs; empty if fewer than half were solved.
    median: Option<f64>,
    /// Shift of the fitted exponential distribution; empty if fewer than three quarters were solved,
    /// or all at once.
    shift: Option<f64>,
    /// The mean time after the shift.
    mean: Option<f64>,
    /// The greatest difference between fit and distribution.
    kolmogorov_smirnov_distance: Option<f64>,
}

const FIT: &str = "shifted exponential";

pub(super) fn write(config: &Targets, rows: &Rows) -> Result<Output, Error> {
    let mut output = Output::new(&config.source, &config.title);
    let caption = format!(
        "{}. Fraction of runs with an incumbent at or below the target. A curve ends where the longest run did; a \
         method without one never got there, and a target that no method has reached has no panel. Dashed black: time-to-target fits.",
        rows.all_shown().join(", ")
    );
    for axis in ProgressAxis::of(rows, &config.methods) {
        let attempts = attempts(config, rows, axis);
        let problems = attempts.chunks(config.methods.len().max(1));
        // A target that nobody has reached would be an empty panel.
        let reached = problems.filter(|problem| {
            problem
                .iter()
                .any(|attempt| !attempt.solved.is_empty())
        });
        let panels = reached
            .map(|problem| draw(problem, axis))
            .collect();
        output.add_figure(axis.file("run_times"), caption.as_str(), 2, panels);
        output.set_reference(FIT);
        axis.add_csv(
            &mut output,
            "run_times",
            &attempts
                .iter()
                .flat_map(steps)
                .collect::<Vec<_>>(),
        )?;
        let fits: Vec<Fit> = attempts.iter().map(fit).collect();
        axis.add_csv(&mut output, "run_times_fit", &fits)?;
        if axis == ProgressAxis::Seconds {
            let columns = "scene target method runs solved median shift mean";
            output.show("Seconds until the target is reached:", &fits, columns)?;
            output.reading = reading(config, &fits);
        }
    }
    Ok(output)
}

/// Returns the fraction of runs solved, at every time at which it grows and at the end.
fn distribution(attempt: &Attempt) -> Vec<(f64, f64)> {
    let fraction = |count: u32| f64::from(count) / attempt.runs as f64;
    let rises = attempt
        .solved
        .iter()
        .zip(1..)
        .map(|(&x, count)| (x, fraction(count)))
        .collect();
    staircase(rises, attempt.end)
}

fn steps<'a>(attempt: &Attempt<'a>) -> Vec<Step<'a>> {
    let &Attempt { scene, target, cost, method, runs, end, .. } = attempt;
    let mut points = distribution(attempt);
    // A method that never succeeds still has a row, at fraction 0, so that it is not forgotten.
    if points.is_empty() && runs > 0 {
        points.push((end, 0.0));
    }
    let step = |(x, solved_fraction)| Step {
        scene,
        target: target.to_string(),
        target_cost: cost,
        method,
        x,
        solved_fraction,
    };
    points.into_iter().map(step).collect()
}

fn fit<'a>(attempt: &Attempt<'a>) -> Fit<'a> {
    let &Attempt { scene, target, method, runs, ref solved, median, .. } = attempt;
    let law = ShiftedExponential::fit(solved, runs);
    Fit {
        scene,
        target: target.to_string(),
        method,
        runs,
        solved: solved.len(),
        median,
        shift: law.map(|law| law.shift),
        mean: law.map(|law| law.mean),
        kolmogorov_smirnov_distance: law.map(|law| law.distance(solved, runs)),
    }
}

/// Draws all methods at one problem, with the fitted distributions on top.
fn draw(problem: &[Attempt], axis: ProgressAxis) -> Panel {
    let curve = |attempt: &Attempt| Layer::new(attempt.method, Marks::Steps(distribution(attempt)));
    let laws = problem
        .iter()
        .filter_map(|Attempt { solved, runs, .. }| {
            Some(fitted_curve(
                &ShiftedExponential::fit(solved, *runs)?,
                *solved.first()?,
                *solved.last()?,
            ))
        });
    let layers = problem.iter().map(curve).chain(laws).collect();
    let title = format!("{}: {}", problem[0].scene, problem[0].target);
    panel(title, axis.axis(), Axis::linear("P(solved)").range(0.0, 1.02), layers)
}

/// Draws the fitted distribution from the first run solved to the last.
fn fitted_curve(law: &ShiftedExponential, first: f64, last: f64) -> Layer {
    const POINTS: u32 = 60;
    // The axis is logarithmic, so evenly spaced logarithms draw a smooth curve.
    let place = |step: u32| first * (last / first).powf(f64::from(step) / f64::from(POINTS));
    let points = (0..=POINTS)
        .map(place)
        .map(|x| (x, law.probability(x)))
        .collect();
    Layer::new(FIT, Marks::Line(points))
}

/// Returns a sentence on the last target, which is the hardest in most specs.
fn reading(config: &Targets, fits: &[Fit]) -> String {
    let Some(last) = config.targets.last().map(ToString::to_string) else { return String::new() };
    let methods = each(&config.methods, |method| {
        let own = || {
            fits.iter()
                .filter(|fit| fit.method == method && fit.target == last)
        };
        let (solved, runs): (usize, usize) =
            (own().map(|fit| fit.solved).sum(), own().map(|fit| fit.runs).sum());
        Some(format!("{method} in {solved} of {runs} runs"))
    });
    format!("{last} was reached by {methods}.")
}
