//! Every query answers as looking at every object does, whatever the tree.

mod support;

use bvh_core::query::{self, Frustum, Near, Region};
use bvh_core::{Aabb, Bvh, Hit, Ray, Shear, Sphere, Triangle, validate};
use glam::Vec3;
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use support::{Random, SHAPES};

fn point() -> impl Strategy<Value = Vec3> {
    let coordinate = || prop_oneof![-8.0f32..8.0, (-4i8..4).prop_map(f32::from)];
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn triangles() -> impl Strategy<Value = Vec<Triangle>> {
    let triangle = (point(), point(), point(), 0.0f32..1.0)
        .prop_map(|(a, b, c, size)| Triangle([a, a + (b - a) * size * 0.3, a + (c - a) * size * 0.3]));
    prop::collection::vec(triangle, 0..40)
}

/// A tree of a shape that depends on the number of triangles.
fn tree(triangles: &[Triangle]) -> Bvh {
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let tree = support::tree(&boxes, SHAPES[boxes.len() % SHAPES.len()], &mut Random(boxes.len() as u64));
    validate(&tree, &boxes).unwrap();
    tree
}

/// The objects that a region may meet by their own boxes, through the tree and without it.
fn check_region(triangles: &[Triangle], region: &impl Region) {
    let (mut found, mut twice) = (BTreeSet::new(), false);
    query::overlapping(&tree(triangles), region, |object| -> ControlFlow<()> {
        if region.may_meet(&triangles[object as usize].aabb()) {
            twice |= !found.insert(object);
        }
        ControlFlow::Continue(())
    });
    let brute_force = |&object: &u32| region.may_meet(&triangles[object as usize].aabb());
    assert!(!twice && found == (0..triangles.len() as u32).filter(brute_force).collect());
}

proptest! {
    #[test]
    fn regions_find_what_looking_at_every_object_finds(
        triangles in triangles(),
        (a, b) in (point(), point()),
        radius in -0.5f32..6.0,
        planes in prop::collection::vec((point(), -6.0f32..6.0), 0..6),
    ) {
        check_region(&triangles, &Aabb { min: a.min(b), max: a.max(b) });
        check_region(&triangles, &a);
        check_region(&triangles, &Sphere::new(b, radius));
        let planes = planes.into_iter().map(|(normal, d)| [normal.x, normal.y, normal.z, d]).collect();
        check_region(&triangles, &Frustum { planes });
    }

    #[test]
    fn a_region_may_meet_every_box_that_has_one_of_its_points(
        (a, b, at) in (point(), point(), point()),
        radius in 0.0f32..6.0,
        planes in prop::collection::vec((point(), -6.0f32..6.0), 0..6),
    ) {
        let aabb = Aabb { min: at.min(b), max: at.max(b) };
        // A point of the box, exactly: one of its corners, or `at` between them.
        let inside = [at, b, Vec3::new(at.x, b.y, at.z)];
        let region = Aabb { min: a.min(at), max: a.max(at) };
        prop_assert!(region.may_meet(&aabb) && at.may_meet(&aabb));
        let far = Aabb { min: aabb.max + 1.0, max: aabb.max + 2.0 };
        prop_assert!(!aabb.may_meet(&far) && !far.max.may_meet(&aabb));
        for p in inside {
            let distance = p.as_dvec3().distance(a.as_dvec3());
            if distance <= f64::from(radius) {
                prop_assert!(Sphere::new(a, radius).may_meet(&aabb));
            }
            let side = |(n, d): &(Vec3, f32)| n.as_dvec3().dot(p.as_dvec3()) + f64::from(*d);
            if planes.iter().all(|plane| side(plane) >= 0.0) {
                let frustum = Frustum { planes: planes.iter().map(|(n, d)| [n.x, n.y, n.z, *d]).collect() };
                prop_assert!(frustum.may_meet(&aabb));
            }
        }
        // A plane beyond which the whole box lies.
        let beyond = Frustum { planes: vec![[1.0, 0.0, 0.0, -aabb.max.x - 1.0]] };
        prop_assert!(!beyond.may_meet(&aabb));
        let touching = Sphere::new(aabb.max + Vec3::X * (radius + 1.0), radius);
        prop_assert!(!touching.may_meet(&aabb));
    }

    #[test]
    fn the_nearest_objects_are_those_that_sorting_all_distances_puts_first(
        triangles in triangles(),
        at in point(),
        k in 0usize..12,
        limit in prop_oneof![Just(f64::INFINITY), 0.0f64..30.0],
        left_out in 2u32..9,
    ) {
        let distance = |object: u32| {
            let distance = triangles[object as usize].closest_point(at).distance_squared(at.as_dvec3());
            (!object.is_multiple_of(left_out)).then_some(distance)
        };
        let near = |object| Some(Near { object, distance_squared: distance(object)? });
        let mut all: Vec<Near> = (0..triangles.len() as u32).filter_map(near).collect();
        all.retain(|near| near.distance_squared <= limit);
        all.sort();
        all.truncate(k);
        let tree = tree(&triangles);
        prop_assert_eq!(&query::k_nearest(&tree, at, k, limit, distance), &all);
        if k > 0 {
            prop_assert_eq!(query::nearest(&tree, at, limit, distance), all.first().copied());
        }
    }

    #[test]
    fn all_hits_along_a_ray_are_found(triangles in triangles(), from in point(), to in point(), t_max in 0.0f32..3.0) {
        let Ok(ray) = Ray::new(from, to - from, 0.0, t_max) else { return Ok(()) };
        let shear = Shear::new(&ray);
        let hit = |object: u32| triangles[object as usize].intersect(&shear, t_max).is_some();
        let mut found = BTreeSet::new();
        query::along(&tree(&triangles), &ray, |object| -> ControlFlow<()> {
            if hit(object) {
                found.insert(object);
            }
            ControlFlow::Continue(())
        });
        prop_assert_eq!(found, (0..triangles.len() as u32).filter(|&object| hit(object)).collect());
        let kept = |object: u32| !object.is_multiple_of(3);
        let mut expected: Vec<Hit> = (0..triangles.len() as u32)
            .filter(|&object| kept(object))
            .filter_map(|object| Some(Hit { t: triangles[object as usize].intersect(&shear, t_max)?, object }))
            .collect();
        expected.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.object.cmp(&b.object)));
        prop_assert_eq!(query::all_hits(&tree(&triangles), &triangles, &ray, kept), expected);
    }

    #[test]
    fn no_point_of_a_triangle_is_closer_than_the_closest(triangle in prop::array::uniform3(point()), at in point()) {
        let triangle = Triangle(triangle);
        let closest = triangle.closest_point(at);
        let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
        let distance = closest.distance(at.as_dvec3());
        for i in 0..=16 {
            for j in 0..=16 - i {
                let (u, v) = (f64::from(i) / 16.0, f64::from(j) / 16.0);
                let other = a * (1.0 - u - v) + b * u + c * v;
                prop_assert!(distance <= other.distance(at.as_dvec3()) + 1e-9, "{closest} {other}");
            }
        }
        // It lies in the triangle: in its plane, and on the inner side of its box.
        let aabb = triangle.aabb();
        let slack = glam::DVec3::splat(1e-6);
        prop_assert!(closest.cmpge(aabb.min.as_dvec3() - slack).all() && closest.cmple(aabb.max.as_dvec3() + slack).all());
    }
}

#[test]
fn a_visit_that_breaks_ends_the_query() {
    let triangles: Vec<Triangle> =
        (0..20u8).map(|i| Triangle([Vec3::splat(f32::from(i)), Vec3::X * f32::from(i), Vec3::ONE])).collect();
    let mut visits = 0;
    let everything = Aabb { min: Vec3::splat(f32::MIN), max: Vec3::splat(f32::MAX) };
    let broken = query::overlapping(&tree(&triangles), &everything, |object| {
        visits += 1;
        if visits == 3 { ControlFlow::Break(object) } else { ControlFlow::Continue(()) }
    });
    assert!(visits == 3 && broken.is_some());
}
