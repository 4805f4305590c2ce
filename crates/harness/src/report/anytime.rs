//! Error against run time: the gap of the incumbent to the best known cost.

use super::config::check_file;
use super::data::{Series, ratio};
use super::drawing::{Drawing, Shape};
use super::prelude::*;
use crate::statistics::{quantile, quartiles};

report! {
    /// Error against run time.
    pub struct Config {
        /// Name of the files; several such reports of one experiment need different ones.
        file: String = "anytime".into();
        /// Labels of the methods. One event per run, as a builder has, is shown as a point.
        methods: Vec<String>, in OneOrMore;
        /// Distances above the best known cost in per cent, for a table of the seconds that the
        /// methods need to get there. Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        targets: Vec<f64> = vec![], in 0.0..=1e6;
    }
    check |config: &Self| check_file("timing_", &config.file);
}

/// One corner of a curve, which is flat up to the next, or its end, as written to
/// `timing_FILE.csv`, where FILE is `anytime` unless the report has another name.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    /// Wall time since the run began.
    seconds: f64,
    /// First quartile of that distance.
    gap_quartile_1: f64,
    /// Median over the runs of the relative distance to the least cost known.
    gap_median: f64,
    /// Third quartile of that distance.
    gap_quartile_3: f64,
}

impl Point<'_> {
    fn gaps(&self) -> [f64; 3] {
        [self.gap_quartile_1, self.gap_median, self.gap_quartile_3]
    }
}

/// One method and target on one scene, as written to `timing_FILE_targets.csv`.
#[derive(Serialize)]
pub(super) struct Reached<'a> {
    scene: &'a str,
    /// Distance above the best known cost to reach.
    target: String,
    method: &'a str,
    /// All runs.
    runs: usize,
    /// Runs that reach the target.
    solved: usize,
    /// Median over all runs, counting runs that never reach the target as last; empty if it is
    /// beside or at such a run.
    median: Option<f64>,
    /// The same for the quantile 0.9.
    quantile_90: Option<f64>,
}

/// Points per factor of ten along a curve.
const PER_DECADE: f64 = 20.0;

impl Config {
    /// Returns the names of the CSV files without extensions: of the curves, and of the targets if
    /// there are any.
    pub(super) fn names(&self) -> Vec<String> {
        let names = ["", "_targets"].map(|end| format!("timing_{}{end}", self.file));
        names.into_iter().take(if self.targets.is_empty() { 1 } else { 2 }).collect()
    }

    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut points = Vec::new();
        let mut reached = Vec::new();
        let mut has_builders = false;
        for scene in rows.scenes() {
            // A scene without a reference has no gaps.
            let Some(reference) = rows.reference(scene) else { continue };
            for method in &self.methods {
                let runs = rows.series(scene, method);
                let corners = curve(scene, method, &runs, reference.cost);
                has_builders |= corners.len() == 1;
                points.extend(corners);
                reached.extend(self.targets.iter().map(|&percent| {
                    let cost = reference.cost * (1.0 + percent / 100.0);
                    let target = format!("best known +{percent} %");
                    Reached::new(scene, target, method, &runs, cost)
                }));
            }
        }
        let figure = Drawing {
            marks: Shape::Steps,
            panels: vec!["scene".into()],
            x: "seconds".into(),
            y: "gap_median".into(),
            ends: Some(["gap_quartile_1", "gap_quartile_3"].map(str::to_owned)),
            series: vec!["method".into()],
            x_label: "seconds".into(),
            y_label: "above the best known".into(),
            log_x: true,
            log_y: true,
            percent_y: true,
            ..Drawing::default()
        };
        let mut caption = String::from("Median and quartiles over repetitions.");
        if has_builders {
            caption += " Points are builders.";
        }
        if points.iter().any(|point| point.gap_median == 0.0) {
            caption += " A curve falls to the floor where it is the best known.";
        }
        let mut output = Output::default();
        let names = self.names();
        output.add_csv(&names[0], &corners(&points))?;
        output.add_figure(&names[0], &caption, 2, figure.panels(rows, &output.table()?));
        if let Some(targets) = names.get(1) {
            output.add_csv(targets, &reached)?;
        }
        Ok(output)
    }
}

impl<'a> Reached<'a> {
    fn new(scene: &'a str, target: String, method: &'a str, runs: &[Series], cost: f64) -> Self {
        // Runs without success must count: dropping them would favour methods that rarely succeed.
        let time = |run: &Series| {
            run.iter().find(|(_, incumbent)| *incumbent <= cost).map_or(f64::INFINITY, |at| at.0)
        };
        let times: Vec<f64> = runs.iter().map(time).collect();
        let quantile = |q| quantile(&times, q).filter(|time| time.is_finite());
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

/// Returns the costs of the incumbents of all runs after `at` seconds, infinite where a run has none
/// yet, so that their median never rises.
fn incumbents(runs: &[Series], at: f64) -> Vec<f64> {
    let incumbent = |run: &Series| {
        run.iter().take_while(|(seconds, _)| *seconds <= at).last().map(|point| point.1)
    };
    runs.iter().map(|run| incumbent(run).unwrap_or(f64::INFINITY)).collect()
}

/// Median and quartiles of the gap from the first moment at which every run has an incumbent to the
/// last event.
fn curve<'a>(scene: &'a str, method: &'a str, runs: &[Series], reference: f64) -> Vec<Point<'a>> {
    let first = runs.iter().filter_map(|run| Some(run.first()?.0)).fold(0.0, f64::max);
    let last = runs.iter().filter_map(|run| Some(run.last()?.0)).fold(0.0, f64::max);
    // The places of a curve are evenly spaced logarithms, which need a positive start.
    if first <= 0.0 || !last.is_finite() {
        return Vec::new();
    }
    let steps = ((last / first).log10() * PER_DECADE).ceil().max(0.0) as u32;
    let place = |step: u32| {
        // The last place is the end itself, which rounding of the power would miss.
        if step == steps { last } else { first * 10f64.powf(f64::from(step) / PER_DECADE) }
    };
    let point = |seconds: f64| {
        let [gap_quartile_1, gap_median, gap_quartile_3] =
            quartiles(&incumbents(runs, seconds)).map(|cost| ratio(cost, reference) - 1.0);
        Point { scene, method, seconds, gap_quartile_1, gap_median, gap_quartile_3 }
    };
    (0..=steps).map(place).map(point).collect()
}

/// The first and last points of every curve, and those that differ from the one before.
fn corners<'a>(points: &[Point<'a>]) -> Vec<Point<'a>> {
    let mut kept = Vec::new();
    for curve in points.chunk_by(|a, b| (a.scene, a.method) == (b.scene, b.method)) {
        for (index, point) in curve.iter().enumerate() {
            let is_end = index == 0 || index + 1 == curve.len();
            // Between corners the staircase is flat, so other points would only enlarge the file.
            if is_end || point.gaps() != curve[index - 1].gaps() {
                kept.push(*point);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::median;

    #[test]
    fn a_target_is_reached_by_the_first_incumbent_at_or_below_it_or_never() {
        let runs = [vec![(1.0, 9.0), (2.0, 7.0), (5.0, 6.0)], vec![(3.0, 7.0)]];
        let when = [9.5, 7.0, 6.0, 1.0].map(|cost| {
            let reached = Reached::new("", String::new(), "", &runs, cost);
            (reached.solved, reached.median)
        });
        assert_eq!(when, [(2, Some(2.0)), (2, Some(2.5)), (1, None), (0, None)]);
    }

    #[test]
    fn the_median_of_incumbents_never_rises() {
        // One run is early and good, two are late and worse.
        let runs: Vec<Series> =
            vec![vec![(1.0, 5.0)], vec![(3.0, 9.0)], vec![(4.0, 8.0), (6.0, 6.0)]];
        let medians = [0.5, 1.0, 3.0, 4.0, 6.0].map(|at| median(&incumbents(&runs, at)).unwrap());
        assert!(medians[0].is_infinite() && medians[1].is_infinite());
        assert_eq!(medians[2..], [9.0, 8.0, 6.0]);
    }
}
