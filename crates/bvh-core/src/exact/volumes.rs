//! The exact values that decide whether a ray hits a triangle: in twice f64 where that suffices,
//! otherwise as expansions.

use super::expansion::Expansion;
use super::twice::{self, Twice};
use super::{Line, Number, Point};
use crate::each::Each;

/// An exact difference of two points.
type Difference = [Twice<f64>; 3];
/// The same as expansions.
type Vector = [Expansion<2>; 3];

pub(super) fn difference(p: [f64; 3], q: [f64; 3]) -> Difference {
    [0, 1, 2].each(|axis| Twice::difference(p[axis], q[axis]))
}

fn exact(difference: Difference) -> Vector {
    difference.each(Expansion::of)
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
    corners: [Difference; 3],
}

/// The first and the second corner of the edges `u`, `v`, `w`.
const EDGES: [[usize; 2]; 3] = [[2, 1], [0, 2], [1, 0]];

impl Volumes {
    /// Prepares exact values; `None` if a coordinate is not finite.
    pub(super) fn new<P: Point>(line: &Line, triangle: &[P; 3]) -> Option<Self> {
        let triangle = triangle.each(P::double);
        let [origin, direction] = line.ends();
        let corners = triangle.each(|corner| difference(corner, origin));
        let points = [origin, direction].into_iter().chain(triangle);
        let is_finite = points.flatten().all(f64::is_finite);
        is_finite.then_some(Self { direction, triangle, corners })
    }

    /// Returns the side of an edge on which the ray is: −1, 0 or 1.
    pub(super) fn side(&self, edge: usize) -> i32 {
        let [first, second] = EDGES[edge].each(|corner| self.corners[corner]);
        self.volume(first, second)
    }

    /// Returns the side from which the ray comes to the triangle: the sign of d · n.
    pub(super) fn facing(&self) -> i32 {
        let [a, b, c] = self.triangle;
        self.volume(difference(b, a), difference(c, a))
    }

    /// Returns the sign of d · (p × q).
    fn volume(&self, p: Difference, q: Difference) -> i32 {
        match twice::sign(self.direction.each(Twice::of), p, q) {
            0 => self.along(&exact(p), &exact(q)).sign(),
            sign => sign,
        }
    }

    /// Returns d · (p × q).
    #[inline(always)]
    fn along(&self, p: &Vector, q: &Vector) -> Expansion<96> {
        let mut volume = Expansion::zero();
        for axis in 0..3 {
            let mut normal = Expansion::zero();
            add_cross(&mut normal, p, q, axis);
            volume.add_scaled(&normal, self.direction[axis]);
        }
        volume
    }

    /// Returns the side of an edge on which the ray is after its origin has moved by (ε, ε², ε³) with
    /// an infinitely small ε > 0, if it was on none: 0 only for an edge that is parallel to it.
    pub(super) fn moved_side(&self, edge: usize) -> i32 {
        let [first, second] = EDGES[edge];
        let edge = exact(difference(self.triangle[second], self.triangle[first]));
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

    /// Returns the distance of the triangle's plane, to which the ray is not parallel, rounded once;
    /// `None` as [`round_quotient`].
    pub(super) fn rounded_distance<N: Number>(&self) -> Option<N> {
        let [a, b, c] = self.triangle;
        let [p, q] = [difference(b, a), difference(c, a)];
        let [low, high] = twice::distance(self.corners[0], self.direction, p, q, None);
        // Of a distance of 0 the sign decides.
        if low == high
            && low > 0.0
            && let Some(distance) = N::rounded_again(low).filter(|distance| distance.is_finite())
        {
            return Some(distance);
        }
        if twice::sign(self.corners[0], p, q) * self.volume(p, q) < 0 {
            return None;
        }
        let [corner, p, q] = [self.corners[0], p, q].each(exact);
        let mut height = Expansion::zero();
        for (axis, component) in corner.iter().enumerate() {
            let mut normal = Expansion::zero();
            add_cross(&mut normal, &p, &q, axis);
            height.add_product(&normal, component, 1.0);
        }
        round_quotient(&height, &self.along(&p, &q))
    }
}

/// Returns the sign of a component of a finite triangle's normal, by exact arithmetic.
#[cold]
#[inline(never)]
pub(super) fn normal_sign<P: Point>(triangle: &[P; 3], axis: usize) -> i32 {
    let [a, b, c] = triangle.each(P::double);
    let mut normal = Expansion::zero();
    add_cross(&mut normal, &exact(difference(b, a)), &exact(difference(c, a)), axis);
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
    let [up, down] = [shift, -shift].each(|shift| libm::scalbn(1.0, shift.max(0)));
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
