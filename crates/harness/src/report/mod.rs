//! What is made from an experiment's CSV files: tables, figures, and the paper's numbers beside ours.
//!
//! A kind of report is one file, one line in [`Report`] and one in [`Report::labels`]. Reports read CSV files only.

pub mod anytime;
mod attempt;
pub mod config;
mod correlation;
pub mod data;
mod distribution;
mod ecdf;
mod estimator;
pub mod gaps;
pub mod generations;
mod metric;
pub mod numbers;
pub mod omissions;
pub mod output;
pub mod page;
pub mod paper;
mod pareto;
pub mod peers;
pub mod pictures;
mod profile;
mod progress;
pub mod ray_tests;
mod run_times;
pub mod significance;
pub mod table;
pub mod target;
pub mod times;
mod traversal;
pub mod trials;

use crate::Error;
use crate::figures::{self, Look};
use crate::run::store::Store;
use bvh_build::{Check, OutOfRange};
use data::Rows;
use output::Output;
use paper::{PaperRow, Verdict};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Declares the kinds of reports: name in specs (in snake case), configuration, and the function that makes it.
macro_rules! reports {
    ($($(#[$doc:meta])* $kind:ident($config:ty) => $write:path;)*) => {
        /// One report of a spec.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "snake_case")]
        pub enum Report {
            $($(#[$doc])* $kind($config),)*
        }

        impl Check for Report {
            fn check(&self) -> Result<(), OutOfRange> {
                match self {
                    $(Self::$kind(config) => config.check(),)*
                }
            }
        }

        impl Report {
            fn write(&self, rows: &Rows) -> Result<Output, Error> {
                match self {
                    $(Self::$kind(config) => $write(config, rows),)*
                }
            }
        }
    };
}

reports! {
    /// Ratios to base, scenes by columns, beside the paper's.
    Table(table::Config) => table::Config::write;
    /// Cost against number of trials.
    Trials(trials::Config) => trials::Config::write;
    /// Times of runs against each other.
    Times(times::Config) => times::Config::write;
    /// Cost against generation.
    Generations(generations::Config) => generations::Config::write;
    /// The distribution of costs over trials.
    Distribution(config::Methods) => distribution::write;
    /// Tests per random ray, methods by scenes.
    RayTests(ray_tests::Config) => ray_tests::Config::write;
    /// The error of the ray estimator against the number of rays, for the first repetition.
    Estimator(config::Methods) => estimator::write;
    /// Costs against tests per ray over many trees; every repetition is one tree.
    Correlation(config::Methods) => correlation::write;
    /// Error against run time and against work.
    Anytime(anytime::Config) => anytime::Config::write;
    /// Gaps to the exact optimum of small scenes.
    Gaps(gaps::Config) => gaps::Config::write;
    /// Run-time distributions.
    RunTimes(config::Targets) => run_times::write;
    /// The aggregate distribution of run times over scenes and targets.
    Ecdf(config::Targets) => ecdf::write;
    /// Performance profiles.
    Profile(config::Targets) => profile::write;
    /// Medians, quartiles and primal integrals.
    Numbers(numbers::Config) => numbers::Config::write;
    /// Whether methods really differ.
    Significance(significance::Config) => significance::Config::write;
    /// One picture by brute force, KD-tree and trees.
    Pictures(pictures::Config) => pictures::Config::write;
    /// Cost against build time and against time per ray.
    Pareto(config::Methods) => pareto::write;
    /// Other libraries beside ours.
    Peers(peers::Config) => peers::Config::write;
    /// Speed of rays by tree, layout and kind of rays, and how well the cost predicts it.
    Traversal(config::Methods) => traversal::write;
    /// What leaving something out saves.
    Omissions(omissions::Config) => omissions::Config::write;
}

impl Report {
    /// The labels of the methods the report speaks of.
    pub fn labels(&self) -> Vec<&String> {
        match self {
            Self::Distribution(config) | Self::Estimator(config) | Self::Correlation(config) => &config.methods,
            Self::Pareto(config) | Self::Traversal(config) => &config.methods,
            Self::RunTimes(config) | Self::Ecdf(config) | Self::Profile(config) => &config.methods,
            Self::Trials(config) => &config.methods,
            Self::Times(config) => &config.methods,
            Self::RayTests(config) => &config.methods,
            Self::Anytime(config) => &config.methods,
            Self::Numbers(config) => &config.methods,
            Self::Pictures(config) => &config.methods,
            Self::Table(config) => return config.columns.iter().map(|column| &column.method).collect(),
            Self::Generations(config) => return vec![&config.method, &config.baseline],
            Self::Gaps(config) => return config.methods.iter().chain([&config.optimum]).collect(),
            Self::Significance(config) => return config.against.iter().chain([&config.method]).collect(),
            Self::Peers(config) => return config.methods.iter().chain([&config.ours]).collect(),
            Self::Omissions(config) => {
                return config.pairs.iter().flat_map(|pair| [&pair.out, &pair.kept]).collect();
            }
        }
        .iter()
        .collect()
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
}

/// The file that keeps what the reports printed. Its tables may have seconds, as its name says.
pub const TEXT_FILE: &str = "timing_report.txt";

/// Makes all reports from the CSV files in the store's folder. Returns the text for the terminal, which
/// [`TEXT_FILE`] keeps.
pub fn write_all(reports: &[Report], store: &Store) -> Result<String, Error> {
    let rows = Rows::read(store.folder())?;
    let methods = rows.methods().into_iter().map(str::to_owned);
    let looks: Vec<(String, Look)> = methods.zip((0..).map(Look::Slot)).collect();
    let mut outputs = reports.iter().map(|report| report.write(&rows)).collect::<Result<Vec<_>, _>>()?;
    let paper: Vec<PaperRow> =
        outputs.iter_mut().flat_map(|output| std::mem::take(&mut output.paper)).collect();
    if !paper.is_empty() {
        outputs.push(beside_paper(&paper)?);
    }
    for output in &mut outputs {
        for (name, bytes) in &output.csv {
            store.write(&format!("{name}.csv"), bytes)?;
        }
        for (name, figure) in &mut output.figures {
            // A method looks the same in all figures of an experiment.
            figure.looks.extend(looks.iter().cloned());
            let svg = figures::svg(figure)?;
            store.write(&format!("{name}.svg"), svg.as_bytes())?;
            store.write(&format!("{name}.png"), &figures::png(&svg)?)?;
        }
    }
    let text: String = outputs.iter().map(Output::text).collect();
    if !text.is_empty() {
        store.write(TEXT_FILE, text.as_bytes())?;
    }
    Ok(text)
}

/// The comparisons of all reports of an experiment with the paper.
fn beside_paper(rows: &[PaperRow]) -> Result<Output, Error> {
    let theirs = || rows.iter().filter(|row| !row.paper.is_empty()).map(|row| row.verdict);
    let agree = theirs().filter(|verdict| *verdict == Verdict::Agrees).count();
    let direction = theirs().filter(|verdict| verdict.is_same_direction()).count();
    let reasons: BTreeSet<&str> = rows.iter().map(|row| row.reason.as_str()).collect();
    let mut output = Output::new("", "Ng & Trifonov 2003 beside our results");
    output.reading = format!(
        "Numbers of the paper: {}. Ours agree with {agree}; {direction} more are on the same side of the base; {} \
         differ. {}",
        theirs().count(),
        theirs().count() - agree - direction,
        reasons.into_iter().collect::<Vec<_>>().join(" ")
    );
    output.add_csv("paper", rows)?;
    let columns = ["scene", "quantity", "paper", "ours", "paper_over_base", "ours_over_base", "verdict"];
    output.show("Every number of the paper beside ours:", rows, &columns)?;
    Ok(output)
}
