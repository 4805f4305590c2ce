//! A ray that is always one: finite, with a direction, over a range of distances.

use glam::Vec3;

/// The points `origin + t · direction` with `t_min <= t <= t_max`.
///
/// Every value of this type is finite and has a direction; what is not is refused by [`Ray::new`], so that no test
/// further down meets a NaN. A range with `t_min > t_max` is empty and hits nothing; with `t_min == t_max` it is
/// one point. Zero components of the direction may have either sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: Vec3,
    direction: Vec3,
    /// 1 / direction, finite: ±`f32::MAX` where the direction is ±0 or nearly.
    inverse: Vec3,
    t_min: f32,
    t_max: f32,
}

/// Why there is no such ray.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidRay {
    /// A NaN or infinite component of the origin.
    #[error("the ray's origin {0} is not finite")]
    Origin(Vec3),
    /// A NaN or infinite component of the direction, or a zero, vanishing or enormous direction.
    #[error("the ray's direction {0} must be finite, its largest component between 2^-100 and 2^100")]
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
        let (origin, direction) = (origin.into(), direction.into());
        if !origin.is_finite() {
            return Err(InvalidRay::Origin(origin));
        }
        if !(direction.is_finite() && Self::DIRECTION_RANGE.contains(&direction.abs().max_element())) {
            return Err(InvalidRay::Direction(direction));
        }
        if t_min.is_nan() || t_min < 0.0 || t_max.is_nan() {
            return Err(InvalidRay::Range { t_min, t_max });
        }
        let inverse = direction.map(|d| {
            let inverse = 1.0 / d;
            if inverse.is_finite() { inverse } else { f32::MAX.copysign(d) }
        });
        // A zero is +0.
        Ok(Self { origin, direction, inverse, t_min: t_min + 0.0, t_max: t_max.min(f32::MAX) })
    }

    /// The whole half line: `t` from 0 to the largest finite distance.
    #[inline]
    pub fn half_line(origin: impl Into<Vec3>, direction: impl Into<Vec3>) -> Result<Self, InvalidRay> {
        Self::new(origin, direction, 0.0, f32::MAX)
    }

    /// Where `t` is 0; finite.
    #[inline]
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// The step by which `t` counts; finite, not zero, any length.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// The reciprocals of the direction's components; finite: ±`f32::MAX` where they would not be.
    #[inline]
    pub fn inverse_direction(&self) -> Vec3 {
        self.inverse
    }

    /// The smallest distance of a hit, 0 or more.
    #[inline]
    pub fn t_min(&self) -> f32 {
        self.t_min
    }

    /// The largest distance of a hit; finite.
    #[inline]
    pub fn t_max(&self) -> f32 {
        self.t_max
    }

    /// The point at distance `t`, in f32.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
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
    /// Whether this hit is to be preferred: the nearer one, and of two at the same distance the one of the lower id,
    /// so that the answer does not depend on the order in which objects are tested.
    #[inline]
    pub fn precedes(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.object < other.object)
    }
}

/// 2^k for k from -126 to 127, in a constant.
const fn pow2(k: i32) -> f32 {
    f32::from_bits(((k + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_go_nowhere_are_refused_and_named() {
        let inf = f32::INFINITY;
        for bad in [Vec3::ZERO, -Vec3::ZERO, Vec3::NAN, Vec3::X * inf, Vec3::X * 1e-45, Vec3::X * 3e38] {
            assert!(matches!(Ray::half_line(Vec3::ZERO, bad), Err(InvalidRay::Direction(_))), "{bad}");
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
    fn reciprocals_are_finite_and_keep_the_sign_of_zeros() {
        let ray = Ray::half_line(Vec3::ZERO, Vec3::new(0.0, -0.0, -2.0)).unwrap();
        assert_eq!(ray.inverse_direction(), Vec3::new(f32::MAX, -f32::MAX, -0.5));
        let tiny = Ray::half_line(Vec3::ZERO, Vec3::new(1e-40, -1e-45, 1.0)).unwrap();
        assert_eq!(tiny.inverse_direction(), Vec3::new(f32::MAX, -f32::MAX, 1.0));
    }
}
