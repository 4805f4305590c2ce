//! What experiments measure. A measurement takes the jobs and leaves rows in the store.

use super::finish::Summary;
use super::jobs::Jobs;
use super::{ray_cost, runs, suite, trace};
use crate::Error;
use crate::measure::ray_cost::Config;
use crate::rows::store::Store;
use crate::spec::Experiment;
use bvh_stress::Effort;
use toml::Table;

/// A measurement of an experiment.
pub(crate) enum Measurement<'a> {
    /// Every method on every scene, with repetitions.
    Runs,
    /// The times of rays through the trees of first runs.
    Traced(&'a Table),
    /// The tests of rays that the trees were not trained on.
    RayCost(&'a Config),
    /// The suite of stiff cases.
    Suite(&'a Effort),
}

impl Experiment {
    /// The experiment's measurements, in their order.
    pub(super) fn measurements(&self) -> Vec<Measurement<'_>> {
        if let Some(effort) = &self.suite {
            return vec![Measurement::Suite(effort)];
        }
        let traced = self.tracing.as_ref().map(Measurement::Traced);
        let judged = self.judges().map(Measurement::RayCost);
        [Measurement::Runs].into_iter().chain(traced).chain(judged).collect()
    }
}

impl Measurement<'_> {
    /// Writes the rows, and adds to the summary what the terminal shows.
    pub fn take(&self, jobs: &Jobs, store: &Store, summary: &mut Summary) -> Result<(), Error> {
        match self {
            Self::Runs => {
                let all = jobs.experiment.measurements();
                let needs_tree = |repetition| all.iter().any(|of| of.needs_tree(repetition));
                runs::measure(jobs, &needs_tree, store, summary)
            }
            Self::Traced(keys) => trace::measure(keys, jobs, store, summary),
            Self::RayCost(config) => ray_cost::measure(config, jobs, store),
            Self::Suite(effort) => suite::measure(effort, jobs, store),
        }
    }

    /// Whether the measurement takes the trees of runs of this repetition.
    pub fn needs_tree(&self, repetition: u32) -> bool {
        match self {
            Self::Runs | Self::Suite(_) => false,
            Self::Traced(_) => repetition == 0,
            Self::RayCost(_) => true,
        }
    }

    /// The reason why several processes cannot share the measurement, if they cannot.
    pub fn indivisible(&self) -> Option<&'static str> {
        match self {
            Self::Runs => None,
            Self::Traced(_) => Some("ray times are compared within one process"),
            Self::RayCost(_) => Some("rays judge all trees of a scene together"),
            Self::Suite(_) => Some("the suite of cases cannot be split"),
        }
    }
}
