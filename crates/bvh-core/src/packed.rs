//! A box as one vector register, for the inner loops of builders and searches.

use crate::Aabb;
use glam::Vec3;

/// A box stored as `(-min, 0, max, 0)`, so that a union is one maximum over eight lanes and an extent is one
/// addition of the two halves. Plain safe code; compilers turn it into one AVX or two SSE instructions.
///
/// Holds the same numbers as an [`Aabb`] (negation is exact) and has the same half area, bit by bit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct PackedAabb([f32; 8]);

impl PackedAabb {
    /// The neutral element of [`grow`](Self::grow). Has no meaningful area.
    pub const EMPTY: Self = Self([f32::NEG_INFINITY; 8]);

    /// Extends the box to contain `other`.
    #[inline(always)]
    pub fn grow(&mut self, other: &Self) {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            // Written so that it is `maxps`: f32::max would add instructions for NaN, which input checks exclude.
            *a = if b > *a { b } else { *a };
        }
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
        let b = &self.0;
        let x = f64::from(b[4]) + f64::from(b[0]);
        let y = f64::from(b[5]) + f64::from(b[1]);
        let z = f64::from(b[6]) + f64::from(b[2]);
        x * y + y * z + z * x
    }
}

impl From<&Aabb> for PackedAabb {
    #[inline]
    fn from(b: &Aabb) -> Self {
        Self([-b.min.x, -b.min.y, -b.min.z, 0.0, b.max.x, b.max.y, b.max.z, 0.0])
    }
}

impl From<&PackedAabb> for Aabb {
    /// `+0` is added so that a lower corner at zero is +0 whichever sign its objects had: unions must not
    /// depend on the order in which −0 and +0 were met.
    #[inline]
    fn from(b: &PackedAabb) -> Self {
        let b = &b.0;
        Self {
            min: Vec3::new(0.0 - b[0], 0.0 - b[1], 0.0 - b[2]),
            max: Vec3::new(b[4] + 0.0, b[5] + 0.0, b[6] + 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        }
    }
}
