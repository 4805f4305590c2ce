//! The exact test of a triangle, for pairs of a ray and a triangle side by side: one ray and
//! several triangles, several rays and one triangle, or anything between.
//!
//! The answers are those of [`exact`](crate::exact): the triangles that the line crosses in real
//! arithmetic, and the distances, rounded once. Each layer leaves to the next what its error bound
//! leaves open.
//!
//! ```text
//!   does the line cross the triangle?        at which distance?
//!
//!   f32          nearly all triangles        f32          is it in the range?
//!    │ perhaps                                │ perhaps, or which one is it?
//!    │                                       f64          nearly all that are crossed
//!    │                                        │ perhaps
//!   f64          nearly all others            │
//!    │ perhaps                                │
//!    └───────────> expansions, exact <────────┘
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
//! less than E = e (m + e) with e = 36uR. Underflow adds less than 2⁻¹²⁶, the last term of the
//! bound in the code, to an edge value, and less to a coordinate, whose e has it too. The sum m + e
//! is the *spread*: no real |x|, |y| exceeds it. If all edge values are above E, or all below −E,
//! the line crosses the triangle. From R = 2⁶² on products may overflow, and the bound is infinite.
//!
//! *Range in f32*. Where all edge values u, v, w are certain, they and their sum a have the signs of
//! the real ones. With depths z of the corners relative to the origin and T a bound of the range,
//!
//! ```text
//!   (T − t) d_z = T d_z − z_A − X,      X = (v (z_B − z_A) + w (z_C − z_A)) / a
//! ```
//!
//! and its product with the computed a is what `within` computes. Let Δ be the larger of the two
//! differences of depths, which |X| does not exceed. An edge value is off by E, a by 3E + 3u|a|, a
//! difference by 4uR: the computed X is off by at most 5EΔ / |a| + 22uR. The computed Δ may lack
//! 4uR, and so 20EuR of 5EΔ, which is below 7uR|a|, because |a| is at least 3E. Where |T d_z| is at
//! most 4R, roundings of the other terms are below 23uR together; where it is more, they are less
//! than T d_z, whose sign is then right, because |t d_z| is at most R. A hit counts by its rounded
//! distance, which is off by at most u|t|, and uR / |d_z| covers that, or by 2⁻¹⁵⁰, where it is
//! subnormal. Hence a product beyond 8EΔ + (64uR + 2⁻¹²⁶|d_z|) |a| has the sign of the difference of T
//! and the rounded distance, or that difference is 0 within the range. Below R = 2⁴⁰ nothing
//! overflows but T d_z, which then has the right sign, and its products; other rays get an infinite
//! bound. Without the term T d_z the sum is −ta d_z, off by no more: divided by |a d_z| with five
//! roundings, where |a| is at least 3E and nothing underflows, it bounds t from both sides. The lower
//! bound is not negative: `within` has the same sum with T d_z ≥ 0 beyond the slack.
//!
//! *f64*, ε = 2⁻⁵³. Corners are sheared by multiplication with d_z, so S = spread · |d_z| is at
//! least the largest |x|, |y|, and the edge values are within E = e (S + e) with e = 64εR|d_z|, as
//! in [`exact`](crate::exact).
//!
//! *Distance*. With the normal N = (B − A) × (C − A), computed in f64,
//!
//! ```text
//!   t = h / s,      h = N · (A − O),      s = N · d
//! ```
//!
//! Let M be twice the product of the largest |B − A| and the largest |C − A| along an axis: no
//! component of N exceeds it, and the computed ones are off by 4εM. Let P be the largest |A − O|
//! along an axis plus both of these sides. Then h is off by Δh = 3 (4 + 1 + 3) εMP, and s by Δs = 3
//! (4 + 3) εM|d_z|. Where the line crosses the triangle, |t d_z| is at most P. With the computed h′
//! and s′,
//!
//! ```text
//!   h′ / s′ − t = (h′ − h − t (s′ − s)) / s′
//! ```
//!
//! is at most (24 + 21) εMP / |s′|, and the division adds 2.2ε|h′ / s′|, which is at most 7εMP /
//! |s′|, because |h| is at most 3MP. The bound 64εMP / |s′| covers the sum. If both ends of this
//! interval round to one f32, that f32 is the rounded distance, because rounding is monotone.

use super::lanes::{Aligned, DoubleLanes, Lanes, Mask};
use crate::each::Each;
use crate::exact::ERROR;
use crate::ray::pow2;
use crate::{PreparedRay, Ray, Triangle};

/// e of f32, in multiples of R.
const SINGLE_ERROR: f32 = 36.0 * (f32::EPSILON / 2.0);

/// The error of a distance times the depth, without the tilt's, in multiples of R.
const RANGE_ERROR: f32 = 64.0 * (f32::EPSILON / 2.0);

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
    /// e, the bound of the error of a coordinate sheared in f32; what underflow adds to the error
    /// of an edge value, infinite where products may overflow; and the bound of the error of a
    /// distance times the depth in f32, without the tilt's.
    pub(super) errors: [L; 3],
    pub(crate) t_min: L,
}

/// The answers of the layer in f32.
#[derive(Clone, Copy)]
pub(crate) struct Crossings {
    /// A bit per pair whose triangle the ray's line may cross.
    pub(crate) possible: u32,
    /// A bit per pair whose triangle the ray's line certainly crosses.
    pub(crate) certain: u32,
}

impl Crossings {
    /// Decides by edge values and the bound of their errors.
    #[inline(always)]
    pub(super) fn new<L: Lanes>([u, v, w]: [L; 3], error: L) -> Self {
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        let below = error.filled(0.0) - error;
        let all = u32::MAX >> (32 - L::N);
        let possible = all & !(least.lt(below) & error.lt(most)).bits();
        let certain = (error.lt(least) | most.lt(below)).bits();
        Self { possible, certain }
    }
}

/// The same, with what the layer's next question needs.
pub(crate) struct Candidates<L> {
    pub(crate) crossings: Crossings,
    /// The edge values, and their error bound.
    edges: [L; 3],
    error: L,
    /// The negated depths of the corners.
    depths: [L; 3],
}

/// What decides about the ranges of rays: aT d_z − az_A − aX, where az_A is left out.
struct Tilt<L> {
    /// a, as in the bounds above.
    area: L,
    /// −aX.
    tilt: L,
    /// The sign of a d_z.
    flip: L,
    /// The error of the sum.
    slack: L,
}

/// The planes of triangles, a triangle per lane. Vectors are in the shear's order of axes.
pub(crate) struct Plane<L: Lanes> {
    /// The first corners.
    corner: [L::Double; 3],
    /// The normals, of any length.
    pub(super) normal: [L::Double; 3],
    /// M, the bound of the normals' components.
    size: L::Double,
    /// The sum of the largest |B − A| and the largest |C − A| along an axis.
    sides: L,
}

impl<L: Lanes> Pairs<L> {
    /// Returns rays of these origins and directions in the shear's order of axes, for corners whose
    /// coordinates relative to the origin are at most `reach`.
    #[inline(always)]
    pub(crate) fn new(
        origin: [L; 3],
        direction: [L; 3],
        slope: [L; 2],
        reach: L,
        t_min: L,
    ) -> Self {
        let errors = Self::errors_of(reach, direction[2]);
        Self { origin, direction, slope, reach, errors, t_min }
    }

    /// Returns the errors of rays of this reach and this largest component of the direction.
    #[inline(always)]
    pub(crate) fn errors_of(reach: L, depth: L) -> [L; 3] {
        // The least normal number, because arithmetic with subnormal ones is slow.
        let least = reach.filled(f32::MIN_POSITIVE);
        let error = reach.mul_add(reach.filled(SINGLE_ERROR), least);
        let range_error = reach.mul_add(reach.filled(RANGE_ERROR), least);
        let range_error = depth.abs().mul_add(least, range_error);
        let or_infinite = |bound: L, below: f32| {
            L::select(reach.lt(reach.filled(below)), bound, reach.filled(f32::INFINITY))
        };
        let underflow = or_infinite(least, pow2(62));
        let range_error = or_infinite(range_error, pow2(40));
        [error, underflow, range_error]
    }

    /// Finds the pairs whose triangle the ray's line may cross, in f32.
    #[inline(always)]
    pub(crate) fn candidates(&self, corners: &[[L; 3]; 3]) -> Candidates<L> {
        let [a, b, c] = corners;
        let [a, b, c] = [self.corner(a), self.corner(b), self.corner(c)];
        let [ax, ay, az] = a;
        let [bx, by, bz] = b;
        let [cx, cy, cz] = c;
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let [error, underflow, _] = self.errors;
        let error = error.mul_add(self.spread(&[a, b, c]), underflow);
        let edges = [u, v, w];
        let crossings = Crossings::new(edges, error);
        Candidates { crossings, edges, error, depths: [az, bz, cz] }
    }

    /// Returns the candidates that may be hits in the range up to `t_max`, and those that certainly
    /// are, in f32.
    #[inline(always)]
    pub(crate) fn within(&self, candidates: &Candidates<L>, t_max: L) -> (u32, u32) {
        let depth = self.direction[2];
        let [az, _, _] = candidates.depths;
        let Tilt { area, tilt, flip, slack } = self.tilt(candidates);
        let begin = area.mul_add(self.t_min.mul_add(depth, az), tilt) ^ flip;
        let end = area.mul_add(t_max.mul_add(depth, az), tilt) ^ flip;
        let no_slack = slack.filled(0.0) - slack;
        let beyond = slack.lt(begin) | end.lt(no_slack);
        let within = begin.lt(no_slack) & slack.lt(end);
        let Crossings { possible, certain } = candidates.crossings;
        let certain = certain & possible;
        (possible & !(certain & beyond.bits()), certain & within.bits())
    }

    /// Returns bounds of the distances at which rays certainly hit triangles, and a bit for each that
    /// is hit along its normal.
    #[inline(always)]
    pub(crate) fn distances(&self, candidates: &Candidates<L>) -> ([L; 2], u32) {
        /// Covers five roundings.
        const ROUNDINGS: f32 = 4.0 * f32::EPSILON;
        let depth = self.direction[2];
        let [az, _, _] = candidates.depths;
        let Tilt { area, tilt, flip, slack } = self.tilt(candidates);
        let height = slack.filled(0.0) - (area.mul_add(az, tilt) ^ flip);
        let inverse = slack.filled(1.0) / (area * depth).abs();
        let low = (height - slack) * inverse * slack.filled(1.0 - ROUNDINGS);
        let high = (height + slack) * inverse * slack.filled(1.0 + ROUNDINGS);
        ([low, high], flip.signs())
    }

    #[inline(always)]
    fn tilt(&self, candidates: &Candidates<L>) -> Tilt<L> {
        let [_, _, range_error] = self.errors;
        let [u, v, w] = candidates.edges;
        let [az, bz, cz] = candidates.depths;
        let area = u + v + w;
        let side = bz - az;
        let other = cz - az;
        let underflow = area.filled(f32::MIN_POSITIVE);
        let slack = (candidates.error * area.filled(8.0))
            .mul_add(side.abs().max(other.abs()), range_error.mul_add(area.abs(), underflow));
        let flip = area.filled(-0.0) & (area ^ self.direction[2]);
        Tilt { area, tilt: v.mul_add(side, w * other), flip, slack }
    }

    #[inline(always)]
    fn spread(&self, [a, b, c]: &[[L; 3]; 3]) -> L {
        let a = a[0].abs().max(a[1].abs());
        let b = b[0].abs().max(b[1].abs());
        let c = c[0].abs().max(c[1].abs());
        a.max(b).max(c) + self.errors[0]
    }

    /// Returns the candidates whose triangle the ray hits at most at `t_max`, and the distances. No
    /// triangle is degenerate.
    #[inline(always)]
    pub(crate) fn decide(
        &self,
        corners: &[[L; 3]; 3],
        crossings: Crossings,
        t_max: L,
    ) -> (L::Mask, L) {
        let (hits, unsure, t) = self.decide_in_f64(corners, crossings, t_max);
        if unsure != 0 {
            return Self::decide_exactly(*self, *corners, t_max, unsure, hits, t);
        }
        (hits, t)
    }

    /// Does the same as far as f64 suffices, and returns a bit per pair that it leaves open. No line
    /// of the others passes through an edge.
    #[inline(always)]
    pub(crate) fn decide_in_f64(
        &self,
        corners: &[[L; 3]; 3],
        crossings: Crossings,
        t_max: L,
    ) -> (L::Mask, u32, L) {
        let decided = self.decide_certain(corners, crossings, t_max);
        if decided.1 == 0 {
            return decided;
        }
        let possible = crossings.possible;
        let (is_hit, is_behind, t) = self.meet(corners);
        let (is_inside, is_outside) = self.cross(corners);
        let crossed = is_inside & t.mask(possible);
        let unsure = possible & !(is_outside | is_inside & (is_hit | is_behind)).bits();
        (is_hit & crossed & self.t_min.le(t) & t.le(t_max), unsure, t)
    }

    /// Does the same for pairs that are certainly crossed, and leaves the others open.
    #[inline(always)]
    pub(crate) fn decide_certain(
        &self,
        corners: &[[L; 3]; 3],
        Crossings { possible, certain }: Crossings,
        t_max: L,
    ) -> (L::Mask, u32, L) {
        let (is_hit, is_behind, t) = self.meet(corners);
        let crossed = t.mask(certain & possible);
        let unsure = possible & !(crossed & (is_hit | is_behind)).bits();
        (is_hit & crossed & self.t_min.le(t) & t.le(t_max), unsure, t)
    }

    #[inline(always)]
    fn meet(&self, corners: &[[L; 3]; 3]) -> (L::Mask, L::Mask, L) {
        let plane = Plane::of_lanes(corners);
        meet(&plane.normal, self.direction, plane.height(&corners[0], &self.origin))
    }

    /// Returns the pairs whose triangle the ray's line certainly crosses, and those whose triangle
    /// it certainly does not, decided in f64.
    #[inline(always)]
    fn cross(&self, corners: &[[L; 3]; 3]) -> (L::Mask, L::Mask) {
        let [a, b, c] = corners;
        let spread = self.spread(&[self.corner(a), self.corner(b), self.corner(c)]);
        let depth = self.direction[2].double().abs();
        let coordinate_error = self.reach.double() * depth.filled(ERROR) * depth;
        let error = coordinate_error * (spread.double() * depth + coordinate_error);
        let [ax, ay] = self.sheared(&corners[0]);
        let [bx, by] = self.sheared(&corners[1]);
        let [cx, cy] = self.sheared(&corners[2]);
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        let below = error.filled(0.0) - error;
        let is_inside = error.lt(least) | most.lt(below);
        let is_outside = least.lt(below) & error.lt(most);
        (L::narrow(is_inside), L::narrow(is_outside))
    }

    /// Returns a corner of each triangle relative to the ray, sheared in f32; the last coordinate is
    /// negated.
    #[inline(always)]
    fn corner(&self, corner: &[L; 3]) -> [L; 3] {
        let z = self.origin[2] - corner[2];
        [
            z.mul_add(self.slope[0], corner[0] - self.origin[0]),
            z.mul_add(self.slope[1], corner[1] - self.origin[1]),
            z,
        ]
    }

    /// Returns a corner of each triangle relative to the ray, sheared in f64.
    #[inline(always)]
    fn sheared(&self, corner: &[L; 3]) -> [L::Double; 2] {
        let depth = self.direction[2].double();
        let x = corner[0].double() - self.origin[0].double();
        let y = corner[1].double() - self.origin[1].double();
        let z = corner[2].double() - self.origin[2].double();
        [
            x.mul_sub(depth, self.direction[0].double() * z),
            y.mul_sub(depth, self.direction[1].double() * z),
        ]
    }

    /// Decides the pairs that are unsure one by one. Takes copies, so that what its callers have
    /// stays in registers.
    #[cold]
    #[inline(never)]
    fn decide_exactly(
        self,
        corners: [[L; 3]; 3],
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
        let origin = self.origin.each(stored);
        let direction = self.direction.each(stored);
        let corners = corners.each(|corner| corner.each(stored));
        let mut distances = Aligned(stored(t));
        let mut hits = is_hit.bits();
        for lane in (0..L::N).filter(|lane| unsure >> lane & 1 != 0) {
            // The distance does not depend on the names of the axes.
            let of = |numbers: &[[f32; 16]; 3]| numbers.each(|numbers| numbers[lane]);
            let ray = Ray::assume_valid(of(&origin), of(&direction), 0.0, f32::MAX);
            let triangle = Triangle::from(corners.each_ref().each(of));
            // The bounds for one ray and one triangle are narrower.
            if let Some(t) = triangle.intersect(&PreparedRay::new(&ray), f32::MAX) {
                hits |= 1 << lane;
                distances.0[lane] = t;
            }
        }
        // SAFETY: there are sixteen numbers.
        let t = unsafe { L::load(distances.0.as_ptr()) };
        (t.mask(hits) & self.t_min.le(t) & t.le(t_max), t)
    }
}

impl<L: Lanes> Plane<L> {
    /// Returns N · (A − O), and the bound of a distance's error for a speed of 1. `first` are the
    /// first corners again.
    #[inline(always)]
    pub(super) fn height(&self, first: &[L; 3], origin: &[L; 3]) -> (L::Double, L::Double) {
        let [nx, ny, nz] = self.normal;
        let x = self.corner[0] - origin[0].double();
        let y = self.corner[1] - origin[1].double();
        let z = self.corner[2] - origin[2].double();
        let reach = longest(origin, first) + self.sides;
        let error = self.size.filled(ERROR) * self.size * reach.double();
        (nz.mul_add(z, ny.mul_add(y, nx * x)), error)
    }

    #[inline(always)]
    pub(crate) fn of_lanes(corners: &[[L; 3]; 3]) -> Self {
        let [a, b, c] = corners;
        let first = longest(a, b);
        let second = longest(a, c);
        let doubled =
            |corner: &[L; 3]| [corner[0].double(), corner[1].double(), corner[2].double()];
        let [a, b, c] = [doubled(a), doubled(b), doubled(c)];
        let size = (first.double() + first.double()) * second.double();
        Self { corner: a, normal: normal(&a, &b, &c), size, sides: first + second }
    }
}

/// Returns the pairs whose ray meets a plane of this normal at the returned rounded distance, and
/// those whose ray meets it before its origin, where the ray's line crosses the triangle. `height`
/// and `slack` are those of [`Plane::height`].
#[inline(always)]
pub(super) fn meet<L: Lanes>(
    [nx, ny, nz]: &[L::Double; 3],
    direction: [L; 3],
    (height, slack): (L::Double, L::Double),
) -> (L::Mask, L::Mask, L) {
    let [dx, dy, dz] = direction.each(L::double);
    let speed = nz.mul_add(dz, ny.mul_add(dy, *nx * dx));
    let inverse = speed.inverse();
    let t = height * inverse;
    let slack = slack * inverse.abs();
    let low = t - slack;
    let high = t + slack;
    let rounded = L::single(high);
    let zero = t.filled(0.0);
    let is_hit = L::narrow(zero.le(low)) & L::single(low).eq(rounded);
    (is_hit, L::narrow(high.lt(zero)), rounded)
}

#[inline(always)]
fn normal<D: DoubleLanes>(a: &[D; 3], b: &[D; 3], c: &[D; 3]) -> [D; 3] {
    let [x, y, z] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let [p, q, r] = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    [y * r - z * q, z * p - x * r, x * q - y * p]
}

#[inline(always)]
fn longest<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> L {
    let x = (b[0] - a[0]).abs();
    let y = (b[1] - a[1]).abs();
    let z = (b[2] - a[2]).abs();
    x.max(y).max(z)
}
