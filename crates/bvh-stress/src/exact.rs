//! Exact arithmetic: the internal area of trees, the reference for reported costs.

use bvh_core::Bvh;
use num_bigint::{BigInt, BigUint};
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
}
