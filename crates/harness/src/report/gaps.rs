//! How far from the exact optimum every method ends on small scenes, and how tight the lower bound is there.

use super::statistics::quantile;
use super::{Output, Rows, looks, text_table};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Gaps to the exact optimum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Heading.
    pub title: String,
    /// Labels of the methods to compare. Their trees must be binary with one object per leaf.
    pub methods: Vec<String>,
    /// Label of the method that finds the optimum.
    pub optimum: String,
}

/// A gap below this is rounding: the method has found the optimum.
const SOLVED: f64 = 1e-12;

/// One method on all scenes of one kind and size, as written to `gaps.csv`; gap = (cost − optimum) / optimum.
#[derive(Serialize)]
struct Gaps<'a> {
    method: &'a str,
    /// `random`, `cluster`, or `whole` for scenes that are no such part.
    part: &'a str,
    objects: usize,
    runs: usize,
    solved_fraction: f64,
    median_gap: f64,
    quantile_90_gap: f64,
    maximum_gap: f64,
}

/// The lower bound over the optimum, on all scenes of one kind and size, as written to `tightness.csv`.
#[derive(Serialize)]
struct Tightness<'a> {
    part: &'a str,
    objects: usize,
    scenes: usize,
    minimum_bound_over_optimum: f64,
    median_bound_over_optimum: f64,
    maximum_bound_over_optimum: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let optimal = rows.runs.iter().filter(|run| run.method == self.optimum);
        let optima: BTreeMap<&str, f64> = optimal.map(|run| (run.scene.as_str(), run.cost)).collect();
        // By method, kind of part and size.
        let mut gaps: BTreeMap<(&str, &str, usize), Vec<f64>> = BTreeMap::new();
        for run in rows.runs.iter().filter(|run| self.methods.contains(&run.method)) {
            if let Some(&optimum) = optima.get(run.scene.as_str()) {
                let gap = if optimum > 0.0 { run.cost / optimum - 1.0 } else { run.cost };
                gaps.entry((&run.method, part(&run.scene), run.objects)).or_default().push(gap);
            }
        }
        let mut ratios: BTreeMap<(&str, usize), Vec<f64>> = BTreeMap::new();
        for row in &rows.bounds {
            if let Some(optimum) = optima.get(row.scene.as_str()).filter(|&&optimum| optimum > 0.0) {
                ratios.entry((part(&row.scene), row.objects)).or_default().push(row.lower_bound / optimum);
            }
        }
        let at = |values: &[f64], q| quantile(values, q).unwrap_or(f64::NAN);
        let mut summaries = Vec::new();
        for method in &self.methods {
            for (&(_, part, objects), gaps) in gaps.iter().filter(|((of, ..), _)| of == method) {
                summaries.push(Gaps {
                    method,
                    part,
                    objects,
                    runs: gaps.len(),
                    solved_fraction: solved(gaps),
                    median_gap: at(gaps, 0.5),
                    quantile_90_gap: at(gaps, 0.9),
                    maximum_gap: at(gaps, 1.0),
                });
            }
        }
        let tightness: Vec<Tightness> = ratios
            .iter()
            .map(|(&(part, objects), ratios)| Tightness {
                part,
                objects,
                scenes: ratios.len(),
                minimum_bound_over_optimum: at(ratios, 0.0),
                median_bound_over_optimum: at(ratios, 0.5),
                maximum_bound_over_optimum: at(ratios, 1.0),
            })
            .collect();
        let caption = format!(
            "{} small scenes. Left, the fraction of runs that end at the optimum; right, the worst gap of any. \
             Below, the proven lower bound over the optimum: median, and from least to greatest.",
            optima.len()
        );
        let mut panels = self.panels(&summaries);
        panels.extend(bound_panels(&tightness));
        let looks = looks(&self.methods);
        let figure = Figure { title: self.title.clone(), caption, columns: 2, panels, looks };
        let mut csv = vec![("gaps".into(), to_bytes(&summaries, Path::new("gaps.csv"))?)];
        if !tightness.is_empty() {
            csv.push(("tightness".into(), to_bytes(&tightness, Path::new("tightness.csv"))?));
        }
        let text = self.text(&gaps, &ratios);
        let reading = self.reading(&gaps, &ratios);
        Ok(Output { csv, figures: vec![("gaps".into(), figure)], paper: vec![], text, reading })
    }

    fn reading(
        &self,
        gaps: &BTreeMap<(&str, &str, usize), Vec<f64>>,
        ratios: &BTreeMap<(&str, usize), Vec<f64>>,
    ) -> String {
        let solves = |method: &String| {
            let own = gaps.iter().filter(|((of, ..), _)| of == method);
            let all: Vec<f64> = own.flat_map(|(_, gaps)| gaps.iter().copied()).collect();
            format!("{method} {:.1} %", 100.0 * solved(&all))
        };
        let methods: Vec<String> = self.methods.iter().map(solves).collect();
        let bounds: Vec<f64> = ratios.values().flatten().copied().collect();
        let bound = quantile(&bounds, 0.5).map_or_else(String::new, |median| {
            format!(" The lower bound is {median:.3} of the optimum (median).")
        });
        format!("Runs that end at the exact optimum: {}.{bound}", methods.join(", "))
    }

    /// Fraction solved and worst gap against size, for every kind of part.
    fn panels(&self, summaries: &[Gaps]) -> Vec<Panel> {
        let parts: BTreeSet<&str> = summaries.iter().map(|summary| summary.part).collect();
        let panel = |part: &str, title: &str, y: Axis, value: fn(&Gaps) -> f64| {
            let line = |method: &String| {
                let own = summaries.iter().filter(|summary| summary.part == part && summary.method == method);
                let points = own.map(|summary| (summary.objects as f64, value(summary))).collect();
                Layer::Line { name: method.clone(), points }
            };
            let layers = self.methods.iter().map(line).collect();
            Panel { title: format!("{part}, {title}"), x: Axis::linear("objects"), y, layers }
        };
        let both = |part| {
            let fraction = Axis::linear("fraction of runs").range(0.0, 1.02);
            let gap = Axis::linear("greatest gap (%)").starting_at(0.0);
            [
                panel(part, "solved", fraction, |summary| summary.solved_fraction),
                panel(part, "greatest gap", gap, |summary| 100.0 * summary.maximum_gap.max(0.0)),
            ]
        };
        parts.into_iter().flat_map(both).collect()
    }

    /// Over all scenes.
    fn text(
        &self,
        gaps: &BTreeMap<(&str, &str, usize), Vec<f64>>,
        ratios: &BTreeMap<(&str, usize), Vec<f64>>,
    ) -> String {
        let header = ["method", "runs", "solved", "median gap", "90 % of gaps below", "greatest gap"];
        let mut table = text_table(header);
        for method in &self.methods {
            let own = gaps.iter().filter(|((of, ..), _)| of == method);
            let all: Vec<f64> = own.flat_map(|(_, gaps)| gaps.iter().copied()).collect();
            let percent = |gap: f64| format!("{:.3} %", 100.0 * gap.max(0.0));
            let at = |q| quantile(&all, q).map_or_else(String::new, percent);
            let solved = format!("{:.1} %", 100.0 * solved(&all));
            table.add_row([method.clone(), all.len().to_string(), solved, at(0.5), at(0.9), at(1.0)]);
        }
        let all: Vec<f64> = ratios.values().flatten().copied().collect();
        let bound = quantile(&all, 0.0).zip(quantile(&all, 0.5)).map_or_else(String::new, |(least, median)| {
            format!("lower bound / optimum: median {median:.3}, least {least:.3}\n")
        });
        format!("{}\n{table}\n{bound}\n", self.title)
    }
}

/// The lower bound over the optimum against size, for every kind of part.
fn bound_panels(tightness: &[Tightness]) -> Vec<Panel> {
    let parts: BTreeSet<&str> = tightness.iter().map(|row| row.part).collect();
    let panel = |part| {
        let own = || tightness.iter().filter(move |row| row.part == part);
        let range = |row: &Tightness| {
            (row.objects as f64, row.minimum_bound_over_optimum, row.maximum_bound_over_optimum)
        };
        let median = |row: &Tightness| (row.objects as f64, row.median_bound_over_optimum);
        let name = || "lower bound".to_owned();
        let layers = vec![
            Layer::Band { name: name(), points: own().map(range).collect() },
            Layer::Line { name: name(), points: own().map(median).collect() },
        ];
        let y = Axis::linear("bound / optimum").range(0.0, 1.02);
        Panel { title: format!("{part}, lower bound"), x: Axis::linear("objects"), y, layers }
    };
    parts.into_iter().map(panel).collect()
}

/// Which kind of part of a scene it is: the word before its count and seed.
fn part(scene: &str) -> &str {
    scene.rsplit(':').nth(2).unwrap_or("whole")
}

/// The fraction of gaps that are no more than rounding.
fn solved(gaps: &[f64]) -> f64 {
    gaps.iter().filter(|&&gap| gap <= SOLVED).count() as f64 / gaps.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_part_is_the_word_before_count_and_seed() {
        let scenes = ["a:cluster:6:1", "b:random:12:0", "c", "c:30"];
        assert_eq!(scenes.map(part), ["cluster", "random", "whole", "whole"]);
    }

    #[test]
    fn rounding_is_no_gap() {
        assert_eq!(solved(&[0.0, -1e-15, 1e-14, 1e-9]), 0.75);
    }
}
