//! Exact arithmetic: the internal area of trees, the reference for reported costs, and the
//! distances of hits, the reference for the answers of tracers.

use bvh_core::{Bvh, Ray, Triangle};
use glam::Vec3;
use num_bigint::{BigInt, BigUint, Sign};
use num_traits::float::FloatCore;
use num_traits::{ToPrimitive, Zero};

/// Every f32 is an integer multiple of 2^-149, hence a product of two differences is an integer
/// multiple of 2^-298.
const UNIT: u32 = 298;
/// Every f64 is an integer multiple of 2^-1074.
const UNIT_F64: u32 = 1074;

/// Returns a finite number in units of 2^-149.
fn whole(x: f32) -> BigInt {
    in_units(x.integer_decode(), 149)
}

/// Returns a number by its parts in units of 2^-`unit`, the size of the smallest of its type.
fn in_units((size, exponent, sign): (u64, i16, i8), unit: i16) -> BigInt {
    // The parts of a denormal number have twice the size and half the unit.
    let doubled = BigInt::from(size) << (exponent + unit + 1);
    (doubled >> 1) * sign
}

/// Returns the exact [`bvh_core::cost::internal_area`] of a valid tree in units of 2^-298.
/// O(nodes).
pub fn internal_area(tree: &Bvh) -> BigUint {
    let mut total = BigInt::zero();
    for node in tree.nodes.iter().filter(|node| !node.is_leaf()) {
        total += half_area(&node.aabb);
    }
    total.magnitude().clone()
}

/// Returns the exact half area of a nonempty box in units of 2^-298.
pub fn half_area(aabb: &bvh_core::Aabb) -> BigInt {
    let [x, y, z] = [0, 1, 2].map(|axis| whole(aabb.max[axis]) - whole(aabb.min[axis]));
    &x * &y + &y * &z + &z * &x
}

/// Returns |cost − exact| / exact, with `exact` in units of 2^-298.
///
/// 0 if both are 0; infinite if only one is 0, or if the cost is negative or not finite.
pub fn relative_error(cost: f64, exact: &BigUint) -> f64 {
    if !(cost.is_finite() && cost >= 0.0) {
        return f64::INFINITY;
    }
    let exact = exact << (UNIT_F64 - UNIT);
    let cost = in_units(cost.integer_decode(), UNIT_F64 as i16).into_parts().1;
    let difference = if cost > exact { &cost - &exact } else { &exact - &cost };
    if difference.is_zero() {
        return 0.0;
    }
    if exact.is_zero() {
        return f64::INFINITY;
    }
    ratio(&difference, &exact)
}

/// Returns a / b for b above 0.
pub fn ratio(a: &BigUint, b: &BigUint) -> f64 {
    // Units of 2^-200 are far below the rounding of any ratio that is not tiny.
    ((a << 200u32) / b).to_f64().unwrap_or(f64::INFINITY) / 2f64.powi(200)
}

/// A vector in units of 2^-149, of which every f32 is an integer multiple.
type Vector = [BigInt; 3];

/// Returns whether `t` is the distance at which the ray's line meets the plane of the triangle,
/// rounded once to the nearest f32, ties to even. False for a line in the plane, and for a plane
/// behind the origin.
pub fn is_rounded_distance(ray: &Ray, triangle: &Triangle, t: f32) -> bool {
    let [a, b, c] = triangle.0.map(vector);
    let origin = vector(ray.origin());
    let normal = cross(&difference(&b, &a), &difference(&c, &a));
    let height = dot(&normal, &difference(&a, &origin));
    let speed = dot(&normal, &vector(ray.direction()));
    let (height, speed) = match speed.sign() {
        Sign::Minus => (-height, -speed),
        Sign::Plus => (height, speed),
        Sign::NoSign => return false,
    };
    if !t.is_finite() || t.is_sign_negative() || height.sign() == Sign::Minus {
        return false;
    }
    // The sum of two neighbours in units of 2^-149 is their middle in units of 2^-150.
    let above = if t == f32::MAX { BigInt::from(1) << (128 + 149) } else { whole(t.next_up()) };
    let end = (whole(t) + above) * &speed;
    let begin = if t == 0.0 { BigInt::ZERO } else { (whole(t) + whole(t.next_down())) * speed };
    let distance = height << 150;
    let is_even = t.to_bits() & 1 == 0;
    // Zero has no neighbour below, so that its interval includes its begin.
    if is_even { begin <= distance && distance <= end } else { begin < distance && distance < end }
}

fn vector(p: Vec3) -> Vector {
    p.to_array().map(whole)
}

fn difference(p: &Vector, q: &Vector) -> Vector {
    [0, 1, 2].map(|i| &p[i] - &q[i])
}

fn cross(p: &Vector, q: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &p[i] * &q[j] - &p[j] * &q[i])
}

fn dot(p: &Vector, q: &Vector) -> BigInt {
    &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::{Aabb, Node};

    fn pair(a: Aabb) -> Bvh {
        Bvh {
            nodes: vec![Node::inner(a, 1, 2), Node::leaf(a, 0, 1), Node::leaf(a, 1, 1)],
            prim_ids: vec![0, 1],
        }
    }

    #[test]
    fn small_whole_areas_are_those_of_f64() {
        let tree = pair(Aabb::from(([-1.0, 2.0, 0.5], [3.0, 2.25, 8.0])));
        assert_eq!(
            relative_error(bvh_core::cost::internal_area(&tree), &internal_area(&tree)),
            0.0
        );
    }

    #[test]
    fn the_smallest_and_the_largest_box_are_exact() {
        let tiny = f32::from_bits(1);
        let exact = internal_area(&pair(Aabb::from(([0.0; 3], [tiny; 3]))));
        assert_eq!(exact, BigUint::from(3u8));
        let exact = internal_area(&pair(Aabb::from(([f32::MIN; 3], [f32::MAX; 3]))));
        let side = (BigUint::from((1u32 << 24) - 1) << 104u32) * 2u8;
        assert_eq!(exact, (&side * &side * 3u8) << UNIT);
    }

    #[test]
    fn an_error_of_one_bit_is_seen() {
        let tree = pair(Aabb::from(([0.0; 3], [1.0; 3])));
        let error = relative_error(3f64.next_up(), &internal_area(&tree));
        assert_eq!(error, (3f64.next_up() - 3.0) / 3.0);
        assert_eq!(relative_error(f64::NAN, &internal_area(&tree)), f64::INFINITY);
        assert_eq!(relative_error(0.0, &BigUint::zero()), 0.0);
    }

    /// Returns the distances, of a few around the real one, that count as the rounded one.
    fn accepted(origin: f32, direction: f32, plane: f32) -> Vec<f32> {
        let triangle =
            Triangle([[0.0, 0.0, plane], [1.0, 0.0, plane], [0.0, 1.0, plane]].map(Vec3::from));
        let ray = Ray::half_line([0.25, 0.25, origin], [0.0, 0.0, direction]).unwrap();
        let real = ((f64::from(plane) - f64::from(origin)) / f64::from(direction)) as f32;
        [real.next_down(), real, real.next_up(), 0.0]
            .into_iter()
            .filter(|&t| is_rounded_distance(&ray, &triangle, t))
            .collect()
    }

    #[test]
    fn one_number_is_the_rounded_distance() {
        assert_eq!(accepted(0.0, 3.0, 1.0), [1.0 / 3.0]);
        assert_eq!(accepted(0.0, -3.0, -1.0), [1.0 / 3.0]);
        assert_eq!(accepted(0.1, 1.0, 0.3), [0.3f32 - 0.1]);
        assert_eq!(accepted(-1e30, 1e-10, 1.0), [0.0; 0]);
    }

    #[test]
    fn a_distance_in_the_middle_rounds_to_even() {
        // 2^24 + 1 and 2^24 + 3 are in the middle between two f32.
        assert_eq!(accepted(-1.0, 1.0, 16_777_216.0), [16_777_216.0]);
        assert_eq!(accepted(-3.0, 1.0, 16_777_216.0), [16_777_220.0]);
    }

    #[test]
    fn planes_behind_the_origin_and_around_the_ray_have_no_distance() {
        assert_eq!(accepted(2.0, 1.0, 1.0), [0.0; 0]);
        let triangle = Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
        let ray = Ray::half_line([0.1, 0.1, 0.0], [1.0, 0.0, 0.0]).unwrap();
        assert!(!is_rounded_distance(&ray, &triangle, 0.0));
    }
}
