//! Gaps to the exact optimum of small scenes, by method, and the tightness of the lower bound.

use super::prelude::*;
use crate::statistics::quantile;
use bvh_scenes::subset::Subset;
use std::collections::{BTreeMap, BTreeSet};

bvh_config::config! { serde;
    /// Gaps to the exact optimum.
    pub struct Config {
        /// Heading.
        title: String;
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

/// The lower bound over the optimum, on all scenes of one kind and size, as written to
/// `tightness.csv`.
#[derive(Serialize)]
pub(super) struct Tightness {
    /// `random` or `cluster`.
    part: &'static str,
    objects: usize,
    /// Number of scenes.
    scenes: usize,
    /// The least of all scenes.
    minimum_bound_over_optimum: f64,
    /// The median.
    median_bound_over_optimum: f64,
    /// The greatest.
    maximum_bound_over_optimum: f64,
}

/// The gaps of all runs by method, kind of part and number of objects, and the bounds over the
/// optimum of all scenes by the latter two.
struct Found<'a> {
    gaps: BTreeMap<(&'a str, &'static str, usize), Vec<f64>>,
    bounds: BTreeMap<(&'static str, usize), Vec<f64>>,
    optima: usize,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let found = self.find(rows);
        let summaries = self.summaries(&found);
        let tightness: Vec<Tightness> = found.bounds.iter().map(tightness).collect();
        let mut output = Output::new("", &self.title);
        output.add_csv("gaps", &summaries)?;
        if !tightness.is_empty() {
            output.add_csv("tightness", &tightness)?;
        }
        let caption = format!(
            "{} small scenes. Left, the fraction of runs that end at the optimum; right, the worst gap of any. Below, \
             the proven lower bound over the optimum: median, and from least to greatest.",
            found.optima
        );
        let mut panels = self.draw(&summaries);
        panels.extend(draw_bounds(&tightness));
        output.add_figure("gaps", caption, 2, panels);
        let columns = "method part objects runs solved_fraction median_gap maximum_gap";
        output.show("Gaps to the exact optimum:", &summaries, columns)?;
        Ok(output)
    }

    fn find<'a>(&self, rows: &'a Rows) -> Found<'a> {
        let optimal = rows.runs.iter().filter(|run| run.method == self.optimum);
        let optima: BTreeMap<&str, f64> =
            optimal.map(|run| (run.scene.as_str(), run.cost)).collect();
        let mut found =
            Found { gaps: BTreeMap::new(), bounds: BTreeMap::new(), optima: optima.len() };
        for run in rows.runs.iter().filter(|run| self.methods.contains(&run.method)) {
            if let Some(&optimum) = optima.get(run.scene.as_str()) {
                // An optimum of 0 has no relative gap, so the cost itself is the gap.
                let gap = if optimum > 0.0 { run.cost / optimum - 1.0 } else { run.cost };
                found
                    .gaps
                    .entry((&run.method, part(&run.scene), run.objects))
                    .or_default()
                    .push(gap);
            }
        }
        for row in &rows.bounds {
            if let Some(optimum) = optima.get(row.scene.as_str()).filter(|&&optimum| optimum > 0.0)
            {
                let same = found.bounds.entry((part(&row.scene), row.objects)).or_default();
                same.push(row.lower_bound / optimum);
            }
        }
        found
    }

    fn summaries<'a>(&self, found: &Found<'a>) -> Vec<Gaps<'a>> {
        let summary =
            |(&(method, part, objects), gaps): (&(&'a str, &'static str, usize), &Vec<f64>)| Gaps {
                method,
                part,
                objects,
                runs: gaps.len(),
                solved_fraction: solved(gaps),
                median_gap: at(gaps, 0.5),
                quantile_90_gap: at(gaps, 0.9),
                maximum_gap: at(gaps, 1.0),
            };
        let of = |method| found.gaps.iter().filter(move |((of, ..), _)| of == method);
        self.methods.iter().flat_map(of).map(summary).collect()
    }

    /// Draws the fraction solved and the worst gap against size, for every kind of part.
    fn draw(&self, summaries: &[Gaps]) -> Vec<Panel> {
        let parts: BTreeSet<&str> = summaries.iter().map(|summary| summary.part).collect();
        let draw = |part: &str, title: &str, y: Axis, value: fn(&Gaps) -> f64| {
            let line = |method: &String| {
                let own = summaries
                    .iter()
                    .filter(|summary| summary.part == part && summary.method == method);
                let points: Vec<_> =
                    own.map(|summary| (summary.objects as f64, value(summary))).collect();
                let marks = [Marks::Line(points.clone()), Marks::Points(points)];
                marks.map(|marks| Layer::new(method, marks))
            };
            let lines = self.methods.iter().flat_map(line).collect();
            panel(format!("{part}, {title}"), Axis::linear("objects"), y, lines)
        };
        let both = |part| {
            let fraction = Axis::linear("runs").range(0.0, 1.02).unit(Unit::Percent);
            let gap = Axis::linear("greatest gap").unit(Unit::Percent);
            [
                draw(part, "solved", fraction, |summary| summary.solved_fraction),
                draw(part, "greatest gap", gap, |summary| summary.maximum_gap.max(0.0)),
            ]
        };
        parts.into_iter().flat_map(both).collect()
    }
}

fn tightness((&(part, objects), bounds): (&(&'static str, usize), &Vec<f64>)) -> Tightness {
    Tightness {
        part,
        objects,
        scenes: bounds.len(),
        minimum_bound_over_optimum: at(bounds, 0.0),
        median_bound_over_optimum: at(bounds, 0.5),
        maximum_bound_over_optimum: at(bounds, 1.0),
    }
}

/// Draws the lower bound over the optimum against size, for every kind of part.
fn draw_bounds(tightness: &[Tightness]) -> Vec<Panel> {
    let parts: BTreeSet<&str> = tightness.iter().map(|row| row.part).collect();
    let draw = |part| {
        let own = || tightness.iter().filter(move |row| row.part == part);
        let range = |row: &Tightness| {
            (row.objects as f64, row.minimum_bound_over_optimum, row.maximum_bound_over_optimum)
        };
        let median = |row: &Tightness| (row.objects as f64, row.median_bound_over_optimum);
        let layers = vec![
            Layer::new("lower bound", Marks::Band(own().map(range).collect())),
            Layer::new("lower bound", Marks::Line(own().map(median).collect())),
        ];
        let y = Axis::linear("bound / optimum").range(0.0, 1.02).unit(Unit::Percent);
        panel(format!("{part}, lower bound"), Axis::linear("objects"), y, layers)
    };
    parts.into_iter().map(draw).collect()
}

/// Returns the kind of part of a scene.
fn part(scene: &str) -> &'static str {
    match Subset::parse(scene) {
        Some((_, Subset::Random(..))) => "random",
        Some((_, Subset::Cluster(..))) => "cluster",
        Some((_, Subset::Spaced(_))) | None => "whole",
    }
}

fn at(values: &[f64], q: f64) -> f64 {
    quantile(values, q).unwrap_or(f64::NAN)
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
