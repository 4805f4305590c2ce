//! The cost of a split: the Müller–Fellner estimate, its weighted forms, and the alternatives of
//! Table 2.
//!
//! A split's cost depends on its two sides alone. The division by the parent's area and the factor
//! 2 of a surface drop out (Ng & Trifonov 2003, section 3.2).

use bvh_core::PackedAabb;
use bvh_core::cost::Measure;

/// The cost of a node's splits, from the size and the *load* of either side. The load of a side is
/// the number of its objects, or the sum of their weights.
///
/// A side's value must not shrink when it gains objects, and [`join`](Self::join) and
/// [`bound`](Self::bound) must not shrink when values grow. Scans rely on this to prune without
/// changing a result.
pub trait SplitCost: Sync {
    /// Returns the load of one object. Default: 1.
    #[inline(always)]
    fn load(&self, _object: u32) -> f64 {
        1.0
    }
    /// Returns the load of several objects. Default: their number.
    #[inline(always)]
    fn total_load(&self, objects: &[u32]) -> f64 {
        objects.len() as f64
    }
    /// Returns the size of a box that is not empty, no smaller than the size of any box inside it.
    /// Default: the half area.
    #[inline(always)]
    fn size(&self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }
    /// Returns the value of a side with this size and load: finite and not negative.
    fn side(&self, area: f64, load: f64) -> f64;
    /// Returns the cost of a split, a symmetric function of the values of its sides.
    #[inline(always)]
    fn join(&self, left: f64, right: f64) -> f64 {
        left + right
    }
    /// Returns the maximum number of splits between the root and a node that may stall: separate a
    /// few objects from almost all others, in a box almost as large. Beyond the limit, a balanced
    /// split of least size times load replaces every split that would stall. Default: 64, more than
    /// scenes with a few objects as large as the scene need. `None` is no limit.
    #[inline(always)]
    fn most_stalls(&self) -> Option<u8> {
        Some(64)
    }
    /// Returns a lower bound of the cost of all splits whose sides have at least these values.
    /// Default: [`join`](Self::join).
    #[inline(always)]
    fn bound(&self, left: f64, right: f64) -> f64 {
        self.join(left, right)
    }
}

/// Müller–Fellner with equal objects: S(L)·|L| + S(R)·|R|.
///
/// Source: Ng & Trifonov 2003, section 3.1, with C_obj = 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct AreaTimesCount;

impl SplitCost for AreaTimesCount {
    #[inline(always)]
    fn side(&self, area: f64, load: f64) -> f64 {
        area * load
    }
}

/// Müller–Fellner with a cost per object: S(L)·ΣC_obj(L) + S(R)·ΣC_obj(R).
///
/// Source: Ng & Trifonov 2003, section 3.1. Weights are finite and not negative.
#[derive(Clone, Copy, Debug)]
pub struct AreaTimesWeight<'a>(pub &'a [f32]);

impl SplitCost for AreaTimesWeight<'_> {
    #[inline(always)]
    fn load(&self, object: u32) -> f64 {
        f64::from(self.0[object as usize])
    }
    #[inline(always)]
    fn total_load(&self, objects: &[u32]) -> f64 {
        objects.iter().map(|&object| self.load(object)).sum()
    }
    #[inline(always)]
    fn side(&self, area: f64, load: f64) -> f64 {
        area * load
    }
}

/// S(L)·|L|^p + S(R)·|R|^p. A p slightly below 1 often gives a better tree, because the number of
/// objects overstates the cost of a side that will be divided further.
///
/// Differs from the paper: the paper has p = 1.
#[derive(Clone, Debug)]
pub struct AreaTimesPower(Vec<f64>);

impl AreaTimesPower {
    /// Makes a table of powers for up to `objects` objects, with `exponent` within 0..=1. Software
    /// computes the powers, so they are the same on every machine.
    pub fn new(objects: usize, exponent: f64) -> Self {
        Self((0..=objects).map(|count| libm::pow(count as f64, exponent)).collect())
    }
}

impl SplitCost for AreaTimesPower {
    #[inline(always)]
    fn side(&self, area: f64, load: f64) -> f64 {
        area * self.0[load as usize]
    }
    /// Returns 8: powers below 1 favour splits that separate single objects.
    #[inline(always)]
    fn most_stalls(&self) -> Option<u8> {
        Some(8)
    }
}

bvh_config::config! {
    /// A heuristic that 'only considers the surface area of the subscene bounding volumes, ignoring
    /// the number of objects contained inside them' (Ng & Trifonov 2003, section 3.3 and Table 2).
    /// The paper gives no formula; these are the known readings.
    #[derive(Copy, Eq)]
    pub enum AreaOnly {
        /// S(L) + S(R), the literal reading.
        Sum,
        /// S(L) + S(R), where a side of one object counts 0: the direct use of the objective, which
        /// skips leaves.
        InnerSum,
        /// max(S(L), S(R)).
        Max,
        /// S(L)² + S(R)², between the sum and the maximum.
        SumOfSquares,
        /// |S(L) − S(R)|, least for equal areas.
        Difference,
        /// S(L) · S(R).
        Product,
    }
}

impl SplitCost for AreaOnly {
    #[inline(always)]
    fn side(&self, area: f64, load: f64) -> f64 {
        match self {
            Self::SumOfSquares => area * area,
            Self::InnerSum if load == 1.0 => 0.0,
            _ => area,
        }
    }
    #[inline(always)]
    fn join(&self, left: f64, right: f64) -> f64 {
        match self {
            Self::Sum | Self::InnerSum | Self::SumOfSquares => left + right,
            Self::Max => left.max(right),
            Self::Difference => (left - right).abs(),
            Self::Product => left * right,
        }
    }
    /// Returns no limit: these heuristics ignore the numbers of objects by definition.
    #[inline(always)]
    fn most_stalls(&self) -> Option<u8> {
        None
    }
    #[inline(always)]
    fn bound(&self, left: f64, right: f64) -> f64 {
        // Only the difference may shrink when a side grows.
        if *self == Self::Difference { 0.0 } else { self.join(left, right) }
    }
}

/// Size times load, with the sizes and loads of another cost.
pub(super) struct Linear<'a, C>(pub &'a C);

impl<C: SplitCost> SplitCost for Linear<'_, C> {
    #[inline(always)]
    fn load(&self, object: u32) -> f64 {
        self.0.load(object)
    }
    #[inline(always)]
    fn total_load(&self, objects: &[u32]) -> f64 {
        self.0.total_load(objects)
    }
    #[inline(always)]
    fn size(&self, aabb: &PackedAabb) -> f64 {
        self.0.size(aabb)
    }
    #[inline(always)]
    fn side(&self, size: f64, load: f64) -> f64 {
        size * load
    }
}

/// Any split cost with a measure instead of the half area. It is not generic, because the measure
/// takes longer than the virtual calls.
#[derive(Clone, Copy)]
pub(super) struct ByMeasure<'a> {
    pub cost: &'a dyn SplitCost,
    pub measure: &'a dyn Measure,
}

impl SplitCost for ByMeasure<'_> {
    fn load(&self, object: u32) -> f64 {
        self.cost.load(object)
    }
    fn total_load(&self, objects: &[u32]) -> f64 {
        self.cost.total_load(objects)
    }
    fn size(&self, aabb: &PackedAabb) -> f64 {
        self.measure.of(aabb)
    }
    fn side(&self, area: f64, load: f64) -> f64 {
        self.cost.side(area, load)
    }
    fn join(&self, left: f64, right: f64) -> f64 {
        self.cost.join(left, right)
    }
    fn bound(&self, left: f64, right: f64) -> f64 {
        self.cost.bound(left, right)
    }
    fn most_stalls(&self) -> Option<u8> {
        self.cost.most_stalls()
    }
}
