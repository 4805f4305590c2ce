//! The metrics that reports compare trees by: name, unit, scale, and what counts as the worst value.

use super::data::ratio;
use crate::rows::RunRow;
use figures::Axis;

/// A number of a tree or of a run; lower is better for all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// The objective over that of the greedy tree.
    CostOverBase,
    /// Total area of inner nodes over the root's area.
    CostOverRootArea,
    /// The Goldsmith–Salmon cost.
    GoldsmithSalmon,
    /// The surface area heuristic.
    Sah,
    /// Cost over the reference, minus 1.
    Gap,
    /// Mean number of box tests per ray.
    BoxesPerRay,
    /// Time per ray.
    NsPerRay,
    /// Time of a build.
    BuildSeconds,
}

impl Metric {
    /// The value of a run that has none, such as one without an incumbent: worse than every other.
    pub const WORST: f64 = f64::INFINITY;
    /// The costs that `runs.csv` has of every tree, apart from the objective.
    pub const COSTS: [Self; 3] = [Self::GoldsmithSalmon, Self::CostOverRootArea, Self::Sah];

    /// Its name in CSV files, its label with the unit, and its scale.
    fn entry(self) -> (&'static str, &'static str, fn(&'static str) -> Axis) {
        match self {
            Self::CostOverBase => ("cost_over_base", "cost / base", Axis::linear),
            Self::CostOverRootArea => ("cost_over_root_area", "cost / root area", Axis::linear),
            Self::GoldsmithSalmon => ("goldsmith_salmon", "Goldsmith–Salmon cost", Axis::linear),
            Self::Sah => ("sah", "surface area heuristic", Axis::linear),
            Self::Gap => ("gap", "gap to the best known", Axis::log),
            Self::BoxesPerRay => ("boxes_per_ray", "box tests per ray", Axis::linear),
            Self::NsPerRay => ("ns_per_ray", "ns per ray", Axis::linear),
            Self::BuildSeconds => ("build_seconds", "build time (s)", Axis::log),
        }
    }

    /// Its name in CSV files.
    pub fn column(self) -> &'static str {
        self.entry().0
    }

    /// An axis of a figure for it.
    pub fn axis(self) -> Axis {
        let (_, label, scale) = self.entry();
        scale(label)
    }

    /// Its value for a run's tree; `None` for what `runs.csv` does not have.
    pub fn of_run(self, run: &RunRow) -> Option<f64> {
        match self {
            Self::CostOverBase => Some(ratio(run.cost, run.base_cost)),
            Self::CostOverRootArea => Some(run.cost_over_root_area),
            Self::GoldsmithSalmon => Some(run.goldsmith_salmon),
            Self::Sah => Some(run.sah),
            Self::Gap | Self::BoxesPerRay | Self::NsPerRay | Self::BuildSeconds => None,
        }
    }
}
