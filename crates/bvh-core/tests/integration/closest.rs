//! Closest points by the wide layout agree with a test of every triangle.

use crate::support::layouts::{by_kernel, layout};
use crate::support::{Random, SHAPES, ball, grid_box, scaled, soup};
use bvh_core::{Triangle, WideBvh};
use glam::Vec3;
use proptest::prelude::*;

proptest! {
    #[test]
    fn no_point_of_a_triangle_is_closer_than_the_closest(
        corners in prop::array::uniform3(prop::array::uniform3(-4i8..4)),
        point in prop::array::uniform3(-8.0f32..8.0).prop_map(Vec3::from),
    ) {
        // Integers, so that many triangles are thin or without area.
        let triangle = Triangle::from(corners.map(|corner| corner.map(f32::from)));
        let closest = triangle.closest_point(point);
        let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
        let distance = closest.distance(point.as_dvec3());
        for i in 0..=16 {
            for j in 0..=16 - i {
                let [u, v] = [i, j].map(|part| f64::from(part) / 16.0);
                let other = a * (1.0 - u - v) + b * u + c * v;
                prop_assert!(distance <= other.distance(point.as_dvec3()) + 1e-9, "{closest} {other}");
            }
        }
        // A point outside of the triangle could be closer, so the point must be in its box.
        let aabb = triangle.aabb();
        let slack = glam::DVec3::splat(1e-6);
        let above = closest.cmpge(aabb.min.as_dvec3() - slack);
        let below = closest.cmple(aabb.max.as_dvec3() + slack);
        prop_assert!((above & below).all());
    }
}

/// Returns the squared distance of the nearest triangle with an area, and the lowest id of the
/// triangles at this distance.
fn brute_force(triangles: &[Triangle], point: Vec3) -> (f64, u32) {
    let mut nearest = (f64::INFINITY, u32::MAX);
    for (id, triangle) in (0..).zip(triangles) {
        let closest = triangle.closest_point(point);
        let distance = closest.distance_squared(point.as_dvec3());
        if !triangle.is_degenerate() && distance < nearest.0 {
            nearest = (distance, id);
        }
    }
    nearest
}

#[test]
fn the_closest_point_is_as_close_as_that_of_any_triangle_at_every_scale() {
    let mut random = Random(1);
    for exponent in [-120, -60, 0, 60, 100, 110, 120, 126] {
        let scale = libm::exp2f(exponent as f32);
        // All of the last scene is on one side of zero, and the largest point far on the other.
        let aside =
            soup(150, &mut random).iter().map(|t| Triangle(t.0.map(|p| -p.abs()))).collect();
        for scene in [soup(150, &mut random), ball(3), grid_box(3), aside] {
            let triangles = scaled(&scene, scale);
            let corner = random.of(&triangles).0[1];
            let distant = Vec3::splat((9.0 * scale).min(f32::MAX));
            let mut points = vec![corner, Vec3::ZERO, distant, Vec3::MAX, Vec3::MIN];
            points.extend((0..200).map(|_| random.point() * 1.5 * scale));
            points.extend((0..20).map(|_| random.point() * Vec3::MAX));
            for shape in 0..=SHAPES.len() {
                let mut closest = vec![None; points.len()];
                let wide = layout(&triangles, shape);
                wide.closest_points(&points, &mut closest);
                for (kernel, wide) in by_kernel(&wide) {
                    let mut same = vec![None; points.len()];
                    wide.closest_points(&points, &mut same);
                    assert_eq!(same, closest, "{kernel:?}, 2^{exponent}");
                }
                for (&point, closest) in points.iter().zip(closest) {
                    let found = closest.unwrap();
                    let expected = brute_force(&triangles, point).0.sqrt();
                    let slack = 1e-13 * expected.max(f64::from(scale));
                    assert!((found.distance - expected).abs() <= slack, "{point}: {found:?}");
                    let offset = found.point - point.as_dvec3();
                    assert!(
                        (offset.length() - found.distance).abs() <= slack,
                        "{point}: {found:?}"
                    );
                    let on = triangles[found.object as usize].closest_point(point);
                    assert_eq!(on, found.point);
                }
            }
        }
    }
}

/// Returns a point whose coordinates have any exponents.
fn point_of_any_bits(random: &mut Random) -> Vec3 {
    loop {
        let point = Vec3::from_array(std::array::from_fn(|_| f32::from_bits(random.bits() as u32)));
        if point.is_finite() {
            return point;
        }
    }
}

#[test]
fn triangles_of_any_bits_are_compared_as_if_each_were_alone() {
    let mut random = Random(2);
    for _ in 0..200 {
        let triangles: Vec<Triangle> = (0..40)
            .map(|_| Triangle(std::array::from_fn(|_| point_of_any_bits(&mut random))))
            .collect();
        let alone: Vec<WideBvh> =
            triangles.iter().map(|&triangle| layout(&[triangle], 0)).collect();
        let layouts = by_kernel(&layout(&triangles, 0));
        for _ in 0..10 {
            let point = point_of_any_bits(&mut random);
            let distances = alone
                .iter()
                .filter_map(|wide| wide.closest_point(point))
                .map(|closest| closest.distance);
            let least = distances.fold(f64::INFINITY, f64::min);
            for (_, wide) in &layouts {
                let found = wide.closest_point(point).unwrap();
                assert_eq!(found.distance, least, "{point}");
                let same = alone[found.object as usize].closest_point(point);
                assert_eq!(same.map(|same| same.point), Some(found.point));
            }
        }
    }
}

#[test]
fn triangles_with_the_same_closest_point_tie_to_the_lowest_id() {
    let triangles = grid_box(4);
    // Multiples of one eighth: every distance is exact.
    let mut points = Vec::new();
    for i in 0..1000 {
        points
            .push(Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) / 4.0 - 1.25);
    }
    for shape in 0..SHAPES.len() {
        let wide = layout(&triangles, shape);
        for &point in &points {
            let found = wide.closest_point(point).unwrap();
            assert_eq!(found.object, brute_force(&triangles, point).1, "{point}");
        }
    }
    // The corners of a ball are on no grid, and its triangles meet in them.
    let triangles = ball(3);
    let wide = layout(&triangles, 0);
    for corner in triangles.iter().flat_map(|triangle| triangle.0) {
        let first = triangles.iter().position(|triangle| triangle.0.contains(&corner));
        let found = wide.closest_point(corner).unwrap();
        assert_eq!((Some(found.object as usize), found.distance), (first, 0.0));
    }
}
