//! Exact arithmetic: the internal area of trees, the reference for reported costs.

use bvh_core::{Aabb, Bvh};
use num_bigint::BigInt;
use num_traits::float::FloatCore;
use num_traits::{Signed, ToPrimitive, Zero};

/// Every f32 is an integer multiple of 2^-150, hence a product of two differences is an integer
/// multiple of 2^-300.
const UNIT: i16 = 150;
/// Every f64 is an integer multiple of 2^-1075.
const UNIT_F64: i16 = 1075;

/// Returns a number by its parts in units of 2^-`unit`.
fn in_units((size, exponent, sign): (u64, i16, i8), unit: i16) -> BigInt {
    (BigInt::from(size) << (exponent + unit)) * sign
}

/// Returns the exact [`bvh_core::cost::internal_area`] of a valid tree in units of 2^-300.
/// O(nodes).
pub fn internal_area(tree: &Bvh) -> BigInt {
    tree.nodes.iter().filter(|node| !node.is_leaf()).map(|node| half_area(&node.aabb)).sum()
}

fn half_area(aabb: &Aabb) -> BigInt {
    let whole = |x: f32| in_units(x.integer_decode(), UNIT);
    let [x, y, z] = [0, 1, 2].map(|axis| whole(aabb.max[axis]) - whole(aabb.min[axis]));
    &x * &y + &y * &z + &z * &x
}

/// Returns |cost − exact| / exact, with `exact` in units of 2^-300.
///
/// 0 if both are 0; infinite if only one is 0, or if the cost is negative or not finite.
pub fn relative_error(cost: f64, exact: &BigInt) -> f64 {
    if !(cost.is_finite() && cost >= 0.0) {
        return f64::INFINITY;
    }
    let exact = exact << (UNIT_F64 - 2 * UNIT);
    let difference = (in_units(cost.integer_decode(), UNIT_F64) - &exact).abs();
    if difference.is_zero() {
        return 0.0;
    }
    if exact.is_zero() {
        return f64::INFINITY;
    }
    // Units of 2^-200 are far below the rounding of any ratio that is not tiny.
    ((difference << 200u32) / exact).to_f64().unwrap_or(f64::INFINITY) / 2f64.powi(200)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::{Aabb, Node};

    fn pair(a: Aabb) -> Bvh {
        Bvh::new(vec![Node::inner(a, 1, 2), Node::leaf(a, 0, 1), Node::leaf(a, 1, 1)], vec![0, 1])
    }

    #[test]
    fn the_smallest_and_the_largest_box_are_exact() {
        let tiny = f32::from_bits(1);
        let exact = internal_area(&pair(Aabb::from(([0.0; 3], [tiny; 3]))));
        assert_eq!(exact, BigInt::from(3) << 2);
        let exact = internal_area(&pair(Aabb::from(([f32::MIN; 3], [f32::MAX; 3]))));
        let side = BigInt::from((1u32 << 24) - 1) << 105u32;
        assert_eq!(exact, (&side * &side * 3) << (2 * UNIT));
    }

    #[test]
    fn an_error_of_one_bit_is_seen() {
        let exact = internal_area(&pair(Aabb::from(([-1.0, 2.0, 0.5], [0.0, 4.0, 1.0]))));
        // Sides of 1, 2 and a half.
        assert_eq!(relative_error(3.5, &exact), 0.0);
        assert_eq!(relative_error(3.5f64.next_up(), &exact), (3.5f64.next_up() - 3.5) / 3.5);
        assert_eq!(relative_error(f64::NAN, &exact), f64::INFINITY);
        assert_eq!(relative_error(0.0, &BigInt::zero()), 0.0);
    }
}
