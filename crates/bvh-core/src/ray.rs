//! A ray that is always one: finite, with a direction, over a range of distances.

use glam::{Vec3, Vec4};

/// The points `origin + t · direction` with `t_min <= t <= t_max`.
///
/// Every value of this type is finite and has a direction; what is not is refused by [`Ray::new`], so that no test
/// further down meets a NaN. A range with `t_min > t_max` is empty and hits nothing; with `t_min == t_max` it is
/// one point. Zero components of the direction may have either sign.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(16))]
pub struct Ray {
    // Whole vectors: a load of four lanes cannot be served from the stores of single ones that have not reached the
    // cache.
    /// The origin, and the smallest distance.
    origin: Vec4,
    /// The direction, and the largest distance.
    direction: Vec4,
    /// 1 / direction, finite: ±`f32::MAX` where the direction is ±0 or nearly; and the least size of the three, which is
    /// 1 / the direction's largest component.
    inverse: Vec4,
}

/// Why there is no such ray.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidRay {
    /// A NaN or infinite component of the origin.
    #[error("the ray's origin {0} is not finite")]
    Origin(Vec3),
    /// A NaN or infinite component of the direction, or a zero, vanishing or enormous direction.
    #[error(
        "the ray's direction {0} must be finite, its largest component between 2^-100 and 2^100"
    )]
    Direction(Vec3),
    /// A range that is NaN or reaches behind the origin.
    #[error("the ray's range {t_min}..={t_max} must not be NaN and must start at 0 or later")]
    Range {
        /// The smallest distance asked for.
        t_min: f32,
        /// The largest distance asked for.
        t_max: f32,
    },
}

impl Ray {
    /// The largest component of a direction: a smaller or larger one could lose precision in its reciprocal.
    const DIRECTION_RANGE: core::ops::RangeInclusive<f32> = pow2(-100)..=pow2(100);

    /// The ray from `origin` in `direction` over `t_min..=t_max`. Distances `t` are in multiples of the direction's
    /// length, which need not be 1. An infinite `t_max` stands for the largest finite distance. Arrays `[f32; 3]` will
    /// do.
    #[inline]
    pub fn new(
        origin: impl Into<Vec3>,
        direction: impl Into<Vec3>,
        t_min: f32,
        t_max: f32,
    ) -> Result<Self, InvalidRay> {
        let origin = origin.into();
        let direction = direction.into();
        // One comparison for all lanes; a NaN fails each.
        let sizes = direction.extend(1.0).abs();
        let longest = sizes.truncate().max_element();
        let is_finite = (origin.extend(0.0).abs().cmple(Vec4::MAX) & sizes.cmple(Vec4::MAX)).all();
        let is_range = (t_min >= 0.0) & !t_max.is_nan();
        if !(is_finite & Self::DIRECTION_RANGE.contains(&longest) & is_range) {
            return Err(Self::why_not(origin, direction, t_min, t_max));
        }
        Ok(Self::assume_valid(origin, direction, t_min, t_max))
    }

    /// [`new`](Self::new) without its checks, for a caller who knows that they would pass: the finite origin, a direction
    /// whose largest component is between 2⁻¹⁰⁰ and 2¹⁰⁰, and `0 <= t_min`, none of them NaN. Of another ray every
    /// answer may be wrong, but nothing worse happens.
    #[inline]
    pub fn assume_valid(
        origin: impl Into<Vec3>,
        direction: impl Into<Vec3>,
        t_min: f32,
        t_max: f32,
    ) -> Self {
        let origin = origin.into();
        let direction = direction.into();
        let inverse = (1.0 / direction.extend(1.0))
            .max(Vec4::MIN)
            .min(Vec4::MAX);
        let sizes = inverse.abs();
        let least = sizes.x.min(sizes.y).min(sizes.z);
        // A zero is +0, so that no kernel hands out another one.
        Self {
            origin: origin.extend(t_min + 0.0),
            direction: direction.extend(t_max.min(f32::MAX) + 0.0),
            inverse: inverse.with_w(least),
        }
    }

    /// The first check of [`new`](Self::new) that fails.
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

    /// The whole half line: `t` from 0 to the largest finite distance.
    #[inline]
    pub fn half_line(
        origin: impl Into<Vec3>,
        direction: impl Into<Vec3>,
    ) -> Result<Self, InvalidRay> {
        Self::new(origin, direction, 0.0, f32::MAX)
    }

    /// Where `t` is 0; finite.
    #[inline]
    pub fn origin(&self) -> Vec3 {
        self.origin.truncate()
    }

    /// The step by which `t` counts; finite, not zero, any length.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        self.direction.truncate()
    }

    /// The reciprocals of the direction's components; finite: ±`f32::MAX` where they would not be.
    #[inline]
    pub fn inverse_direction(&self) -> Vec3 {
        self.inverse.truncate()
    }

    /// The least size of the reciprocals of the direction's components.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    #[inline]
    pub(crate) fn least_inverse(&self) -> f32 {
        self.inverse.w
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

    /// The point at distance `t`, in f32.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin() + t * self.direction()
    }
}

/// An object met by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// The object's id.
    pub object: u32,
}

impl Hit {
    /// What a batch writes for a ray that meets nothing: no object has this id, and no distance is so large.
    pub const MISS: Self = Self { t: f32::INFINITY, object: u32::MAX };

    /// Whether this is [`MISS`](Self::MISS).
    #[inline]
    pub fn is_miss(&self) -> bool {
        self.object == u32::MAX
    }

    /// Whether this hit is to be preferred: the nearer one, and of two at the same distance the one of the lower id,
    /// so that the answer does not depend on the order in which objects are tested.
    #[inline]
    pub fn precedes(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.object < other.object)
    }
}

/// 2^k for k from -126 to 127, in a constant.
pub(crate) const fn pow2(k: i32) -> f32 {
    f32::from_bits(((k + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_go_nowhere_are_refused_and_named() {
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
            let refused = Ray::new(Vec3::ZERO, Vec3::X, t_min, t_max);
            assert!(matches!(refused, Err(InvalidRay::Range { .. })), "{t_min} {t_max}");
        }
    }

    #[test]
    fn a_range_begins_and_ends_at_positive_zeros() {
        let ray = Ray::new(Vec3::ZERO, Vec3::X, -0.0, -0.0).unwrap();
        assert_eq!([ray.t_min(), ray.t_max()].map(f32::to_bits), [0, 0]);
    }

    #[test]
    fn reciprocals_are_finite_and_keep_the_sign_of_zeros() {
        let ray = Ray::half_line(Vec3::ZERO, Vec3::new(0.0, -0.0, -2.0)).unwrap();
        assert_eq!(ray.inverse_direction(), Vec3::new(f32::MAX, -f32::MAX, -0.5));
        let tiny = Ray::half_line(Vec3::ZERO, Vec3::new(1e-40, -1e-45, 1.0)).unwrap();
        assert_eq!(tiny.inverse_direction(), Vec3::new(f32::MAX, -f32::MAX, 1.0));
    }
}
