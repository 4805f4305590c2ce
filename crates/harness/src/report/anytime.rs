//! Error against run time: the gap of the incumbent to the best known cost.

use super::config::check_file;
use super::data::{Series, ratio};
use super::drawing::{Drawing, Shape};
use super::prelude::*;
use crate::statistics::quartiles;

report! {
    /// Error against run time.
    pub struct Config {
        /// Name of the files; several such reports of one experiment need different ones.
        file: String = "anytime".into();
        /// Labels of the methods. One event per run, as a builder has, is shown as a point.
        methods: Vec<String>, in OneOrMore;
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

/// Points per factor of ten along a curve.
const PER_DECADE: f64 = 20.0;

impl Config {
    /// Returns the name of the CSV file without its extension.
    pub(super) fn csv(&self) -> String {
        format!("timing_{}", self.file)
    }

    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut points = Vec::new();
        for scene in rows.scenes() {
            // A scene without a reference has no gaps.
            let Some(reference) = rows.reference(scene) else { continue };
            for method in &self.methods {
                points.extend(curve(scene, method, &rows.series(scene, method), reference.cost));
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
        let caption = "Median and quartiles over repetitions. Points are builders. A curve falls \
                       to the floor where it is the best known.";
        let mut output = Output::default();
        let file = self.csv();
        output.add_csv(&file, &corners(&points))?;
        output.add_figure(file, caption, 2, figure.panels(rows, &output.table()?));
        Ok(output)
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
    fn the_median_of_incumbents_never_rises() {
        // One run is early and good, two are late and worse.
        let runs: Vec<Series> =
            vec![vec![(1.0, 5.0)], vec![(3.0, 9.0)], vec![(4.0, 8.0), (6.0, 6.0)]];
        let medians = [0.5, 1.0, 3.0, 4.0, 6.0].map(|at| median(&incumbents(&runs, at)).unwrap());
        assert!(medians[0].is_infinite() && medians[1].is_infinite());
        assert_eq!(medians[2..], [9.0, 8.0, 6.0]);
    }
}
