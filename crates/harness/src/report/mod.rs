//! Reports made from an experiment's CSV files: tables, figures, and comparisons with the paper.
//!
//! A kind of report is one file and a line of `kinds!`. Reports read CSV files only.

pub mod anytime;
mod colours;
pub mod config;
pub mod data;
pub mod drawing;
pub mod generations;
pub mod output;
pub mod paper;
mod prelude;
pub mod query;
mod query_column;
pub mod query_measure;
pub mod query_report;
pub(crate) mod suite;
pub mod trials;

use crate::Error;
use crate::rows::store::Store;
use crate::rows::{ReferenceRow, Row as _, RunRow, TimingRow};
use bvh_config::{Check, OutOfRange};
use config::Labels as _;
use data::Rows;
use output::Output;
use paper::PaperRow;
use query_column::Column;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

/// Declares the kinds of reports: a variant each, its name in specs, and the file of its `Config`.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal in $file:ident;)*) => {
        /// One report of a spec.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        #[allow(clippy::large_enum_variant, reason = "a spec has few reports")]
        pub enum Report {
            $($(#[$doc])* #[serde(rename = $name)] $kind($file::Config),)*
        }

        impl Check for Report {
            fn check(&self) -> Result<(), OutOfRange> {
                match self {
                    $(Self::$kind(config) => config.check(),)*
                }
            }
        }

        impl Report {
            /// The names of all kinds.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Reads the configuration of a report of the kind `name`; `None` if there is none of
            /// this name. Unlike deserialising a whole report, hands `config` on unbuffered, so
            /// that its errors know their place.
            pub fn read<'de, D: Deserializer<'de>>(
                name: &str,
                config: D,
            ) -> Result<Option<Self>, D::Error> {
                Ok(Some(match name {
                    $($name => Self::$kind(Deserialize::deserialize(config)?),)*
                    _ => return Ok(None),
                }))
            }

            fn write(&self, rows: &Rows) -> Result<Output, Error> {
                match self {
                    $(Self::$kind(config) => config.finish(config.write(rows)?, rows),)*
                }
            }
        }
    };
}

kinds! {
    /// The best of so many trials.
    Trials = "trials" in trials;
    /// Cost against generation.
    Generations = "generations" in generations;
    /// Error against run time.
    Anytime = "anytime" in anytime;
    /// Rows of a CSV file of a run or of an earlier report, selected, grouped, aggregated and drawn.
    Query = "query" in query_report;
}

// What kinds differ in names all of them, so that the compiler asks for a new one.
impl Report {
    /// Returns the labels of the methods that the report names, each with its key.
    pub fn labels(&self) -> Vec<(String, &str)> {
        let (own, figure) = match self {
            Self::Trials(config) => (config.methods.labels("methods"), &config.figure),
            Self::Generations(config) => {
                let baseline = config.baseline.labels("baseline");
                ([config.method.labels("method"), baseline].concat(), &config.figure)
            }
            Self::Anytime(config) => (config.methods.labels("methods"), &config.figure),
            Self::Query(config) => (config.pairs.labels("pairs"), &config.figure),
        };
        let lines = figure.iter().flat_map(|figure| figure.lines.labels("figure.lines"));
        own.into_iter().chain(lines).collect()
    }

    /// Returns the labels of the methods whose single trials the report reads; `history.csv`
    /// suffices for all others.
    pub fn trial_methods(&self) -> Vec<String> {
        match self {
            Self::Trials(config) => config.methods.clone(),
            Self::Generations(config) => vec![config.method.clone(), config.baseline.clone()],
            Self::Query(config) => config.trial_methods(),
            Self::Anytime(_) => vec![],
        }
    }

    /// Returns the CSV files that the report makes; those of its figures have their names.
    pub fn files(&self) -> Vec<String> {
        let names = match self {
            Self::Trials(_) => vec!["trials".to_owned()],
            Self::Generations(_) => vec!["generations".to_owned()],
            Self::Anytime(config) => config.names(),
            Self::Query(config) => vec![config.file.clone()],
        };
        names.into_iter().map(|name| format!("{name}.csv")).collect()
    }

    /// Returns the CSV files that the report reads by name, each with its key.
    pub fn reads(&self) -> Vec<(&str, &str)> {
        let config = match self {
            Self::Query(config) => config,
            Self::Trials(_) | Self::Generations(_) | Self::Anytime(_) => return vec![],
        };
        let files = [("rows", config.rows.as_str()), ("join", &config.join)];
        files.into_iter().filter(|(key, file)| *key == "rows" || !file.is_empty()).collect()
    }

    /// Returns true if the report measures gaps, for which it needs the times of events.
    pub fn needs_references(&self) -> bool {
        match self {
            Self::Anytime(_) => true,
            Self::Query(_) => self.reads().iter().any(|(_, file)| *file == ReferenceRow::FILE),
            Self::Trials(_) | Self::Generations(_) => false,
        }
    }
}

/// Makes all reports from the CSV files in the store's folder, as [`outputs`] does, and writes them
/// there, figures as SVG. Returns the text for the terminal.
pub fn write(
    reports: &[Report],
    of_suite: bool,
    store: &Store,
    is_quick: bool,
) -> Result<String, Error> {
    let outputs = outputs(reports, of_suite, store.folder())?;
    for output in &outputs {
        for (name, bytes) in &output.csv {
            store.write(&format!("{name}.csv"), bytes)?;
        }
        // Only the rows of quick variants are ever read, so they need no figures.
        for (name, figure) in output.figures.iter().filter(|_| !is_quick) {
            store.write(&format!("{name}.svg"), figures::svg(figure).as_bytes())?;
        }
    }
    outputs.iter().map(Output::text).collect()
}

/// Makes all reports from the CSV files in a folder; the comparison with the paper is last. The
/// suite of cases has one report of its own instead. Writes nothing.
pub fn outputs(reports: &[Report], of_suite: bool, folder: &Path) -> Result<Vec<Output>, Error> {
    if of_suite {
        return Ok(vec![suite::output(folder)?]);
    }
    let mut rows = Rows::read(folder)?;
    let mut outputs = Vec::new();
    for report in reports {
        let output = report.write(&rows)?;
        let known = report.files();
        let figures = output.figures.iter().map(|(name, _)| name);
        let mut made = output.csv.iter().map(|(name, _)| name).chain(figures);
        debug_assert!(made.all(|name| known.contains(&format!("{name}.csv"))), "{known:?}");
        rows.made.extend(output.csv.clone());
        outputs.push(output);
    }
    // A spec without reports is a first try, whose author wants to see the costs.
    if reports.is_empty() {
        outputs.push(final_costs(&rows)?);
    }
    let paper: Vec<PaperRow> =
        outputs.iter_mut().flat_map(|output| std::mem::take(&mut output.paper)).collect();
    if !paper.is_empty() {
        outputs.push(beside_paper(&paper)?);
    }
    Ok(outputs)
}

/// Returns the table of final costs, for experiments without reports.
fn final_costs(rows: &Rows) -> Result<Output, Error> {
    let columns = [
        ("runs", "count cost"),
        ("least_over_base", "min cost_over_base"),
        ("median_over_base", "median cost_over_base"),
        ("median_seconds", "median seconds"),
    ];
    let column = |(name, value): (&str, &str)| Column {
        name: name.into(),
        value: value.into(),
        ..Column::default()
    };
    let costs = query_report::Config {
        rows: RunRow::FILE.into(),
        join: TimingRow::FILE.into(),
        by: ["scene", "scene_kind", "method"].map(str::to_owned).into(),
        columns: columns.map(column).into(),
        ..query_report::Config::default()
    };
    let tables = costs.write(rows)?.csv.into_iter();
    let unwritten = tables.map(|(_, bytes)| ("Runs".to_owned(), bytes)).collect();
    Ok(Output { unwritten, ..Output::new("", "Final costs over those of the greedy tree") })
}

fn beside_paper(rows: &[PaperRow]) -> Result<Output, Error> {
    let mut output = Output::new("", "Ng & Trifonov 2003 beside our results");
    output.add_csv("paper", rows)?;
    output.paper = rows.to_vec();
    Ok(output)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_of_a_spec_replaces_the_one_of_its_kind() {
        let text = "kind = 'anytime'\nmethods = ['a']\nfigure = { caption = 'mine' }";
        let report: Report = toml::from_str(text).unwrap();
        let figures = report.write(&Rows::default()).unwrap().figures;
        let captions: Vec<&str> = figures.iter().map(|(_, figure)| &*figure.caption).collect();
        assert_eq!(captions, ["mine"]);
    }
}
