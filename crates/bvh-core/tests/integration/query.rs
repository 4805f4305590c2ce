//! Every query gives the answer of examining every object, for any tree.

use crate::support::{Random, SHAPES};
use bvh_core::query::{self, Near, Region};
use bvh_core::{Aabb, Bvh, Sphere, Triangle, validate};
use glam::Vec3;
use proptest::prelude::*;
use std::ops::ControlFlow;

fn point() -> impl Strategy<Value = Vec3> {
    // Integers, so that distances are often equal.
    let coordinate = prop_oneof![-8.0f32..8.0, (-4i8..4).prop_map(f32::from)];
    prop::array::uniform3(coordinate).prop_map(Vec3::from_array)
}

fn small_triangle() -> impl Strategy<Value = Triangle> {
    let corners_and_size = (point(), point(), point(), 0.0f32..0.3);
    corners_and_size
        .prop_map(|(a, b, c, size)| Triangle([a, a + (b - a) * size, a + (c - a) * size]))
}

fn triangles() -> impl Strategy<Value = Vec<Triangle>> {
    prop::collection::vec(small_triangle(), 0..40)
}

/// Makes a tree whose shape depends on the number of triangles.
fn tree(triangles: &[Triangle]) -> Bvh {
    let boxes = crate::support::boxes(triangles);
    let shape = SHAPES[boxes.len() % SHAPES.len()];
    let tree = crate::support::tree(&boxes, shape, &mut Random(boxes.len() as u64));
    validate(&tree, &boxes).unwrap();
    tree
}

/// Checks that the tree gives the same objects as examining every object by its box.
fn check_region(triangles: &[Triangle], region: &impl Region) {
    let mut found = Vec::new();
    query::overlapping(&tree(triangles), region, |object| -> ControlFlow<()> {
        if region.may_meet(&triangles[object as usize].aabb()) {
            found.push(object);
        }
        ControlFlow::Continue(())
    });
    found.sort_unstable();
    let mut expected = Vec::new();
    for (object, triangle) in (0..).zip(triangles) {
        if region.may_meet(&triangle.aabb()) {
            expected.push(object);
        }
    }
    assert_eq!(found, expected);
}

proptest! {
    #[test]
    fn regions_find_the_objects_that_examining_every_object_finds(
        triangles in triangles(),
        (a, b) in (point(), point()),
        radius in -0.5f32..6.0,
    ) {
        check_region(&triangles, &Aabb { min: a.min(b), max: a.max(b) });
        check_region(&triangles, &a);
        check_region(&triangles, &Sphere::new(b, radius));
    }

    #[test]
    fn a_region_may_meet_every_box_that_has_one_of_its_points(
        (a, b, corner) in (point(), point(), point()),
        radius in 0.0f32..6.0,
    ) {
        let aabb = Aabb { min: corner.min(b), max: corner.max(b) };
        let region = Aabb { min: a.min(corner), max: a.max(corner) };
        prop_assert!(region.may_meet(&aabb) && corner.may_meet(&aabb));
        let far = Aabb { min: aabb.max + 1.0, max: aabb.max + 2.0 };
        prop_assert!(!aabb.may_meet(&far) && !far.max.may_meet(&aabb));
        // Three corners of the box, which are in it without rounding.
        for inside in [corner, b, Vec3::new(corner.x, b.y, corner.z)] {
            let distance = inside.as_dvec3().distance(a.as_dvec3());
            if distance <= f64::from(radius) {
                prop_assert!(Sphere::new(a, radius).may_meet(&aabb));
            }
        }
        let touching = Sphere::new(aabb.max + Vec3::X * (radius + 1.0), radius);
        prop_assert!(!touching.may_meet(&aabb));
    }

    #[test]
    fn the_nearest_object_is_the_one_that_examining_every_object_finds(
        triangles in triangles(),
        point in point(),
        limit in prop_oneof![Just(f64::INFINITY), Just(f64::NAN), 0.0f64..30.0],
        every_skipped in 2u32..9,
    ) {
        let distance = |object: u32| {
            let closest = triangles[object as usize].closest_point(point);
            let is_skipped = object.is_multiple_of(every_skipped);
            (!is_skipped).then_some(closest.distance_squared(point.as_dvec3()))
        };
        let mut expected: Option<Near> = None;
        for object in 0..triangles.len() as u32 {
            if let Some(distance_squared) = distance(object)
                && distance_squared <= limit
                && expected.is_none_or(|nearest| distance_squared < nearest.distance_squared)
            {
                expected = Some(Near { object, distance_squared });
            }
        }
        prop_assert_eq!(query::nearest(&tree(&triangles), point, limit, distance), expected);
    }

    #[test]
    fn no_point_of_a_triangle_is_closer_than_the_closest(
        corners in prop::array::uniform3(point()),
        point in point(),
    ) {
        let triangle = Triangle(corners);
        let closest = triangle.closest_point(point);
        let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
        let distance = closest.distance(point.as_dvec3());
        for i in 0..=16 {
            for j in 0..=16 - i {
                let u = f64::from(i) / 16.0;
                let v = f64::from(j) / 16.0;
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

#[test]
fn a_visit_that_breaks_ends_the_query() {
    let mut triangles = Vec::new();
    for i in (0..20u8).map(f32::from) {
        triangles.push(Triangle([Vec3::splat(i), Vec3::X * i, Vec3::ONE]));
    }
    let mut visits = 0;
    let everything = Aabb { min: Vec3::splat(f32::MIN), max: Vec3::splat(f32::MAX) };
    let broken = query::overlapping(&tree(&triangles), &everything, |object| {
        visits += 1;
        if visits == 3 { ControlFlow::Break(object) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(visits, 3);
    assert!(broken.is_some());
}

#[test]
fn of_objects_that_contain_the_point_the_first_is_nearest() {
    let triangle = Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
    for count in 2..40 {
        let nearest = query::nearest(&tree(&vec![triangle; count]), Vec3::X, 0.0, |_| Some(0.0));
        assert_eq!(nearest, Some(Near { object: 0, distance_squared: 0.0 }), "{count}");
    }
}
