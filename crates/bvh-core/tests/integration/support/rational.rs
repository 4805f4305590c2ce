//! Vectors of exact rationals.

use glam::DVec3;
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
