//! Distances in twice the precision of f64: every value is the sum of two numbers.
//!
//! Differences of coordinates, products of two numbers and their rounding errors are exact; only sums
//! of the small parts are rounded (compensated sums: Ogita, Rump & Oishi 2005, 'Accurate sum and dot
//! product').
//!
//! # The bound
//!
//! With ε = 2⁻⁵³, N and M of [`exact`](crate::exact): the small parts of a product of two differences
//! are below 4ε of it, and their roundings below 8ε². A component of the normal is off by less than
//! 20ε² of the sum of its absolute products, and its small part is below 5ε of it. In A · n, the small
//! parts are together below 9εN, and their roundings, with those of n, below 120ε²N; in d · n, below
//! 100ε²M. Both are normalised, so that the quotient adds a few ε²|t|. The distance is off by less
//! than (120ε²N + 100ε²|t|M) / |d · n| · 8/7 and these, which is less than 512ε² (N + |t|M) / |d · n|:
//! 2⁻⁴⁸ times the bound in f64.

use super::expansion::two_product;
use core::ops::{Add, Div, Mul, Sub};

/// The factor from bounds in f64 to bounds here.
pub(crate) const NARROWER: f64 = 1.0 / (1_u64 << 48) as f64;

/// A number, or several side by side.
pub(crate) trait Numbers:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The rounded product and its rounding error.
    fn two_product(self, other: Self) -> (Self, Self);
}

impl Numbers for f64 {
    fn two_product(self, other: Self) -> (Self, Self) {
        two_product(self, other)
    }
}

/// A number as the sum of a large and a small part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twice<D>(pub(crate) D, pub(crate) D);

impl<D: Numbers> Twice<D> {
    /// The exact sum of two numbers (Knuth).
    #[inline(always)]
    fn sum(a: D, b: D) -> Self {
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
}

/// Returns a · b − c · d.
#[inline(always)]
fn determinant<D: Numbers>(a: Twice<D>, b: Twice<D>, c: Twice<D>, d: Twice<D>) -> Twice<D> {
    let (first, first_rest) = a.0.two_product(b.0);
    let (second, second_rest) = c.0.two_product(d.0);
    let Twice(large, rest) = Twice::difference(first, second);
    let small = (a.0 * b.1 + a.1 * b.0) - (c.0 * d.1 + c.1 * d.0);
    Twice(large, rest + ((first_rest - second_rest) + small))
}

/// Returns the sum of three products; `small` is that of the products with small parts.
#[inline(always)]
fn sum_of_products<D: Numbers>(a: [D; 3], b: [D; 3], small: D) -> Twice<D> {
    let (x, x_rest) = a[0].two_product(b[0]);
    let (y, y_rest) = a[1].two_product(b[1]);
    let (z, z_rest) = a[2].two_product(b[2]);
    let Twice(xy, xy_rest) = Twice::sum(x, y);
    let Twice(large, rest) = Twice::sum(xy, z);
    Twice::sum(large, (xy_rest + rest) + ((x_rest + y_rest) + (z_rest + small)))
}

/// Returns the distance A · n / d · n of the plane with the normal n = p × q: the corner A and the
/// sides p, q, exactly, and the direction d.
#[inline(always)]
pub(crate) fn distance<D: Numbers>(
    corner: &[Twice<D>; 3],
    direction: &[D; 3],
    [px, py, pz]: &[Twice<D>; 3],
    [qx, qy, qz]: &[Twice<D>; 3],
) -> Twice<D> {
    let x = determinant(*py, *qz, *pz, *qy);
    let y = determinant(*pz, *qx, *px, *qz);
    let z = determinant(*px, *qy, *py, *qx);
    let normal = [x.0, y.0, z.0];
    let [a, b, c] = *corner;
    let small = (a.0 * x.1 + a.1 * x.0) + (b.0 * y.1 + b.1 * y.0) + (c.0 * z.1 + c.1 * z.0);
    let height = sum_of_products([a.0, b.0, c.0], normal, small);
    let [dx, dy, dz] = *direction;
    let speed = sum_of_products([dx, dy, dz], normal, dx * x.1 + dy * y.1 + dz * z.1);
    let t = height.0 / speed.0;
    let (product, rest) = t.two_product(speed.0);
    let remainder = ((height.0 - product) - rest) + (height.1 - t * speed.1);
    Twice(t, remainder / speed.0)
}
