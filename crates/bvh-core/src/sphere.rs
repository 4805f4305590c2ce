//! Spheres and their intersection with rays, from outside and from inside.

use crate::{Aabb, Ray, clip_to_box};
use glam::Vec3;

/// A sphere in world units. Its surface can be hit from both sides; a sphere whose radius is not positive is never hit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Sphere {
    /// The centre.
    pub center: Vec3,
    /// The radius.
    pub radius: f32,
}

impl Sphere {
    /// From a centre, as an array or as a vector, and a radius.
    pub fn new(center: impl Into<Vec3>, radius: f32) -> Self {
        Self { center: center.into(), radius }
    }

    /// A box around the sphere, its corners rounded outwards and kept finite.
    pub fn aabb(&self) -> Aabb {
        let (center, radius) = (self.center.as_dvec3(), f64::from(self.radius));
        let below = |x: f64| {
            let rounded = x as f32;
            if f64::from(rounded) > x { rounded.next_down() } else { rounded }.max(f32::MIN)
        };
        let corner = |sign: f64| (center * sign - radius).to_array().map(below);
        Aabb { min: Vec3::from(corner(1.0)), max: -Vec3::from(corner(-1.0)) }
    }

    /// The nearest distance in the ray's range, at most `t_max`, at which the ray hits the surface. It lies in the interval
    /// of the sphere's box (see [`clip_to_box`]).
    ///
    /// Computed in f64, where no product of finite f32 overflows. The discriminant uses the distance of the *centre* from
    /// the line, and one solution follows from the other, so that small, distant and barely touched spheres suffer no
    /// cancellation (Haines, Günther & Akenine-Möller 2019, 'Precision improvements for ray/sphere intersection').
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        if self.radius.is_nan() || self.radius <= 0.0 {
            return None;
        }
        let (to_center, direction) =
            (self.center.as_dvec3() - ray.origin().as_dvec3(), ray.direction().as_dvec3());
        let radius = f64::from(self.radius);
        let length2 = direction.length_squared();
        let along = to_center.dot(direction);
        let off_axis = to_center - direction * (along / length2);
        let discriminant = radius * radius - off_axis.length_squared();
        if discriminant < 0.0 {
            return None;
        }
        let half_chord = libm::sqrt(length2 * discriminant);
        let q = along + half_chord.copysign(along);
        // Factored, because the difference of the squares would cancel near the surface.
        let distance = to_center.length();
        let other = (distance - radius) * (distance + radius);
        let (first, second) = if along >= 0.0 { (other / q, q / length2) } else { (q / length2, other / q) };
        let nearest = if first >= f64::from(ray.t_min()) { first } else { second };
        clip_to_box(ray, &self.aabb(), nearest as f32, t_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(center: Vec3, radius: f32, origin: Vec3, direction: Vec3) -> Option<f32> {
        Sphere { center, radius }.intersect(&Ray::half_line(origin, direction).unwrap(), f32::MAX)
    }

    #[test]
    fn a_sphere_is_hit_in_front_from_inside_and_not_behind() {
        assert_eq!(hit(Vec3::ZERO, 1.0, Vec3::X * -3.0, Vec3::X), Some(2.0));
        assert_eq!(hit(Vec3::ZERO, 1.0, Vec3::X * 0.5, Vec3::X), Some(0.5));
        assert_eq!(hit(Vec3::ZERO, 1.0, Vec3::X * 3.0, Vec3::X), None);
        assert_eq!(hit(Vec3::ZERO, 1.0, Vec3::X * -3.0, Vec3::X * 4.0), Some(0.5));
    }

    #[test]
    fn a_tangent_touches_and_a_line_past_it_misses() {
        assert_eq!(hit(Vec3::ZERO, 1.0, Vec3::new(-3.0, 1.0, 0.0), Vec3::X), Some(3.0));
        assert_eq!(hit(Vec3::ZERO, 1.0, Vec3::new(-3.0, 1.0f32.next_up(), 0.0), Vec3::X), None);
    }

    #[test]
    fn distances_are_right_far_away_and_at_every_scale() {
        assert_eq!(hit(Vec3::X * 1e7, 0.5, Vec3::X * -1e7, Vec3::X), Some(2e7));
        for k in [-60, 60, 100] {
            let s = libm::exp2f(k as f32);
            assert_eq!(hit(Vec3::X * 3.0 * s, s, Vec3::ZERO, Vec3::X), Some(2.0 * s), "2^{k}");
        }
        assert_eq!(hit(Vec3::ZERO, 0.0, Vec3::X * -1.0, Vec3::X), None);
        assert_eq!(hit(Vec3::ZERO, f32::NAN, Vec3::X * -1.0, Vec3::X), None);
    }

    #[test]
    fn the_box_of_a_sphere_contains_it_and_is_finite() {
        for (center, radius) in [(Vec3::splat(0.1), 1e-9), (Vec3::splat(1e8), 0.3), (Vec3::splat(3e38), 3e38)] {
            let b = Sphere { center, radius }.aabb();
            assert!(b.check().is_ok(), "{b:?}");
            let (low, high) = (center.as_dvec3() - f64::from(radius), center.as_dvec3() + f64::from(radius));
            assert!(b.min.as_dvec3().cmple(low).all() && b.max == b.max.min(Vec3::splat(f32::MAX)));
            assert!(b.max.as_dvec3().cmpge(high.min(glam::DVec3::splat(f32::MAX.into()))).all());
        }
    }
}
