//! The exact values that decide whether a ray hits a triangle, as expansions.

use crate::Ray;
use crate::expansion::Expansion;
use glam::Vec3;

/// An exact difference of two points.
type Vector = [Expansion<2>; 3];

#[inline]
fn difference(p: Vec3, q: Vec3) -> Vector {
    let mut vector = [Expansion::zero(); 3];
    for (axis, component) in vector.iter_mut().enumerate() {
        *component = Expansion::difference(p[axis], q[axis]);
    }
    vector
}

/// Adds one component of the exact cross product. Returned products would be copied from function to
/// function, which took longer than the arithmetic.
fn add_cross(sum: &mut Expansion<16>, p: &Vector, q: &Vector, axis: usize) {
    let i = (axis + 1) % 3;
    let j = (axis + 2) % 3;
    sum.add_product(&p[i], &q[j]);
    sum.subtract_product(&p[j], &q[i]);
}

/// The exact values that decide whether a ray hits a triangle.
pub(super) struct Volumes<'a> {
    direction: Vec3,
    triangle: &'a [Vec3; 3],
    /// The corners relative to the origin.
    corners: [Vector; 3],
}

/// The first and the second corner of the edges `u`, `v`, `w`.
const EDGES: [[usize; 2]; 3] = [[2, 1], [0, 2], [1, 0]];

impl<'a> Volumes<'a> {
    /// Prepares exact values; `None` if a coordinate is not finite.
    pub(super) fn new(ray: &Ray, triangle: &'a [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = *triangle;
        let origin = ray.origin();
        let direction = ray.direction();
        let is_finite = [a, b, c, origin, direction].iter().all(|point| point.is_finite());
        if !is_finite {
            return None;
        }
        let corners = [difference(a, origin), difference(b, origin), difference(c, origin)];
        Some(Self { direction, triangle, corners })
    }

    /// Returns the side of an edge on which the ray is: −1, 0 or 1.
    pub(super) fn side(&self, edge: usize) -> i32 {
        let [first, second] = EDGES[edge];
        let mut volume: Expansion<96> = Expansion::zero();
        for axis in 0..3 {
            let mut normal = Expansion::zero();
            add_cross(&mut normal, &self.corners[first], &self.corners[second], axis);
            volume.add_scaled(&normal, f64::from(self.direction[axis]));
        }
        volume.sign()
    }

    /// Returns the side of an edge on which the ray is after its origin has moved by (ε, ε², ε³) with
    /// an infinitely small ε > 0, if it was on none: 0 only for an edge that is parallel to it.
    pub(super) fn moved_side(&self, edge: usize) -> i32 {
        let [first, second] = EDGES[edge];
        let edge = difference(self.triangle[second], self.triangle[first]);
        let direction = self.direction.to_array().map(f64::from);
        [(1, 2), (2, 0), (0, 1)]
            .into_iter()
            .map(|(i, j)| {
                let mut component: Expansion<8> = Expansion::zero();
                component.add_scaled(&edge[j], direction[i]);
                component.add_scaled(&edge[i], -direction[j]);
                component.sign()
            })
            .find(|&sign| sign != 0)
            .unwrap_or(0)
    }

    /// Returns the distance of the triangle's plane, rounded once; `None` as [`round_quotient`].
    pub(super) fn rounded_distance(&self) -> Option<f32> {
        let [a, b, c] = *self.triangle;
        let to_second = difference(b, a);
        let to_third = difference(c, a);
        let mut height = Expansion::zero();
        let mut speed = Expansion::zero();
        for axis in 0..3 {
            let mut normal = Expansion::zero();
            add_cross(&mut normal, &to_second, &to_third, axis);
            height.add_product(&normal, &self.corners[0][axis]);
            speed.add_scaled(&normal, f64::from(self.direction[axis]));
        }
        round_quotient(&height, &speed)
    }
}

/// Returns the sign of a component of a finite triangle's normal, by exact arithmetic.
#[cold]
#[inline(never)]
pub(super) fn normal_sign(&[a, b, c]: &[Vec3; 3], axis: usize) -> i32 {
    let mut normal = Expansion::zero();
    add_cross(&mut normal, &difference(b, a), &difference(c, a), axis);
    normal.sign()
}

/// Returns the quotient, rounded to the nearest f32, ties to even; `None` if it is negative, if the
/// denominator is zero, or if the quotient rounds to infinity.
fn round_quotient(numerator: &Expansion<192>, denominator: &Expansion<96>) -> Option<f32> {
    let sign = denominator.sign();
    if sign == 0 || numerator.sign() * sign < 0 {
        return None;
    }
    // The relative error of this quotient is below 2⁻³⁸, so it rounds to the right f32 or to a
    // neighbour.
    let near = ((numerator.approximate() / denominator.approximate()) as f32).min(f32::MAX);
    // The side of `middle` on which the exact quotient is: −1, 0 or 1.
    let side = |middle: f64| {
        let mut difference: Expansion<384> = numerator.widened();
        difference.add_scaled(denominator, -middle);
        difference.sign() * sign
    };
    let is_odd = near.to_bits() & 1 == 1;
    let above = side(middle_above(near));
    if above > 0 || (above == 0 && is_odd) {
        let up = near.next_up();
        return up.is_finite().then_some(up);
    }
    if near > 0.0 {
        let below = side(middle_above(near.next_down()));
        if below < 0 || (below == 0 && is_odd) {
            return Some(near.next_down());
        }
    }
    // Turn −0 into +0.
    Some(near + 0.0)
}

/// Returns the middle between a number that is not negative and the next f32. The number after the
/// largest f32 is 2¹²⁸.
fn middle_above(number: f32) -> f64 {
    const BEYOND: f64 = 2.0 * (1_u128 << 127) as f64;
    let next = number.next_up();
    let next = if next.is_finite() { f64::from(next) } else { BEYOND };
    0.5 * (f64::from(number) + next)
}
