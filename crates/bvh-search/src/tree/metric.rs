//! The size of a box, whose sum a search minimises: the half area, or the caller's measure.
//!
//! Searches are generic over the metric, so the area costs no indirection.

use bvh_core::PackedAabb;
use bvh_core::cost::Measure;

/// The size of a box: finite, not negative, and no smaller for a box that contains another. The cost
/// of leaves is known at run time only, because a type for either cost would compile every search
/// once more.
pub(crate) trait Metric: Copy + Send + Sync {
    /// Returns the metric that counts leaves as much as inner nodes, as the surface area heuristic
    /// does with equal constants, for trees that divide objects among leaves.
    fn with_leaves(self) -> Self;
    /// The cost of a leaf per unit of its size, relative to an inner node; 0 where every tree has
    /// the same leaves.
    fn leaf_cost(self) -> f64;
    /// The size of a box that is not empty.
    fn of(self, aabb: &PackedAabb) -> f64;
}

/// The half area; by default of inner nodes only.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HalfArea {
    leaf_cost: f64,
}

impl Metric for HalfArea {
    fn with_leaves(self) -> Self {
        Self { leaf_cost: 1.0 }
    }

    #[inline(always)]
    fn leaf_cost(self) -> f64 {
        self.leaf_cost
    }

    #[inline(always)]
    fn of(self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }
}

/// The caller's measure.
#[derive(Clone, Copy)]
pub(crate) struct Measured<'a> {
    measure: &'a dyn Measure,
    leaf_cost: f64,
}

impl<'a> Measured<'a> {
    /// Counts inner nodes only.
    pub fn new(measure: &'a dyn Measure) -> Self {
        Self { measure, leaf_cost: 0.0 }
    }
}

impl Metric for Measured<'_> {
    fn with_leaves(self) -> Self {
        Self { leaf_cost: 1.0, ..self }
    }

    #[inline(always)]
    fn leaf_cost(self) -> f64 {
        self.leaf_cost
    }

    #[inline(always)]
    fn of(self, aabb: &PackedAabb) -> f64 {
        self.measure.of(aabb)
    }
}

/// Implements [`Search`](crate::Search) by the type's method `search_by`, which is generic over the
/// metric. A blanket implementation would overlap with the implementation for all builders.
macro_rules! search_by_metric {
    ($config:ty) => {
        impl crate::run::Search for $config {
            fn search(
                &self,
                problem: &crate::run::Problem,
                seed: u64,
                run: &mut Run,
            ) -> crate::run::Found {
                match problem.measure {
                    Some(measure) => {
                        self.search_by(crate::tree::Measured::new(measure), problem, seed, run)
                    }
                    None => self.search_by(crate::tree::HalfArea::default(), problem, seed, run),
                }
            }
        }
    };
}
pub(crate) use search_by_metric;
