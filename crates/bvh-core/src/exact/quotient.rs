//! Distances in twice the precision of f64: an expansion of two terms for every value.
//!
//! A sum of two such values, or their product without the product of the low terms, is off by less
//! than 2⁻¹⁰² of itself (Joldes, Muller & Popescu 2017, 'Tight and rigorous error bounds for basic
//! building blocks of double-word arithmetic'). Differences of coordinates are exact. So the bounds
//! of f64 hold with 2⁻¹⁰² for 2⁻⁵³.

use crate::expansion::two_product;
use core::ops::{Add, Div, Mul, Sub};

/// The factor from bounds in f64 to bounds here, and as much again.
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

/// A number as the sum of two, the second at most half a unit in the last place of the first.
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

    /// The sum of two numbers of which the first is larger.
    #[inline(always)]
    fn quick(a: D, b: D) -> Self {
        let sum = a + b;
        Self(sum, b - (sum - a))
    }

    /// The exact difference of two numbers.
    #[inline(always)]
    pub(crate) fn difference(a: D, b: D) -> Self {
        let difference = a - b;
        let b_part = difference - a;
        let a_part = difference - b_part;
        Self(difference, (a - a_part) - (b + b_part))
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let Self(high, rest) = Self::sum(self.0, other.0);
        let Self(low, last) = Self::sum(self.1, other.1);
        let Self(high, rest) = Self::quick(high, rest + low);
        Self::quick(high, rest + last)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        let Self(high, rest) = Self::difference(self.0, other.0);
        let Self(low, last) = Self::difference(self.1, other.1);
        let Self(high, rest) = Self::quick(high, rest + low);
        Self::quick(high, rest + last)
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let (product, rest) = self.0.two_product(other.0);
        Self::quick(product, rest + (self.0 * other.1 + self.1 * other.0))
    }

    #[inline(always)]
    fn times_number(self, number: D) -> Self {
        let (product, rest) = self.0.two_product(number);
        Self::quick(product, rest + self.1 * number)
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        let first = self.0 / other.0;
        let rest = self.minus(other.times_number(first));
        let second = rest.0 / other.0;
        let rest = rest.minus(other.times_number(second));
        let Self(high, low) = Self::quick(first, second);
        Self::quick(high, low + rest.0 / other.0)
    }
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
    let x = py.times(*qz).minus(pz.times(*qy));
    let y = pz.times(*qx).minus(px.times(*qz));
    let z = px.times(*qy).minus(py.times(*qx));
    let height = corner[0].times(x).plus(corner[1].times(y)).plus(corner[2].times(z));
    let speed = x.times_number(direction[0]).plus(y.times_number(direction[1]));
    height.over(speed.plus(z.times_number(direction[2])))
}
