//! A valid ray: finite, with a direction, over a range of distances.

use crate::exact::Line;
use glam::{Vec3, Vec4};

/// The points `origin + t · direction` with `t_min <= t <= t_max`.
///
/// Every value of this type is finite and has a direction, unless [`Ray::assume_valid`] made it.
/// [`Ray::new`] rejects anything else, so no later test meets a NaN. A range with `t_min > t_max` is empty and hits nothing; a range with
/// `t_min == t_max` is one point. Zero components of the direction may have either sign.
///
/// ```
/// # use bvh_core::Ray;
/// // Distances are in multiples of the direction: 1 is the light.
/// let to_light = Ray::new([0.0, 0.0, 0.0], [0.0, 0.0, 9.0], 0.0, 1.0);
/// assert!(to_light.is_ok());
/// assert!(Ray::half_line([0.0, 0.0, f32::NAN], [0.0, 0.0, 1.0]).is_err());
/// assert!(Ray::half_line([0.0; 3], [0.0; 3]).is_err(), "no direction");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(16))]
pub struct Ray {
    // Four-lane fields: a load of four lanes would stall on recent stores of single lanes that have
    // not reached the cache.
    /// The origin, and the smallest distance.
    origin: Vec4,
    /// The direction, and the largest distance.
    direction: Vec4,
    /// 1 / direction, kept finite: ±`f32::MAX` where the direction is ±0 or nearly 0. The fourth
    /// lane is the least absolute value of the three, 1 / the direction's largest component.
    inverse: Vec4,
}

/// The reason why a ray is rejected.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidRay {
    /// The origin has a NaN or infinite component.
    #[error("the ray's origin {0} is not finite")]
    Origin(Vec3),
    /// The direction has a NaN or infinite component, or is zero, tiny or huge.
    #[error(
        "the ray's direction {0} must be finite, its largest component between 2^-100 and 2^100"
    )]
    Direction(Vec3),
    /// The range is NaN or extends behind the origin.
    #[error("the ray's range {t_min}..={t_max} must not be NaN and must start at 0 or later")]
    #[allow(missing_docs)] // The message explains the fields.
    Range { t_min: f32, t_max: f32 },
}

impl Ray {
    /// The range of a direction's largest component. The reciprocal of a component outside could
    /// lose precision.
    pub(crate) const DIRECTION_RANGE: core::ops::RangeInclusive<f32> = pow2(-100)..=pow2(100);

    /// Makes the ray from `origin` in `direction` over `t_min..=t_max`. Distances `t` are in
    /// multiples of the direction's length, which need not be 1. An infinite `t_max` becomes the
    /// largest finite distance. Arrays `[f32; 3]` are accepted.
    #[inline]
    pub fn new(
        origin: impl Into<Vec3>,
        direction: impl Into<Vec3>,
        t_min: f32,
        t_max: f32,
    ) -> Result<Self, InvalidRay> {
        let origin = origin.into();
        let direction = direction.into();
        // One comparison covers all lanes, and NaN fails every comparison.
        let sizes = direction.extend(1.0).abs();
        let longest = sizes.truncate().max_element();
        let is_finite = (origin.extend(0.0).abs().cmple(Vec4::MAX) & sizes.cmple(Vec4::MAX)).all();
        let is_range = (t_min >= 0.0) & !t_max.is_nan();
        if !(is_finite & Self::DIRECTION_RANGE.contains(&longest) & is_range) {
            return Err(Self::why_not(origin, direction, t_min, t_max));
        }
        Ok(Self::with_inverse(origin, direction, 1.0 / direction, t_min, t_max))
    }

    /// Makes a ray like [`new`](Self::new), without the checks, for callers who know that they
    /// would pass: a finite origin, a direction whose largest component is between 2⁻¹⁰⁰ and 2¹⁰⁰,
    /// `0 <= t_min`, and no NaN. Otherwise answers may be wrong, but nothing is undefined. A
    /// `t_min` below 0 counts as 0.
    #[inline]
    pub fn assume_valid(
        origin: impl Into<Vec3>,
        direction: impl Into<Vec3>,
        t_min: f32,
        t_max: f32,
    ) -> Self {
        let origin = origin.into();
        let direction = direction.into();
        // The products of infinity and zero are no numbers, which would enter unused lanes of nodes
        // and never end. An empty range enters nothing.
        let is_finite = (origin.extend(0.0).abs().cmple(Vec4::MAX)
            & direction.extend(0.0).abs().cmple(Vec4::MAX))
        .all();
        let t_max = if is_finite { t_max } else { -1.0 };
        Self::with_inverse(origin, direction, 1.0 / direction, t_min, t_max)
    }

    /// Makes a ray of these reciprocals, which may be infinite.
    #[inline(always)]
    pub(crate) fn with_inverse(
        origin: Vec3,
        direction: Vec3,
        inverse: Vec3,
        t_min: f32,
        t_max: f32,
    ) -> Self {
        let inverse = inverse.extend(1.0).max(Vec4::MIN).min(Vec4::MAX);
        let sizes = inverse.abs();
        let least = sizes.x.min(sizes.y).min(sizes.z);
        // Adding 0 turns −0 into +0, so no kernel returns a distance of −0.
        // A range that began below 0 would have entries below 0, and kernels sort entries by
        // their bits.
        Self {
            origin: origin.extend(t_min.max(0.0) + 0.0),
            direction: direction.extend(t_max.min(f32::MAX) + 0.0),
            inverse: inverse.with_w(least),
        }
    }

    /// Returns the error of the first check of [`new`](Self::new) that fails.
    #[cold]
    fn why_not(origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> InvalidRay {
        let longest = direction.abs().max_element();
        if !origin.is_finite() {
            InvalidRay::Origin(origin)
        } else if !direction.is_finite() || !Self::DIRECTION_RANGE.contains(&longest) {
            InvalidRay::Direction(direction)
        } else {
            InvalidRay::Range { t_min, t_max }
        }
    }

    /// Makes a half line: `t` from 0 to the largest finite distance.
    #[inline]
    pub fn half_line(
        origin: impl Into<Vec3>,
        direction: impl Into<Vec3>,
    ) -> Result<Self, InvalidRay> {
        Self::new(origin, direction, 0.0, f32::MAX)
    }

    /// The point where `t` is 0; finite.
    #[inline]
    pub fn origin(&self) -> Vec3 {
        self.origin.truncate()
    }

    /// The unit of `t`: finite, not zero, of any length.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        self.direction.truncate()
    }

    /// The reciprocals of the direction's components, kept finite: at most `f32::MAX` in size.
    #[inline]
    pub fn inverse_direction(&self) -> Vec3 {
        self.inverse.truncate()
    }

    /// Returns the origin, the direction and the reciprocals, with the fourth lanes of the fields.
    #[inline]
    pub(crate) fn vectors(&self) -> [Vec4; 3] {
        [self.origin, self.direction, self.inverse]
    }

    /// The smallest distance of a hit, 0 or more.
    #[inline]
    pub fn t_min(&self) -> f32 {
        self.origin.w
    }

    /// The largest distance of a hit; finite.
    #[inline]
    pub fn t_max(&self) -> f32 {
        self.direction.w
    }

    #[inline(always)]
    pub(crate) fn ends(&self) -> [Vec3; 2] {
        [self.origin(), self.direction()]
    }

    #[inline(always)]
    pub(crate) fn line(&self) -> Line {
        Line::new(self.origin(), self.direction())
    }

    /// Returns the point at distance `t`, in f32.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin() + t * self.direction()
    }
}

/// A hit of a ray with an object, in the layout that C has for it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Hit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// The object's id.
    pub object: u32,
}

impl Hit {
    /// The value that a batch writes for a ray without a hit. No object has this id, and no hit has
    /// this distance.
    pub const MISS: Self = Self { t: f32::INFINITY, object: u32::MAX };

    /// Returns whether this is [`MISS`](Self::MISS).
    #[inline]
    pub fn is_miss(&self) -> bool {
        self.object == u32::MAX
    }

    /// Returns whether this hit is preferred: the nearer hit, or the lower id at the same distance.
    /// The answer of a traversal therefore does not depend on the order of the tests.
    #[inline]
    pub fn precedes(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.object < other.object)
    }
}

/// Returns 2^k for k from -126 to 127, in constants too.
pub(crate) const fn pow2(k: i32) -> f32 {
    f32::from_bits(((k + 127) as u32) << 23)
}

/// Returns the greatest power of two up to a positive normal number.
#[inline(always)]
pub(crate) fn power_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() >> 52 << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_rays_are_rejected_with_their_fault() {
        let inf = f32::INFINITY;
        for bad in
            [Vec3::ZERO, -Vec3::ZERO, Vec3::NAN, Vec3::X * inf, Vec3::X * 1e-45, Vec3::X * 3e38]
        {
            assert!(
                matches!(Ray::half_line(Vec3::ZERO, bad), Err(InvalidRay::Direction(_))),
                "{bad}"
            );
        }
        for bad in [Vec3::NAN, Vec3::new(0.0, -inf, 0.0)] {
            assert!(matches!(Ray::half_line(bad, Vec3::X), Err(InvalidRay::Origin(_))), "{bad}");
        }
        for (t_min, t_max) in [(f32::NAN, 1.0), (0.0, f32::NAN), (-1.0, 1.0), (-inf, inf)] {
            let rejected = Ray::new(Vec3::ZERO, Vec3::X, t_min, t_max);
            assert!(matches!(rejected, Err(InvalidRay::Range { .. })), "{t_min} {t_max}");
        }
    }

    #[test]
    fn a_range_begins_and_ends_at_positive_zeros() {
        let ray = Ray::new(Vec3::ZERO, Vec3::X, -0.0, -0.0).unwrap();
        assert_eq!([ray.t_min(), ray.t_max()].map(f32::to_bits), [0, 0]);
        let below_zero = Ray::assume_valid(Vec3::ONE, Vec3::X, -1e30, f32::INFINITY);
        assert_eq!(below_zero, Ray::half_line(Vec3::ONE, Vec3::X).unwrap());
    }

    #[test]
    fn reciprocals_are_finite_and_keep_the_sign_of_zeros() {
        let ray = Ray::half_line(Vec3::ZERO, Vec3::new(0.0, -0.0, -2.0)).unwrap();
        assert_eq!(ray.inverse_direction(), Vec3::new(f32::MAX, -f32::MAX, -0.5));
        let tiny = Ray::half_line(Vec3::ZERO, Vec3::new(1e-40, -1e-45, 1.0)).unwrap();
        assert_eq!(tiny.inverse_direction(), Vec3::new(f32::MAX, -f32::MAX, 1.0));
    }
}
