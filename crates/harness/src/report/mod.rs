//! What is made from an experiment's CSV files: tables, figures, and the paper's numbers beside ours.
//!
//! A kind of report is one file with a `Config` and one line in [`Report`]. Reports read CSV files only.

pub mod anytime;
pub mod correlation;
pub mod distribution;
pub mod ecdf;
pub mod estimator;
pub mod gaps;
pub mod generations;
pub mod numbers;
pub mod omissions;
pub mod page;
pub mod pareto;
pub mod peers;
pub mod pictures;
pub mod profile;
pub mod progress;
pub mod ray_tests;
pub mod run_times;
pub mod significance;
pub mod statistics;
pub mod table;
pub mod target;
pub mod times;
pub mod traversal;
pub mod trials;

use crate::run::rows::{
    self, BoundRow, ClockRow, HistoryRow, PaperRow, RayRow, ReferenceRow, RenderRow, RenderTimeRow, Row,
    RunRow, TimingRow, TraceRow, TraceTimeRow,
};
use crate::run::store::Store;
use crate::{Error, figures};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// One report of a spec.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Report {
    /// Ratios to base, scenes by columns, beside the paper's.
    Table(table::Config),
    /// Cost against number of trials.
    Trials(trials::Config),
    /// Times of runs against each other.
    Times(times::Config),
    /// Cost against generation.
    Generations(generations::Config),
    /// The distribution of costs over trials.
    Distribution(distribution::Config),
    /// Tests per random ray, methods by scenes.
    RayTests(ray_tests::Config),
    /// The error of the ray estimator against the number of rays.
    Estimator(estimator::Config),
    /// Costs against tests per ray over many trees.
    Correlation(correlation::Config),
    /// Error against run time and against work.
    Anytime(anytime::Config),
    /// Gaps to the exact optimum of small scenes.
    Gaps(gaps::Config),
    /// Run-time distributions.
    RunTimes(run_times::Config),
    /// The aggregate distribution of run times over scenes and targets.
    Ecdf(ecdf::Config),
    /// Performance profiles.
    Profile(profile::Config),
    /// Medians, quartiles and primal integrals.
    Numbers(numbers::Config),
    /// Whether methods really differ.
    Significance(significance::Config),
    /// One picture by brute force, KD-tree and trees.
    Pictures(pictures::Config),
    /// Cost against build time and against time per ray.
    Pareto(pareto::Config),
    /// Other libraries beside ours.
    Peers(peers::Config),
    /// Speed of rays by tree, layout and kind of rays, and how well the cost predicts it.
    Traversal(traversal::Config),
    /// What leaving something out saves.
    Omissions(omissions::Config),
}

impl Report {
    /// The labels of the methods the report speaks of.
    pub fn labels(&self) -> Vec<&String> {
        match self {
            Self::Table(config) => config.columns.iter().map(|column| &column.method).collect(),
            Self::Trials(config) => config.methods.iter().collect(),
            Self::Times(config) => config.methods.iter().collect(),
            Self::Generations(config) => vec![&config.method, &config.baseline],
            Self::Distribution(config) => config.methods.iter().collect(),
            Self::RayTests(config) => config.methods.iter().collect(),
            Self::Estimator(config) => config.methods.iter().collect(),
            Self::Correlation(config) => config.methods.iter().collect(),
            Self::Gaps(config) => config.methods.iter().chain([&config.optimum]).collect(),
            Self::Anytime(config) => config.methods.iter().collect(),
            Self::RunTimes(config) => config.methods.iter().collect(),
            Self::Ecdf(config) => config.methods.iter().collect(),
            Self::Profile(config) => config.methods.iter().collect(),
            Self::Numbers(config) => config.methods.iter().collect(),
            Self::Significance(config) => config.against.iter().chain([&config.method]).collect(),
            Self::Pictures(config) => config.methods.iter().collect(),
            Self::Pareto(config) => config.methods.iter().collect(),
            Self::Peers(config) => config.methods.iter().chain([&config.ours]).collect(),
            Self::Traversal(config) => config.methods.iter().collect(),
            Self::Omissions(config) => config.labels().collect(),
        }
    }

    /// Whether the report asks when events happened.
    pub fn needs_clock(&self) -> bool {
        self.needs_references()
    }

    /// Whether the report measures gaps.
    pub fn needs_references(&self) -> bool {
        use Report::{Anytime, Ecdf, Numbers, Profile, RunTimes};
        matches!(self, Anytime(_) | RunTimes(_) | Ecdf(_) | Profile(_) | Numbers(_))
    }

    pub(crate) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        match self {
            Self::Table(config) => config.write(rows),
            Self::Trials(config) => config.write(rows),
            Self::Times(config) => config.write(rows),
            Self::Generations(config) => config.write(rows),
            Self::Distribution(config) => config.write(rows),
            Self::RayTests(config) => config.write(rows),
            Self::Estimator(config) => config.write(rows),
            Self::Correlation(config) => config.write(rows),
            Self::Gaps(config) => config.write(rows),
            Self::Anytime(config) => config.write(rows),
            Self::RunTimes(config) => config.write(rows),
            Self::Ecdf(config) => config.write(rows),
            Self::Profile(config) => config.write(rows),
            Self::Numbers(config) => config.write(rows),
            Self::Significance(config) => config.write(rows),
            Self::Pictures(config) => config.write(rows),
            Self::Pareto(config) => config.write(rows),
            Self::Peers(config) => config.write(rows),
            Self::Traversal(config) => config.write(rows),
            Self::Omissions(config) => config.write(rows),
        }
    }
}

/// An experiment's rows, as read from its CSV files.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Of `runs.csv`.
    pub runs: Vec<RunRow>,
    /// Of `history.csv`.
    pub history: Vec<HistoryRow>,
    /// Of `timing.csv`.
    pub timing: Vec<TimingRow>,
    /// Of `rays.csv`; none if rays were not asked for.
    pub rays: Vec<RayRow>,
    /// Of `bounds.csv`; none if bounds were not asked for.
    pub bounds: Vec<BoundRow>,
    /// Of `timing_history.csv`; none if no report needs them, otherwise one for every row of `history`, in its order.
    pub clock: Vec<ClockRow>,
    /// Of `references.csv`, under the experiment's objective; none if no report needs them.
    pub references: Vec<ReferenceRow>,
    /// Of `renders.csv`; none if pictures were not asked for.
    pub renders: Vec<RenderRow>,
    /// Of `timing_renders.csv`, likewise.
    pub render_times: Vec<RenderTimeRow>,
    /// Of `traversal.csv`; none if rays were not traced.
    pub traces: Vec<TraceRow>,
    /// Of `timing_traversal.csv`, likewise.
    pub trace_times: Vec<TraceTimeRow>,
}

impl Rows {
    /// Reads the CSV files in an experiment's folder.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        Ok(Self {
            runs: rows::read(&folder.join(RunRow::FILE))?,
            history: rows::read_if_any(folder)?,
            timing: rows::read_if_any(folder)?,
            rays: rows::read_if_any(folder)?,
            bounds: rows::read_if_any(folder)?,
            clock: rows::read_if_any(folder)?,
            references: rows::read_if_any(folder)?,
            renders: rows::read_if_any(folder)?,
            render_times: rows::read_if_any(folder)?,
            traces: rows::read_if_any(folder)?,
            trace_times: rows::read_if_any(folder)?,
        })
    }

    /// The scenes in the order of the rows, with their kinds.
    pub fn scenes(&self) -> Vec<(&str, &str)> {
        let mut scenes: Vec<_> =
            self.runs.iter().map(|run| (run.scene.as_str(), run.scene_kind.as_str())).collect();
        scenes.dedup();
        scenes
    }

    /// The scene's name with its kind.
    pub fn shown(&self, scene: &str) -> String {
        let kind = self.runs.iter().find(|run| run.scene == scene).map_or("", |run| run.scene_kind.as_str());
        display_name(scene, kind)
    }

    /// The histories of one method on one scene, one per repetition.
    pub fn histories(&self, scene: &str, method: &str) -> Vec<Vec<&HistoryRow>> {
        let own = |row: &&HistoryRow| row.scene == scene && row.method == method;
        let rows: Vec<&HistoryRow> = self.history.iter().filter(own).collect();
        rows.chunk_by(|a, b| a.repetition == b.repetition).map(<[_]>::to_vec).collect()
    }

    /// The cost of the scene's greedy tree.
    pub fn base_cost(&self, scene: &str) -> f64 {
        self.runs.iter().find(|run| run.scene == scene).map_or(f64::NAN, |run| run.base_cost)
    }

    /// What gaps on the scene are measured from.
    pub fn reference(&self, scene: &str) -> Option<&ReferenceRow> {
        self.references.iter().find(|row| row.scene == scene)
    }

    /// The runs of one method on one scene.
    pub fn runs_of<'a>(&'a self, scene: &'a str, method: &'a str) -> impl Iterator<Item = &'a RunRow> {
        self.runs.iter().filter(move |run| run.scene == scene && run.method == method)
    }

    /// The seconds of the runs of one method on one scene.
    pub fn seconds_of(&self, scene: &str, method: &str) -> impl Iterator<Item = f64> {
        self.timing.iter().filter(move |row| row.scene == scene && row.method == method).map(|row| row.seconds)
    }

    /// The costs of one method's trials on one scene over base, one list per repetition, in order.
    pub fn trials_over_base(&self, scene: &str, method: &str) -> Vec<Vec<f64>> {
        let base = self.base_cost(scene);
        let over_base = |history: Vec<&HistoryRow>| history.iter().map(|row| over(row.cost, base)).collect();
        self.histories(scene, method).into_iter().map(over_base).collect()
    }
}

/// A ratio of costs; 1 when the base is 0, as in `runs.csv`.
fn over(cost: f64, base: f64) -> f64 {
    if base > 0.0 { cost / base } else { 1.0 }
}

/// What a report makes.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// Further CSV files: name without extension, and bytes. Names that begin with `timing` hold seconds.
    pub csv: Vec<(String, Vec<u8>)>,
    /// Figures: name without extension, and what they show.
    pub figures: Vec<(String, figures::Figure)>,
    /// Comparisons with the paper.
    pub paper: Vec<PaperRow>,
    /// For the terminal.
    pub text: String,
    /// The sentence that reads the result, from its numbers; empty if the table says it all.
    pub reading: String,
}

/// A scene's name with its kind, as every table shows it.
fn display_name(scene: &str, kind: &str) -> String {
    if kind == "file" { scene.into() } else { format!("{scene} ({kind})") }
}

/// Makes all reports from the CSV files in the store's folder. Returns the text for the terminal.
pub fn write_all(reports: &[Report], store: &Store) -> Result<String, Error> {
    let rows = Rows::read(store.folder())?;
    let mut text = String::new();
    let mut paper = Vec::new();
    for report in reports {
        let output = report.write(&rows)?;
        for (name, bytes) in &output.csv {
            store.write(&format!("{name}.csv"), bytes)?;
        }
        for (name, figure) in &output.figures {
            let svg = figures::svg(figure)?;
            store.write(&format!("{name}.svg"), svg.as_bytes())?;
            store.write(&format!("{name}.png"), &figures::png(&svg)?)?;
        }
        paper.extend(output.paper);
        text += &output.text;
    }
    if !paper.is_empty() {
        store.write("paper.csv", &rows::to_bytes(&paper, Path::new("paper.csv"))?)?;
    }
    Ok(text)
}

/// How our ratio to base compares with the paper's: whether it is within `tolerance` of it, and on the same side of
/// the base.
pub fn verdict(paper: f64, ours: f64, tolerance: f64) -> String {
    // The paper prints four digits: closer to the base than this is on neither side.
    let side = |ratio: f64| if (ratio - 1.0).abs() < 5e-4 { 0.0 } else { (ratio - 1.0).signum() };
    let close = (ours / paper - 1.0).abs() <= tolerance;
    let contradicts = side(paper) * side(ours) < 0.0;
    let relation = if ours > paper { "higher" } else { "lower" };
    match (close, contradicts) {
        (true, false) => "agrees".into(),
        (true, true) => format!("close, but {relation}, across the base"),
        (false, false) => format!("same direction, {relation}"),
        (false, true) => format!("differs, {relation}"),
    }
}

/// Every method with a look of its own, the same in all panels.
fn looks(methods: &[String]) -> Vec<(String, figures::Look)> {
    methods.iter().cloned().zip((0..).map(figures::Look::Slot)).collect()
}

/// An empty table for the terminal.
fn text_table<'a>(header: impl IntoIterator<Item = &'a str>) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table.load_preset(comfy_table::presets::UTF8_FULL_CONDENSED).set_header(header);
    table
}

#[cfg(test)]
mod tests {
    use super::verdict;

    #[test]
    fn verdicts_tell_agreement_direction_and_contradiction_apart() {
        assert_eq!(verdict(1.0018, 1.003, 0.02), "agrees");
        assert_eq!(verdict(1.1, 1.2, 0.02), "same direction, higher");
        assert_eq!(verdict(2.0, 1.1, 0.02), "same direction, lower");
        assert_eq!(verdict(0.996, 1.01, 0.02), "close, but higher, across the base");
        assert_eq!(verdict(0.95, 1.2, 0.02), "differs, higher");
    }
}
