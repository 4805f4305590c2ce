//! The paper's Figure 1: cost against number of trials, one run's staircase and the exact expectation.

use super::config::OneOrMore;
use super::data::Rows;
use super::output::{Output, each, panel};
use super::paper::{PaperRow, Verdict};
use crate::Error;
use crate::figures::{Axis, Layer};
use crate::statistics::{expected_best_of, minimum};
use serde::Serialize;

bvh_build::config! { serde;
    /// Cost against number of trials.
    pub struct Config {
        /// Where the paper has it, such as `Figure 1`.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods to compare.
        methods: Vec<String>, in OneOrMore;
        /// Figures end at, and methods are compared at, the best of so many trials. Use fewer than are run: the
        /// expectation needs a pool to draw from.
        best_of: usize = 100, in 1..;
        /// The method that the paper found best.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_best: Option<String>;
        /// Why ours differs, where it does.
        reason: String;
    }
}

/// One point, as written to `trials.csv`.
#[derive(Serialize)]
struct Point<'a> {
    scene: &'a str,
    method: &'a str,
    trials: usize,
    /// Best of the first so many trials of the first repetition.
    single_run_over_base: f64,
    /// Expected best of so many, from all trials.
    expected_over_base: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut output = Output::new(&self.source, &self.title);
        let (mut points, mut panels) = (Vec::new(), Vec::new());
        for scene in rows.scenes() {
            let curves: Vec<Vec<Point>> =
                self.methods.iter().map(|method| self.curve(rows, scene, method)).collect();
            let values = |value: fn(&Point) -> f64| {
                let line =
                    move |curve: &Vec<Point>| curve.iter().map(|p| (p.trials as f64, value(p))).collect();
                self.methods.iter().cloned().zip(curves.iter().map(line))
            };
            let single = values(|point| point.single_run_over_base);
            let single: Vec<Layer> = single.map(|(name, points)| Layer::Steps { name, points }).collect();
            let expected = values(|point| point.expected_over_base);
            let expected = expected.map(|(name, points)| Layer::Line { name, points }).collect();
            for (what, mut layers) in [("one run", single), ("expected", expected)] {
                layers.push(Layer::HLine { y: 1.0, label: "greedy".into() });
                let (x, y) = (Axis::log("number of trials"), Axis::linear("best cost / base"));
                panels.push(panel(format!("{}, {what}", rows.shown(scene)), x, y, layers));
            }
            self.compare(&rows.shown(scene), &curves, &mut output);
            points.extend(curves.into_iter().flatten());
        }
        let caption = "Lowest cost among so many trials, over that of the greedy tree. Left, one run, as in the paper; \
                       right, the exact expectation from all trials run.";
        output.add_figure("trials", caption, 2, panels);
        output.add_csv("trials", &points)?;
        Ok(output)
    }

    fn curve<'a>(&self, rows: &Rows, scene: &'a str, method: &'a str) -> Vec<Point<'a>> {
        let trials = rows.trials_over_base(scene, method);
        let (Some(first), pool) = (trials.first(), trials.concat()) else { return Vec::new() };
        let point = |trials: usize| {
            let single_run_over_base = minimum(first.iter().copied().take(trials))?;
            let expected_over_base = expected_best_of(&pool, trials)?;
            Some(Point { scene, method, trials, single_run_over_base, expected_over_base })
        };
        (1..=self.best_of.min(first.len())).map_while(point).collect()
    }

    /// Ranks the methods by the expected best of as many trials as are compared.
    fn compare(&self, scene: &str, curves: &[Vec<Point>], output: &mut Output) {
        let mut ranking: Vec<&Point> = curves.iter().filter_map(|curve| curve.last()).collect();
        ranking.sort_by(|a, b| a.expected_over_base.total_cmp(&b.expected_over_base));
        let Some(best) = ranking.first() else { return };
        let order = each(&ranking, |point| Some(format!("{}: {:.4}", point.method, point.expected_over_base)));
        output.reading += &format!("{scene}, expected best of {} over base: {order}. ", self.best_of);
        let Some(paper) = &self.paper_best else { return };
        let quantity = format!("best of the compared, by the expected best of {}", self.best_of);
        let verdict = if paper == best.method { Verdict::Agrees } else { Verdict::Differs };
        let row = PaperRow::new(&self.source, scene, quantity, &self.reason);
        let rule = "the same method has the least expected cost";
        let row = row.compare(paper, best.method, verdict, rule);
        output.paper.push(PaperRow { ours_over_base: Some(best.expected_over_base), ..row });
    }
}
