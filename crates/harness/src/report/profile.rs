//! Performance profiles (Dolan & Moré 2002): on what fraction of the problems a method is within a factor of the
//! fastest.

use super::progress::{Along, median_reached, series};
use super::target::Target;
use super::{Output, Rows, looks};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use serde::{Deserialize, Serialize};

/// A performance profile. A problem is a scene with a target.
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

/// One method on one problem, as written to `timing_profile.csv`, `profile_evaluations.csv` and `profile_work.csv`.
#[derive(Serialize)]
struct Row<'a> {
    scene: &'a str,
    target: String,
    method: &'a str,
    /// Median over repetitions; empty if the median run never reached the target.
    x: Option<f64>,
    ratio_to_fastest: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        for along in Along::ALL {
            let mut table: Vec<Row> = Vec::new();
            let mut problems = 0;
            for (scene, _) in rows.scenes() {
                for target in &self.targets {
                    let Some(cost) = target.cost(rows, scene) else { continue };
                    problems += 1;
                    let times: Vec<Option<f64>> = self
                        .methods
                        .iter()
                        .map(|method| median_reached(&series(rows, scene, method, along), cost))
                        .collect();
                    let fastest = times.iter().flatten().copied().reduce(f64::min);
                    table.extend(self.methods.iter().zip(times).map(|(method, x)| Row {
                        scene,
                        target: target.name(),
                        method,
                        x,
                        ratio_to_fastest: x.zip(fastest).map(|(x, fastest)| x / fastest),
                    }));
                }
            }
            output.figures.push((along.file("profile"), self.figure(&table, problems, along)));
            output.csv.push((along.file("profile"), along.csv(&table)?));
            if along == Along::Work {
                output.reading = self.reading(&table, problems);
            }
        }
        Ok(output)
    }

    fn reading(&self, table: &[Row], problems: usize) -> String {
        let of = |method: &String| {
            let own = || table.iter().filter(|row| row.method == method).filter_map(|row| row.ratio_to_fastest);
            let fastest = own().filter(|ratio| *ratio <= 1.0).count();
            format!("{method} {} ({fastest} as the fastest)", own().count())
        };
        let all: Vec<String> = self.methods.iter().map(of).collect();
        format!("Of {problems} problems, a scene with a target each, solved by work: {}.", all.join(", "))
    }

    fn figure(&self, table: &[Row], problems: usize, along: Along) -> Figure {
        let end = table.iter().filter_map(|row| row.ratio_to_fastest).fold(1.0, f64::max) * 1.2;
        let layer = |method: &String| {
            let own = table.iter().filter(|row| row.method == method);
            let mut ratios: Vec<f64> = own.filter_map(|row| row.ratio_to_fastest).collect();
            ratios.sort_by(f64::total_cmp);
            Layer::Steps { name: method.clone(), points: profile(&ratios, problems, end) }
        };
        let x = Axis::log(format!("{} over that of the fastest method", along.label())).range(1.0, end);
        let y = Axis::linear("fraction of problems").range(0.0, 1.02);
        let panel = Panel { title: String::new(), x, y, layers: self.methods.iter().map(layer).collect() };
        let targets: Vec<String> = self.targets.iter().map(Target::name).collect();
        Figure {
            title: format!("{}: {}", self.source, self.title),
            caption: format!(
                "On what fraction of {problems} problems the median run is within a factor of the fastest method's. A \
                 problem is a scene with a target: {}.",
                targets.join(", ")
            ),
            columns: 1,
            panels: vec![panel],
            looks: looks(&self.methods),
        }
    }
}

/// The fraction of the problems whose sorted ratio is at most x, from 1 to `end`.
fn profile(ratios: &[f64], problems: usize, end: f64) -> Vec<(f64, f64)> {
    let fraction = |count: usize| count as f64 / problems as f64;
    let fastest = ratios.iter().filter(|ratio| **ratio <= 1.0).count();
    let mut steps = vec![(1.0, fraction(fastest))];
    steps.extend(ratios.iter().zip(1..).skip(fastest).map(|(&ratio, count)| (ratio, fraction(count))));
    steps.push((end, fraction(ratios.len())));
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_begins_with_the_wins_and_ends_with_what_was_solved() {
        assert_eq!(profile(&[1.0, 2.0, 2.5], 4, 3.0), [(1.0, 0.25), (2.0, 0.5), (2.5, 0.75), (3.0, 0.75)]);
        assert_eq!(profile(&[], 4, 3.0), [(1.0, 0.0), (3.0, 0.0)]);
    }
}
