//! The paper's Figure 1: cost against number of trials, one run's staircase and the exact expectation.

use super::statistics::{expected_best_of, minimum};
use super::{Output, Rows, display_name};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::{PaperRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Cost against number of trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper has it, such as `Figure 1`.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Labels of the methods to compare.
    pub methods: Vec<String>,
    /// Figures end at, and methods are compared at, the best of so many trials. Use fewer than are run: the
    /// expectation needs a pool to draw from.
    pub best_of: usize,
    /// The method that the paper found best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paper_best: Option<String>,
    /// Why ours differs, where it does.
    #[serde(default)]
    pub reason: String,
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
        let mut points = Vec::new();
        let mut output = Output::default();
        let mut panels = Vec::new();
        for (scene, kind) in rows.scenes() {
            let mut staircases = Vec::new();
            let mut expectations = Vec::new();
            let mut ranking = Vec::new();
            for method in &self.methods {
                let trials = rows.trials_over_base(scene, method);
                let (Some(first), pool) = (trials.first(), trials.concat()) else { continue };
                let (mut staircase, mut expectation) = (Vec::new(), Vec::new());
                for m in 1..=self.best_of.min(first.len()) {
                    let single_run_over_base = minimum(first.iter().copied().take(m)).unwrap_or(f64::NAN);
                    let Some(expected_over_base) = expected_best_of(&pool, m) else { break };
                    staircase.push((m as f64, single_run_over_base));
                    expectation.push((m as f64, expected_over_base));
                    points.push(Point { scene, method, trials: m, single_run_over_base, expected_over_base });
                }
                if let Some(&(_, last)) = expectation.last() {
                    ranking.push((last, method));
                }
                staircases.push(Layer::Steps { name: method.clone(), points: staircase });
                expectations.push(Layer::Line { name: method.clone(), points: expectation });
            }
            let shown = display_name(scene, kind);
            for (what, mut layers) in [("one run", staircases), ("expected", expectations)] {
                layers.push(Layer::HLine { y: 1.0, label: "greedy".into() });
                let (x, y) = (Axis::log("number of trials"), Axis::linear("best cost / base"));
                panels.push(Panel { title: format!("{shown}, {what}"), x, y, layers });
            }
            ranking.sort_by(|a, b| a.0.total_cmp(&b.0));
            self.compare(&shown, &ranking, &mut output);
        }
        let caption =
            "Lowest cost among so many trials, over that of the greedy tree. Left, one run, as in the paper; \
                       right, the exact expectation from all trials run."
                .into();
        let figure = Figure {
            title: format!("{}: {}", self.source, self.title),
            caption,
            columns: 2,
            panels,
            ..Default::default()
        };
        output.figures.push(("trials".into(), figure));
        output.csv.push(("trials".into(), to_bytes(&points, Path::new("trials.csv"))?));
        Ok(output)
    }

    fn compare(&self, scene: &str, ranking: &[(f64, &String)], output: &mut Output) {
        if let (Some((low, best)), Some((high, worst))) = (ranking.first(), ranking.last()) {
            let m = self.best_of;
            output.reading += &format!(
                "{scene}, expected best of {m}: {best} lowest with {low:.4} of base, {worst} highest with {high:.4}. "
            );
        }
        let order = ranking.iter().map(|(ratio, method)| format!("{method}: {ratio:.4}")).collect::<Vec<_>>();
        output.text += &format!(
            "{}: {}\n{scene}, expected best of {}: {}\n\n",
            self.source,
            self.title,
            self.best_of,
            order.join(", ")
        );
        let (Some(paper), Some((ratio, best))) = (&self.paper_best, ranking.first()) else { return };
        output.paper.push(PaperRow {
            source: self.source.clone(),
            scene: scene.into(),
            quantity: format!("best of the compared, by the expected best of {}", self.best_of),
            paper: paper.clone(),
            ours: (*best).clone(),
            paper_over_base: None,
            ours_over_base: Some(*ratio),
            verdict: if paper == *best { "agrees" } else { "differs" }.into(),
            reason: self.reason.clone(),
        });
    }
}
