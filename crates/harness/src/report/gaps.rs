//! Gaps to the exact optimum of small scenes, by method.

use super::prelude::*;
use crate::statistics::quantile;
use bvh_scenes::subset::Subset;
use std::collections::BTreeMap;

report! {
    /// Gaps to the exact optimum.
    pub struct Config {
        /// Labels of the methods to compare. Their trees must be binary with one object per leaf.
        methods: Vec<String>, in OneOrMore;
        /// Label of the method that finds the optimum.
        optimum: String;
    }
}

/// A gap below this is rounding: the method has found the optimum.
const SOLVED: f64 = 1e-12;

/// One method on all scenes of one kind and size, as written to `gaps.csv`; gap = (cost − optimum)
/// / optimum.
#[derive(Serialize)]
pub(super) struct Gaps<'a> {
    method: &'a str,
    /// `random`, `cluster`, or `whole` for scenes that are no such part.
    part: &'static str,
    objects: usize,
    runs: usize,
    /// Fraction of the runs that found the optimum.
    solved_fraction: f64,
    /// The median gap.
    median_gap: f64,
    /// The gap that nine of ten runs do not exceed.
    quantile_90_gap: f64,
    /// The greatest gap.
    maximum_gap: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let optimal = rows.runs.iter().filter(|run| run.method == self.optimum);
        let optima: BTreeMap<&str, f64> =
            optimal.map(|run| (run.scene.as_str(), run.cost)).collect();
        let mut summaries = Vec::new();
        for method in &self.methods {
            let mut gaps_by_part: BTreeMap<(&'static str, usize), Vec<f64>> = BTreeMap::new();
            for run in rows.runs.iter().filter(|run| run.method == *method) {
                let Some(&optimum) = optima.get(run.scene.as_str()) else { continue };
                // An optimum of 0 has no relative gap, so the cost itself is the gap.
                let gap = if optimum > 0.0 { run.cost / optimum - 1.0 } else { run.cost };
                gaps_by_part.entry((part(&run.scene), run.objects)).or_default().push(gap);
            }
            summaries.extend(gaps_by_part.into_iter().map(|((part, objects), gaps)| {
                let at = |q| quantile(&gaps, q).unwrap_or(f64::NAN);
                Gaps {
                    method,
                    part,
                    objects,
                    runs: gaps.len(),
                    solved_fraction: solved(&gaps),
                    median_gap: at(0.5),
                    quantile_90_gap: at(0.9),
                    maximum_gap: at(1.0),
                }
            }));
        }
        let mut output = Output::default();
        output.add_csv("gaps", &summaries)?;
        Ok(output)
    }
}

/// Returns the kind of part of a scene.
fn part(scene: &str) -> &'static str {
    match Subset::parse(scene) {
        Some((_, Subset::Random(..))) => "random",
        Some((_, Subset::Cluster(..))) => "cluster",
        Some((_, Subset::Spaced(_))) | None => "whole",
    }
}

/// Returns the fraction of gaps that are only rounding.
fn solved(gaps: &[f64]) -> f64 {
    gaps.iter().filter(|&&gap| gap <= SOLVED).count() as f64 / gaps.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_no_gap() {
        assert_eq!(solved(&[0.0, -1e-15, 1e-14, 1e-9]), 0.75);
    }
}
