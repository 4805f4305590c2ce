//! Trees with divided triangles, and the cost of layouts.

use crate::support::{Random, SHAPES, ball, boxes, soup, tree};
use bvh_core::cost::layout_area;
use bvh_core::{
    Aabb, Bvh, Clip, InvalidBvh, Node, Ray, Triangle, WideBvh, validate, validate_references,
};

/// Divides leaves of `tree` at random planes, and divides parts again. Returns the tree, and the
/// object, axis and coordinate of each plane.
pub fn divided(
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
/// are within it. Without a plane there are none.
pub fn rays_on_planes(
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
    if planes.is_empty() {
        return rays;
    }
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
fn a_triangle_that_is_not_finite_is_rejected_whole_and_divided() {
    let broken = Triangle::from([[0.0; 3], [1.0, 0.0, f32::NAN], [0.0, f32::INFINITY, 0.0]]);
    let root = Aabb::from([[-1.0; 3], [1.0; 3]]);
    let whole = Bvh { nodes: vec![Node::leaf(root, 0, 1)], prim_ids: vec![0] };
    let nodes = vec![Node::inner(root, 1, 2), Node::leaf(root, 0, 1), Node::leaf(root, 1, 1)];
    for tree in [whole, Bvh { nodes, prim_ids: vec![0, 0] }] {
        assert!(WideBvh::new(&tree, &[broken]).is_err(), "{tree:?}");
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
