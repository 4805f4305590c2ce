//! Müller–Fellner: top-down object division by the best of all splits along all three axes.
//!
//! Müller & Fellner 1999, 'Hybrid scene structuring with application to ray tracing', as described
//! by Ng & Trifonov 2003, sections 3.1 and 3.2.
//!
//! Differs from the paper: nodes are divided down to single objects, as in Ng & Trifonov, not to a
//! cost threshold. Scans are pruned without changing their result. Ties go to the more balanced
//! split, then to the lower axis and position.

use super::divide::{Division, Workspace};
use super::presort::Presorted;
use super::rule::SplitRule;
use super::split_cost::{
    AreaOnly, AreaTimesCount, AreaTimesPower, AreaTimesWeight, ByMeasure, SplitCost,
};
use crate::{BuildError, Builder, Check, OutOfRange, Watch};
use bvh_config::{Accepts, Nested};
use bvh_core::cost::{Area, Measure};
use bvh_core::{Aabb, Bvh};

bvh_config::config! {
    /// The heuristic, and the shortcuts of a build.
    pub struct Config {
        /// The cost of a split. The default is the original heuristic.
        heuristic: Heuristic = Heuristic::AreaTimesCount, in Nested;
        /// True if axes that order a node's objects identically are scanned once. Greedy trees stay
        /// the same; candidate lists of GRASP lose their duplicates, which may change its trees.
        skip_same_order: bool = true;
        /// True if objects that are already in order along an axis are not sorted along it. Changes
        /// no tree.
        skip_sorted: bool = true;
        /// True if a scene without area, all on one line along an axis, is divided only along x.
        /// Changes no tree.
        skip_flat: bool = true;
    }
}

bvh_config::config! {
    /// The cost of a split.
    #[derive(Copy, Default)]
    pub enum Heuristic {
        /// S(L)·|L| + S(R)·|R|.
        #[default]
        AreaTimesCount,
        /// S(L)·|L|^p + S(R)·|R|^p, 0 ≤ p ≤ 1.
        AreaTimesPower(f64),
        /// Only areas: the heuristic of Table 2, in one of its readings.
        AreaOnly(AreaOnly),
        /// S(L)·ΣC_obj(L) + S(R)·ΣC_obj(R) with made-up costs, to measure the effect of object
        /// costs.
        AreaTimesCost(MadeUpCosts),
    }
}

/// Costs C_obj for scenes whose objects have no known costs: one object in `every` is more
/// expensive than the others.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case", deny_unknown_fields)
)]
pub struct MadeUpCosts {
    /// The objects 0, `every`, 2 · `every` and so on are expensive, `every` ≥ 1.
    pub every: u32,
    /// The cost of the expensive objects, 0 to 10⁶; the others cost 1.
    pub cost: f64,
}

impl MadeUpCosts {
    fn costs(self, objects: usize) -> Vec<f32> {
        let mut costs = vec![1.0; objects];
        for (object, cost) in costs.iter_mut().enumerate() {
            if object.is_multiple_of(self.every as usize) {
                *cost = self.cost as f32;
            }
        }
        costs
    }
}

impl Check for Heuristic {
    fn check(&self) -> Result<(), OutOfRange> {
        match self {
            Self::AreaTimesPower(power) => (0.0..=1.0).check("area_times_power", power),
            Self::AreaTimesCost(MadeUpCosts { every, cost }) => {
                (1..).check("area_times_cost.every", every)?;
                (0.0..=1e6).check("area_times_cost.cost", cost)
            }
            _ => Ok(()),
        }
    }
}

impl Builder for Config {
    fn build_watched(
        &self,
        boxes: &[Aabb],
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError> {
        // All trees over a scene without area have the same area, but measures may differ.
        let scene = &Presorted::sort(boxes, self.skip_sorted, self.skip_flat && measure.is_none())?;
        self.check()?;
        let mut tree = Bvh::default();
        self.construct(scene, measure, None, &mut Workspace::default(), &mut tree, watch)?;
        Ok(tree)
    }
}

impl Config {
    /// Divides by any rule, for example a randomised one, on one thread, or without a rule by the
    /// best splits; by half area or by a measure; unless the `watch` cancels. Reuses the memory of
    /// `workspace` and `tree`. The heuristic's parameter must be [in range](Check).
    pub fn construct(
        &self,
        scene: &Presorted,
        measure: Option<&dyn Measure>,
        rule: Option<&mut dyn SplitRule>,
        workspace: &mut Workspace,
        tree: &mut Bvh,
        watch: &Watch,
    ) -> Result<(), BuildError> {
        let objects = scene.boxes.len();
        let (of_weights, costs);
        // What only tables compare is not compiled once more for the sake of its speed.
        let cost: &dyn SplitCost = match self.heuristic {
            Heuristic::AreaTimesCount => {
                let division = self.division(&AreaTimesCount, scene, watch);
                return division.divide(measure, rule, workspace, tree);
            }
            Heuristic::AreaTimesPower(p) => {
                let powers = AreaTimesPower::new(objects, p);
                return self.division(&powers, scene, watch).divide(measure, rule, workspace, tree);
            }
            Heuristic::AreaOnly(ref reading) => reading,
            Heuristic::AreaTimesCost(made_up) => {
                costs = made_up.costs(objects);
                of_weights = AreaTimesWeight(&costs);
                &of_weights
            }
        };
        let by_measure = ByMeasure { cost, measure: measure.unwrap_or(&Area) };
        self.division(&by_measure, scene, watch).divide(None, rule, workspace, tree)
    }

    fn division<'a, C>(
        &self,
        split_cost: &'a C,
        scene: &'a Presorted,
        watch: &'a Watch,
    ) -> Division<'a, C> {
        Division { scene, split_cost, skip_same_order: self.skip_same_order, watch }
    }
}
