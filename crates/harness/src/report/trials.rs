//! Figure 1 of the paper: cost against number of trials, for one run and as an exact expectation.

use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::statistics::{expected_best_of, mean_interval, minimum};

report! {
    /// Cost against number of trials.
    pub struct Config {
        /// Labels of the methods to compare.
        methods: Vec<String>, in OneOrMore;
        /// Number of trials whose best is compared, and at which figures end. Use fewer than are
        /// run: the expectation needs a pool to draw from.
        best_of: usize = 100, in 1..;
        /// The method that the paper found best.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_best: Option<String>;
    }
}

/// One point, as written to `trials.csv`.
#[derive(Serialize)]
pub(super) struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    trials: usize,
    /// Best of the first `trials` trials of the first repetition.
    single_run_over_base: f64,
    /// Expected best of `trials` trials: the mean of the exact expectations over repetitions.
    expected_over_base: f64,
    /// Lower end of the 95 % interval of that mean over repetitions; empty if there is only one.
    expected_low: Option<f64>,
    /// The upper end.
    expected_high: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::default();
        let mut points = Vec::new();
        for scene in rows.scenes() {
            let curves: Vec<Vec<Point>> =
                self.methods.iter().map(|method| self.curve(rows, scene, method)).collect();
            output.paper.extend(self.compare(&rows.shown(scene), &curves));
            points.extend(curves.into_iter().flatten());
        }
        output.add_csv("trials", &points)?;
        Ok(output)
    }

    fn curve<'a>(&self, rows: &Rows, scene: &'a str, method: &'a str) -> Vec<Point<'a>> {
        let repetitions = rows.trials_over_base(scene, method);
        let Some(first) = repetitions.first() else { return Vec::new() };
        let point = |trials: usize| {
            let single_run_over_base = minimum(first.iter().copied().take(trials))?;
            let every: Vec<f64> =
                repetitions.iter().filter_map(|costs| expected_best_of(costs, trials)).collect();
            let (expected_over_base, interval) = mean_interval(&every)?;
            let (expected_low, expected_high) = interval.unzip();
            Some(Point {
                scene,
                method,
                trials,
                single_run_over_base,
                expected_over_base,
                expected_low,
                expected_high,
            })
        };
        (1..=self.best_of.min(first.len())).map_while(point).collect()
    }

    /// Returns the methods that no other method is below at `best_of` trials, the lowest first.
    fn best<'p, 'a>(&self, curves: &'p [Vec<Point<'a>>]) -> Vec<&'p Point<'a>> {
        let mut ranking: Vec<&Point> = curves.iter().filter_map(|curve| curve.last()).collect();
        ranking.sort_by(|a, b| a.expected_over_base.total_cmp(&b.expected_over_base));
        let end = |end: Option<f64>, point: &Point| end.unwrap_or(point.expected_over_base);
        let high = ranking.first().map(|least| end(least.expected_high, least));
        ranking.retain(|point| high.is_none_or(|high| high >= end(point.expected_low, point)));
        ranking
    }

    /// Compares the best methods with the paper's. Where there are several, it is inconclusive
    /// which is best.
    fn compare(&self, scene: &str, curves: &[Vec<Point>]) -> Option<PaperRow> {
        let best = self.best(curves);
        let (least, paper) = (best.first()?, self.paper_best.as_ref()?);
        let verdict = match (best.iter().any(|point| point.method == paper), best.len()) {
            (true, 1) => Verdict::Agrees,
            (true, _) => Verdict::Inconclusive,
            (false, _) => Verdict::Differs,
        };
        let quantity = format!("best of the compared, by the expected best of {}", self.best_of);
        let rule = "its 95 % interval lies below those of all others; it differs if that of another lies below its own";
        let names: Vec<&str> = best.iter().map(|point| point.method).collect();
        let row = PaperRow::new(scene, quantity);
        Some(PaperRow {
            ours_over_base: Some(least.expected_over_base),
            ours_low: least.expected_low,
            ours_high: least.expected_high,
            ..row.compare(paper, names.join(" or "), verdict, rule)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::rows::TrialRow;

    /// Rows of two methods, each with the costs of its trials by repetition.
    fn rows(methods: [(&str, [[f64; 3]; 4]); 2]) -> Rows {
        let mut rows = Rows::default();
        for (method, repetitions) in methods {
            for (repetition, costs) in (0..).zip(repetitions) {
                rows.runs.push(run(method, repetition, 3, 0));
                rows.trials.extend(costs.map(|cost| TrialRow {
                    scene: "s".into(),
                    method: method.into(),
                    repetition,
                    evaluations: 0,
                    cost,
                }));
            }
        }
        rows
    }

    fn verdict(paper_best: &str, other: [[f64; 3]; 4]) -> (String, Verdict) {
        let one = [[1.0, 1.1, 1.2], [1.01, 1.1, 1.2], [0.99, 1.1, 1.2], [1.0, 1.1, 1.2]];
        let config = Config {
            methods: vec!["one".into(), "other".into()],
            best_of: 2,
            paper_best: Some(paper_best.into()),
            ..Config::default()
        };
        let output = config.write(&rows([("one", one), ("other", other)])).unwrap();
        (output.paper[0].ours.clone(), output.paper[0].verdict)
    }

    #[test]
    fn a_method_is_best_only_if_repetitions_tell_it_from_the_others() {
        let worse = [[1.3, 1.4, 1.5], [1.31, 1.4, 1.5], [1.29, 1.4, 1.5], [1.3, 1.4, 1.5]];
        assert_eq!(verdict("one", worse), ("one".into(), Verdict::Agrees));
        assert_eq!(verdict("other", worse), ("one".into(), Verdict::Differs));
        // Less on average by one lucky repetition.
        let lucky = [[0.8, 1.1, 1.2], [1.02, 1.1, 1.2], [1.01, 1.1, 1.2], [1.02, 1.1, 1.2]];
        assert_eq!(verdict("one", lucky), ("other or one".into(), Verdict::Inconclusive));
        assert_eq!(verdict("other", lucky), ("other or one".into(), Verdict::Inconclusive));
    }
}
