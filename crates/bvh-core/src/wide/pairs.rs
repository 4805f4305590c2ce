//! The exact test of a triangle, for pairs of a ray and a triangle side by side: one ray and
//! several triangles, several rays and one triangle, or anything between.
//!
//! The answers are those of [`exact`](crate::exact): the triangles that the line crosses in real
//! arithmetic, and the distances, rounded once. Three layers decide; each leaves to the next what
//! its error bound leaves open.
//!
//! ```text
//!   f32          sheared corners, error bound   most triangles       ──> miss
//!    │ perhaps
//!   f64          likewise                       nearly all others    ──> miss, or rounded distance
//!    │ perhaps
//!   expansions   exact                          what remains         ──> miss, or rounded distance
//! ```
//!
//! # The bounds
//!
//! Let R be at least the coordinates of corners relative to the origin, z the axis of the
//! direction's largest component, m the largest computed |x|, |y| of the sheared corners. The names
//! are those of [`exact`](crate::exact).
//!
//! *f32*, u = 2⁻²⁴. A difference from the origin is off by uR, its product with the slope by 3uR,
//! and the sheared coordinate by less than 4.1uR + um < 6.3uR. The edge value is off by less than 4
//! · 6.3uRm + 2 (6.3uR)² from its operands, and by 4um² < 8.5uRm from its own roundings: in total
//! less than E = e (m + e) with e = 64uR. Underflow adds less than 2⁻¹²⁶, the last term of the
//! bound in the code. The sum m + e is the *spread*: no real |x|, |y| exceeds it.
//!
//! *f64*, ε = 2⁻⁵³. Corners are sheared by multiplication with d_z, so S = spread · |d_z| is at
//! least the largest |x|, |y|, and the edge values are within E = e (S + e) with e = 64εR|d_z|, as
//! in [`exact`](crate::exact). The distance is computed from depths relative to the first corner,
//! where errors of `u`, `v`, `w` count little:
//!
//! ```text
//!   t = (A_z D + v (B_z − A_z) + w (C_z − A_z)) / (D d_z),      D = u + v + w
//! ```
//!
//! The weights `v / D` and `w / D` are off by 4E / D each. With Z the larger |B_z − A_z|, |C_z −
//! A_z| this moves `t d_z` by 8EZ / D; all other roundings are below 50εR. The bound (16EZ / |D| +
//! 64εR) / |d_z| covers both, and if D < 6E, where weights are off by more, it exceeds Z. If both
//! ends of this interval round to one f32, that f32 is the rounded distance, because rounding is
//! monotone. This layer leaves more open next to the origin than the filter in
//! [`exact`](crate::exact), which is asked next.

use super::lanes::{DoubleLanes, Lanes, Mask};
use crate::exact::ERROR;
use crate::{PreparedRay, Ray, Triangle};

/// e of f32, in multiples of R.
pub(crate) const SINGLE_ERROR: f32 = 64.0 * (f32::EPSILON / 2.0);

/// The rays of the pairs. Vectors, of corners too, are in the shear's order of axes: the
/// direction's largest component is the last.
#[derive(Clone, Copy)]
pub(crate) struct Pairs<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    /// The movement along the first two axes per step along the third.
    pub(crate) slope: [L; 2],
    /// At least the coordinates of corners relative to the origin.
    pub(crate) reach: L,
    /// e, the bound of the error of a coordinate sheared in f32.
    pub(crate) error: L,
    pub(crate) t_min: L,
}

impl<L: Lanes> Pairs<L> {
    /// Returns a bit per pair whose triangle the ray's line may meet, decided in f32, and the
    /// spread of each pair for [`decide`](Self::decide).
    #[inline(always)]
    pub(crate) fn candidates(&self, corners: &[[L; 3]; 3]) -> (u32, L) {
        // SAFETY: values exist.
        let (zero, underflow) = unsafe { (L::splat(0.0), L::splat(f32::MIN_POSITIVE)) };
        let [a, b, c] = self.roughly_sheared(corners);
        let [ax, ay] = a;
        let [bx, by] = b;
        let [cx, cy] = c;
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        let spread = self.spread(&[a, b, c]);
        let error = self.error.mul_add(spread, underflow);
        (!(least.lt(zero - error) & error.lt(most)).bits(), spread)
    }

    #[inline(always)]
    fn spread(&self, [a, b, c]: &[[L; 2]; 3]) -> L {
        let a = a[0].abs().max(a[1].abs());
        let b = b[0].abs().max(b[1].abs());
        let c = c[0].abs().max(c[1].abs());
        a.max(b).max(c) + self.error
    }

    /// Returns the pairs whose triangle the ray hits at most at `t_max`, and the distances. No
    /// triangle is degenerate. `doubled` are the same corners in f64.
    #[inline(always)]
    pub(crate) fn decide(
        &self,
        corners: &[[L; 3]; 3],
        doubled: &[[L::Double; 3]; 3],
        spread: L,
        t_max: L,
    ) -> (L::Mask, L) {
        // SAFETY: values exist.
        let [zero, one, sixteen, part] = unsafe { constants([0.0, 1.0, 16.0, ERROR]) };
        let dz = self.direction[2].double();
        let depth_error = self.reach.double() * part;
        let coordinate_error = depth_error * size(dz);
        let error = coordinate_error * (spread.double() * size(dz) + coordinate_error);
        let [ax, ay, az] = self.sheared(&doubled[0]);
        let [bx, by, bz] = self.sheared(&doubled[1]);
        let [cx, cy, cz] = self.sheared(&doubled[2]);
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        let below = zero - error;
        let is_outside = least.lt(below) & error.lt(most);
        let is_inside = error.lt(least) | most.lt(below);
        let determinant = u + v + w;
        let b_depth = bz - az;
        let c_depth = cz - az;
        let inverse = one / (determinant * dz);
        let t = (az * determinant + (v * b_depth + w * c_depth)) * inverse;
        let difference = size(b_depth).max(size(c_depth));
        let slack =
            (sixteen * error * difference + depth_error * size(determinant)) * size(inverse);
        let low = t - slack;
        let high = t + slack;
        let rounded = L::single(high);
        let is_hit = L::narrow(is_inside & zero.le(low)) & L::single(low).eq(rounded);
        let is_miss = L::narrow(is_outside | is_inside & high.lt(zero));
        let decided = (is_hit | is_miss).bits();
        if decided != u32::MAX >> (32 - L::N) {
            return self.decide_exactly(corners, t_max, !decided, is_hit, rounded);
        }
        (is_hit & self.t_min.le(rounded) & rounded.le(t_max), rounded)
    }

    /// Returns the same as [`decide`](Self::decide) for pairs whose candidates were found
    /// elsewhere.
    #[inline(always)]
    pub(crate) fn decide_alone(&self, corners: &[[L; 3]; 3], t_max: L) -> (L::Mask, L) {
        let spread = self.spread(&self.roughly_sheared(corners));
        self.decide(corners, &doubled(corners), spread, t_max)
    }

    /// Returns the corners of each triangle relative to the ray, sheared in f32.
    #[inline(always)]
    fn roughly_sheared(&self, [a, b, c]: &[[L; 3]; 3]) -> [[L; 2]; 3] {
        [self.corner(a), self.corner(b), self.corner(c)]
    }

    #[inline(always)]
    fn corner(&self, corner: &[L; 3]) -> [L; 2] {
        let z = self.origin[2] - corner[2];
        [
            z.mul_add(self.slope[0], corner[0] - self.origin[0]),
            z.mul_add(self.slope[1], corner[1] - self.origin[1]),
        ]
    }

    /// Returns a corner of each triangle relative to the ray, sheared in f64, and its depth.
    #[inline(always)]
    fn sheared(&self, corner: &[L::Double; 3]) -> [L::Double; 3] {
        let depth = self.direction[2].double();
        let z = corner[2] - self.origin[2].double();
        let x = corner[0] - self.origin[0].double();
        let y = corner[1] - self.origin[1].double();
        [
            x.mul_sub(depth, self.direction[0].double() * z),
            y.mul_sub(depth, self.direction[1].double() * z),
            z,
        ]
    }

    /// Decides the pairs that are unsure one by one.
    #[cold]
    #[inline(never)]
    fn decide_exactly(
        &self,
        corners: &[[L; 3]; 3],
        t_max: L,
        unsure: u32,
        is_hit: L::Mask,
        t: L,
    ) -> (L::Mask, L) {
        let stored = |lanes: L| {
            let mut numbers = [0.0; 16];
            // SAFETY: there is room for sixteen lanes.
            unsafe { lanes.store(numbers.as_mut_ptr()) };
            numbers
        };
        let origin = self.origin.map(stored);
        let direction = self.direction.map(stored);
        let corners = corners.map(|corner| corner.map(stored));
        let mut distances = stored(t);
        let mut hits = is_hit.bits();
        for lane in (0..L::N).filter(|lane| unsure >> lane & 1 != 0) {
            // The distance does not depend on the names of the axes.
            let of = |numbers: &[[f32; 16]; 3]| numbers.map(|numbers| numbers[lane]);
            let ray = Ray::assume_valid(of(&origin), of(&direction), 0.0, f32::MAX);
            let triangle = Triangle::from(corners.each_ref().map(of));
            // The bounds for one ray and one triangle are narrower.
            if let Some(t) = triangle.intersect(&PreparedRay::new(&ray), f32::MAX) {
                hits |= 1 << lane;
                distances[lane] = t;
            }
        }
        // SAFETY: values exist.
        let (hits, t) =
            unsafe { (L::Mask::from_bits(hits), L::load_unaligned(distances.as_ptr())) };
        (hits & self.t_min.le(t) & t.le(t_max), t)
    }
}

/// Returns each number in all lanes.
///
/// # Safety
/// The processor has the instructions.
#[inline(always)]
unsafe fn constants<D: DoubleLanes>([a, b, c, d]: [f64; 4]) -> [D; 4] {
    // SAFETY: the caller's promise.
    unsafe { [D::splat(a), D::splat(b), D::splat(c), D::splat(d)] }
}

/// Returns the absolute value.
#[inline(always)]
fn size<D: DoubleLanes>(x: D) -> D {
    // SAFETY: a value exists.
    let zero = unsafe { D::splat(0.0) };
    x.max(zero - x)
}

/// Returns the corners in f64.
#[inline(always)]
pub(crate) fn doubled<L: Lanes>([a, b, c]: &[[L; 3]; 3]) -> [[L::Double; 3]; 3] {
    [
        [a[0].double(), a[1].double(), a[2].double()],
        [b[0].double(), b[1].double(), b[2].double()],
        [c[0].double(), c[1].double(), c[2].double()],
    ]
}
