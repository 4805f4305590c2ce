//! Distances and signs in twice the precision of f64: what a distance in f64 lacks is found from the
//! distance of its point to the plane.
//!
//! ```text
//!   t₀ ≈ A · n / d · n,      t = t₀ + n · P / d · n,      P = A − t₀ d
//! ```
//!
//! holds for any t₀. Differences of coordinates, products of two numbers and their rounding errors
//! are exact; only sums of the small parts are rounded (compensated sums: Ogita, Rump & Oishi 2005,
//! 'Accurate sum and dot product').
//!
//! # The bound
//!
//! With ε = 2⁻⁵³, N and M of [`exact`](crate::exact): the small parts of a product of two differences
//! are below 4ε of it, and their roundings below 8ε². A component of the normal is off by less than
//! 20ε² of the sum of its absolute products, and its small part is below 5ε of it. A component of P
//! is off by less than 4.1ε² of |A| + |t₀ d|, and its small part is below 2.1ε of that. In n · P, the
//! product of two small parts is left out, and the other small parts, together below 10.3ε (N +
//! |t₀|M), are rounded at most eight times: it is off by less than 118ε² (N + |t₀|M), and ε of itself.
//!
//! The computed s of d · n is off by less than 8.2εM. Let m = M / |s|, and c what is computed for
//! n · P / d · n. Where 8.3εm is at most 1/4, c is off by less than 3.4ε|c| from roundings, by 11.2εm|c|
//! from s, and by 160ε² (N + |t₀|M) / |s| from n · P, with s. As m is at least nearly 1, the slack
//! 512ε² (N + |t₀|M) / |s| + 32εm|c| covers these, and the rounding of c plus or minus the slack. If
//! both sums with t₀ round to one number, that is the rounded distance, because rounding is monotone.
//!
//! Where m is greater, the slack exceeds a quarter of |c| and 2⁻⁵⁰|t₀|: the sums differ, unless all
//! numbers are 0, when A · n is. Infinite numbers, of what overflows or of s = 0, make NaN of a sum.
//! What underflows is below 2⁻⁸²⁰ / |s|, and N at least 2⁻⁶¹⁰, unless t₀ is 0, or has the few bits of
//! bounds in f32, when nothing does. Any finite f32, directions included, are in a range as narrow:
//! products of three are multiples of 2⁻⁴⁴⁷ below 2³⁹⁰, t₀ d one of 2⁻¹⁰³⁸, and the slack is at least
//! 2⁻⁹³⁴.
//!
//! The [signs](sign) of d · n and A · n follow from the same sums with d or A for P, whose small parts
//! are smaller: they are off by less than 118ε²M or 118ε²N, and nothing underflows.

use crate::each::Each;
use core::ops::{Add, Div, Mul, Sub};

/// A number, or several side by side.
pub(crate) trait Numbers:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The rounded product and its rounding error.
    fn two_product(self, other: Self) -> (Self, Self);

    /// `self · factor + term`, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// One over the number, off by at most 1.2ε of it.
    fn inverse(self) -> Self;

    /// The size.
    fn abs(self) -> Self;

    /// The same number wherever there is one in `self`.
    fn filled(self, x: f64) -> Self;
}

impl Numbers for f64 {
    fn two_product(self, other: Self) -> (Self, Self) {
        two_product(self, other)
    }

    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    fn inverse(self) -> Self {
        1.0 / self
    }

    fn abs(self) -> Self {
        self.abs()
    }

    fn filled(self, x: Self) -> Self {
        x
    }
}

/// A number as the sum of a large and a small part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twice<D>(pub(super) D, pub(super) D);

impl Twice<f64> {
    pub(super) fn of(number: f64) -> Self {
        Self(number, 0.0)
    }
}

impl<D: Numbers> Twice<D> {
    /// The exact sum of two numbers (Knuth).
    #[inline(always)]
    pub(super) fn sum(a: D, b: D) -> Self {
        let sum = a + b;
        let b_part = sum - a;
        let a_part = sum - b_part;
        Self(sum, (a - a_part) + (b - b_part))
    }

    #[inline(always)]
    pub(crate) fn difference(a: D, b: D) -> Self {
        let difference = a - b;
        let b_part = difference - a;
        let a_part = difference - b_part;
        Self(difference, (a - a_part) - (b + b_part))
    }

    /// Returns `self` − t · d.
    #[inline(always)]
    fn beyond(self, t: D, d: D) -> Self {
        let (product, rest) = t.two_product(d);
        let Self(large, small) = Self::difference(self.0, product);
        Self(large, small + (self.1 - rest))
    }
}

/// Returns a · b − c · d, and the sum of the absolute products.
#[inline(always)]
fn determinant<D: Numbers>(a: Twice<D>, b: Twice<D>, c: Twice<D>, d: Twice<D>) -> (Twice<D>, D) {
    let (first, first_rest) = a.0.two_product(b.0);
    let (second, second_rest) = c.0.two_product(d.0);
    let Twice(large, rest) = Twice::difference(first, second);
    let small = a.0.mul_add(b.1, a.1 * b.0) - c.0.mul_add(d.1, c.1 * d.0);
    let small = rest + ((first_rest - second_rest) + small);
    (Twice(large, small), first.abs() + second.abs())
}

#[inline(always)]
fn dot<D: Numbers>(a: [D; 3], b: [D; 3]) -> D {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// Returns n · p, where the small part of the last products is left out.
#[inline(always)]
fn dot_twice<D: Numbers>([x, y, z]: [Twice<D>; 3], [px, py, pz]: [Twice<D>; 3]) -> Twice<D> {
    let (first, first_rest) = px.0.two_product(x.0);
    let (second, second_rest) = py.0.two_product(y.0);
    let (third, third_rest) = pz.0.two_product(z.0);
    let Twice(two, two_rest) = Twice::sum(first, second);
    let Twice(large, rest) = Twice::sum(two, third);
    // What is known first is added first.
    let small = dot([x.1, y.1, z.1], [px.0, py.0, pz.0]);
    let small = x.0.mul_add(px.1, y.0.mul_add(py.1, z.0.mul_add(pz.1, small)));
    Twice(large, ((two_rest + rest) + (first_rest + second_rest + third_rest)) + small)
}

/// Returns p × q, and the sums of the absolute products.
#[inline(always)]
fn cross<D: Numbers>(
    [px, py, pz]: [Twice<D>; 3],
    [qx, qy, qz]: [Twice<D>; 3],
) -> ([Twice<D>; 3], [D; 3]) {
    let (x, x_size) = determinant(py, qz, pz, qy);
    let (y, y_size) = determinant(pz, qx, px, qz);
    let (z, z_size) = determinant(px, qy, py, qx);
    ([x, y, z], [x_size, y_size, z_size])
}

/// Returns the sign of a · (p × q), 0 if the bound leaves it open.
pub(super) fn sign(a: [Twice<f64>; 3], p: [Twice<f64>; 3], q: [Twice<f64>; 3]) -> i32 {
    let (normal, sizes) = cross(p, q);
    let Twice(large, small) = dot_twice(normal, a);
    let value = large + small;
    let slack = dot(a.each(|x| x.0.abs()), sizes) * (1.0 / (1_u128 << 99) as f64);
    i32::from(value > slack) - i32::from(value < -slack)
}

/// Returns two bounds of the distance A · n / d · n of the plane with the normal n = p × q: the corner
/// A and the sides p, q, exactly, and the direction d, which is not parallel to the plane. If they
/// are equal, that is the distance, rounded once; if not, they may both be off. `nearly` is a number close to it, 0 or a
/// normal one, if one is known already: of a subnormal one the bounds would lose their slack.
#[inline(always)]
pub(crate) fn distance<D: Numbers>(
    [ax, ay, az]: [Twice<D>; 3],
    [dx, dy, dz]: [D; 3],
    p: [Twice<D>; 3],
    q: [Twice<D>; 3],
    nearly: Option<D>,
) -> [D; 2] {
    let ([x, y, z], sizes) = cross(p, q);
    let normal = [x.0, y.0, z.0];
    let inverse = dot([dx, dy, dz], normal).inverse();
    let t = match nearly {
        Some(t) => t,
        None => dot([ax.0, ay.0, az.0], normal) * inverse,
    };
    let place = [ax.beyond(t, dx), ay.beyond(t, dy), az.beyond(t, dz)];
    let Twice(large, small) = dot_twice([x, y, z], place);
    let change = (large + small) * inverse;
    let inverse = inverse.abs();
    let height = dot([ax.0.abs(), ay.0.abs(), az.0.abs()], sizes) * inverse;
    let tilt = dot([dx.abs(), dy.abs(), dz.abs()], sizes) * inverse;
    let slack = t.abs().mul_add(tilt, height) * t.filled(1.0 / (1_u128 << 97) as f64);
    let slack = (change.abs() * tilt).mul_add(t.filled(1.0 / (1_u64 << 48) as f64), slack);
    [t + (change - slack), t + (change + slack)]
}

/// Returns the rounded product of two numbers and the rounding error (Dekker). It avoids the fused
/// operation, which `core` and some processors lack.
pub(super) fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let (a_high, a_low) = split(a);
    let (b_high, b_low) = split(b);
    let rest = a_high * b_high - product;
    let rest = rest + a_high * b_low;
    let rest = rest + a_low * b_high;
    (product, rest + a_low * b_low)
}

/// Splits a number into two halves of at most 26 bits each.
fn split(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = ((1_u64 << 27) + 1) as f64;
    let scaled = SPLITTER * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}
