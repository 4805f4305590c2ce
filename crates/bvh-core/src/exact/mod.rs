//! Intersection of a ray and a triangle in real arithmetic.
//!
//! # Meaning of an answer
//!
//! A ray has an origin `o`, a direction `d` and a range `t_min..=t_max`, a triangle has corners
//! `a`, `b`, `c`; all are f32, or all f64, and count as exact real numbers. The ray *meets* the triangle if its
//! line crosses the closed triangle (edges and corners belong to it) and is not parallel to the
//! triangle's plane. With `A = a − o` and so on,
//!
//! ```text
//!   u = d · (C × B)     v = d · (A × C)     w = d · (B × A)      n = (b − a) × (c − a)
//!   meets  ⇔  u, v, w ≥ 0 or u, v, w ≤ 0,  and  u + v + w = −d · n ≠ 0
//!   distance  t = A · n / d · n
//! ```
//!
//! The real distance is *rounded once*, to the nearest number, ties to even. The ray *hits* the
//! triangle if `t ≥ 0` and `t_min ≤ rounded t ≤ t_max`. The cases at the border follow:
//!
//! - Triangles without area, and rays in a triangle's plane, have `d · n = 0`: never hit.
//! - A triangle behind the origin is not hit, even very close to the origin; a distance below half
//!   of the least number rounds to +0, and no distance is −0.
//! - A distance that rounds to infinity is beyond every `t_max`.
//! - A triangle with a corner that is not finite is never hit.
//!
//! The *nearest* hit among several triangles has the least rounded distance, and the lowest id
//! among equals. Neither a tree nor an instruction set appears in these definitions. Closed meshes
//! are watertight: a line that passes from one side of a surface to the other crosses some closed
//! triangle of the surface, unless the line is parallel to that triangle.
//!
//! # Layers
//!
//! ```text
//!   f64           sheared corners, error bound    nearly all triangles   ──> miss, or rounded distance
//!    │ perhaps
//!   twice f64     compensated sums, error bound   near edges and corners ──> side, or rounded distance
//!    │ perhaps
//!   expansions    exact                           what remains           ──> miss, or rounded distance
//! ```
//!
//! The first two layers answer only where their error bounds prove the answer. They could be omitted,
//! or computed with other roundings, and no answer would change.
//!
//! # The bounds
//!
//! Let axis z be the axis of the largest component of `d`, x and y the others, `R ≥ |A|, |B|, |C|`
//! (largest components), and ε half a unit in the last place of 1. Multiplication by `d_z` shears a
//! corner into the plane across the ray:
//!
//! ```text
//!   x(A) = d_z A_x − d_x A_z,  y(A) = d_z A_y − d_y A_z,    and   u = (x(C) y(B) − y(C) x(B)) / d_z,  …
//! ```
//!
//! *f64*, ε = 2⁻⁵³. `A_x` and `A_z` are off by ε of themselves, both products by 2ε and the
//! difference by ε: `x(A)` is off by less than 6.1 εR|d_z|. Let e = 2⁻⁴⁷R|d_z| = 64 εR|d_z|, and S
//! the largest computed |x|, |y| of a corner; S < 2.1 R|d_z|. The computed `u d_z` is off by less
//! than 4 · 6.1 εR|d_z|S + 2 (6.1 εR|d_z|)² from its operands, and by 4.1 εS² ≤ 8.7 εR|d_z|S from
//! its own three roundings: in total less than `E = e (S + e)`. With one value below −E and another
//! above E the line misses. With all three above E, or below −E, it crosses, and the determinant is
//! not zero.
//!
//! The distance is the quotient of the formula above, with the edges `b − a` and `c − a` as they
//! are, not relative to the origin: near the origin this has far smaller errors than interpolation
//! between depths. `A · n` is a sum of six products of three differences. Each difference is off by
//! ε of itself, and its way through two products and three sums adds 5ε: with N the sum of the
//! absolute products, `A · n` is off by less than 8.1 εN, and in the same way `d · n` by less than
//! 8.1 εM. With `64 εM ≤ |d · n|` the computed quotient t is off by less than (8.1 ε (N + |t| M) /
//! |d · n|) · 8/7 + ε|t|, which is less than the bound `16 ε (N + |t| M) / |d · n|`. If both ends
//! of this interval round to one f32, that f32 is the rounded distance, because rounding is
//! monotone.
//!
//! Nothing overflows or underflows: coordinates are multiples of 2⁻¹⁴⁹ below 2¹²⁹, all values above
//! are between 2⁻⁷⁵⁰ and 2⁷⁵⁰ or zero.
//!
//! *Expansions* are exact. The sign of `A · n − m d · n`, where m is the middle between two f32,
//! rounds the quotient.
//!
//! Sources: Möller & Trumbore 1997, 'Fast, minimum storage ray/triangle intersection' (the
//! quotients); Woop, Benthin & Wald 2013, 'Watertight ray/triangle intersection' (the shear);
//! Shewchuk 1997, 'Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates' (filters and expansions). Differs from Woop et al.: the shear decides no answer,
//! because the next layer decides every answer within the errors of the shear.

mod expansion;
mod number;
mod twice;
mod volumes;

use crate::each::Each;
use glam::DVec3;
pub(crate) use number::{Number, Point};
pub(crate) use twice::{Numbers, Twice, distance};
use volumes::{Volumes, difference};

/// The axes of the shear, indexed by the axis of the direction's largest component.
pub(crate) static AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// The answer of a layer with rounding errors about a line and a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// The line does not cross the triangle, or crosses it behind the origin.
    Miss,
    /// The line crosses the triangle between these distances, which are not negative.
    Between(f64, f64),
    /// The error bound allows several answers.
    Unsure,
}

/// A ray in f64. The axis of the direction's largest component is the last of `axes`, the order of
/// the coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) origin: [f64; 3],
    pub(crate) direction: [f64; 3],
    pub(crate) axes: [usize; 3],
}

/// The factor of error bounds, 64ε in f64.
pub(crate) const ERROR: f64 = 1.0 / (1_u64 << 47) as f64;

impl Line {
    #[inline(always)]
    pub(crate) fn new<P: Point>(origin: P, direction: P) -> Self {
        let origin = origin.double();
        let direction = direction.double();
        let axes = AXES[largest_axis(direction.into())];
        Self {
            origin: axes.each(|axis| origin[axis]),
            direction: axes.each(|axis| direction[axis]),
            axes,
        }
    }

    /// Returns the origin and the direction by axis.
    fn ends(&self) -> [[f64; 3]; 2] {
        [self.origin, self.direction].each(|ordered| {
            let mut by_axis = [0.0; 3];
            self.axes.into_iter().zip(ordered).for_each(|(axis, x)| by_axis[axis] = x);
            by_axis
        })
    }

    /// Returns the triangle's corners relative to the origin, in the order of `axes`.
    #[inline(always)]
    fn relative<P: Point>(&self, triangle: &[P; 3]) -> [[f64; 3]; 3] {
        let [kx, ky, kz] = self.axes;
        let [ox, oy, oz] = self.origin;
        let relative = |corner: P| {
            let corner = corner.double();
            [corner[kx] - ox, corner[ky] - oy, corner[kz] - oz]
        };
        let [a, b, c] = *triangle;
        [relative(a), relative(b), relative(c)]
    }

    /// Returns the difference of two corners, in the order of `axes`.
    #[inline(always)]
    fn edge<P: Point>(&self, from: P, to: P) -> [f64; 3] {
        let from = from.double();
        let to = to.double();
        self.axes.each(|axis| to[axis] - from[axis])
    }

    /// Returns the edge values `u`, `v`, `w`, multiplied by `d_z`, and the bound of their errors.
    #[inline(always)]
    fn edges(&self, corners: &[[f64; 3]; 3]) -> ([f64; 3], f64) {
        let [dx, dy, dz] = self.direction;
        let reach = largest(corners.as_flattened());
        let error = reach * dz.abs() * ERROR;
        let sheared = |[x, y, z]: [f64; 3]| [x * dz - dx * z, y * dz - dy * z];
        let [a, b, c] = *corners;
        let [a, b, c] = [sheared(a), sheared(b), sheared(c)];
        let spread = largest([a, b, c].as_flattened());
        let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
        ([cross(c, b), cross(a, c), cross(b, a)], error * (spread + error))
    }

    /// Returns the weights of the corners where the line meets the triangle's plane, if it does.
    pub(crate) fn barycentrics<P: Point>(&self, triangle: &[P; 3]) -> Option<[f64; 3]> {
        let (weights, _) = self.edges(&self.relative(triangle));
        let sum: f64 = weights.iter().sum();
        (sum != 0.0).then(|| weights.each(|weight| weight / sum))
    }

    /// Decides in f64 if the error bounds permit.
    #[inline(always)]
    pub(crate) fn filter<P: Point>(&self, triangle: &[P; 3]) -> Verdict {
        let corners = self.relative(triangle);
        let ([u, v, w], error) = self.edges(&corners);
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        if least < -error && most > error {
            return Verdict::Miss;
        }
        if least > error || most < -error {
            return self.plane(&corners[0], triangle);
        }
        Verdict::Unsure
    }

    /// Decides in f64 where the line crosses the triangle's plane if the error bounds permit.
    #[inline(always)]
    fn plane<P: Point>(&self, corner: &[f64; 3], [first, second, third]: &[P; 3]) -> Verdict {
        let to_second = self.edge(*first, *second);
        let to_third = self.edge(*first, *third);
        let (normal, products) = normal(&to_second, &to_third);
        let along = dot(&self.direction, &normal);
        let along_error = ERROR * dot(&self.direction.each(f64::abs), &products);
        if along == 0.0 || along_error > along.abs() {
            return Verdict::Unsure;
        }
        let t = dot(corner, &normal) / along;
        let error = ERROR * dot(&corner.each(f64::abs), &products) + t.abs() * along_error;
        let slack = 0.25 * error / along.abs();
        let low = t - slack;
        let high = t + slack;
        if high < 0.0 {
            return Verdict::Miss;
        }
        if low >= 0.0 { Verdict::Between(low, high) } else { Verdict::Unsure }
    }

    /// Returns the side from which the ray crosses a triangle by the rule of
    /// [`Triangle::crossing`](crate::Triangle::crossing): 1 along the normal, −1 against it, and 0 if it
    /// does not.
    pub(crate) fn crossed_side<P: Point>(&self, triangle: &[P; 3]) -> i32 {
        let verdict = self.filter(triangle);
        if verdict == Verdict::Miss {
            return 0;
        }
        let side = self.side(triangle);
        let is_crossed =
            verdict != Verdict::Unsure || side != 0 && self.distance(triangle, true).is_some();
        if is_crossed { side } else { 0 }
    }

    /// Returns the side from which the line comes to a triangle that it crosses: 1 along the normal,
    /// −1 against it, and 0 for a line parallel to its plane.
    #[inline]
    pub(crate) fn side<P: Point>(&self, triangle: &[P; 3]) -> i32 {
        let [first, second, third] = *triangle;
        let (normal, products) = normal(&self.edge(first, second), &self.edge(first, third));
        let along = dot(&self.direction, &normal);
        if ERROR * dot(&self.direction.each(f64::abs), &products) < along.abs() {
            return if along > 0.0 { 1 } else { -1 };
        }
        Volumes::new(self, triangle).map_or(0, |volumes| volumes.facing())
    }

    /// Returns the distance of the plane of a triangle that the line crosses at or in front of the
    /// origin, rounded once.
    #[inline(never)]
    pub(crate) fn rounded<P: Point<Number = f64>>(
        [origin, direction]: [P; 2],
        triangle: &[P; 3],
    ) -> f64 {
        let [a, b, c] = triangle.each(P::double);
        let corner = difference(a, origin.double());
        let sides = [difference(b, a), difference(c, a)];
        let [low, high] = distance(corner, direction.double(), sides[0], sides[1], None);
        if low == high {
            return low + 0.0;
        }
        let volumes = Volumes::new(&Self::new(origin, direction), triangle);
        volumes.and_then(|volumes| volumes.rounded_distance()).unwrap_or(high)
    }

    /// Returns the rounded distance at which the ray's line crosses the triangle at or in front of
    /// the origin, by exact arithmetic where f64 does not suffice. If the origin `is_moved`, by the
    /// rule of [`Triangle::crossing`](crate::Triangle::crossing). Does not allocate.
    #[cold]
    #[inline(never)]
    fn distance<P: Point>(&self, triangle: &[P; 3], is_moved: bool) -> Option<P::Number> {
        let volumes = Volumes::new(self, triangle)?;
        let corners = self.relative(triangle);
        let (edges, error) = self.edges(&corners);
        // The edge values in f64 are multiplied by the depth.
        let above = if self.direction[2] < 0.0 { -1 } else { 1 };
        let mut sides =
            edges.each(|edge| above * (i32::from(edge > error) - i32::from(edge < -error)));
        if sides.contains(&-1) && sides.contains(&1) {
            return None;
        }
        // Most rays that come here pass through one edge or corner, at a distance that f64 knows.
        let verdict = self.plane(&corners[0], triangle);
        if verdict == Verdict::Miss {
            return None;
        }
        for (edge, side) in sides.iter_mut().enumerate() {
            if *side == 0 {
                *side = volumes.side(edge);
            }
            if *side == 0 && is_moved {
                *side = volumes.moved_side(edge);
            }
        }
        // The sum of the edge values is −d · n: where all are 0, the line is parallel to the plane.
        if sides == [0; 3]
            || sides.contains(&-1) && sides.contains(&1)
            || is_moved && sides.contains(&0)
        {
            return None;
        }
        match rounded(verdict) {
            Some(distance) => distance,
            None => volumes.rounded_distance(),
        }
    }

    /// Returns the rounded distance at which the ray crosses the triangle at or in front of the
    /// origin, by the rule of [`Triangle::crossing`](crate::Triangle::crossing) if the origin is
    /// moved, otherwise by that of [`Triangle::intersect`](crate::Triangle::intersect).
    #[inline(always)]
    pub(crate) fn crossing<P: Point>(
        &self,
        triangle: &[P; 3],
        is_moved: bool,
    ) -> Option<P::Number> {
        let verdict = self.filter(triangle);
        if verdict == Verdict::Miss {
            return None;
        }
        match rounded(verdict) {
            Some(distance) => distance,
            None => self.distance(triangle, is_moved),
        }
    }
}

/// Returns the axis of a vector's largest component, the lowest on ties, without a branch that the
/// processor could not predict.
#[inline(always)]
pub(crate) fn largest_axis(vector: DVec3) -> usize {
    let [x, y, z] = vector.abs().to_array();
    let axis = usize::from(y > x);
    if z > larger(x, y) { 2 } else { axis }
}

/// Returns the rounded distance, if the verdict decides it: `Some(None)` beyond every number.
#[inline(always)]
fn rounded<N: Number>(verdict: Verdict) -> Option<Option<N>> {
    let Verdict::Between(low, high) = verdict else { return None };
    let rounded = N::rounded(high);
    (N::rounded(low) == rounded).then(|| rounded.is_finite().then_some(rounded))
}

/// Returns whether a triangle has no area; false if a corner is not finite.
pub(crate) fn is_degenerate<P: Point>(triangle: &[P; 3]) -> bool {
    triangle.iter().all(|corner| corner.double().iter().all(|x| x.is_finite()))
        && (0..3).all(|axis| normal_sign(triangle, axis) == 0)
}

/// Returns the sign of a component of a finite triangle's normal: −1, 0 or 1. Each rounding in f64,
/// of two differences, a product and their difference, is off by ε of the sum of the absolute
/// products, which the bound 64ε covers.
pub(crate) fn normal_sign<P: Point>(triangle: &[P; 3], axis: usize) -> i32 {
    let [a, b, c] = triangle.each(P::double);
    let edge = |from: [f64; 3], to: [f64; 3]| [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    let (normal, products) = normal(&edge(a, b), &edge(a, c));
    let error = ERROR * products[axis];
    if normal[axis].abs() > error {
        return if normal[axis] > 0.0 { 1 } else { -1 };
    }
    // Products of zero are exact.
    if error == 0.0 { 0 } else { volumes::normal_sign(triangle, axis) }
}

/// Returns the cross product, and the same with sums of absolute products instead of differences.
#[inline(always)]
fn normal([px, py, pz]: &[f64; 3], [qx, qy, qz]: &[f64; 3]) -> ([f64; 3], [f64; 3]) {
    let pairs = [[py * qz, pz * qy], [pz * qx, px * qz], [px * qy, py * qx]];
    (pairs.each(|[a, b]| a - b), pairs.each(|[a, b]| a.abs() + b.abs()))
}

#[inline(always)]
fn dot(p: &[f64; 3], q: &[f64; 3]) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

#[inline(always)]
fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |most, number| larger(most, number.abs()))
}

/// Returns the larger of two numbers, the second if one is NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
