//! Müller–Fellner: top-down object division by the best of all splits along all three axes.
//!
//! Müller & Fellner 1999, 'Hybrid scene structuring with application to ray tracing', as described by Ng &
//! Trifonov 2003, sections 3.1 and 3.2.
//!
//! Differs from the paper: divides down to single objects, as Ng & Trifonov do, not to a cost threshold; prunes
//! scans exactly; ties go to the more balanced split, then the lower axis and position.

use crate::config::{Accepts, Itself};
use crate::division::{self, Workspace};
use crate::evaluation::{AreaOnly, AreaTimesCount, AreaTimesPower, AreaTimesWeight, Evaluation};
use crate::sweep::{SplitRule, TakeBest};
use crate::{BuildError, Builder, Check, OutOfRange, Presorted};
use bvh_core::{Aabb, Bvh};

crate::config! {
    /// How to divide.
    pub struct Config {
        /// What a split is judged by. By default the original's.
        heuristic: Heuristic = Heuristic::AreaTimesCount, in Itself;
        /// Whether axes that order a node's objects identically are scanned once. Changes no tree.
        skip_same_order: bool = true;
        /// Whether an axis along which the objects came in order is not sorted again. Changes no tree.
        skip_sorted: bool = true;
        /// Whether a scene without area, all on one line along an axis, is divided along x alone. Changes no tree.
        skip_flat: bool = true;
    }
}

/// What a split is judged by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Heuristic {
    /// S(L)·|L| + S(R)·|R|.
    #[default]
    AreaTimesCount,
    /// S(L)·|L|^p + S(R)·|R|^p, 0 ≤ p ≤ 1.
    AreaTimesPower(f64),
    /// Areas alone: the heuristic of Table 2, in one of its readings.
    AreaOnly(AreaOnly),
}

impl Check for Heuristic {
    fn check(&self) -> Result<(), OutOfRange> {
        match self {
            Self::AreaTimesPower(power) => (0.0..=1.0).check("area_times_power", power),
            _ => Ok(()),
        }
    }
}

impl Builder for Config {
    fn build(&self, boxes: &[Aabb]) -> Result<Bvh, BuildError> {
        let scene = Presorted::sort(boxes, self.skip_sorted, self.skip_flat)?;
        self.check()?;
        let mut tree = Bvh::default();
        match self.heuristic {
            Heuristic::AreaTimesCount => self.greedy(&scene, &AreaTimesCount, &mut tree),
            Heuristic::AreaTimesPower(p) => {
                self.greedy(&scene, &AreaTimesPower::new(scene.len(), p), &mut tree)
            }
            Heuristic::AreaOnly(reading) => self.greedy(&scene, &reading, &mut tree),
        }
        Ok(tree)
    }
}

impl Config {
    /// Builds with `weights[i]` the expected cost C_obj of intersecting object `i`: any unit, finite, not negative.
    /// Replaces the configured heuristic.
    pub fn build_weighted(&self, boxes: &[Aabb], weights: &[f32]) -> Result<Bvh, BuildError> {
        let scene = Presorted::sort(boxes, self.skip_sorted, self.skip_flat)?;
        if weights.len() != boxes.len() {
            return Err(BuildError::WeightCount { weights: weights.len(), objects: boxes.len() });
        }
        if let Some(index) = weights.iter().position(|weight| !(weight.is_finite() && *weight >= 0.0)) {
            return Err(BuildError::InvalidWeight { index, weight: weights[index].into() });
        }
        let mut tree = Bvh::default();
        self.greedy(&scene, &AreaTimesWeight(weights), &mut tree);
        Ok(tree)
    }

    fn greedy<E: Evaluation>(&self, scene: &Presorted, evaluation: &E, tree: &mut Bvh) {
        let workspace = &mut Workspace::default();
        #[cfg(feature = "rayon")]
        if scene.len() >= division::PARALLEL_OBJECTS && rayon::current_num_threads() > 1 {
            return division::divide_parallel(
                scene,
                evaluation,
                TakeBest,
                self.skip_same_order,
                workspace,
                tree,
            );
        }
        division::divide(scene, evaluation, &mut TakeBest, self.skip_same_order, workspace, tree);
    }

    /// Divides by another rule than 'take the best': one randomised construction, on one thread. Reuses the memory
    /// of `workspace` and `tree`. The heuristic's parameter must be in range, see [`Heuristic::check`].
    pub fn construct(
        &self,
        scene: &Presorted,
        rule: &mut impl SplitRule,
        workspace: &mut Workspace,
        tree: &mut Bvh,
    ) {
        let skip = self.skip_same_order;
        match self.heuristic {
            Heuristic::AreaTimesCount => division::divide(scene, &AreaTimesCount, rule, skip, workspace, tree),
            Heuristic::AreaTimesPower(p) => {
                let powers = AreaTimesPower::new(scene.len(), p);
                division::divide(scene, &powers, rule, skip, workspace, tree);
            }
            Heuristic::AreaOnly(reading) => division::divide(scene, &reading, rule, skip, workspace, tree),
        }
    }
}
