//! Boxes in two vector registers, for the inner loops of builders and searches.

use crate::Aabb;
use glam::{DVec4, Vec4};

/// A box stored as `-min` and `max`, so that a union is two maxima and an extent one addition, four lanes at a time.
///
/// Holds the same numbers as an [`Aabb`] (negation is exact) and has the same half area, bit by bit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct PackedAabb {
    negated_min: Vec4,
    max: Vec4,
}

impl PackedAabb {
    /// The neutral element of [`grow`](Self::grow). Has no meaningful area.
    pub const EMPTY: Self = Self { negated_min: Vec4::NEG_INFINITY, max: Vec4::NEG_INFINITY };

    /// Extends the box to contain `other`.
    #[inline(always)]
    pub fn grow(&mut self, other: &Self) {
        self.negated_min = self.negated_min.max(other.negated_min);
        self.max = self.max.max(other.max);
    }

    /// The smallest box around both.
    #[inline(always)]
    #[must_use]
    pub fn union(mut self, other: &Self) -> Self {
        self.grow(other);
        self
    }

    /// Half of the surface area in f64, equal to [`Aabb::half_area`] for every non-empty box.
    #[inline(always)]
    pub fn half_area(&self) -> f64 {
        let DVec4 { x, y, z, .. } = self.extent();
        x * y + y * z + z * x
    }

    /// Twice the centre, as [`Aabb::doubled_centroid`] but for the sign of zeros; the fourth lane 0.
    #[inline(always)]
    pub fn doubled_centroid(&self) -> DVec4 {
        self.max.as_dvec4() - self.negated_min.as_dvec4()
    }

    /// `-min` and `max`; the fourth numbers of an object's box are 0.
    #[inline(always)]
    pub fn planes(&self) -> [[f32; 4]; 2] {
        [self.negated_min.to_array(), self.max.to_array()]
    }

    /// Side lengths in world units, the fourth lane 0.
    #[inline(always)]
    pub fn extent(&self) -> DVec4 {
        self.max.as_dvec4() + self.negated_min.as_dvec4()
    }
}

impl From<&Aabb> for PackedAabb {
    #[inline]
    fn from(b: &Aabb) -> Self {
        Self { negated_min: (-b.min).extend(0.0), max: b.max.extend(0.0) }
    }
}

impl From<&PackedAabb> for Aabb {
    /// Coordinates at zero become +0 whichever sign they had: unions must not depend on the order in which −0 and +0
    /// were met.
    #[inline]
    fn from(b: &PackedAabb) -> Self {
        Self { min: (Vec4::ZERO - b.negated_min).truncate(), max: (b.max + Vec4::ZERO).truncate() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    fn any_box() -> impl Strategy<Value = Aabb> {
        let finite = || prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO;
        prop::array::uniform6(finite()).prop_map(|c| {
            let (a, b) = (Vec3::new(c[0], c[1], c[2]), Vec3::new(c[3], c[4], c[5]));
            Aabb { min: a.min(b), max: a.max(b) }
        })
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
