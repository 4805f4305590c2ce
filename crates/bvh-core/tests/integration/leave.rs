//! Rays that leave a triangle do not hit it again, and begin close to it.

use crate::support::layouts::by_kernel;
use crate::support::{Random, scaled, soup};
use bvh_core::{Bvh, Node, PreparedRay, Ray, Triangle, WideBvh};
use glam::Vec3;

#[test]
fn no_kernel_hits_a_triangle_again_that_a_ray_has_left() {
    let mut random = Random(1);
    let mut rays = 0;
    for exponent in [-60, 0, 60] {
        let scale = libm::exp2f(exponent as f32);
        for far in [0.0, 30.0, 1e5] {
            for triangle in scaled(&soup(300, &mut random), scale) {
                let corners = triangle.0.map(|corner| corner + far * scale);
                // Slivers, too.
                let thin = corners[0] + (corners[2] - corners[0]) * 1e-3;
                for triangle in [Triangle(corners), Triangle([corners[0], corners[1], thin])] {
                    rays += leave(&triangle, &mut random);
                }
            }
        }
    }
    assert!(rays > 50_000, "{rays}");
}

#[test]
fn no_ray_hits_a_sliver_again_as_thin_as_is_promised() {
    let mut random = Random(2);
    let mut rays = 0;
    for _ in 0..20_000 {
        // In the plane x + y + z = 0, up to the rounding of its corners, of which two directions
        // are almost the same.
        let along = random.point();
        let along = along - along.element_sum() / 3.0;
        let across = along.cross(Vec3::ONE).normalize_or_zero() * along.length();
        let far = along * -random.unit() + across * random.unit() * libm::exp2f(-25.0);
        let triangle = Triangle([Vec3::ZERO, along, far]);
        let [b, c] = [along, far].map(Vec3::as_dvec3);
        let scale = b.abs().max(c.abs()).max_element();
        if b.cross(c).length() < 2f64.powi(-29) * scale * scale {
            continue;
        }
        rays += leave(&triangle, &mut random);
    }
    assert!(rays > 50_000, "{rays}");
}

/// Tests rays from a triangle. Returns their number.
fn leave(triangle: &Triangle, random: &mut Random) -> usize {
    let Some(normal) = triangle.normal() else { return 0 };
    let leaf = Node::leaf(triangle.aabb(), 0, 1);
    let tree = Bvh { nodes: vec![leaf], prim_ids: vec![0] };
    let wide = by_kernel(&WideBvh::new(&tree, &[*triangle]).unwrap());
    let mut tested = 0;
    for _ in 0..10 {
        let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
        let [mut u, mut v] = [random.unit(), random.unit()].map(f64::from);
        if u + v > 1.0 {
            [u, v] = [1.0 - u, 1.0 - v];
        }
        let point = a + (b - a) * u + (c - a) * v;
        let side = normal * random.of(&[1.0, -1.0]);
        let origin = triangle.leave(point, side);
        let size = (b - a).length().max((c - a).length());
        let near = 2f64.powi(-17) * (size + point.length());
        assert!(origin.as_dvec3().distance(point) < near, "{triangle:?} {point}");
        // In every direction of the side, also almost along the plane.
        let other = random.point();
        let along = other - normal * other.dot(normal);
        for lift in [1.0, 1e-2, 1e-5] {
            let direction = along + side * (along.length() * lift);
            let exact = triangle_normal(triangle).dot(direction.as_dvec3());
            if exact * f64::from(side.dot(normal)) <= 0.0 {
                continue;
            }
            let Ok(ray) = Ray::half_line(origin, direction) else { continue };
            tested += 1;
            assert_eq!(
                triangle.intersect(&PreparedRay::new(&ray), f32::MAX),
                None,
                "{triangle:?} {ray:?}"
            );
            for (kernel, wide) in &wide {
                assert_eq!(wide.nearest_hit(&ray), None, "{kernel:?} {triangle:?} {ray:?}");
                assert_eq!(wide.all_hits(&ray), [], "{kernel:?} {triangle:?} {ray:?}");
            }
        }
    }
    tested
}

fn triangle_normal(triangle: &Triangle) -> glam::DVec3 {
    let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}
