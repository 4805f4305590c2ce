//! The builders of the initial tree of a local search.

use bvh_build::{BuildError, Builder, Watch, muller_fellner, ploc};
use bvh_config::{Accepts, Check, Nested, OutOfRange};
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh};

bvh_config::config! {
    /// A builder of a tree with one object per leaf. Different initial trees lead to different
    /// local optima.
    pub enum Start {
        /// Greedy top-down division.
        MullerFellner(muller_fellner::Config),
        /// Bottom-up clustering: better on some scenes of architecture and machines, much worse on
        /// smooth surfaces.
        Agglomerative(ploc::Config),
    }
}

impl Default for Start {
    /// Returns Müller–Fellner with |L|^0.9. Local search from its trees reaches lower costs than
    /// from trees of the original heuristic.
    fn default() -> Self {
        Self::MullerFellner(construction())
    }
}

/// The top-down builder of the default start.
pub(crate) fn construction() -> muller_fellner::Config {
    let heuristic = muller_fellner::Heuristic::AreaTimesPower(0.9);
    muller_fellner::Config { heuristic, ..Default::default() }
}

impl Check for Start {
    fn faults(&self) -> Vec<OutOfRange> {
        match self {
            Self::MullerFellner(config) => Nested.faults("muller_fellner", config),
            Self::Agglomerative(config) => Nested.faults("agglomerative", config),
        }
    }
}

impl Builder for Start {
    fn build_watched(
        &self,
        boxes: &[Aabb],
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError> {
        match self {
            Self::MullerFellner(config) => config.build_watched(boxes, measure, watch),
            Self::Agglomerative(config) => config.build_watched(boxes, measure, watch),
        }
    }
}
