//! A box in two vector registers, for the inner loops of builders and searches.

use crate::Aabb;
use glam::{DVec4, Vec4};

/// A box that is stored as `-min` and `max`. A union is two maxima and an extent is one addition,
/// four lanes at a time.
///
/// It holds the same numbers as an [`Aabb`], because negation is exact, and has the same half area,
/// bit by bit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct PackedAabb {
    negated_min: Vec4,
    max: Vec4,
}

impl PackedAabb {
    /// The neutral element of [`grow`](Self::grow). It has no meaningful area.
    pub const EMPTY: Self = Self { negated_min: Vec4::NEG_INFINITY, max: Vec4::NEG_INFINITY };

    /// Extends the box to contain `other`.
    #[inline(always)]
    pub fn grow(&mut self, other: &Self) {
        self.negated_min = self.negated_min.max(other.negated_min);
        self.max = self.max.max(other.max);
    }

    /// Returns the smallest box around both boxes.
    #[inline(always)]
    #[must_use]
    pub fn union(mut self, other: &Self) -> Self {
        self.grow(other);
        self
    }

    /// Returns half of the surface area in f64. It equals [`Aabb::half_area`] for every box that is
    /// not empty.
    #[inline(always)]
    pub fn half_area(&self) -> f64 {
        let DVec4 { x, y, z, .. } = self.extent();
        x * y + y * z + z * x
    }

    /// Returns twice the centre, with 0 in the fourth lane. It equals [`Aabb::doubled_centroid`]
    /// except for the sign of zeros.
    #[inline(always)]
    pub fn doubled_centroid(&self) -> DVec4 {
        self.max.as_dvec4() - self.negated_min.as_dvec4()
    }

    /// Returns `-min` and `max`. Their fourth lanes are 0 for the box of an object.
    #[inline(always)]
    pub fn planes(&self) -> [[f32; 4]; 2] {
        [self.negated_min.to_array(), self.max.to_array()]
    }

    /// Returns the side lengths in world units, with 0 in the fourth lane.
    #[inline(always)]
    pub fn extent(&self) -> DVec4 {
        self.max.as_dvec4() + self.negated_min.as_dvec4()
    }
}

impl From<&Aabb> for PackedAabb {
    #[inline]
    fn from(aabb: &Aabb) -> Self {
        Self { negated_min: (-aabb.min).extend(0.0), max: aabb.max.extend(0.0) }
    }
}

impl From<&PackedAabb> for Aabb {
    /// Unpacks a box. Zeros become +0, because a union must not depend on the order in which −0 and
    /// +0 were added to it.
    #[inline]
    fn from(packed: &PackedAabb) -> Self {
        // 0 − x and x + 0 are +0 for both zeros; −x would not be.
        let min = Vec4::ZERO - packed.negated_min;
        let max = packed.max + Vec4::ZERO;
        Self { min: min.truncate(), max: max.truncate() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    fn any_point() -> impl Strategy<Value = Vec3> {
        let finite = prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO;
        prop::array::uniform3(finite).prop_map(Vec3::from_array)
    }

    fn any_box() -> impl Strategy<Value = Aabb> {
        (any_point(), any_point()).prop_map(|(a, b)| Aabb { min: a.min(b), max: a.max(b) })
    }

    proptest! {
        #[test]
        fn packing_changes_neither_unions_nor_areas(a in any_box(), b in any_box()) {
            let packed = PackedAabb::from(&a).union(&PackedAabb::from(&b));
            let plain = a.union(&b);
            prop_assert_eq!(Aabb::from(&packed), plain);
            prop_assert_eq!(packed.half_area().to_bits(), plain.half_area().to_bits());
            prop_assert_eq!(packed.doubled_centroid().truncate(), plain.doubled_centroid());
            let [[x, y, z, _], high] = packed.planes();
            prop_assert_eq!(Aabb::from(([-x, -y, -z], [high[0], high[1], high[2]])), plain);
        }
    }
}
