//! The best of so many trials: of one run as in figure 1 of the paper, the median of all blocks of
//! so many trials, and as an exact expectation.

use super::prelude::*;
use crate::statistics::best_of::predicted_best;
use crate::statistics::{expected_best_of, mean_interval, median, minimum};

report! {
    /// Cost against number of trials.
    pub struct Config {
        /// Labels of the methods to compare.
        methods: Vec<String>, in OneOrMore;
        /// The greatest number of trials. Use fewer than are run: the expectation needs a pool to
        /// draw from.
        best_of: usize = 100, in 1..;
        /// Numbers of trials whose best has a row; by default all from 1 to `best_of`.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        counts: Vec<usize>, in 1..;
    }
}

/// The best of so many trials, as written to `trials.csv`.
#[derive(Serialize)]
pub(super) struct Point<'a> {
    scene: &'a str,
    scene_kind: &'a str,
    method: &'a str,
    /// Number of trials of which the best is taken.
    trials: usize,
    /// Best of the first `trials` trials of the first repetition.
    single_run_over_base: f64,
    /// Median over all blocks of `trials` successive trials, of all repetitions, of their best.
    median_over_base: f64,
    /// Lower end of the interval that has the best of as many new trials in at least nine of ten
    /// repetitions, predicted from the order statistics of all trials, or from an exponential tail
    /// below the lowest.
    low_over_base: Option<f64>,
    /// Upper end of this interval.
    high_over_base: Option<f64>,
    /// Expected best of `trials` trials: the mean of the exact expectations over repetitions.
    expected_over_base: f64,
    /// Lower end of the 95 % interval of that mean over repetitions; empty if there is only one.
    expected_low: Option<f64>,
    /// The upper end.
    expected_high: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut points = Vec::new();
        for scene in rows.scenes() {
            points.extend(self.methods.iter().flat_map(|method| self.curve(rows, scene, method)));
        }
        let mut output = Output::default();
        output.add_csv("trials", &points)?;
        Ok(output)
    }

    fn curve<'a>(&self, rows: &'a Rows, scene: &'a str, method: &'a str) -> Vec<Point<'a>> {
        let repetitions = rows.trials_over_base(scene, method);
        let Some(first) = repetitions.first() else { return Vec::new() };
        let pool = repetitions.concat();
        let point = |trials: usize| {
            let blocks = repetitions.iter().flat_map(|costs| costs.chunks_exact(trials));
            let best = |costs: &[f64]| minimum(costs.iter().copied());
            let bests: Vec<f64> = blocks.filter_map(best).collect();
            let (low_over_base, high_over_base) = predicted_best(&pool, trials).unzip();
            let every: Vec<f64> =
                repetitions.iter().filter_map(|costs| expected_best_of(costs, trials)).collect();
            let (expected_over_base, interval) = mean_interval(&every)?;
            let (expected_low, expected_high) = interval.unzip();
            Some(Point {
                scene,
                scene_kind: rows.kind(scene),
                method,
                trials,
                single_run_over_base: *bests.first()?,
                median_over_base: median(&bests)?,
                low_over_base,
                high_over_base,
                expected_over_base,
                expected_low,
                expected_high,
            })
        };
        let all: Vec<usize> = (1..=self.best_of).collect();
        let counts = if self.counts.is_empty() { &all } else { &self.counts };
        counts.iter().filter(|count| **count <= first.len()).filter_map(|c| point(*c)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::rows::TrialRow;

    #[test]
    fn the_best_of_some_trials_is_the_median_of_all_blocks_and_of_the_first_run() {
        let mut rows = Rows::default();
        for (repetition, costs) in (0..).zip([[5.0, 4.0, 3.0, 6.0, 1.0], [2.0, 9.0, 8.0, 8.0, 0.5]])
        {
            rows.runs.push(run("m", repetition));
            rows.trials.extend(costs.map(|cost| TrialRow {
                scene: "s".into(),
                method: "m".into(),
                repetition,
                evaluations: 0,
                cost,
            }));
        }
        let config = Config { methods: vec!["m".into()], counts: vec![2, 6], ..Config::default() };
        let table = config.write(&rows).unwrap().table().unwrap();
        let [row] = &table[..] else { panic!("a row where there are enough trials: {table:?}") };
        // The blocks have 4, 3, 2 and 8.
        let found = ["trials", "single_run_over_base", "median_over_base"].map(|name| &row[name]);
        assert_eq!(found, ["2", "4.0", "3.5"]);
    }
}
