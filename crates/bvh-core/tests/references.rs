//! Trees whose triangles lie in several leaves: every traversal gives the answer of testing every triangle, bit by bit, and no ray
//! passes between two parts of a triangle.

mod support;

use bvh_core::{
    Aabb, Bvh, Clip, InvalidBvh, Kernel, Node, Ray, Shear, Triangle, WideBvh, any_hit_by, collapse_leaves,
    cost::{SahConstants, layout_area},
    nearest_hit_by, query, validate, validate_references,
};
use glam::Vec3;
use support::{Random, SHAPES, ball, bits, boxes, brute_force, grid_box, rays, scaled, soup, tree};

/// Divides leaves of `tree` at random planes, parts of leaves again, and returns the tree with the planes.
fn divided(tree: &Bvh, triangles: &[Triangle], random: &mut Random) -> (Bvh, Vec<(u32, usize, f32)>) {
    let objects = triangles;
    let mut tree = tree.clone();
    let mut planes = Vec::new();
    let mut at = 0;
    while at < tree.nodes.len() {
        let Node { aabb, .. } = tree.nodes[at];
        let range = tree.nodes[at].prims();
        if range.len() == 1 && random.below(3) > 0 {
            let object = tree.prim_ids[range.start];
            let axis = random.below(3);
            let corner = random.of(&triangles[object as usize].0)[axis];
            let somewhere = aabb.min[axis] + random.unit() * aabb.extent()[axis] as f32;
            let plane = random.of(&[somewhere, corner]);
            let parts = aabb.halves(axis, plane).map(|region| objects.clip(object, &region));
            if aabb.min[axis] < plane && plane < aabb.max[axis] && !parts.contains(&Aabb::EMPTY) {
                let first = tree.nodes.len() as u32;
                tree.nodes[at] = Node::inner(aabb, first, 2);
                let added = tree.prim_ids.len() as u32;
                tree.nodes
                    .extend([Node::leaf(parts[0], range.start as u32, 1), Node::leaf(parts[1], added, 1)]);
                tree.prim_ids.push(object);
                planes.push((object, axis, plane));
            }
        }
        at += 1;
    }
    (tree, planes)
}

#[test]
fn a_divided_object_is_near_once() {
    let mut random = Random(9);
    let triangles = soup(60, &mut random);
    let (split, planes) = divided(&tree(&boxes(&triangles), SHAPES[0], &mut random), &triangles, &mut random);
    assert!(planes.len() > 10, "{}", planes.len());
    for _ in 0..200 {
        let point = random.point() * 2.0;
        let distance = |id: u32| triangles[id as usize].closest_point(point).distance_squared(point.as_dvec3());
        let mut expected: Vec<(f64, u32)> = (0..60).map(|id| (distance(id), id)).collect();
        expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
        for k in [1, 7, 100] {
            let found = query::k_nearest(&split, point, k, f64::INFINITY, |id| Some(distance(id)));
            let found: Vec<_> = found.iter().map(|near| (near.distance_squared, near.object)).collect();
            assert_eq!(found, expected[..k.min(60)], "{point}");
        }
    }
}

/// Rays through points of triangles on the planes at which they are divided: across the plane, and within it.
fn rays_on_planes(
    triangles: &[Triangle],
    planes: &[(u32, usize, f32)],
    count: usize,
    random: &mut Random,
) -> Vec<Ray> {
    let size = triangles.iter().flat_map(|t| t.0).fold(0.0f32, |size, p| size.max(p.abs().max_element()));
    let ray = |_| {
        let (object, axis, plane) = random.of(planes);
        let Triangle([a, b, c]) = triangles[object as usize];
        let (u, v) = (random.unit(), random.unit());
        let mut on_triangle = a + (b - a) * u + (c - a) * (v * (1.0 - u));
        on_triangle[axis] = plane;
        let mut from = on_triangle + random.point() * (size * random.of(&[3.0, 0.1, 1e-3]));
        if random.below(2) == 0 {
            from[axis] = plane;
        }
        Ray::half_line(from, (on_triangle - from) / size).ok()
    };
    (0..count).filter_map(ray).collect()
}

#[test]
fn every_traversal_of_divided_triangles_answers_as_brute_force_at_every_scale() {
    let mut random = Random(4);
    let (mut hits, mut divisions) = (0, 0);
    for (name, scene) in [("soup", soup(120, &mut random)), ("grid", grid_box(3)), ("ball", ball(1))] {
        for exponent in [-120, -60, 0, 60, 120] {
            let triangles = scaled(&scene, libm::exp2f(exponent as f32));
            for shape in SHAPES {
                let whole = tree(&boxes(&triangles), shape, &mut random);
                let (split, planes) = divided(&whole, &triangles, &mut random);
                divisions += planes.len();
                validate_references(&split, &boxes(&triangles), &triangles.as_slice()).unwrap();
                let collapsed = collapse_leaves(&split, &SahConstants::default());
                validate_references(&collapsed, &boxes(&triangles), &triangles.as_slice()).unwrap();
                let mut rays = rays(&triangles, 300, &mut random);
                if !planes.is_empty() {
                    rays.extend(rays_on_planes(&triangles, &planes, 600, &mut random));
                }
                for tree in [&split, &collapsed] {
                    let wide = WideBvh::new(tree, &triangles).unwrap();
                    let kernels = Kernel::ALL.into_iter().filter_map(|kernel| wide.clone().with_kernel(kernel));
                    let kernels: Vec<WideBvh> = kernels.collect();
                    for ray in &rays {
                        let expected = brute_force(&triangles, ray);
                        let shear = Shear::new(ray);
                        let test = |id: u32, t_max| triangles[id as usize].intersect(&shear, t_max);
                        let case = format!("{name} * 2^{exponent}, {ray:?}");
                        assert_eq!(bits(nearest_hit_by(tree, ray, test, &mut ())), bits(expected), "{case}");
                        let meets = |id: u32| test(id, ray.t_max()).is_some();
                        assert_eq!(any_hit_by(tree, ray, meets, &mut ()), expected.is_some(), "{case}");
                        for wide in &kernels {
                            assert_eq!(bits(wide.nearest_hit(ray)), bits(expected), "{case}");
                            assert_eq!(wide.any_hit(ray), expected.is_some(), "{case}");
                        }
                        hits += usize::from(expected.is_some());
                    }
                }
            }
        }
    }
    assert!(hits > 10_000 && divisions > 1000, "{hits} {divisions}");
}

#[test]
fn no_ray_passes_between_two_parts_of_a_closed_surface() {
    let mut random = Random(5);
    for triangles in [ball(2), grid_box(2)] {
        let whole = tree(&boxes(&triangles), SHAPES[0], &mut random);
        let (split, planes) = divided(&whole, &triangles, &mut random);
        let wide = WideBvh::new(&split, &triangles).unwrap();
        let middle = triangles.iter().flat_map(|t| t.0).fold(Vec3::ZERO, |sum, p| sum + p)
            / (3 * triangles.len()) as f32;
        for _ in 0..20_000 {
            // From inside, through a point on a plane or near one, or in the plane itself.
            let (object, axis, plane) = random.of(&planes);
            let Triangle([a, b, c]) = triangles[object as usize];
            let mut target = a + (b - a) * random.unit() * 0.5 + (c - a) * random.unit() * 0.5;
            target[axis] = plane;
            let mut from = middle + random.point() * 0.1;
            if random.below(2) == 0 && (plane - middle[axis]).abs() < 0.1 {
                from[axis] = plane;
            }
            let Ok(ray) = Ray::half_line(from, target - from) else { continue };
            assert!(wide.nearest_hit(&ray).is_some() && wide.any_hit(&ray), "{ray:?}");
        }
    }
}

#[test]
fn a_tree_that_leaves_out_a_part_or_an_object_is_refused() {
    let mut random = Random(9);
    let triangles = ball(1);
    let boxes = boxes(&triangles);
    let whole = tree(&boxes, SHAPES[0], &mut random);
    let (split, _) = divided(&whole, &triangles, &mut random);
    assert!(split.prim_ids.len() > triangles.len() + 20);
    assert_eq!(
        validate(&split, &boxes),
        Err(InvalidBvh::ObjectCount { named: split.prim_ids.len(), objects: triangles.len() })
    );
    let objects = &triangles.as_slice();
    for at in (0..split.nodes.len()).filter(|&at| split.nodes[at].prims().len() == 1) {
        let mut other = split.clone();
        let position = split.nodes[at].prims().start;
        other.prim_ids[position] = (split.prim_ids[position] + 1) % triangles.len() as u32;
        assert!(validate_references(&other, &boxes, objects).is_err(), "{at}");
    }
}

#[test]
fn the_cost_of_a_layout_is_known_before_it_is_made() {
    let mut random = Random(10);
    for n in [1, 2, 7, 60, 200] {
        let triangles: Vec<Triangle> =
            soup(n, &mut random).into_iter().filter(|t| !t.is_degenerate()).collect();
        for shape in SHAPES {
            let tree = tree(&boxes(&triangles), shape, &mut random);
            let Some(root) = tree.root_aabb().filter(|root| root.half_area() > 0.0) else { continue };
            let found = WideBvh::new(&tree, &triangles).unwrap().expected_visits();
            let expected = layout_area(&tree) / root.half_area();
            assert!((found - expected).abs() <= 1e-4 * expected, "{n}: {found} {expected}");
        }
    }
}
