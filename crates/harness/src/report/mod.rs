//! Reports made from an experiment's CSV files: tables, figures, and comparisons with the paper.
//!
//! A kind of report is one file and one line in [`Report`]. Reports read CSV files only.

pub mod anytime;
mod colours;
pub mod config;
mod correlation;
pub mod data;
pub mod distribution;
pub mod drawing;
pub mod gaps;
pub mod generations;
pub mod numbers;
pub mod output;
pub mod paper;
mod prelude;
pub mod query;
mod query_column;
pub mod query_measure;
pub mod query_report;
mod ray_cost;
pub mod table;
pub mod trials;

use crate::Error;
use crate::rows::store::Store;
use crate::rows::{Row as _, RunRow, TimingRow};
use bvh_config::{Check, OutOfRange};
use config::Labels as _;
use data::Rows;
use output::Output;
use paper::PaperRow;
use query_column::Column;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

/// Declares the kinds of reports: name in specs (in snake case), configuration and its keys that
/// name methods, and the function that makes it.
macro_rules! reports {
    ($($(#[$doc:meta])* $name:literal => $kind:ident($config:ty: $($label:ident),*) by $write:path;)*) => {
        /// One report of a spec.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        #[allow(clippy::large_enum_variant, reason = "a spec has few reports")]
        pub enum Report {
            $($(#[$doc])* #[serde(rename = $name)] $kind($config),)*
        }

        impl Check for Report {
            fn check(&self) -> Result<(), OutOfRange> {
                match self {
                    $(Self::$kind(config) => config.check(),)*
                }
            }
        }

        impl Report {
            fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => $name,)*
                }
            }

            /// The names of all kinds.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Reads the configuration of a report of the kind `name`; `None` if there is none of
            /// this name. Unlike deserialising a whole report, hands `config` on unbuffered, so
            /// that its errors know their place.
            pub fn read<'de, D: Deserializer<'de>>(name: &str, config: D) -> Result<Option<Self>, D::Error> {
                match name {
                    $($name => <$config>::deserialize(config).map(|config| Some(Self::$kind(config))),)*
                    _ => Ok(None),
                }
            }

            /// The labels of the methods that the report names, each with its key.
            pub fn labels(&self) -> Vec<(String, &str)> {
                match self {
                    $(Self::$kind(config) => {
                        let lines = config.figure.as_ref().map(|figure| figure.lines.labels("figure.lines"));
                        let own = [$(config.$label.labels(stringify!($label))),*].concat();
                        own.into_iter().chain(lines.into_iter().flatten()).collect()
                    })*
                }
            }

            fn write(&self, rows: &Rows) -> Result<Output, Error> {
                match self {
                    $(Self::$kind(config) => config.finish($write(config, rows)?, rows),)*
                }
            }
        }
    };
}

reports! {
    /// Ratios to base, scenes by columns, compared with the paper's.
    "table" => Table(table::Config: columns) by table::Config::write;
    /// Cost against number of trials.
    "trials" => Trials(trials::Config: methods) by trials::Config::write;
    /// Cost against generation.
    "generations" => Generations(generations::Config: method, baseline) by generations::Config::write;
    /// The distribution of costs over trials.
    "distribution" => Distribution(distribution::Config: methods) by distribution::write;
    /// Costs against tests per ray over the trees of each method; every repetition is one tree.
    "correlation" => Correlation(correlation::Config: methods) by correlation::write;
    /// Error against run time.
    "anytime" => Anytime(anytime::Config: methods) by anytime::Config::write;
    /// Gaps to the exact optimum of small scenes.
    "gaps" => Gaps(gaps::Config: methods, optimum) by gaps::Config::write;
    /// Medians, quartiles, and seconds until targets are reached.
    "numbers" => Numbers(numbers::Config: methods) by numbers::Config::write;
    /// Tests of rays in trees that are trained on rays.
    "ray_cost" => RayCost(ray_cost::Config: base, pairs) by ray_cost::Config::write;
    /// Rows of a CSV file of a run or of an earlier report, selected, grouped, aggregated and drawn.
    "query" => Query(query_report::Config: pairs) by query_report::Config::write;
}

impl Report {
    /// Returns the labels of the methods whose single trials the report reads; `history.csv`
    /// suffices for all others.
    pub fn trial_methods(&self) -> Vec<&str> {
        match self {
            Self::Trials(trials::Config { methods, .. })
            | Self::Distribution(distribution::Config { methods, .. }) => {
                methods.iter().map(String::as_str).collect()
            }
            Self::Generations(config) => vec![&config.method, &config.baseline],
            Self::Table(config) => config.trial_methods(),
            _ => vec![],
        }
    }

    /// Returns the CSV files that the report makes; those of its figures have their names.
    pub fn files(&self) -> Vec<String> {
        let names = match self {
            Self::Anytime(config) => return vec![format!("{}.csv", config.csv())],
            Self::Numbers(config) if config.targets.is_empty() => {
                vec!["numbers", "timing_numbers"]
            }
            Self::Numbers(_) => vec!["numbers", "timing_numbers", "timing_to_target"],
            Self::RayCost(config) if !config.pairs.is_empty() => {
                vec!["ray_cost", "ray_cost_pairs"]
            }
            Self::Query(config) => vec![config.file.as_str()],
            // The others make one file, of their name.
            report => vec![report.name()],
        };
        names.into_iter().map(|name| format!("{name}.csv")).collect()
    }

    /// Returns the CSV files that the report reads by name, each with its key.
    pub fn reads(&self) -> Vec<(&str, &str)> {
        let Self::Query(config) = self else { return vec![] };
        let files = [("rows", config.rows.as_str()), ("join", &config.join)];
        files.into_iter().filter(|(key, file)| *key == "rows" || !file.is_empty()).collect()
    }

    /// Returns true if the report measures gaps, for which it needs the times of events.
    pub fn needs_references(&self) -> bool {
        matches!(self, Self::Anytime(_) | Self::Numbers(_))
    }
}

/// Makes all reports from the CSV files in a folder; the comparison with the paper is last. Writes
/// nothing.
pub fn outputs(reports: &[Report], folder: &Path) -> Result<Vec<Output>, Error> {
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

/// Writes the output of reports into the store's folder; figures, as SVG, only if `drawn` is true.
/// Returns the text for the terminal.
pub fn write_all(outputs: &[Output], store: &Store, drawn: bool) -> Result<String, Error> {
    for output in outputs {
        for (name, bytes) in &output.csv {
            store.write(&format!("{name}.csv"), bytes)?;
        }
        for (name, figure) in output.figures.iter().filter(|_| drawn) {
            store.write(&format!("{name}.svg"), figures::svg(figure).as_bytes())?;
        }
    }
    outputs.iter().map(Output::text).collect()
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

/// Collects the comparisons with the paper of all reports.
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
        for (kind, keys) in
            [("generations", "method = 'a'\nbaseline = 'b'"), ("anytime", "methods = ['a']")]
        {
            let text = format!("kind = '{kind}'\n{keys}\nfigure = {{ caption = 'mine' }}");
            let report: Report = toml::from_str(&text).unwrap();
            let figures = report.write(&Rows::default()).unwrap().figures;
            let captions: Vec<&str> = figures.iter().map(|(_, figure)| &*figure.caption).collect();
            assert_eq!(captions, ["mine"], "{kind}");
        }
    }
}
