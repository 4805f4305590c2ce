//! All hits of a ray: each crossing of a surface once, and a parity that is right on closed meshes
//! for rays through edges and corners.

use crate::support::layouts::layout;
use crate::support::{Random, closed_meshes};
use bvh_core::{PreparedRay, Ray, Triangle};
use glam::Vec3;
use num_bigint::{BigInt, Sign};

/// A point outside of all closed meshes.
const OUTSIDE: Vec3 = Vec3::new(7.0, -5.5, 6.25);

/// Returns rays from `origin` through corners, edges and centres of the triangles.
fn rays_through(
    triangles: &[Triangle],
    origin: Vec3,
    count: usize,
    random: &mut Random,
) -> Vec<Ray> {
    let mut rays = Vec::new();
    while rays.len() < count {
        let Triangle([a, b, c]) = random.of(triangles);
        let on_edge = a + (c - a) * random.unit();
        let target = random.of(&[a, (a + b) / 2.0, on_edge, (a + b + c) / 3.0]);
        // Every other ray is parallel to an axis through its target or along an edge.
        let mut axis = Vec3::ZERO;
        axis[random.below(3)] = random.of(&[1.0, -1.0]);
        let (origin, direction) = match random.below(4) {
            0 => (target - 8.0 * axis, axis),
            1 => (a - 8.0 * (b - a), b - a),
            _ => (origin, target - origin),
        };
        rays.extend(Ray::half_line(origin, direction));
    }
    rays
}

#[test]
fn a_half_line_crosses_a_closed_mesh_an_odd_number_of_times_from_inside_only() {
    let mut random = Random(4);
    for (name, triangles, inside) in closed_meshes() {
        let wide = layout(&triangles, 0);
        for (origin, parity) in [(inside, 1), (OUTSIDE, 0)] {
            let rays = rays_through(&triangles, origin, 10_000, &mut random);
            let mut counts = vec![0; rays.len()];
            wide.all_hits_of(&rays, &mut Vec::new(), &mut counts);
            for (ray, count) in rays.iter().zip(counts) {
                let expected = if ray.origin() == origin { parity } else { 0 };
                // Rays along short edges may begin anywhere.
                if ray.origin() == origin || ray.origin().abs().max_element() > 4.0 {
                    assert_eq!(count % 2, expected, "{name}: {count} hits of {ray:?}");
                }
            }
        }
    }
}

/// The exponent of ε: with K bits for each of its powers, ε is less than any exact value of the
/// test.
const K: usize = 1000;

/// Returns `x · 2^149`.
fn integer(x: f32) -> BigInt {
    let bits = x.to_bits();
    let exponent = bits >> 23 & 0xff;
    let fraction = bits & 0x7f_ffff | if exponent > 0 { 1 << 23 } else { 0 };
    let size = BigInt::from(fraction) << exponent.saturating_sub(1);
    if x.is_sign_negative() { -size } else { size }
}

/// Returns whether the line of the ray crosses the inside of the triangle in exact arithmetic,
/// after the origin has been moved by (ε, ε², ε³).
fn is_crossed(ray: &Ray, triangle: &Triangle) -> bool {
    let direction = ray.direction().to_array().map(integer);
    let origin = ray.origin().to_array().map(|x| integer(x) << (3 * K));
    let [x, y, z] = origin;
    let origin = [x + (BigInt::from(1) << (2 * K)), y + (BigInt::from(1) << K), z + 1];
    let corners = triangle.0.map(|corner| {
        let corner = corner.to_array().map(|x| integer(x) << (3 * K));
        [0, 1, 2].map(|axis| &corner[axis] - &origin[axis])
    });
    let side = |p: &[BigInt; 3], q: &[BigInt; 3]| -> Sign {
        [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
            .map(|(i, j, k)| &direction[i] * (&p[j] * &q[k] - &p[k] * &q[j]))
            .into_iter()
            .sum::<BigInt>()
            .sign()
    };
    let [a, b, c] = &corners;
    let sides = [side(c, b), side(a, c), side(b, a)];
    sides[0] != Sign::NoSign && sides.iter().all(|&side| side == sides[0])
}

#[test]
fn crossings_are_those_of_a_moved_origin_in_exact_arithmetic() {
    let crossed = compare_with_exact_arithmetic(24);
    assert!(crossed > 400, "{crossed}");
}

#[test]
#[ignore = "slow: a million rays against exact arithmetic take minutes"]
fn a_million_rays_cross_ten_closed_meshes_as_in_exact_arithmetic() {
    assert!(compare_with_exact_arithmetic(50_000) > 1_000_000);
}

/// Compares all triangles that so many rays from inside and from outside of each closed mesh meet
/// with exact arithmetic. Returns the number of crossings.
fn compare_with_exact_arithmetic(count: usize) -> usize {
    let mut random = Random(7);
    let mut crossed = 0;
    for (name, triangles, inside) in closed_meshes() {
        let wide = layout(&triangles, 0);
        for (origin, parity) in [(inside, 1), (OUTSIDE, 0)] {
            for ray in rays_through(&triangles, origin, count, &mut random) {
                let hits = wide.all_hits(&ray);
                if ray.origin() == origin {
                    assert_eq!(hits.len() % 2, parity, "{name}: {ray:?}");
                }
                for (object, triangle) in (0..).zip(&triangles) {
                    let case = || format!("{name}: {ray:?} {triangle:?}");
                    let hit = hits.iter().find(|hit| hit.object == object);
                    let met = triangle.intersect(&PreparedRay::new(&ray), f32::MAX);
                    assert!(hit.is_none_or(|hit| met == Some(hit.t)), "{}", case());
                    if met.is_some() {
                        assert_eq!(hit.is_some(), is_crossed(&ray, triangle), "{}", case());
                    }
                }
                crossed += hits.len();
            }
        }
    }
    crossed
}
