//! The conservative ray–box test: it never misses a box that contains a hit.

use crate::aabb::{round_down, round_up};
use crate::each::Each;
use crate::ray::pow2;
use crate::{Aabb, Frame, Ray, frame};
use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};

/// A ray prepared for tests against the boxes of one scene.
///
/// Three properties make the answer of a traversal independent of its tree, and its time
/// independent of the place and the size of the scene:
///
/// 1. *Conservative.* If the ray is in the box at a distance t ≥ 0 in real arithmetic, the interval
///    of the box contains t rounded to f32.
/// 2. *Monotone.* The interval of a box inside another box is inside the other's interval, bit by
///    bit: each operation rounds monotonically.
/// 3. *Tight.* Boxes grow in proportion to their distance from the ray's origin alone: by less than
///    2⁻²⁰ of it, and by less than 2⁻⁴⁷ of it if the ray begins far from the scene. Along an axis
///    that the ray almost does not move along (see *Parallel*), a box may not bound the ray at all.
///    In a [frame](crate::Frame), they grow by 2⁻⁴⁷ of the largest coordinates of the scene and of
///    the origin besides.
///
/// # Proof of the first
///
/// Take one axis, and a direction d > 0 along it; the other sign mirrors every step. The ray is in
/// the box at t:
///
/// ```text
///       origin          lower      origin + t d       upper
///   ──────┼───────────────┼─────────────┼───────────────┼─────>
///         └─ d · entry ───┘             │               │
///         ├─ d · t ─────────────────────┘               │
///         └─ d · exit ──────────────────────────────────┘
/// ```
///
/// With u = 2⁻²⁴, the difference lower − origin is rounded by at most u of itself, subnormal or not,
/// and so are the reciprocal of d and its product n with 1 − 4u. Before it is rounded, the product of
/// the difference and n is at most (1 + u)³ (1 − 4u) < 1 times (lower − origin) / d ≤ t if the
/// difference is positive, and at most t if it is not. Rounding is monotone, so that the entry is at
/// most t rounded. In the same way the exit, with 1 + 4u, is at least t rounded.
///
/// *Parallel.* Where the reciprocal of d would overflow, n is made of the largest number, which is
/// below 1 / d, and the factor of exits is infinite. The origin is moved by one step up for lower
/// faces and by one step down for upper faces. So if the ray begins between the faces, the product
/// of the difference of the face ahead is infinite, and the exit does not bound the ray. If it begins
/// one step beside the face that it enters by, that face gives 0 · ∞, a NaN, which bounds nothing
/// either.
///
/// *Far.* In the unit of a scene, the growth of its boxes increases with the distance from it. So
/// rays from far away, and rays whose differences could overflow, are tested in f64. The quotient of
/// a difference and d is rounded two or three times, by 2⁻⁵³ of itself; the factors are 1 ∓ 2⁻⁴⁹.
///
/// *In a frame.* The module `frame` has the errors of the ray's form in it.
#[derive(Clone, Copy, Debug)]
pub struct Slabs {
    /// The origin, as it is subtracted from lower and from upper corners.
    pub(crate) lower: Vec4,
    pub(crate) upper: Vec4,
    /// The reciprocals of the direction for entries and for exits.
    pub(crate) near: Vec4,
    pub(crate) far: Vec4,
    /// The ray in the frame of the boxes.
    pub(crate) ray: Ray,
    /// The ray in f64, if it begins far from the scene.
    far_ray: Option<FarRay>,
}

/// The factors of entries and of exits, 1 − 4u and 1 + 4u.
pub(crate) const NEAR: f32 = 1.0 - 4.0 * (f32::EPSILON / 2.0);
pub(crate) const FAR: f32 = 1.0 + 4.0 * (f32::EPSILON / 2.0);
/// The factors in f64.
pub(crate) const NEAR_DOUBLE: f64 = 1.0 - 8.0 * f64::EPSILON;
pub(crate) const FAR_DOUBLE: f64 = 1.0 + 8.0 * f64::EPSILON;

impl Slabs {
    /// Prepares `ray` for boxes inside `bounds`, which may be a scene's root box or an object's
    /// box.
    #[inline]
    pub fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let far_ray = ray.is_far_from(bounds).then(|| FarRay::new(ray));
        Self::from_origins(ray, [ray.origin(); 2], far_ray)
    }

    /// Prepares `ray` for boxes that lie in `frame`, and inside `bounds` there.
    #[inline]
    pub fn in_frame(ray: &Ray, frame: Option<&Frame>, bounds: &Aabb) -> Self {
        match frame {
            None => Self::new(ray, bounds),
            Some(frame) => {
                let ends = ray.ends().each(Vec3::as_dvec3);
                Self::of_frame(&frame.ray(ray), ends, frame, bounds)
            }
        }
    }

    /// Prepares a ray of these ends, whose form in the frame is `boxed`.
    #[inline(never)]
    pub(crate) fn of_frame(boxed: &Ray, ends: [DVec3; 2], frame: &Frame, bounds: &Aabb) -> Self {
        let is_far = boxed.is_far_from(bounds);
        let far_ray = is_far.then(|| FarRay::in_frame(ends, frame, bounds));
        let origin = frame.point(ends[0]);
        let slack = DVec3::splat(frame.far_slack(ends[0], bounds));
        let origins = [round_up(origin + slack), round_down(origin - slack)];
        Self::from_origins(boxed, origins, far_ray)
    }

    #[inline(always)]
    fn from_origins(ray: &Ray, [mut lower, mut upper]: [Vec3; 2], far_ray: Option<FarRay>) -> Self {
        let inverse = ray.inverse_direction();
        let far = inverse * FAR;
        let is_parallel = far.abs().cmpeq(Vec3::INFINITY);
        if is_parallel.any() {
            lower = Vec3::select(is_parallel, lower.map(f32::next_up), lower);
            upper = Vec3::select(is_parallel, upper.map(f32::next_down), upper);
        }
        Self {
            lower: lower.extend(0.0),
            upper: upper.extend(0.0),
            near: (inverse * NEAR).extend(0.0),
            far: far.extend(0.0),
            ray: *ray,
            far_ray,
        }
    }

    /// Returns whether boxes are tested in f64.
    #[inline(always)]
    pub(crate) fn is_far(&self) -> bool {
        self.far_ray.is_some()
    }

    /// Returns the distances between which the ray may be inside the box, from `t_min` on. The
    /// interval is empty if the first exceeds the second.
    #[inline(always)]
    pub fn interval(&self, aabb: &Aabb) -> (f32, f32) {
        if let Some(far_ray) = &self.far_ray {
            return far_ray.rounded_interval(aabb, self.ray.t_min());
        }
        let Aabb { min, max } = *aabb;
        // Two overlapping loads of four lanes and a rotation. The fourth lane is not used.
        let min = Vec4::new(min.x, min.y, min.z, max.x);
        let max = Vec4::new(aabb.min.z, max.x, max.y, max.z).yzwx();
        let low = min - self.lower;
        let high = max - self.upper;
        let near = (low * self.near).min(high * self.near);
        let far = (low * self.far).max(high * self.far);
        let entry = larger(larger(near.x, near.y), larger(near.z, self.ray.t_min()));
        // A NaN bounds nothing: `smaller` returns its other operand.
        (entry, smaller(far.x, smaller(far.y, smaller(far.z, f32::INFINITY))))
    }

    /// Returns the distances between which the ray may cross the plane across `axis` at `position`,
    /// a plane that meets the bounds. The ray may be in front of the plane up to the second
    /// distance, and behind it from the first on. The interval of a box in front of the plane ends
    /// by the second distance, and the interval of a box behind it begins at the first or later,
    /// bit by bit.
    #[inline(always)]
    pub fn crossing(&self, axis: usize, position: f32) -> (f32, f32) {
        if let Some(far_ray) = &self.far_ray {
            return far_ray.crossing(axis, position);
        }
        let is_backwards = self.near[axis] < 0.0;
        // Of a box behind the plane, the plane is the first face; of a box in front, the last.
        let (first, last) =
            if is_backwards { (self.upper, self.lower) } else { (self.lower, self.upper) };
        let last = (position - last[axis]) * self.far[axis];
        // 0 · ∞ where the ray runs along the plane.
        let last = if last.is_nan() { f32::INFINITY } else { last };
        ((position - first[axis]) * self.near[axis], last)
    }

    /// Returns the distance at which the ray enters the box; infinity for a miss, which is beyond
    /// every `t_max`.
    #[inline(always)]
    pub fn entry(&self, aabb: &Aabb) -> f32 {
        let (entry, exit) = self.interval(aabb);
        if entry <= exit { entry } else { f32::INFINITY }
    }
}

impl Ray {
    /// Returns whether f32 is too coarse to tell boxes inside `bounds` apart from the ray's origin.
    #[inline]
    pub(crate) fn is_far_from(&self, bounds: &Aabb) -> bool {
        !self.begins_in(&near_region(bounds))
    }

    #[inline(always)]
    pub(crate) fn begins_in(&self, region: &Aabb) -> bool {
        // Two overlapping loads of four lanes, of which one does not count.
        let Aabb { min, max } = *region;
        let [origin, ..] = self.vectors();
        let is_above = Vec4::new(min.x, min.y, min.z, max.x).cmple(origin);
        let is_below = origin.cmple(Vec4::new(min.z, max.x, max.y, max.z).yzwx());
        (is_above & is_below).bitmask() & 0b111 == 0b111
    }

    /// Returns the largest coordinate of a point of `bounds` relative to the origin, rounded.
    #[inline(always)]
    pub(crate) fn reach(&self, bounds: &Aabb) -> f32 {
        let origin = self.origin();
        (bounds.max - origin).max(origin - bounds.min).max_element()
    }
}

/// Returns the region from which f32 tells boxes inside `bounds` apart: up to 256 times as far from
/// them as they extend, and where no coordinate relative to another overflows.
#[inline]
pub(crate) fn near_region(bounds: &Aabb) -> Aabb {
    const HUGE: f32 = pow2(126);
    if frame::size(bounds) >= HUGE {
        return Aabb::EMPTY;
    }
    let distance = 256.0 * (bounds.max - bounds.min).max_element();
    Aabb {
        min: (bounds.min - distance).max(Vec3::splat(-HUGE)),
        max: (bounds.max + distance).min(Vec3::splat(HUGE)),
    }
}

/// A ray in f64, for boxes that f32 cannot tell apart from its origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FarRay {
    /// The origin, as it is subtracted from lower and from upper corners. They differ in a frame.
    pub(crate) lower: DVec3,
    pub(crate) upper: DVec3,
    pub(crate) direction: DVec3,
}

impl FarRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let origin = ray.origin().as_dvec3();
        Self { lower: origin, upper: origin, direction: ray.direction().as_dvec3() }
    }

    /// Returns the ray for boxes that lie in a frame, and inside `bounds` there.
    pub(crate) fn in_frame([origin, direction]: [DVec3; 2], frame: &Frame, bounds: &Aabb) -> Self {
        let slack = DVec3::splat(frame.far_slack(origin, bounds));
        let origin = frame.point(origin);
        let direction = frame.direction(direction);
        Self { lower: origin + slack, upper: origin - slack, direction }
    }

    /// Returns the distances at which the line of the ray enters and leaves a box, each rounded by
    /// at most 2⁻⁵¹ of itself. The first exceeds the second, up to that rounding, if the line misses
    /// the box.
    #[inline]
    fn interval(&self, aabb: &Aabb) -> (f64, f64) {
        let mut entry = f64::NEG_INFINITY;
        let mut exit = f64::INFINITY;
        for axis in 0..3 {
            let direction = self.direction[axis];
            let low = f64::from(aabb.min[axis]) - self.lower[axis];
            let high = f64::from(aabb.max[axis]) - self.upper[axis];
            if direction == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return (f64::INFINITY, f64::NEG_INFINITY);
                }
                continue;
            }
            let (near, far) = if direction < 0.0 { (high, low) } else { (low, high) };
            entry = entry.max(near / direction);
            exit = exit.min(far / direction);
        }
        (entry, exit)
    }

    #[cold]
    #[inline(never)]
    fn rounded_interval(&self, aabb: &Aabb, t_min: f32) -> (f32, f32) {
        let (entry, exit) = self.interval(aabb);
        let entry = entry * NEAR_DOUBLE;
        let exit = exit * FAR_DOUBLE;
        if entry > exit {
            return (f32::INFINITY, f32::NEG_INFINITY);
        }
        (larger(entry as f32, t_min), exit as f32)
    }

    #[cold]
    #[inline(never)]
    fn crossing(&self, axis: usize, position: f32) -> (f32, f32) {
        let direction = self.direction[axis];
        let [lower, upper] = [self.lower, self.upper]
            .each(|origin| (f64::from(position) - origin[axis]) / direction);
        // 0 / 0 where the ray runs in the plane.
        if lower.is_nan() || upper.is_nan() {
            return (f32::NEG_INFINITY, f32::INFINITY);
        }
        // Of a box behind the plane, the plane is the first face; of a box in front, the last.
        let is_backwards = direction.is_sign_negative();
        let (first, last) = if is_backwards { (upper, lower) } else { (lower, upper) };
        let first = (first * NEAR_DOUBLE).min(first * FAR_DOUBLE);
        let last = (last * NEAR_DOUBLE).max(last * FAR_DOUBLE);
        (first as f32, last as f32)
    }
}

/// Returns the larger of two numbers that are not NaN. Unlike `f32::max`, it is one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns the smaller of two numbers, the second if one is NaN.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Moves the distance of a hit into the interval of its object's box, which rounding may have left,
/// so that every traversal finds the hit. Returns `None` if `t` is below `ray.t_min()` or NaN, if
/// the ray misses the box in its range, or if the moved distance exceeds `t_max`.
///
/// A traversal skips a box whose entry is behind the nearest hit so far. Without the move, the tree
/// would decide which of two objects at nearly the same distance is found. The moved distance is at
/// least the distance, in real arithmetic and then rounded, at which the ray enters the box, and no
/// traversal enters a box around it later.
///
/// `bounds` must be the object's box, or a box inside it.
#[inline]
pub fn clip_to_box(ray: &Ray, bounds: &Aabb, t: f32, t_max: f32) -> Option<f32> {
    if t.is_nan() || t < ray.t_min() {
        return None;
    }
    let (entry, exit) = FarRay::new(ray).interval(bounds);
    let first = larger((entry * FAR_DOUBLE) as f32, ray.t_min());
    let last = (exit * NEAR_DOUBLE) as f32;
    // Adding 0 turns −0 into +0.
    let moved = larger(smaller(t, last), first) + 0.0;
    // A box so little behind the ray that the distance rounds to zero is missed, as by traversals.
    let is_met = entry <= exit && exit >= 0.0 && ray.t_min() <= exit as f32;
    (is_met && moved <= t_max).then_some(moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn meets(ray: &Ray, b: &Aabb) -> bool {
        let (entry, exit) = Slabs::new(ray, b).interval(b);
        entry <= exit && entry <= ray.t_max()
    }

    #[test]
    fn a_box_behind_the_ray_is_missed_although_its_distance_rounds_to_zero() {
        // Far away, where slabs are exact, too.
        for end in [1.0, 1e38] {
            let b = Aabb::from(([0.0, -1.0, -1.0], [0.0, 1.0, end]));
            let ray = Ray::half_line([f32::from_bits(1), 0.0, 0.0], [200.0, 0.0, 0.0]).unwrap();
            assert_eq!(clip_to_box(&ray, &b, 0.0, 1.0), None);
        }
    }

    #[test]
    fn rays_from_one_step_beside_a_face_and_almost_along_it_meet_the_box() {
        let long = libm::exp2f(110.0);
        let cases = [
            (libm::exp2f(-149.0), 0.0, libm::exp2f(-130.0)),
            (1.0, 1.0f32.next_down(), libm::exp2f(-129.0)),
        ];
        for (from, face, slope) in cases {
            for sign in [1.0, -1.0] {
                let corners = [[0.0, 0.0, face - 1.0], [long, 1.0, face]];
                let [origin, direction] = [[0.25, 0.5, from], [1.0, 0.0, -slope]];
                for turns in 0..3 {
                    let turned = |[x, y, z]: [f32; 3]| {
                        let mut turned = [x, y, z * sign];
                        turned.rotate_left(turns);
                        Vec3::from(turned)
                    };
                    let b = Aabb::around(corners.map(turned));
                    let ray = Ray::half_line(turned(origin), turned(direction)).unwrap();
                    assert!(meets(&ray, &b), "{ray:?}");
                }
            }
        }
    }

    #[test]
    fn boxes_without_extent_are_met_at_every_scale() {
        for k in [-120, -60, 0, 60, 120] {
            let scale = libm::exp2f(k as f32);
            let point = Vec3::new(0.5, -0.75, 1.875) * scale;
            for towards in [Vec3::X, Vec3::new(0.25, -1.0, 0.5), Vec3::new(-0.0, 0.125, 0.0)] {
                // The ray meets the point in real arithmetic, too.
                for steps in [0.0, 1.0, 8.0] {
                    let ray = Ray::half_line(point - steps * scale * towards, towards).unwrap();
                    assert!(meets(&ray, &Aabb { min: point, max: point }), "2^{k}: {ray:?}");
                }
            }
        }
    }

    /// Returns an upper bound of the entry and a lower bound of the exit in real arithmetic, which
    /// differ by 2⁻⁴⁸ of themselves from these distances.
    fn real_interval(ray: &Ray, aabb: &Aabb) -> (f64, f64) {
        let (entry, exit) = FarRay::new(ray).interval(aabb);
        (entry + entry.abs() * 1e-15, exit - exit.abs() * 1e-15)
    }

    proptest! {
        #[test]
        fn intervals_are_monotone_contain_the_real_ones_and_grow_with_the_distance_alone(
            words in prop::collection::vec(prop::array::uniform12(any::<u32>()), 200),
            exponents in prop::array::uniform4(-149i32..127),
            largest in 0i32..60,
        ) {
            // Coordinates of three sizes, and scenes of another, more or less far away.
            let number = |word: u32, exponent: i32| {
                let size = libm::ldexp(f64::from(word >> 8) / 16_777_216.0 + 0.5, exponent);
                (if word & 1 == 0 { size } else { -size }) as f32
            };
            for word in words {
                let vector = |first: usize, exponent: i32| {
                    Vec3::from([0, 1, 2].map(|i| {
                        let word = word[first + i];
                        if word & 0b1110 == 0 { 0.0 } else { number(word, exponent) }
                    }))
                };
                let corner = vector(0, exponents[0].min(120));
                let bounds = Aabb::around([corner, corner + vector(3, exponents[1].min(120))]);
                let mut origin = vector(6, exponents[2].min(120));
                // Often next to an edge or in a face.
                for axis in (0..3).filter(|axis| word[6 + axis] >> 4 & 0b11 == 0) {
                    origin[axis] = bounds.min[axis];
                }
                let direction = vector(9, exponents[3].clamp(-98, 98));
                let Ok(ray) = Ray::half_line(origin, direction) else { continue };
                let scene = Aabb {
                    min: bounds.min,
                    max: bounds.max + libm::ldexpf(1.0, exponents[1].min(60) + largest),
                };
                if scene.check().is_err() {
                    continue;
                }
                let slabs = Slabs::new(&ray, &scene);
                let (entry, exit) = slabs.interval(&bounds);
                // The interval of a box inside another one is inside its interval.
                let around = slabs.interval(&scene);
                prop_assert!(around.0 <= entry && exit <= around.1, "{ray:?} {bounds:?} {scene:?}");
                // So is that of a box in front of the ray by the slabs of the box itself.
                let alone = Slabs::new(&ray, &bounds).interval(&bounds);
                let is_inside = entry <= alone.0 && alone.1 <= exit;
                prop_assert!(is_inside || alone.1 <= 0.0, "{ray:?} {bounds:?} {scene:?}");
                // A box on one side of a plane is met on that side.
                for axis in 0..3 {
                    let is_backwards = ray.inverse_direction()[axis] < 0.0;
                    let [first, last] = [is_backwards, !is_backwards]
                        .map(|is_upper| if is_upper { bounds.max } else { bounds.min }[axis]);
                    let (from, until) = slabs.crossing(axis, first);
                    prop_assert!(from <= entry && from <= until.max(ray.t_min()), "{ray:?}");
                    prop_assert!(slabs.crossing(axis, last).1 >= exit, "{ray:?} {bounds:?}");
                }
                let (real_entry, real_exit) = real_interval(&ray, &bounds);
                if real_entry <= real_exit && real_exit >= 0.0 {
                    prop_assert!(entry <= (real_entry.max(0.0) as f32), "{ray:?} {bounds:?}");
                    prop_assert!(exit >= real_exit as f32, "{ray:?} {bounds:?}");
                }
                // A box that is farther off than the growth is missed.
                let size = real_entry.abs().max(real_exit.abs());
                let gap = real_entry.max(0.0) - real_exit;
                if gap > size * 1e-6 + 1e-44 && size < 1e38 {
                    prop_assert!(entry > exit, "{ray:?} {bounds:?}: {entry} {exit}");
                }
            }
        }
    }
}
