//! The measurement of the suite of stiff and extreme cases, which `bvh_stress` declares and checks:
//! rows and seconds.
//!
//! Only the commands and specs that run the suite know it.

pub mod child;
pub mod stability;

use crate::Error;
use crate::report::output::Output;
use bvh_config::{Accepts, Nested, OutOfRange};
use std::path::Path;

/// A measurement over the suite, selected by a spec.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Every case with every method.
    Stability(stability::Config),
}

impl Measure {
    /// Makes the table from the CSV files in the folder.
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
