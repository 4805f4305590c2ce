//! Every traversal gives the answer of testing every object, bit by bit.

use crate::support::{
    Random, SHAPES, ball, bits, boxes, brute_force, chain, grid_box, rays, scaled, soup, tree,
};
use bvh_core::{
    Aabb, Bvh, Hit, PreparedRay, Ray, Sphere, TestCounts, Triangle, WideBvh, any_hit, any_hit_by,
    clip_to_box, collapse_leaves, cost::SahConstants, nearest_hit, nearest_hit_by,
    nearest_hit_of_all, validate,
};
use glam::Vec3;

fn check(name: &str, tree: &Bvh, triangles: &[Triangle], ray: &Ray, expected: Option<Hit>) {
    let hit = nearest_hit(tree, triangles, ray);
    assert_eq!(bits(hit), bits(expected), "{name}: {ray:?}");
    assert_eq!(any_hit(tree, triangles, ray), expected.is_some(), "{name}: {ray:?}");
}

#[test]
fn every_tree_answers_as_brute_force_at_every_scale() {
    let mut random = Random(1);
    let scenes = [("soup", soup(150, &mut random)), ("grid", grid_box(4)), ("ball", ball(2))];
    let mut hits = 0;
    for (name, scene) in scenes {
        for exponent in [-60, 0, 60] {
            let triangles = scaled(&scene, libm::exp2f(exponent as f32));
            let boxes = boxes(&triangles);
            let mut trees = SHAPES.map(|shape| tree(&boxes, shape, &mut random)).to_vec();
            trees.push(chain(&boxes));
            for index in 0..trees.len() {
                trees.push(collapse_leaves(&trees[index], &SahConstants::default()));
            }
            for tree in &trees {
                validate(tree, &boxes).unwrap();
            }
            for ray in rays(&triangles, 3000, &mut random) {
                let expected = brute_force(&triangles, &ray);
                hits += usize::from(expected.is_some());
                for (index, tree) in trees.iter().enumerate() {
                    let case = format!("{name} * 2^{exponent}, tree {index}");
                    check(&case, tree, &triangles, &ray, expected);
                }
            }
        }
    }
    assert!(hits > 5000, "the rays should hit something: {hits}");
}

#[test]
fn spheres_and_boxes_are_traced_by_the_same_functions() {
    let mut random = Random(2);
    let mut spheres = Vec::new();
    for _ in 0..75 {
        spheres.push(Sphere { center: random.point(), radius: 0.01 + 0.2 * random.unit() });
    }
    let boxes: Vec<Aabb> = spheres.iter().map(Sphere::aabb).collect();
    let trees = SHAPES.map(|shape| tree(&boxes, shape, &mut random));
    for _ in 0..5000 {
        let origin = random.point() * random.of(&[1.0, 100.0]);
        let target = random.point();
        let ray = Ray::half_line(origin, target - origin).unwrap();
        let sphere = |id: u32, t_max| spheres[id as usize].intersect(&ray, t_max);
        // A box is hit where its interval begins.
        let solid_box = |id: u32, t_max| clip_to_box(&ray, &boxes[id as usize], ray.t_min(), t_max);
        let objects = spheres.len() as u32;
        let nearest_sphere = nearest_hit_of_all(objects, &ray, sphere, &mut ());
        let nearest_box = nearest_hit_of_all(objects, &ray, solid_box, &mut ());
        for tree in &trees {
            assert_eq!(nearest_hit(tree, &spheres, &ray), nearest_sphere, "{ray:?}");
            assert_eq!(nearest_hit_by(tree, &ray, solid_box, &mut ()), nearest_box, "{ray:?}");
        }
    }
}

#[test]
fn a_chain_of_twenty_thousand_is_traced_from_both_ends() {
    let mut triangles = Vec::new();
    for i in 0..20_000u16 {
        let shift = Vec3::Z * f32::from(i);
        triangles.push(Triangle([shift, Vec3::X + shift, Vec3::Y + shift]));
    }
    let tree = chain(&boxes(&triangles));
    assert_eq!(tree.depth(), triangles.len() - 1);
    for (z, direction, object) in [(-1.0, 1.0, 0), (30_000.0, -1.0, 19_999)] {
        let ray = Ray::half_line(Vec3::new(0.1, 0.1, z), Vec3::Z * direction).unwrap();
        let hit = nearest_hit(&tree, &triangles, &ray);
        assert_eq!(hit.map(|hit| hit.object), Some(object));
        assert_eq!(WideBvh::new(&tree, &triangles).unwrap().nearest_hit(&ray), hit);
        // No object is hit: every node is visited.
        let mut counts = TestCounts::default();
        assert!(!any_hit_by(&tree, &ray, |_| false, &mut counts));
        assert_eq!(
            counts,
            TestCounts { boxes: tree.nodes.len() as u64, objects: tree.prim_ids.len() as u64 }
        );
    }
}

#[test]
fn no_ray_leaves_a_closed_mesh_through_an_edge_or_a_vertex() {
    let mut random = Random(3);
    for (name, triangles) in [("ball", ball(3)), ("box", grid_box(7)), ("plain box", grid_box(1))] {
        let tree = tree(&boxes(&triangles), SHAPES[0], &mut random);
        for _ in 0..40_000 {
            let Triangle([a, b, _]) = random.of(&triangles);
            let target = a + (b - a) * random.of(&[0.0, 0.5, 1.0, 1.0 / 3.0]);
            let origin = random.point() * 0.5;
            // Close to a long edge the rounding of its ends is large compared with the distance to
            // the edge.
            let close = target * (1.0 - random.of(&[1e-2, 1e-4, 1e-6]))
                + random.point() * target.abs() * 1e-7;
            for origin in [origin, Vec3::ZERO, close] {
                let direction = (target - origin) * random.of(&[1.0, 1e5]);
                let ray = Ray::half_line(origin, direction).unwrap();
                let prepared = PreparedRay::new(&ray);
                let test =
                    |id: u32| triangles[id as usize].intersect(&prepared, ray.t_max()).is_some();
                assert!(any_hit_by(&tree, &ray, test, &mut ()), "{name} leaks {ray:?}");
            }
        }
    }
}

/// Two adjacent triangles share an edge along one axis, and their boxes share a face. A ray that
/// starts close to the edge and runs nearly along it hits the sheet next to the edge. There the
/// rounding of the far corners moves the decision which triangle is hit by far more than the
/// rounding of the box test moves the boxes.
#[test]
fn no_ray_slips_between_the_boxes_beside_a_long_edge() {
    let mut random = Random(4);
    for axis in 0..3 {
        let ends = [turned(axis, 0.0, -1.0, 0.0), turned(axis, 0.0, 1.0, 0.0)];
        let triangles =
            [-1.0, 1.0].map(|x| Triangle([ends[0], ends[1], turned(axis, x, 0.0, 0.0)]));
        let tree = tree(&boxes(&triangles), SHAPES[0], &mut random);
        let wide = WideBvh::new(&tree, &triangles).unwrap();
        for _ in 0..20_000 {
            let height = random.of(&[1e-3, 1e-4, 1e-5, 1e-6]) * (1.0 + random.unit());
            let aside = random.unit() - 0.5;
            let rise = 0.3 + 0.6 * random.unit();
            let start = -aside / rise * height + (random.unit() - 0.5) * 2e-7;
            let origin = turned(axis, start, random.unit() - 0.5, -height);
            let ray = Ray::half_line(origin, turned(axis, aside, 1.0, rise)).unwrap();
            let prepared = PreparedRay::new(&ray);
            let test = |id: u32| triangles[id as usize].intersect(&prepared, ray.t_max()).is_some();
            assert!(any_hit_by(&tree, &ray, test, &mut ()), "axis {axis}: {ray:?}");
            assert!(
                wide.any_hit(&ray) && wide.any_hit_counted(&ray, &mut ()),
                "axis {axis}: {ray:?}"
            );
        }
    }
}

/// Returns the point x, y, z with its coordinates turned so that x is along `axis`.
fn turned(axis: usize, x: f32, y: f32, z: f32) -> Vec3 {
    let mut point = Vec3::ZERO;
    point[axis] = x;
    point[(axis + 1) % 3] = y;
    point[(axis + 2) % 3] = z;
    point
}

fn tests_of_nearest(tree: &Bvh, boxes: &[Aabb], ray: &Ray) -> TestCounts {
    let mut counts = TestCounts::default();
    let test = |id: u32, t_max| clip_to_box(ray, &boxes[id as usize], 0.0, t_max);
    nearest_hit_by(tree, ray, test, &mut counts);
    counts
}

/// Counts the tests of the search for any object, where every object is hit.
fn tests_of_any(tree: &Bvh, ray: &Ray) -> TestCounts {
    let mut counts = TestCounts::default();
    any_hit_by(tree, ray, |_| true, &mut counts);
    counts
}

#[test]
fn counts_include_the_root_and_stop_at_the_first_hit() {
    let boxes = [0.0, 2.0, 4.0, 6.0].map(|x| Aabb { min: Vec3::X * x, max: Vec3::X * x + 1.0 });
    let tree = chain(&boxes);
    let middle = Vec3::splat(0.5);
    let forwards = Ray::half_line(middle - Vec3::X, Vec3::X).unwrap();
    assert_eq!(tests_of_any(&tree, &forwards), TestCounts { boxes: 3, objects: 1 });
    assert_eq!(tests_of_nearest(&tree, &boxes, &forwards), TestCounts { boxes: 3, objects: 1 });
    let backwards = Ray::half_line(middle + Vec3::X * 9.0, -Vec3::X).unwrap();
    assert_eq!(tests_of_any(&tree, &backwards), TestCounts { boxes: 7, objects: 1 });
    // A ray that misses the root tests only the root's box.
    let past = Ray::half_line(middle + Vec3::X * 9.0, Vec3::X).unwrap();
    assert_eq!(tests_of_nearest(&tree, &boxes, &past), TestCounts { boxes: 1, objects: 0 });
    assert_eq!(nearest_hit_by(&Bvh::default(), &past, |_, _| Some(0.0), &mut ()), None);
    // A ray with an empty range does so too.
    let empty = Ray::new(middle - Vec3::X, Vec3::X, 2.0, 1.0).unwrap();
    assert_eq!(tests_of_nearest(&tree, &boxes, &empty), TestCounts { boxes: 1, objects: 0 });
}
