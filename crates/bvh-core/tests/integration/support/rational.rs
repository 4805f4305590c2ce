//! Exact rationals: vectors, and where the line of a ray crosses a triangle.

use glam::DVec3;
use num_bigint::BigInt;
use num_rational::BigRational;

pub type Vector = [BigRational; 3];

pub fn exactly(p: DVec3) -> Vector {
    p.to_array().map(|x| BigRational::from_float(x).unwrap())
}

pub fn minus(p: &Vector, q: &Vector) -> Vector {
    [0, 1, 2].map(|i| &p[i] - &q[i])
}

pub fn cross(p: &Vector, q: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &p[i] * &q[j] - &p[j] * &q[i])
}

pub fn dot(p: &Vector, q: &Vector) -> BigRational {
    &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2]
}

pub fn zero() -> BigRational {
    BigRational::from_integer(BigInt::ZERO)
}

/// Returns (b − a) × (c − a).
pub fn normal(triangle: [DVec3; 3]) -> Vector {
    let [a, b, c] = triangle.map(exactly);
    cross(&minus(&b, &a), &minus(&c, &a))
}

/// Returns the distance at which a ray without a range hits a triangle, by Cramer's rule (Möller &
/// Trumbore 1997), with other products than the library.
pub fn distance([origin, direction]: [DVec3; 2], triangle: [DVec3; 3]) -> Option<BigRational> {
    let [a, b, c] = triangle.map(exactly);
    let direction = exactly(direction);
    let p = minus(&b, &a);
    let q = minus(&c, &a);
    let height = cross(&direction, &q);
    let determinant = dot(&p, &height);
    if determinant == zero() {
        return None;
    }
    let from_a = minus(&exactly(origin), &a);
    let aside = cross(&from_a, &p);
    let [t, v, w] = [dot(&q, &aside), dot(&from_a, &height), dot(&direction, &aside)]
        .map(|numerator| numerator / &determinant);
    let is_ahead = t >= zero() && v >= zero() && w >= zero();
    (is_ahead && v + w <= BigRational::from_integer(1.into())).then_some(t)
}

/// Returns whether a number that is not negative is `rounded` to the nearest of a few neighbours,
/// ties to even. An infinite neighbour is none.
pub fn is_rounded_to(x: &BigRational, [below, rounded, above]: [f64; 3], is_even: bool) -> bool {
    let number = BigRational::from_float;
    let half = BigRational::new(1.into(), 2.into());
    let middle = |other: f64| Some((number(rounded).unwrap() + number(other)?) * &half);
    middle(below).is_none_or(|below| x > &below || is_even && x == &below)
        && middle(above).is_none_or(|above| x < &above || is_even && x == &above)
}
