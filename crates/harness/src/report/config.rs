//! Keys that several kinds of reports share, and checks of their lists.

use super::query::QueryError;
use crate::rows;
use bvh_config::{Accepts, OutOfRange};

/// Declares the configuration of a kind of reports: its own keys after those that all kinds have.
macro_rules! report {
    ($(#[$doc:meta])* pub struct Config { $($keys:tt)* } $($check:tt)*) => {
        bvh_config::config! { serde;
            $(#[$doc])*
            pub struct Config {
                /// Place in the paper, such as `Figure 2`, or topic.
                source: String;
                /// The report in words.
                title: String;
                /// Reason for differences from the paper.
                reason: String;
                $($keys)*
                /// A figure of the report's first table.
                #[serde(skip_serializing_if = "Option::is_none")]
                figure: Option<$crate::report::drawing::Drawing>, in bvh_config::Nested;
            }
            $($check)*
        }

        impl Config {
            pub(super) fn finish(&self, mut output: Output, rows: &Rows) -> Result<Output, Error> {
                let Self { source, title, reason, figure, .. } = self;
                if let Some(figure) = figure {
                    figure.draw(rows, &mut output)?;
                }
                Ok(output.headed(source, title, reason))
            }
        }
    };
}
pub(crate) use report;

/// Accepts lists that are not empty.
#[derive(Clone, Copy, Debug)]
pub struct OneOrMore;

impl<T> Accepts<Vec<T>> for OneOrMore {
    fn check(&self, key: &str, found: &Vec<T>) -> Result<(), OutOfRange> {
        if found.is_empty() { Err(OutOfRange::new(key, "empty", "one or more")) } else { Ok(()) }
    }
}

/// The labels of methods that a configuration names, each with the key of its place.
pub trait Labels {
    /// Returns all labels under `key` in order.
    fn labels(&self, key: &str) -> Vec<(String, &str)>;
}

impl Labels for String {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        vec![(key.into(), self)]
    }
}

impl<L: Labels> Labels for [L] {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.iter()
            .enumerate()
            .flat_map(|(at, named)| named.labels(&format!("{key}[{at}]")))
            .collect()
    }
}

impl Labels for [String; 2] {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.as_slice().labels(key)
    }
}

bvh_config::config! { serde;
    /// Methods that make one line of a figure.
    pub struct Series {
        /// Name of the line in the figure.
        name: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
    }
}

impl Labels for Series {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.methods.labels(&format!("{key}.methods"))
    }
}

/// Rejects names of CSV files that could lead to another folder or replace rows of the runs.
/// `before` stands before the name, and `.csv` behind it.
pub fn check_file(before: &str, name: &str) -> Result<(), OutOfRange> {
    // Other characters separate folders or are invalid on some system.
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(is_plain) {
        return Err(OutOfRange::new("file", format!("{name:?}"), "letters, digits, - and _"));
    }
    let csv = format!("{before}{name}.csv");
    if rows::FILES.contains(&csv.as_str()) || csv == "paper.csv" {
        let accepted = format!("a name other than that of {csv}, which every experiment writes");
        return Err(OutOfRange::new("file", format!("{name:?}"), accepted));
    }
    Ok(())
}

/// Rejects the text under `key` if it cannot be read as a part of a query.
pub(super) fn accept<T>(key: &str, result: Result<T, QueryError>) -> Result<(), OutOfRange> {
    match result {
        Err(QueryError::Malformed { found, accepted, .. }) => {
            Err(OutOfRange::new(key, format!("{found:?}"), accepted))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_or_replace_rows_of_runs_are_rejected() {
        for (before, name) in [("", "builds"), ("timing_", "builds"), ("timing_", "runs")] {
            assert_eq!(check_file(before, name), Ok(()));
        }
        for name in ["runs", "paper", "timing_history", "", "../runs"] {
            assert!(check_file("", name).is_err(), "{name}");
        }
        for name in ["history", "", "../runs"] {
            assert!(check_file("timing_", name).is_err(), "timing_{name}");
        }
    }
}
