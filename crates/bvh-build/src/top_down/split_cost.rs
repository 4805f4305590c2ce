//! The cost of a split: the Müller–Fellner estimate, its weighted forms, and the alternatives of Table 2.
//!
//! A split's cost depends on its two sides alone. The division by the parent's area and the factor 2 of a surface
//! drop out (Ng & Trifonov 2003, section 3.2).

use bvh_core::PackedAabb;
use bvh_core::cost::Measure;

/// The cost of a node's splits, from the size and the *load* of either side. The load is a sum over a side's objects: of
/// ones, or of weights.
///
/// A side's value must not shrink as objects are added to it, nor may [`join`](Self::join) or [`bound`](Self::bound)
/// as values grow. Scans rely on this to prune without changing a result.
pub trait SplitCost: Sync {
    /// The load of one object. Default 1.
    #[inline(always)]
    fn load(&self, _object: u32) -> f64 {
        1.0
    }
    /// The load of several objects. Default: their number.
    #[inline(always)]
    fn total_load(&self, objects: &[u32]) -> f64 {
        objects.len() as f64
    }
    /// The size of a box that is not empty, no smaller than that of any box inside it. Default its half area.
    #[inline(always)]
    fn size(&self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }
    /// The value of a side with this size and load: finite and not negative.
    fn side(&self, area: f64, load: f64) -> f64;
    /// The cost of a split, from the values of its sides; symmetric.
    #[inline(always)]
    fn join(&self, left: f64, right: f64) -> f64 {
        left + right
    }
    /// The number of splits between the root and a node that may stall, which is to separate a few objects from almost all others in a
    /// box almost as large. After so many, every split that would stall is replaced by a balanced one of least size times load. Default
    /// 64, more than scenes with a few objects as large as the scene need; `None` is no limit.
    #[inline(always)]
    fn most_stalls(&self) -> Option<u8> {
        Some(64)
    }
    /// A lower bound on the cost of all splits whose sides have at least these values. Default: [`join`](Self::join).
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
        objects
            .iter()
            .map(|&object| self.load(object))
            .sum()
    }
    #[inline(always)]
    fn side(&self, area: f64, load: f64) -> f64 {
        area * load
    }
}

/// S(L)·|L|^p + S(R)·|R|^p. A p slightly below 1 often gives a better tree, because the number of objects overstates
/// the cost of a side that will itself be divided.
///
/// Differs from the paper: p = 1 there.
#[derive(Clone, Debug)]
pub struct AreaTimesPower(Vec<f64>);

impl AreaTimesPower {
    /// A table of powers for up to `objects` objects, with `exponent` within 0..=1. They are computed in software, so
    /// that they are the same on every machine.
    pub fn new(objects: usize, exponent: f64) -> Self {
        Self(
            (0..=objects)
                .map(|count| libm::pow(count as f64, exponent))
                .collect(),
        )
    }
}

impl SplitCost for AreaTimesPower {
    #[inline(always)]
    fn side(&self, area: f64, load: f64) -> f64 {
        area * self.0[load as usize]
    }
    /// 8: powers below 1 favour splits that separate single objects.
    #[inline(always)]
    fn most_stalls(&self) -> Option<u8> {
        Some(8)
    }
}

/// A heuristic that 'only considers the surface area of the subscene bounding volumes, ignoring the number of
/// objects contained inside them' (Ng & Trifonov 2003, section 3.3 and Table 2). The paper gives no formula;
/// these are the readings we know of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum AreaOnly {
    /// S(L) + S(R), the literal reading.
    Sum,
    /// S(L) + S(R), where a side of one object counts 0: the objective, which leaves out leaves, applied directly.
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
    /// No limit: to leave out the numbers of objects is what these are about.
    #[inline(always)]
    fn most_stalls(&self) -> Option<u8> {
        None
    }
    #[inline(always)]
    fn bound(&self, left: f64, right: f64) -> f64 {
        // Only the difference may shrink as a side grows.
        if *self == Self::Difference { 0.0 } else { self.join(left, right) }
    }
}

/// Size times load, whatever the power, with the sizes and loads of another cost.
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

/// Any of these with a measure in place of the half area. Not generic: the measure takes longer than the calls.
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
