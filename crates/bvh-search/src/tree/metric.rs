//! The size of a box, whose sum a search minimises: the half area, or the caller's measure.
//!
//! Searches are generic over the metric, so the area costs no indirection.

pub(crate) use bvh_core::cost::Area;
use bvh_core::cost::{self, Measure, Sum};
use bvh_core::{Bvh, PackedAabb};

/// The size of a box: finite, not negative, and no smaller for a box that contains another.
pub(crate) trait Metric: Copy + Send + Sync {
    /// The cost of a leaf per unit of its size, relative to an inner node; 0 where every tree has
    /// the same leaves.
    const LEAF: f64 = 0.0;
    /// The size of a box that is not empty.
    fn of(self, aabb: &PackedAabb) -> f64;
    /// The total size of the boxes of all inner nodes, and of the leaves weighted by `LEAF`.
    fn internal(self, tree: &Bvh) -> f64;
}

impl Metric for Area {
    #[inline(always)]
    fn of(self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }

    fn internal(self, tree: &Bvh) -> f64 {
        cost::internal_area(tree)
    }
}

impl Metric for &dyn Measure {
    #[inline(always)]
    fn of(self, aabb: &PackedAabb) -> f64 {
        Measure::of(self, aabb)
    }

    fn internal(self, tree: &Bvh) -> f64 {
        cost::internal_measure(tree, self)
    }
}

/// Another metric for trees that divide objects among leaves. Leaves and inner nodes count equally,
/// as in the surface area heuristic with equal constants.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WithLeaves<A>(pub A);

impl<A: Metric> Metric for WithLeaves<A> {
    const LEAF: f64 = 1.0;

    #[inline(always)]
    fn of(self, aabb: &PackedAabb) -> f64 {
        self.0.of(aabb)
    }

    fn internal(self, tree: &Bvh) -> f64 {
        tree.nodes
            .iter()
            .map(|node| self.0.of(&PackedAabb::from(&node.aabb)))
            .collect::<Sum>()
            .value()
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
                    Some(measure) => self.search_by(measure, problem, seed, run),
                    None => self.search_by(crate::tree::Area, problem, seed, run),
                }
            }
        }
    };
}
pub(crate) use search_by_metric;
