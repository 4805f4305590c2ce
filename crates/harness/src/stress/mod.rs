//! The suite: the stiff and extreme cases S01 to S45, and the promises that every method, traversal
//! and reader keeps on them.
//!
//! Tests and the experiment share the table [`CASES`]. [`Promise`] lists the general promises. Only
//! the commands and specs that run the suite know it.

pub mod case;
mod cell;
pub mod checks;
pub mod child;
pub mod exact_area;
pub mod examine;
pub mod kernels;
mod peers;
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

/// A measurement over the suite, selected by a spec.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Every case with every method.
    Stability(stability::Config),
}

impl Measure {
    /// The columns of the CSV files that measurements write.
    pub fn columns() -> Vec<Columns> {
        stability::columns()
    }

    /// Makes tables and figures from the CSV files in the folder.
    pub fn output(&self, folder: &Path) -> Result<Output, Error> {
        match self {
            Self::Stability(_) => stability::output(folder),
        }
    }
}

impl bvh_config::Check for Measure {
    fn faults(&self) -> Vec<OutOfRange> {
        match self {
            Self::Stability(config) => Nested.faults("stability", config),
        }
    }
}
