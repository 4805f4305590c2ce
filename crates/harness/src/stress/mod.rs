//! The suite: cases S01 to S45, stiff and extreme, and what is promised of every method, traversal and reader on them.
//!
//! [`CASES`] is the one table for the tests and the experiment; [`Promise`] lists the general promises. Nothing else in
//! the harness knows the suite but the commands and specs that run it.

pub mod case;
mod cell;
pub mod checks;
pub mod child;
pub mod exact_area;
pub mod examine;
pub mod kernels;
mod peers;
pub mod precision;
pub mod promise;
pub mod stability;
mod table;
pub mod tracing;
pub mod transform;

use crate::Error;
use crate::report::output::Output;
use crate::rows::columns::Columns;
use bvh_config::{Accepts, Nested, OutOfRange};
pub use case::{Case, Check, EXACT_OBJECTS, Effort, LargerScenes, Part, Size, is_builder, methods};
pub use cell::Cell;
pub use promise::{Broken, Promise, Verdict};
use std::path::Path;
pub use table::{CASES, by_id};

/// A measurement over the suite, as a spec asks for it.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Every case with every method.
    Stability(stability::Config),
    /// Areas in f32 and f64 against exact ones.
    Precision(precision::Config),
}

impl Measure {
    /// The columns of the CSV files that measurements leave.
    pub fn columns() -> Vec<Columns> {
        [stability::columns(), precision::columns()].concat()
    }

    /// What it says about the CSV files in the folder.
    pub fn output(&self, folder: &Path) -> Result<Output, Error> {
        match self {
            Self::Stability(_) => stability::output(folder),
            Self::Precision(_) => precision::output(folder),
        }
    }
}

impl bvh_config::Check for Measure {
    fn faults(&self) -> Vec<OutOfRange> {
        match self {
            Self::Stability(config) => Nested.faults("stability", config),
            Self::Precision(config) => Nested.faults("precision", config),
        }
    }
}
