//! The exact values that decide whether a ray hits a triangle, as expansions.

use super::expansion::Expansion;
use super::{Line, Number, Point};

/// An exact difference of two points.
type Vector = [Expansion<2>; 3];

#[inline]
fn difference(p: [f64; 3], q: [f64; 3]) -> Vector {
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
    sum.add_product(&p[i], &q[j], 1.0);
    sum.add_product(&p[j], &q[i], -1.0);
}

/// The exact values that decide whether a ray hits a triangle.
pub(super) struct Volumes {
    direction: [f64; 3],
    triangle: [[f64; 3]; 3],
    /// The corners relative to the origin.
    corners: [Vector; 3],
}

/// The first and the second corner of the edges `u`, `v`, `w`.
const EDGES: [[usize; 2]; 3] = [[2, 1], [0, 2], [1, 0]];

impl Volumes {
    /// Prepares exact values; `None` if a coordinate is not finite.
    pub(super) fn new<P: Point>(line: &Line, triangle: &[P; 3]) -> Option<Self> {
        let triangle = triangle.map(P::double);
        let [origin, direction] = line.ends();
        let corners = triangle.map(|corner| difference(corner, origin));
        let points = [origin, direction].into_iter().chain(triangle);
        let is_finite = points.flatten().all(f64::is_finite);
        is_finite.then_some(Self { direction, triangle, corners })
    }

    /// Returns the side of an edge on which the ray is: −1, 0 or 1.
    pub(super) fn side(&self, edge: usize) -> i32 {
        let [first, second] = EDGES[edge];
        let mut volume: Expansion<96> = Expansion::zero();
        for axis in 0..3 {
            let mut normal = Expansion::zero();
            add_cross(&mut normal, &self.corners[first], &self.corners[second], axis);
            volume.add_scaled(&normal, self.direction[axis]);
        }
        volume.sign()
    }

    /// Returns the side of an edge on which the ray is after its origin has moved by (ε, ε², ε³) with
    /// an infinitely small ε > 0, if it was on none: 0 only for an edge that is parallel to it.
    pub(super) fn moved_side(&self, edge: usize) -> i32 {
        let [first, second] = EDGES[edge];
        let edge = difference(self.triangle[second], self.triangle[first]);
        [(1, 2), (2, 0), (0, 1)]
            .into_iter()
            .map(|(i, j)| {
                let mut component: Expansion<8> = Expansion::zero();
                component.add_scaled(&edge[j], self.direction[i]);
                component.add_scaled(&edge[i], -self.direction[j]);
                component.sign()
            })
            .find(|&sign| sign != 0)
            .unwrap_or(0)
    }

    /// Returns d · n, exactly.
    pub(super) fn speed(&self) -> Expansion<96> {
        self.plane().1
    }

    /// Returns the distance of the triangle's plane, rounded once; `None` as [`round_quotient`].
    pub(super) fn rounded_distance<N: Number>(&self) -> Option<N> {
        let (height, speed) = self.plane();
        round_quotient(&height, &speed)
    }

    /// Returns A · n and d · n.
    #[inline(always)]
    fn plane(&self) -> (Expansion<192>, Expansion<96>) {
        let [a, b, c] = self.triangle;
        let to_second = difference(b, a);
        let to_third = difference(c, a);
        let mut height = Expansion::zero();
        let mut speed = Expansion::zero();
        for axis in 0..3 {
            let mut normal = Expansion::zero();
            add_cross(&mut normal, &to_second, &to_third, axis);
            height.add_product(&normal, &self.corners[0][axis], 1.0);
            speed.add_scaled(&normal, self.direction[axis]);
        }
        (height, speed)
    }
}

/// Returns the sign of a component of a finite triangle's normal, by exact arithmetic.
#[cold]
#[inline(never)]
pub(super) fn normal_sign<P: Point>(triangle: &[P; 3], axis: usize) -> i32 {
    let [a, b, c] = triangle.map(P::double);
    let mut normal = Expansion::zero();
    add_cross(&mut normal, &difference(b, a), &difference(c, a), axis);
    normal.sign()
}

/// Returns the quotient, rounded to the nearest number, ties to even; `None` if it is negative, if
/// the denominator is zero, or if the quotient rounds to infinity.
fn round_quotient<N: Number>(numerator: &Expansion<192>, denominator: &Expansion<96>) -> Option<N> {
    let sign = denominator.sign();
    if sign == 0 || numerator.sign() * sign < 0 {
        return None;
    }
    if numerator.sign() == 0 {
        return Some(N::rounded(0.0));
    }
    // Scaled so that the quotient is about 1: products neither overflow nor lose bits below the
    // least number.
    let exponent = |x: f64| libm::ilogb(x);
    let shift = exponent(numerator.approximate()) - exponent(denominator.approximate());
    let [up, down] = [shift, -shift].map(|shift| libm::scalbn(1.0, shift.max(0)));
    let denominator = denominator.scaled(up);
    let numerator = numerator.scaled(down);
    // The exact difference of the numerator and a multiple of the denominator.
    let remainder = |parts: [f64; 2]| {
        let mut remainder: Expansion<576> = numerator.widened();
        parts.iter().for_each(|part| remainder.add_scaled(&denominator, -part));
        remainder
    };
    // Each quotient has a relative error below 2⁻³⁸, and so their sum one below 2⁻⁷⁵: it rounds to
    // the right number or to a neighbour.
    let speed = denominator.approximate();
    let first = numerator.approximate() / speed;
    let second = remainder([first, 0.0]).approximate() / speed;
    let near = N::rounded(libm::scalbn(first + second, shift));
    let near = if near.is_finite() { near } else { near.next_down() };
    // The side of the middle between a number and the one above it on which the exact quotient is:
    // −1, 0 or 1.
    let side_of_middle = |below: N| {
        let below_scaled = libm::scalbn(below.double(), -shift);
        let step = half_step(below, shift);
        remainder([below_scaled, step]).sign() * sign
    };
    let above = side_of_middle(near);
    if above > 0 || (above == 0 && near.is_odd()) {
        let up = near.next_up();
        return up.is_finite().then_some(up);
    }
    if near.double() > 0.0 {
        let below = side_of_middle(near.next_down());
        if below < 0 || (below == 0 && near.is_odd()) {
            return Some(near.next_down());
        }
    }
    // Turn −0 into +0.
    Some(N::rounded(near.double() + 0.0))
}

/// Returns half of the step from a number that is not negative to the next one, times 2^−shift. The
/// number after the largest one is a power of two.
fn half_step<N: Number>(number: N, shift: i32) -> f64 {
    let next = number.next_up();
    let (from, to) = if next.is_finite() { (number, next) } else { (number.next_down(), number) };
    // The step is a power of two: scaled first, since half of the least one is none.
    libm::scalbn(to.double() - from.double(), -shift - 1)
}
