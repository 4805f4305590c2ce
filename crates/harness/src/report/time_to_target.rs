//! Error against run time in one table: seconds and work until every method is within a distance of
//! the best known.

use super::attempt::{Attempt, attempts};
use super::config::Targets;
use super::prelude::*;
use super::progress::{ProgressAxis, WORST};
use crate::statistics::order_quantile;

/// One method and target on one scene, as written to `timing_to_target.csv`,
/// `to_target_evaluations.csv` and `to_target_work.csv`.
#[derive(Serialize)]
pub(super) struct Reached<'a> {
    scene: &'a str,
    target: String,
    method: &'a str,
    runs: usize,
    solved: usize,
    /// Median over all runs, counting runs that never reach the target as last; empty if such a run
    /// is the median.
    median: Option<f64>,
    /// The same for the quantile 0.9.
    quantile_90: Option<f64>,
}

pub(super) fn write(config: &Targets, rows: &Rows) -> Result<Output, Error> {
    let mut output = Output::new(&config.source, &config.title);
    for axis in [ProgressAxis::Seconds, ProgressAxis::Work] {
        let table: Vec<Reached> = attempts(config, rows, axis)
            .iter()
            .map(reached)
            .collect();
        axis.add_csv(&mut output, "to_target", &table)?;
        let explanation = format!("{} until the target is reached, over all runs:", axis.label());
        let columns = "scene target method runs solved median quantile_90";
        output.show(&explanation, &table, columns)?;
        if axis == ProgressAxis::Seconds {
            output.reading = reading(config, &table);
        }
    }
    Ok(output)
}

fn reached<'a>(attempt: &Attempt<'a>) -> Reached<'a> {
    // Runs without success must count: dropping them would favour methods that rarely succeed.
    let mut times = attempt.solved.clone();
    times.resize(attempt.runs, WORST);
    let at = |q| order_quantile(&times, q).filter(|time| time.is_finite());
    Reached {
        scene: attempt.scene,
        target: attempt.target.to_string(),
        method: attempt.method,
        runs: attempt.runs,
        solved: attempt.solved.len(),
        median: at(0.5),
        quantile_90: at(0.9),
    }
}

/// Returns a sentence on the first method to reach each target, by scene.
fn reading(config: &Targets, table: &[Reached]) -> String {
    let firsts = config.targets.iter().filter_map(|target| {
        let rows: Vec<&Reached> = table
            .iter()
            .filter(|row| row.target == target.to_string())
            .collect();
        let first = |scene: &[&Reached]| {
            let timed = scene
                .iter()
                .filter_map(|row| Some((row.median?, row.method)));
            let (seconds, method) = timed.min_by(|a, b| a.0.total_cmp(&b.0))?;
            Some(format!("{method} on {} ({seconds:.2} s)", scene[0].scene))
        };
        let firsts = each(rows.chunk_by(|a, b| a.scene == b.scene), first);
        (!firsts.is_empty()).then(|| format!("{target}: {firsts}"))
    });
    let firsts: Vec<String> = firsts.collect();
    format!("The first method in the median to reach {}.", firsts.join("; "))
}
