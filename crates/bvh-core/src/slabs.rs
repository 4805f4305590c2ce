//! The conservative ray–box test: it never misses a box that contains a hit.

use crate::{Aabb, Ray};
use glam::{Vec3, Vec4, Vec4Swizzles};

/// A ray prepared for tests against the boxes of one scene.
///
/// Three properties make the answer of a traversal independent of its tree:
///
/// 1. *Conservative.* If the ray is in the box at a distance t ≥ 0 in real arithmetic, the interval
///    of the box contains t rounded to f32. The box grows by R · [`Slabs::MARGIN`] = 8uR, where u =
///    2⁻²⁴ and R is the largest coordinate of the scene relative to the origin; at least 7.9uR
///    remain after the sum with the origin is rounded. The difference from a plane and the
///    reciprocal of the direction are off by at most u of themselves, and no difference exceeds R.
///    So the product before its own rounding is at most t for an entry and at least t for an exit,
///    and rounding is monotone. A reciprocal that would overflow is `f32::MAX`, which moves an
///    entry nearer. An exit is then at least 7.9uR · `f32::MAX`, and t ≤ R / D, where D ≥ 2⁻¹⁰⁰ is
///    the direction's largest component.
/// 2. *Monotone.* The interval of a box inside another box is inside the other's interval, bit by
///    bit: each operation rounds monotonically.
/// 3. *Defined.* Reciprocals are finite and the margin is never zero, so no 0 · ∞ occurs, and a ray
///    in a face plane is strictly inside the enlarged box.
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
    /// The factor of an exit. With u = 2^-24, an entry is too far by at most (1 + u)^3, and an exit
    /// too near by at most (1 − u)^4.
    pub const FAR: f32 = 1.0 + 8.0 * (f32::EPSILON / 2.0);

    /// The growth of boxes, in multiples of the largest coordinate of the scene relative to the
    /// ray's origin.
    pub const MARGIN: f32 = 8.0 * (f32::EPSILON / 2.0);

    /// Prepares `ray` for boxes inside `bounds`, which may be a scene's root box or an object's
    /// box.
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

    /// Returns the distances between which the ray may be inside the box, from `t_min` on. The
    /// interval is empty if the first exceeds the second.
    #[inline(always)]
    pub fn interval(&self, aabb: &Aabb) -> (f32, f32) {
        let Aabb { min, max } = *aabb;
        // Two overlapping loads of four lanes and a rotation. The fourth lane is not used.
        let min = Vec4::new(min.x, min.y, min.z, max.x);
        let max = Vec4::new(aabb.min.z, max.x, max.y, max.z).yzwx();
        let low = (min - self.lower) * self.inverse;
        let high = (max - self.upper) * self.inverse;
        let near = low.min(high);
        let far = low.max(high);
        let entry = larger(larger(near.x, near.y), larger(near.z, self.t_min));
        (entry, smaller(smaller(far.x, far.y), far.z) * Self::FAR)
    }

    /// Returns the distances between which the ray may cross the plane across `axis` at `position`,
    /// a plane that meets the bounds. The ray may be in front of the plane up to the second
    /// distance, and behind it from the first on. The interval of a box in front of the plane ends
    /// by the second distance, and the interval of a box behind it begins at the first or later,
    /// bit by bit.
    #[inline(always)]
    pub fn crossing(&self, axis: usize, position: f32) -> (f32, f32) {
        let a = (position - self.lower[axis]) * self.inverse[axis];
        let b = (position - self.upper[axis]) * self.inverse[axis];
        (smaller(a, b), larger(a, b) * Self::FAR)
    }

    /// Returns the distance at which the ray enters the box; infinity for a miss, which is beyond
    /// every `t_max`.
    #[inline(always)]
    pub fn entry(&self, aabb: &Aabb) -> f32 {
        let (entry, exit) = self.interval(aabb);
        if entry <= exit { entry } else { f32::INFINITY }
    }
}

/// Returns the growth of boxes along each axis for a ray that meets boxes inside `bounds`. It is
/// always large enough to change the origin when added to it.
#[inline(always)]
pub(crate) fn margin(ray: &Ray, bounds: &Aabb) -> Vec3 {
    let origin = ray.origin();
    let reach = (bounds.min - origin).abs().max((bounds.max - origin).abs());
    // The second term covers the rounding of the sum with the origin. The third keeps the margin
    // above zero if the origin and the reach are zero.
    reach.max_element() * Slabs::MARGIN + origin.abs() * f32::EPSILON + f32::MIN_POSITIVE
}

/// Returns the larger of two numbers that are not NaN. Unlike `f32::max`, it is one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns the smaller of two numbers that are not NaN.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Moves the distance of a hit into the interval of its object's box, which rounding may have left,
/// so that every traversal finds the hit. Returns `None` if `t` is below `ray.t_min()` or NaN, if
/// the ray misses the box in its range, or if the moved distance exceeds `t_max`.
///
/// A traversal skips a box whose entry is behind the nearest hit so far. Without the move, the tree
/// would decide which of two objects at nearly the same distance is found.
///
/// `bounds` must be the object's box, or a box inside it.
#[inline]
pub fn clip_to_box(ray: &Ray, bounds: &Aabb, t: f32, t_max: f32) -> Option<f32> {
    if t.is_nan() || t < ray.t_min() {
        return None;
    }
    let (entry, exit) = Slabs::new(ray, bounds).interval(bounds);
    // Adding 0 turns −0 into +0.
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
    fn boxes_on_one_side_of_a_plane_are_met_on_that_side() {
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
                let alone = Slabs::new(&ray, &inner).interval(&inner);
                let scene = Slabs::new(&ray, &outer).interval(&inner);
                let around = Slabs::new(&ray, &outer).interval(&outer);
                assert!(alone.0 >= scene.0 && alone.1 <= scene.1, "{ray:?}");
                assert!(scene.0 >= around.0 && scene.1 <= around.1, "{ray:?}");
            }
        }
    }
}
