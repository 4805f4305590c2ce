//! Distances in twice the precision of f64: an expansion of two terms for every value.
//!
//! A sum of two such values, or their product without the product of the low terms, is off by less
//! than 2⁻¹⁰² of itself (Joldes, Muller & Popescu 2017, 'Tight and rigorous error bounds for basic
//! building blocks of double-word arithmetic'). Differences of coordinates are exact. So the bounds
//! of f64 hold with 2⁻¹⁰² for 2⁻⁵³.

use crate::expansion::{two_product, two_sum};

/// The factor from bounds in f64 to bounds here, and as much again.
pub(super) const NARROWER: f64 = 1.0 / (1_u64 << 48) as f64;

/// A number as the sum of two, the second at most half a unit in the last place of the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Twice(pub(super) f64, pub(super) f64);

impl Twice {
    #[inline(always)]
    pub(super) fn difference(a: f64, b: f64) -> Self {
        let (sum, rest) = two_sum(a, -b);
        Self(sum, rest)
    }

    /// The sum of two numbers of which the first is larger.
    #[inline(always)]
    fn quick(a: f64, b: f64) -> Self {
        let sum = a + b;
        Self(sum, b - (sum - a))
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (high, rest) = two_sum(self.0, other.0);
        let (low, last) = two_sum(self.1, other.1);
        let Self(high, rest) = Self::quick(high, rest + low);
        Self::quick(high, rest + last)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.plus(Self(-other.0, -other.1))
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let (product, rest) = two_product(self.0, other.0);
        Self::quick(product, rest + (self.0 * other.1 + self.1 * other.0))
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        let first = self.0 / other.0;
        let rest = self.minus(other.times(Self(first, 0.0)));
        let second = rest.0 / other.0;
        let rest = rest.minus(other.times(Self(second, 0.0)));
        let Self(high, low) = Self::quick(first, second);
        Self::quick(high, low + rest.0 / other.0)
    }
}

#[inline(always)]
fn dot(a: &[Twice; 3], b: &[Twice; 3]) -> Twice {
    a[0].times(b[0]).plus(a[1].times(b[1])).plus(a[2].times(b[2]))
}

/// Returns the distance A · n / d · n of the plane with the normal n = p × q.
pub(super) fn distance(
    corner: &[Twice; 3],
    direction: &[f64; 3],
    [px, py, pz]: &[Twice; 3],
    [qx, qy, qz]: &[Twice; 3],
) -> Twice {
    let normal = [
        py.times(*qz).minus(pz.times(*qy)),
        pz.times(*qx).minus(px.times(*qz)),
        px.times(*qy).minus(py.times(*qx)),
    ];
    dot(corner, &normal).over(dot(&direction.map(|x| Twice(x, 0.0)), &normal))
}
