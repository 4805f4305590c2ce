//! Hits and distances agree with real arithmetic, rounded once: a comparison with exact rationals.

use crate::support::rational::{distance, is_rounded_to, normal, zero};
use crate::support::{Random, size};
use bvh_core::{PreparedRay, Ray, Triangle};
use glam::Vec3;
use proptest::prelude::*;

/// Compares one ray and one triangle. Returns whether the ray hits.
fn check(ray: &Ray, triangle: &Triangle) -> bool {
    let corners = triangle.0.map(Vec3::as_dvec3);
    let real = distance([ray.origin(), ray.direction()].map(Vec3::as_dvec3), corners);
    // Without a range.
    let whole = Ray::half_line(ray.origin(), ray.direction()).unwrap();
    let found = triangle.intersect(&PreparedRay::new(&whole), f32::MAX);
    let t = found.unwrap_or(f32::INFINITY);
    // Beyond the largest f32, infinity takes the place of 2¹²⁸.
    let size = |x: f32| if x.is_finite() { f64::from(x) } else { 2f64.powi(128) };
    let above = if t.is_finite() { size(t.next_up()) } else { f64::INFINITY };
    let is_right = match &real {
        Some(real) => {
            let is_even = t.to_bits() & 1 == 0;
            is_rounded_to(real, [size(t.next_down()), size(t), above], is_even)
                && t.is_sign_positive()
        }
        None => found.is_none(),
    };
    assert!(is_right, "{found:?} {real:?} {ray:?} {triangle:?}");
    let in_range = triangle.intersect(&PreparedRay::new(ray), ray.t_max());
    assert_eq!(in_range, found.filter(|&t| ray.t_min() <= t && t <= ray.t_max()), "{ray:?}");
    let is_degenerate = normal(corners).iter().all(|x| x == &zero());
    assert_eq!(triangle.is_degenerate(), is_degenerate, "{triangle:?}");
    in_range.is_some()
}

/// Returns a number of any size, subnormal numbers and zeros included, or one of a few values, so
/// that values coincide.
fn number(random: &mut Random) -> f32 {
    match random.below(8) {
        0 => 0.0,
        1 => -0.0,
        2 => f32::from_bits((random.bits() as u32) & 0x807f_ffff),
        3 => f32::from_bits((random.bits() as u32) & 0x807f_ffff | 0x7f00_0000),
        4 | 5 => (random.below(9) as f32 - 4.0) * 0.25,
        6 => random.unit() * 2.0 - 1.0,
        _ => loop {
            let x = f32::from_bits(random.bits() as u32);
            if x.is_finite() {
                break x;
            }
        },
    }
}

fn wild_point(random: &mut Random) -> Vec3 {
    Vec3::new(number(random), number(random), number(random))
}

/// Returns a point at or next to an edge, a corner, the inside or the plane of the triangle, in
/// f32.
fn target(triangle: &Triangle, random: &mut Random) -> Vec3 {
    let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
    let s = random.of(&[0.0, 0.5, 1.0, 0.25, 1.0 / 3.0, 0.1, 1.5]);
    let r = f64::from(random.unit());
    let point = match random.below(5) {
        0 => a,
        1 => a + (b - a) * s,
        2 => b + (c - b) * r,
        3 => a + (b - a) * (0.5 * r) + (c - a) * (0.5 * s),
        _ => (a + b + c) / 3.0,
    };
    let mut point = point.as_vec3();
    if random.below(3) == 0 {
        let axis = random.below(3);
        point[axis] =
            if random.below(2) == 0 { point[axis].next_up() } else { point[axis].next_down() };
    }
    point
}

/// Returns rays towards points where the decision is hard.
fn hard_ray(triangle: &Triangle, random: &mut Random) -> Option<Ray> {
    let [a, b, c] = triangle.0;
    let size = size(std::slice::from_ref(triangle));
    let target = target(triangle, random);
    let mut axis_parallel = Vec3::ZERO;
    axis_parallel[random.below(3)] = random.of(&[1.0, -1.0, 0.125, 3.0]);
    let power = libm::exp2f(random.below(41) as f32 - 20.0);
    let (origin, direction) = match random.below(9) {
        // From anywhere. The ray misses the target slightly, because the direction is rounded.
        0 => {
            let origin = random.point() * size * random.of(&[0.0, 1.0, 100.0, 1e6]);
            (origin, target - origin)
        }
        // Through the target exactly, along an axis.
        1 => (target - axis_parallel * size, axis_parallel),
        2 => (target, random.point()),
        // Along an edge, and in the plane.
        3 => (a - (b - a), b - a),
        4 => (a, c - b),
        // Exactly through the target, if the sums are exact.
        5 => {
            let step =
                Vec3::new(1.0, random.below(5) as f32 - 2.0, 0.5 * random.below(5) as f32 - 1.0);
            (target - step * power * size, step)
        }
        // Close to the triangle, nearly in its plane.
        6 => {
            let origin = target + random.point() * size * 1e-6;
            (origin, b - a + random.point() * size * 1e-6)
        }
        7 => (wild_point(random), wild_point(random)),
        _ => (target + (target - a) * 2.0, a - target),
    };
    let direction = direction * random.of(&[1.0, 1.0, 1e-20, 1e20]);
    let (t_min, t_max) =
        random.of(&[(0.0, f32::MAX), (0.0, f32::MAX), (1.0, 1.0), (0.5, 2.0), (0.0, 0.0)]);
    Ray::new(origin, direction, t_min, t_max).ok()
}

/// Returns triangles of many kinds, at many scales.
fn hard_triangle(random: &mut Random) -> Triangle {
    let scale = match random.below(4) {
        0 => 1.0,
        1 => libm::exp2f(random.below(241) as f32 - 120.0),
        2 => libm::exp2f(random.below(20) as f32 - 149.0),
        _ => 0.0625,
    };
    let grid = |random: &mut Random| {
        Vec3::new(random.below(5) as f32, random.below(5) as f32, random.below(5) as f32) - 2.0
    };
    let corners = match random.below(6) {
        0 => [random.point(), random.point(), random.point()],
        1 => [grid(random), grid(random), grid(random)],
        // Nearly degenerate.
        2 => {
            let a = random.point();
            let b = random.point();
            [a, b, a + (b - a) * random.unit()]
        }
        3 => {
            let a = random.point() * 1e3;
            [a, a + random.point() * 1e-3, a + random.point() * 1e-3]
        }
        4 => {
            let z = random.unit();
            [0, 1, 2].map(|_| Vec3::new(random.unit(), random.below(3) as f32, z))
        }
        _ => return Triangle([wild_point(random), wild_point(random), wild_point(random)]),
    };
    Triangle(corners.map(|corner| corner * scale))
}

#[test]
fn hard_rays_hit_where_real_arithmetic_says_at_the_real_distance_rounded_once() {
    let mut random = Random(1);
    let mut hits = 0;
    for _ in 0..5000 {
        let triangle = hard_triangle(&mut random);
        for _ in 0..4 {
            if let Some(ray) = hard_ray(&triangle, &mut random) {
                hits += usize::from(check(&ray, &triangle));
            }
        }
    }
    assert!(hits > 1500, "{hits}");
}

#[test]
fn a_triangle_behind_the_origin_is_not_hit_however_little() {
    let sheet = |z: f32| Triangle::from([[-1.0, -1.0, z], [3.0, -1.0, z], [-1.0, 3.0, z]]);
    let least = f32::from_bits(1);
    for (z, length, expected) in [
        (0.0, 1.0, Some(0.0)),
        (-0.0, 1.0, Some(0.0)),
        (least, 1.0, Some(least)),
        (least, 2.0, Some(0.0)),
        (3.0 * least, 2.0, Some(2.0 * least)),
        (least, 1e30, Some(0.0)),
        (-least, 1.0, None),
        (-least, 1e30, None),
        (f32::MAX, 1.0, Some(f32::MAX)),
        (f32::MAX, 0.5, None),
    ] {
        let ray = Ray::half_line([0.1, 0.2, 0.0], [0.0, 0.0, length]).unwrap();
        let found = sheet(z).intersect(&PreparedRay::new(&ray), f32::MAX);
        assert_eq!(found.map(f32::to_bits), expected.map(f32::to_bits), "{z:e} {length:e}");
        check(&ray, &sheet(z));
    }
}

#[test]
fn triangles_with_a_corner_that_is_not_finite_are_never_hit() {
    let corners =
        [Vec3::new(-1.0, -1.0, 1.0), Vec3::new(3.0, -1.0, 1.0), Vec3::new(-1.0, 3.0, 1.0)];
    let ray = Ray::half_line([0.1, 0.2, 0.0], [0.0, 0.0, 1.0]).unwrap();
    assert!(check(&ray, &Triangle(corners)));
    for corner in 0..3 {
        for axis in 0..3 {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut corners = corners;
                corners[corner][axis] = bad;
                assert_eq!(Triangle(corners).intersect(&PreparedRay::new(&ray), f32::MAX), None);
            }
        }
    }
}

proptest! {
    #[test]
    fn any_ray_and_any_triangle_agree_with_real_arithmetic(bits in prop::array::uniform15(any::<u32>()), range in any::<u32>()) {
        let numbers = bits.map(f32::from_bits);
        let point = |i: usize| Vec3::new(numbers[i], numbers[i + 1], numbers[i + 2]);
        let triangle = Triangle([point(0), point(3), point(6)]);
        let is_finite = numbers.iter().all(|x| x.is_finite());
        let t_max = f32::from_bits(range);
        if is_finite && let Ok(ray) = Ray::new(point(9), point(12), 0.0, t_max) {
            check(&ray, &triangle);
        }
    }
}
