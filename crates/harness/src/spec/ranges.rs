//! What range every number of a spec is to be in: one table.
//!
//! Parameters of methods are left to the methods, which check them for callers without a spec too.

use super::Experiment;
use super::fault::Fault;
use crate::report::Report;
use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::RangeBounds;

type Range = (Bound<f64>, Bound<f64>);

const NOT_NEGATIVE: Range = (Included(0.0), Unbounded);
const POSITIVE: Range = (Excluded(0.0), Unbounded);
const SOME: Range = (Included(1.0), Unbounded);

/// Keys without indices, with their range. Of a table whose keys are names, or of an array, the key stands for all in
/// it.
const RANGES: &[(&str, Range)] = &[
    ("reports.at_seconds", POSITIVE),
    ("reports.best_of", SOME),
    ("reports.columns.best_of", SOME),
    ("reports.columns.paper", POSITIVE),
    ("reports.document", POSITIVE),
    ("reports.level", (Excluded(0.0), Excluded(1.0))),
    ("reports.paper", POSITIVE),
    ("reports.paper_final", POSITIVE),
    ("reports.paper_gain", POSITIVE),
    ("reports.paper_improves_after", NOT_NEGATIVE),
    ("reports.targets.percent", (Excluded(-100.0), Included(1e6))),
    ("reports.tolerance", (Included(0.0), Included(1.0))),
];

/// Checks all numbers but those of methods, and what several numbers must be together.
pub(super) fn check(experiment: &Experiment) -> Result<(), Fault> {
    let table = without_methods(experiment).map_err(|error| Fault::new("a value", error, "TOML"))?;
    numbers(&table, &mut |shown, key, found| match range(key) {
        Some(range) if !range.contains(&found) => Err(Fault::new(shown, found, in_words(range))),
        _ => Ok(()),
    })?;
    experiment.reports.iter().enumerate().try_for_each(|(index, report)| together(index, report))
}

fn without_methods(experiment: &Experiment) -> Result<toml::Value, toml::ser::Error> {
    toml::Value::try_from(Experiment { methods: vec![], ..experiment.clone() })
}

fn range(key: &str) -> Option<Range> {
    let within =
        |known: &str| key.strip_prefix(known).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    RANGES.iter().find(|(known, _)| within(known)).map(|&(_, range)| range)
}

fn in_words(range: Range) -> String {
    match range {
        (Included(low), Included(high)) => format!("{low} to {high}"),
        (Excluded(low), Included(high)) => format!("above {low}, up to {high}"),
        (Excluded(low), Excluded(high)) => format!("above {low} and below {high}"),
        (Included(low), _) => format!("{low} or more"),
        (Excluded(low), _) => format!("above {low}"),
        _ => "any number".into(),
    }
}

/// Calls `visit` with every number, its key as messages show it, and its key without indices.
fn numbers(
    value: &toml::Value,
    visit: &mut impl FnMut(&str, &str, f64) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let mut open = vec![(String::new(), String::new(), value)];
    while let Some((shown, key, value)) = open.pop() {
        let below = |name: &String| {
            let dot = if key.is_empty() { "" } else { "." };
            (format!("{shown}{dot}{name}"), format!("{key}{dot}{name}"))
        };
        match value {
            toml::Value::Integer(number) => visit(&shown, &key, *number as f64)?,
            toml::Value::Float(number) => visit(&shown, &key, *number)?,
            toml::Value::Table(table) => open.extend(table.iter().rev().map(|(name, value)| {
                let (shown, key) = below(name);
                (shown, key, value)
            })),
            toml::Value::Array(array) => open.extend(
                array
                    .iter()
                    .enumerate()
                    .rev()
                    .map(|(at, value)| (format!("{shown}[{at}]"), key.clone(), value)),
            ),
            _ => {}
        }
    }
    Ok(())
}

/// Lists of a report: not empty, in order, of the length of another.
fn together(index: usize, report: &Report) -> Result<(), Fault> {
    let refuse = |key: &str, found: String, accepted: &str| {
        Err(Fault::new(format!("reports[{index}].{key}"), found, accepted))
    };
    if report.labels().is_empty() {
        let key = match report {
            Report::Table(_) => "columns",
            Report::Omissions(_) => "pairs",
            _ => "methods",
        };
        return refuse(key, "empty".into(), "one or more");
    }
    match report {
        Report::Anytime(config) => {
            if !config.at_seconds.is_sorted_by(|a, b| a < b) {
                return refuse("at_seconds", format!("{:?}", config.at_seconds), "ascending numbers");
            }
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if config.file.is_empty() || !config.file.chars().all(plain) {
                return refuse("file", format!("{:?}", config.file), "letters, digits, - and _");
            }
        }
        Report::Significance(config) if config.against.is_empty() => {
            return refuse("against", "empty".into(), "one label or more");
        }
        Report::Gaps(config) if config.methods.is_empty() => {
            return refuse("methods", "empty".into(), "one label or more");
        }
        Report::Peers(config) if config.methods.is_empty() => {
            return refuse("methods", "empty".into(), "one label or more");
        }
        Report::Generations(config) => {
            let disordered = config.paper_final.iter().find(|(_, [low, high])| low > high);
            if let Some((scene, found)) = disordered {
                return refuse(&format!("paper_final.{scene}"), format!("{found:?}"), "the lower number first");
            }
        }
        _ => {}
    }
    let (targets, paper, methods) = match report {
        Report::RunTimes(config) => (Some(&config.targets), None, 0),
        Report::Ecdf(config) => (Some(&config.targets), None, 0),
        Report::Profile(config) => (Some(&config.targets), None, 0),
        Report::Times(config) => (None, Some(&config.paper), config.methods.len()),
        Report::RayTests(config) => (None, Some(&config.paper), config.methods.len()),
        _ => (None, None, 0),
    };
    if targets.is_some_and(|targets| targets.is_empty()) {
        return refuse("targets", "empty".into(), "one or more");
    }
    let longer = paper.and_then(|paper| paper.iter().find(|(_, numbers)| numbers.len() > methods));
    match longer {
        Some((scene, numbers)) => {
            let accepted = format!("up to {methods}, one for each of methods");
            refuse(&format!("paper.{scene}"), format!("a list of {} numbers", numbers.len()), &accepted)
        }
        None => Ok(()),
    }
}
