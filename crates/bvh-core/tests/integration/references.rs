//! Trees with divided triangles. Every traversal gives the answer of testing every triangle, bit by
//! bit, and no ray passes between two parts of a triangle.

use crate::support::layouts::by_kernel;
use crate::support::{
    Random, SHAPES, ball, bits, boxes, brute_force, grid_box, rays, scaled, soup, tree,
};
use bvh_core::{
    Aabb, Bvh, Clip, Hit, InvalidBvh, Kernel, Node, PreparedRay, Ray, Triangle, WideBvh,
    any_hit_by, collapse_leaves,
    cost::{SahConstants, layout_area, layout_cost},
    nearest_hit_by, validate, validate_references,
};
use std::thread;

/// Divides leaves of `tree` at random planes, and divides parts again. Returns the tree, and the
/// object, axis and coordinate of each plane.
fn divided(
    tree: &Bvh,
    triangles: &[Triangle],
    random: &mut Random,
) -> (Bvh, Vec<(u32, usize, f32)>) {
    let mut tree = tree.clone();
    let mut planes = Vec::new();
    let mut index = 0;
    while index < tree.nodes.len() {
        let Node { aabb, .. } = tree.nodes[index];
        let range = tree.nodes[index].prims();
        if range.len() == 1 && random.below(3) > 0 {
            let object = tree.prim_ids[range.start];
            let axis = random.below(3);
            let corner = random.of(&triangles[object as usize].0)[axis];
            let somewhere = aabb.min[axis] + random.unit() * aabb.extent()[axis] as f32;
            // Planes through corners are the hard ones.
            let plane = random.of(&[somewhere, corner]);
            let [low, high] =
                aabb.halves(axis, plane).map(|region| triangles.clip(object, &region));
            let divides = aabb.min[axis] < plane && plane < aabb.max[axis];
            if divides && low != Aabb::EMPTY && high != Aabb::EMPTY {
                let first = tree.nodes.len() as u32;
                let added = tree.prim_ids.len() as u32;
                tree.nodes[index] = Node::inner(aabb, first, 2);
                tree.nodes.push(Node::leaf(low, range.start as u32, 1));
                tree.nodes.push(Node::leaf(high, added, 1));
                tree.prim_ids.push(object);
                planes.push((object, axis, plane));
            }
        }
        index += 1;
    }
    (tree, planes)
}

/// Makes rays through the points where planes divide triangles. Some rays cross the plane and some
/// are within it.
fn rays_on_planes(
    triangles: &[Triangle],
    planes: &[(u32, usize, f32)],
    count: usize,
    random: &mut Random,
) -> Vec<Ray> {
    let mut size = 0.0f32;
    for corner in triangles.iter().flat_map(|triangle| triangle.0) {
        size = size.max(corner.abs().max_element());
    }
    let mut rays = Vec::new();
    for _ in 0..count {
        let (object, axis, plane) = random.of(planes);
        let Triangle([a, b, c]) = triangles[object as usize];
        let u = random.unit();
        let v = random.unit();
        let mut target = a + (b - a) * u + (c - a) * (v * (1.0 - u));
        target[axis] = plane;
        let mut from = target + random.point() * (size * random.of(&[3.0, 0.1, 1e-3]));
        if random.below(2) == 0 {
            from[axis] = plane;
        }
        // Scaled, so that the direction stays in range for huge and tiny scenes.
        rays.extend(Ray::half_line(from, (target - from) / size));
    }
    rays
}

/// Fails unless every traversal of the tree gives the expected answer to a ray.
fn check(
    case: &str,
    tree: &Bvh,
    kernels: &[(Kernel, WideBvh)],
    triangles: &[Triangle],
    ray: &Ray,
    expected: Option<Hit>,
) {
    let prepared = PreparedRay::new(ray);
    let test = |id: u32, t_max| triangles[id as usize].intersect(&prepared, t_max);
    let found = nearest_hit_by(tree, ray, test, &mut ());
    assert_eq!(bits(found), bits(expected), "{case}, {ray:?}");
    let found = any_hit_by(tree, ray, |id| test(id, ray.t_max()).is_some(), &mut ());
    assert_eq!(found, expected.is_some(), "{case}, {ray:?}");
    let crossings = triangles.iter().filter(|triangle| triangle.crossing(ray).is_some()).count();
    for (_, wide) in kernels {
        assert_eq!(wide.all_hits(ray).len(), crossings, "{case}, {ray:?}");
        assert_eq!(bits(wide.nearest_hit(ray)), bits(expected), "{case}, {ray:?}");
        assert_eq!(wide.any_hit(ray), expected.is_some(), "{case}, {ray:?}");
    }
}

#[test]
fn every_traversal_of_divided_triangles_answers_as_brute_force_at_every_scale() {
    let mut random = Random(4);
    let mut hits = 0;
    let mut divisions = 0;
    for (name, scene) in
        [("soup", soup(120, &mut random)), ("grid", grid_box(3)), ("ball", ball(1))]
    {
        for exponent in [-120, -60, 0, 60, 120] {
            let triangles = scaled(&scene, libm::exp2f(exponent as f32));
            for shape in SHAPES {
                let undivided = tree(&boxes(&triangles), shape, &mut random);
                let (split, planes) = divided(&undivided, &triangles, &mut random);
                divisions += planes.len();
                validate_references(&split, &boxes(&triangles), &triangles.as_slice()).unwrap();
                let collapsed = collapse_leaves(&split, &SahConstants::default());
                validate_references(&collapsed, &boxes(&triangles), &triangles.as_slice()).unwrap();
                let mut rays = rays(&triangles, 300, &mut random);
                if !planes.is_empty() {
                    rays.extend(rays_on_planes(&triangles, &planes, 600, &mut random));
                }
                let case = format!("{name} * 2^{exponent}");
                for tree in [&split, &collapsed] {
                    let kernels = by_kernel(&WideBvh::new(tree, &triangles).unwrap());
                    for ray in &rays {
                        let expected = brute_force(&triangles, ray);
                        check(&case, tree, &kernels, &triangles, ray, expected);
                        hits += usize::from(expected.is_some());
                    }
                }
            }
        }
    }
    assert!(hits > 10_000 && divisions > 1000, "{hits} {divisions}");
}

#[test]
fn a_tree_without_a_part_or_an_object_is_rejected() {
    let mut random = Random(9);
    let triangles = ball(1);
    let boxes = boxes(&triangles);
    let undivided = tree(&boxes, SHAPES[0], &mut random);
    let (split, _) = divided(&undivided, &triangles, &mut random);
    assert!(split.prim_ids.len() > triangles.len() + 20);
    assert_eq!(
        validate(&split, &boxes),
        Err(InvalidBvh::ObjectCount { named: split.prim_ids.len(), objects: triangles.len() })
    );
    let objects = &triangles.as_slice();
    for (index, node) in split.nodes.iter().enumerate() {
        if node.prims().len() != 1 {
            continue;
        }
        let position = node.prims().start;
        let mut other = split.clone();
        other.prim_ids[position] = (split.prim_ids[position] + 1) % triangles.len() as u32;
        assert!(validate_references(&other, &boxes, objects).is_err(), "{index}");
    }
}

#[test]
#[cfg(not(target_family = "wasm"))] // It has no threads.
fn threads_do_not_change_the_cost_of_a_layout() {
    let mut random = Random(10);
    for n in [1, 2, 7, 60, 200] {
        let triangles = soup(n, &mut random);
        for shape in SHAPES {
            let tree = tree(&boxes(&triangles), shape, &mut random);
            let by_threads = layout_cost(&tree, None, &|first, second| {
                thread::scope(|scope| {
                    scope.spawn(first);
                    second();
                });
            });
            assert_eq!(by_threads.to_bits(), layout_area(&tree).to_bits());
        }
    }
}

#[test]
fn the_cost_of_a_layout_is_known_before_it_is_made() {
    let mut random = Random(10);
    for n in [1, 2, 7, 60, 200] {
        let mut triangles = soup(n, &mut random);
        // The layout omits triangles without area, which have a cost in the tree.
        triangles.retain(|triangle| !triangle.is_degenerate());
        for shape in SHAPES {
            let tree = tree(&boxes(&triangles), shape, &mut random);
            let root_area = tree.root_aabb().map_or(0.0, |root| root.half_area());
            if root_area == 0.0 {
                continue;
            }
            let wide = WideBvh::new(&tree, &triangles).unwrap();
            let found = wide.expected_visits();
            let area = layout_area(&tree);
            let expected = area / root_area;
            assert!((found - expected).abs() <= 1e-4 * expected, "{n}: {found} {expected}");
        }
    }
}
