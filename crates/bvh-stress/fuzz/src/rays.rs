//! Rays and triangles of arbitrary bits: compares every traversal with testing every object.

use super::bytes::Bytes;
use bvh_build::{Builder, goldsmith_salmon, muller_fellner};
use bvh_core::{
    Aabb, Primitives, Ray, Sphere, Triangle, any_hit_by, clip_to_box, nearest_hit_by,
    nearest_hit_of_all,
};
use bvh_scenes::trace::kd_tree;
use bvh_stress::tracing::{TRAVERSALS, bits, check};
use glam::Vec3;

/// Reads a mode, the number of triangles, an exponent, then triangles, then rays.
pub fn rays(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let [mode, count, exponent] = bytes.take();
    let few = mode & 1 == 0;
    let few_in_rays = mode & 2 == 0;
    let scale = f32::from_bits(u32::from(exponent.clamp(1, 254)) << 23);
    let scale = if mode & 4 == 0 { 1.0 } else { scale };
    let triangles: Vec<Triangle> = (0..count % 12)
        .map(|_| Triangle([(); 3].map(|()| finite(bytes.point(few) * scale))))
        .collect();
    let mut rays = Vec::new();
    while !bytes.0.is_empty() && rays.len() < 8 {
        let origin = bytes.point(few_in_rays) * if few_in_rays { scale } else { 1.0 };
        let direction = bytes.point(few_in_rays);
        let t_min = bytes.number(few_in_rays);
        let t_max = bytes.number(few_in_rays);
        let range = if mode & 8 == 0 { (0.0, f32::INFINITY) } else { (t_min, t_max) };
        match Ray::new(origin, direction, range.0, range.1) {
            Ok(ray) => rays.push(ray),
            // A ray is rejected only for its direction's length, a NaN, or a negative start.
            Err(error) => assert!(
                !(origin + direction).is_finite()
                    || direction.abs().max_element() < 1e-30
                    || direction.abs().max_element() > 1e30
                    || range.1.is_nan()
                    || range.0.is_nan()
                    || range.0 < 0.0,
                "{error}"
            ),
        }
    }
    let objects = Primitives::Triangles(triangles.clone());
    for (name, traversal) in TRAVERSALS {
        check(*traversal, &objects, &rays).unwrap_or_else(|broken| panic!("{name}: {broken}"));
    }
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    // Spheres from the same bits test the traversal with another object test.
    let spheres: Vec<Sphere> =
        triangles.iter().map(|t| Sphere::new(t.0[0] / 4.0, t.0[1].x.abs() / 4.0)).collect();
    let around: Vec<Aabb> = spheres.iter().map(Sphere::aabb).collect();
    for ray in &rays {
        check_trees(&boxes, ray, |id, t_max| {
            clip_to_box(ray, &boxes[id as usize], ray.t_min(), t_max)
        });
        check_trees(&around, ray, |id, t_max| spheres[id as usize].intersect(ray, t_max));
    }
}

/// Replaces coordinates that are not finite, which every scene rejects.
fn finite(point: Vec3) -> Vec3 {
    point.map(|coordinate| if coordinate.is_finite() { coordinate } else { 0.0 })
}

/// Checks that trees and a KD-tree over the boxes give the answers of testing every object.
fn check_trees(boxes: &[Aabb], ray: &Ray, test: impl Fn(u32, f32) -> Option<f32>) {
    let expected = nearest_hit_of_all(boxes.len() as u32, ray, &test, &mut ());
    let any = |id: u32| test(id, ray.t_max()).is_some();
    for builder in
        [&muller_fellner::Config::default() as &dyn Builder, &goldsmith_salmon::Config::default()]
    {
        let tree = builder.build(boxes).unwrap();
        assert_eq!(bits(nearest_hit_by(&tree, ray, &test, &mut ())), bits(expected), "{ray:?}");
        assert_eq!(any_hit_by(&tree, ray, any, &mut ()), expected.is_some(), "{ray:?}");
    }
    let cells = kd_tree::Config::default().build(boxes).unwrap();
    assert_eq!(bits(cells.nearest_hit(ray, &test, &mut ())), bits(expected), "KD-tree: {ray:?}");
    assert_eq!(cells.any_hit(ray, any, &mut ()), expected.is_some(), "KD-tree: {ray:?}");
}
