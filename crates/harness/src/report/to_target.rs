//! Error against run time in one table: seconds until every method is within a distance of the best
//! known.

use super::prelude::*;
use super::progress::{Series, WORST, reached, series};
use crate::statistics::order_quantile;

/// One method and target on one scene, as written to `timing_to_target.csv`.
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

/// Adds the seconds until `methods` reach `targets`.
pub(super) fn add(
    output: &mut Output,
    methods: &[String],
    targets: &[f64],
    rows: &Rows,
) -> Result<(), Error> {
    let mut table = Vec::new();
    for scene in rows.scenes() {
        let runs_of_methods: Vec<Vec<Series>> =
            methods.iter().map(|method| series(rows, scene, method)).collect();
        let Some(reference) = rows.reference(scene) else { continue };
        for percent in targets {
            let cost = reference.cost * (1.0 + percent / 100.0);
            let target = match percent {
                0.0 => "best known".to_owned(),
                percent => format!("best known +{percent} %"),
            };
            for (method, runs) in methods.iter().zip(&runs_of_methods) {
                table.push(Reached::new(scene, target.clone(), method, runs, cost));
            }
        }
    }
    let solved = |method: &&String| -> usize {
        table.iter().filter(|row| row.method == *method).map(|row| row.solved).sum()
    };
    let runs: usize = table.iter().map(|row| row.runs).sum::<usize>() / methods.len();
    output.finding = methods.iter().max_by_key(solved).map(|method| {
        format!("‘{method}’ reaches the target in {} of {runs} runs", solved(&method))
    });
    output.add_csv("timing_to_target", &table)?;
    let columns = "scene target method runs solved median quantile_90";
    output.show("Seconds until the target is reached, over all runs:", &table, columns)
}

impl<'a> Reached<'a> {
    fn new(scene: &'a str, target: String, method: &'a str, runs: &[Series], cost: f64) -> Self {
        // Runs without success must count: dropping them would favour methods that rarely succeed.
        let times: Vec<f64> = runs.iter().map(|run| reached(run, cost).unwrap_or(WORST)).collect();
        let quantile = |q| order_quantile(&times, q).filter(|time| time.is_finite());
        Self {
            scene,
            target,
            method,
            runs: runs.len(),
            solved: times.iter().filter(|time| time.is_finite()).count(),
            median: quantile(0.5),
            quantile_90: quantile(0.9),
        }
    }
}
