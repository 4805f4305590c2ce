//! Spheres and their intersection with rays, from outside and from inside.

use crate::aabb::round_down;
use crate::{Aabb, Ray, clip_to_box};
use glam::{DVec3, Vec3};

/// A sphere in world units. Its surface can be hit from both sides. A sphere whose radius is not
/// positive is never hit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Sphere {
    /// The centre.
    pub center: Vec3,
    /// The radius.
    pub radius: f32,
}

impl Sphere {
    /// Makes a sphere from a centre, an array or a vector, and a radius.
    pub fn new(center: impl Into<Vec3>, radius: f32) -> Self {
        Self { center: center.into(), radius }
    }

    /// Returns a box around the sphere. Its corners are rounded outwards and kept finite.
    pub fn aabb(&self) -> Aabb {
        let center = self.center.as_dvec3();
        let radius = f64::from(self.radius);
        let lower = |corner: DVec3| round_down(corner).max(Vec3::MIN);
        // Negated, so that the upper corner is rounded outwards by rounding downwards too.
        Aabb { min: lower(center - radius), max: -lower(-center - radius) }
    }

    /// Returns the nearest distance at which the ray hits the surface, in the ray's range and at
    /// most `t_max`. The distance is inside the interval of the sphere's box (see [`clip_to_box`]).
    ///
    /// Computed in f64, where no product of finite f32 numbers overflows. The discriminant uses the
    /// distance of the *centre* from the line, and the second solution follows from the first. This
    /// avoids cancellation for spheres that are small, distant or barely touched (Haines, Günther &
    /// Akenine-Möller 2019, 'Precision improvements for ray/sphere intersection').
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        if self.radius.is_nan() || self.radius <= 0.0 {
            return None;
        }
        let to_center = self.center.as_dvec3() - ray.origin().as_dvec3();
        let direction = ray.direction().as_dvec3();
        let radius = f64::from(self.radius);
        let length2 = direction.length_squared();
        let along = to_center.dot(direction);
        let off_axis = to_center - direction * (along / length2);
        let discriminant = radius * radius - off_axis.length_squared();
        if discriminant < 0.0 {
            return None;
        }
        let half_chord = (length2 * discriminant).sqrt();
        // The sum of two numbers of the same sign does not cancel.
        let q = along + half_chord.copysign(along);
        // A product, because the difference of the squares would cancel near the surface.
        let distance = to_center.length();
        let other = (distance - radius) * (distance + radius);
        let (first, second) =
            if along >= 0.0 { (other / q, q / length2) } else { (q / length2, other / q) };
        // A ray that starts inside hits the far side.
        let nearest = if first >= f64::from(ray.t_min()) { first } else { second };
        clip_to_box(ray, &self.aabb(), nearest as f32, t_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(center: Vec3, radius: f32, origin: Vec3, direction: Vec3) -> Option<f32> {
        let ray = Ray::half_line(origin, direction).unwrap();
        Sphere { center, radius }.intersect(&ray, f32::MAX)
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
            let scale = libm::exp2f(k as f32);
            let center = Vec3::X * 3.0 * scale;
            assert_eq!(hit(center, scale, Vec3::ZERO, Vec3::X), Some(2.0 * scale), "2^{k}");
        }
        assert_eq!(hit(Vec3::ZERO, 0.0, Vec3::X * -1.0, Vec3::X), None);
        assert_eq!(hit(Vec3::ZERO, f32::NAN, Vec3::X * -1.0, Vec3::X), None);
    }

    #[test]
    fn the_box_of_a_sphere_contains_it_and_is_finite() {
        for (center, radius) in
            [(Vec3::splat(0.1), 1e-9), (Vec3::splat(1e8), 0.3), (Vec3::splat(3e38), 3e38)]
        {
            let aabb = Sphere { center, radius }.aabb();
            assert!(aabb.check().is_ok(), "{aabb:?}");
            let low = center.as_dvec3() - f64::from(radius);
            let high = center.as_dvec3() + f64::from(radius);
            assert!(aabb.min.as_dvec3().cmple(low).all());
            assert_eq!(aabb.max, aabb.max.min(Vec3::MAX));
            // The sphere may reach beyond the largest f32, its box may not.
            let finite_high = high.min(DVec3::splat(f32::MAX.into()));
            assert!(aabb.max.as_dvec3().cmpge(finite_high).all());
        }
    }
}
