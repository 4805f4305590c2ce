//! The conservative ray–box test: it never misses a box that holds a hit.

use crate::{Aabb, Ray};
use glam::{Vec3, Vec4, Vec4Swizzles};

/// A ray prepared for tests against the boxes of one scene.
///
/// Three promises make the answer of a traversal independent of its tree:
///
/// 1. *Conservative.* The interval of a box contains the exact one: the exit is enlarged by [`Slabs::FAR`], which
///    covers the rounding of entry and exit (the bound 1 + 2γ(3) of Pharr, Jakob & Humphreys, Physically Based
///    Rendering, 3.9.2, and the multiplication itself), and the box by [`Slabs::MARGIN`] of the scene's distance
///    from the origin, which covers what the rounding of [`Triangle::intersect`](crate::Triangle::intersect) moves
///    a vertex (Woop, Benthin & Wald 2013, section 4, who enlarge each box by its own distance).
/// 2. *Monotone.* A box inside another one, bit by bit, has its interval inside the other's: each operation rounds
///    monotonically.
/// 3. *Defined.* Reciprocals are finite and the margin is never zero, hence no 0 · ∞, and a ray in a face plane is
///    strictly inside the enlarged box.
#[derive(Clone, Copy, Debug)]
pub struct Slabs {
    /// origin + margin, subtracted from lower corners.
    lower: Vec4,
    /// origin − margin, subtracted from upper corners.
    upper: Vec4,
    inverse: Vec4,
    t_min: f32,
}

impl Slabs {
    /// What an exit is multiplied by: with u = 2^-24 an entry is too far by (1 + u)^3 and an exit too near by
    /// (1 − u)^4 at most.
    pub const FAR: f32 = 1.0 + 8.0 * (f32::EPSILON / 2.0);

    /// By how much boxes grow, in multiples of the largest coordinate of the scene relative to the ray's origin.
    /// The rounding of a sheared vertex is below 6u of it.
    pub const MARGIN: f32 = 8.0 * (f32::EPSILON / 2.0);

    /// Prepares `ray` for boxes inside `bounds`, which may be a scene's root box or one object's.
    #[inline]
    pub fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let origin = ray.origin();
        let margin = margin(ray, bounds);
        Self {
            lower: (origin + margin).extend(0.0),
            upper: (origin - margin).extend(0.0),
            inverse: ray.inverse_direction().extend(0.0),
            t_min: ray.t_min(),
        }
    }

    /// The distances between which the ray may be inside the box, `t_min` at least; none when the first exceeds the
    /// second.
    #[inline(always)]
    pub fn interval(&self, aabb: &Aabb) -> (f32, f32) {
        let Aabb { min, max } = *aabb;
        // Two overlapping loads and a rotation; the fourth lane is not used.
        let min = Vec4::new(min.x, min.y, min.z, max.x);
        let max = Vec4::new(aabb.min.z, max.x, max.y, max.z).yzwx();
        let low = (min - self.lower) * self.inverse;
        let high = (max - self.upper) * self.inverse;
        let near = low.min(high);
        let far = low.max(high);
        let entry = larger(larger(near.x, near.y), larger(near.z, self.t_min));
        (entry, smaller(smaller(far.x, far.y), far.z) * Self::FAR)
    }

    /// The distances between which the ray may cross the plane across `axis` at `position`, a plane that meets the
    /// bounds: up to the second it may be in front of the plane, from the first on behind it. The interval of any box
    /// in front of the plane ends, and that of any box behind it begins, on that side, bit by bit.
    #[inline(always)]
    pub fn crossing(&self, axis: usize, position: f32) -> (f32, f32) {
        let a = (position - self.lower[axis]) * self.inverse[axis];
        let b = (position - self.upper[axis]) * self.inverse[axis];
        (smaller(a, b), larger(a, b) * Self::FAR)
    }

    /// Where the ray enters the box; infinite when it misses it, which is behind every `t_max`.
    #[inline(always)]
    pub fn entry(&self, aabb: &Aabb) -> f32 {
        let (entry, exit) = self.interval(aabb);
        if entry <= exit { entry } else { f32::INFINITY }
    }
}

/// By how much boxes grow along each axis for a ray that meets boxes inside `bounds`; never too little to change the
/// origin it is added to.
#[inline(always)]
pub(crate) fn margin(ray: &Ray, bounds: &Aabb) -> Vec3 {
    let origin = ray.origin();
    let reach = (bounds.min - origin)
        .abs()
        .max((bounds.max - origin).abs());
    // The second term covers the rounding of the sum with the origin, the third is for an origin and a reach of zero.
    reach.max_element() * Slabs::MARGIN + origin.abs() * f32::EPSILON + f32::MIN_POSITIVE
}

/// The larger of two numbers; unlike `f32::max` one instruction, since neither is NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller of two numbers, as [`larger`].
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Moves the distance of a hit into its object's own box: from wherever rounding put it to where a traversal looks.
/// `None` when `t` is before `ray.t_min()` or NaN, the ray misses the box in its range, or the moved distance is behind
/// `t_max`.
///
/// A traversal skips a box whose entry is behind the nearest hit so far. Whether an object with nearly the same
/// distance is in that box or in another one would otherwise decide which of them is found.
///
/// `bounds` must be the object's box, or one inside it.
#[inline]
pub fn clip_to_box(ray: &Ray, bounds: &Aabb, t: f32, t_max: f32) -> Option<f32> {
    if t.is_nan() || t < ray.t_min() {
        return None;
    }
    let (entry, exit) = Slabs::new(ray, bounds).interval(bounds);
    // A zero is +0, however it came about.
    let moved = larger(smaller(t, exit), entry) + 0.0;
    (entry <= exit && moved <= t_max).then_some(moved)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meets(ray: &Ray, b: &Aabb) -> bool {
        let (entry, exit) = Slabs::new(ray, b).interval(b);
        entry <= exit && entry <= ray.t_max()
    }

    #[test]
    fn rays_in_faces_along_edges_and_through_corners_meet_the_box() {
        let b = Aabb::from(([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]));
        for zero in [0.0, -0.0] {
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let mut direction = Vec3::splat(zero);
                    direction[axis] = sign;
                    for corner in [b.min, b.max, Vec3::new(b.min.x, b.max.y, b.min.z)] {
                        for start in [corner - 10.0 * direction, corner - 0.5 * direction, corner] {
                            let ray = Ray::half_line(start, direction).unwrap();
                            assert!(meets(&ray, &b), "{ray:?}");
                        }
                        let away = Ray::half_line(corner + 7.0 * direction, direction).unwrap();
                        assert!(!meets(&away, &b), "{away:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn boxes_without_extent_are_met_at_every_scale() {
        for k in [-120, -60, 0, 60, 120] {
            let scale = libm::exp2f(k as f32);
            let point = Vec3::new(0.3, -0.7, 1.9) * scale;
            for origin in [Vec3::new(-1.0, 0.4, 0.1) * scale, Vec3::ZERO, point] {
                let towards = (point - origin) / scale;
                let ray =
                    Ray::half_line(origin, if towards == Vec3::ZERO { Vec3::X } else { towards })
                        .unwrap();
                assert!(meets(&ray, &Aabb { min: point, max: point }), "2^{k}: {ray:?}");
            }
        }
    }

    #[test]
    fn what_lies_on_one_side_of_a_plane_is_met_on_that_side() {
        let b = Aabb::from(([0.1, -0.2, 0.3], [0.4, -0.2, 0.9]));
        for direction in
            [Vec3::new(0.3, -0.1, 0.7), Vec3::new(-1e-40, 0.0, 1.0), Vec3::new(-0.0, 1.0, 0.0)]
        {
            for origin in
                [Vec3::ZERO, b.min, b.max, Vec3::new(0.25, -0.2, -9.0), Vec3::splat(-3e38)]
            {
                let ray = Ray::half_line(origin, direction).unwrap();
                let slabs = Slabs::new(&ray, &b);
                let (entry, exit) = slabs.interval(&b);
                for axis in 0..3 {
                    let mut near = b.min[axis];
                    let mut far = b.max[axis];
                    if ray.inverse_direction()[axis] < 0.0 {
                        (near, far) = (far, near);
                    }
                    assert!(slabs.crossing(axis, near).0 <= entry, "{ray:?}");
                    assert!(slabs.crossing(axis, far).1 >= exit, "{ray:?}");
                    assert!(
                        slabs.crossing(axis, near).0
                            <= slabs.crossing(axis, near).1.max(ray.t_min()),
                        "{ray:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn intervals_of_boxes_inside_others_are_inside_theirs() {
        let inner = Aabb::from(([0.1, 0.2, 0.3], [0.4, 0.2, 0.9]));
        let outer = Aabb::from(([0.1, -3.0, 0.3], [0.5, 0.2, 1e6]));
        for direction in
            [Vec3::new(0.3, 0.1, 0.7), Vec3::new(-1e-40, 0.0, 1.0), Vec3::new(-0.0, 1.0, 0.0)]
        {
            for origin in
                [Vec3::ZERO, Vec3::splat(0.2), Vec3::new(0.25, 0.2, -9.0), Vec3::splat(-3e38)]
            {
                let ray = Ray::half_line(origin, direction).unwrap();
                let own = Slabs::new(&ray, &inner).interval(&inner);
                let scene = Slabs::new(&ray, &outer).interval(&inner);
                let around = Slabs::new(&ray, &outer).interval(&outer);
                assert!(own.0 >= scene.0 && own.1 <= scene.1, "{ray:?}");
                assert!(scene.0 >= around.0 && scene.1 <= around.1, "{ray:?}");
            }
        }
    }
}
