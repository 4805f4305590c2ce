//! Trees with divided triangles, and the cost of layouts.

use crate::support::layouts::divided;
use crate::support::{Random, SHAPES, ball, boxes, soup, tree};
use bvh_core::cost::layout_area;
use bvh_core::{Aabb, Bvh, InvalidBvh, Node, Triangle, WideBvh, validate, validate_references};

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
    let mut shrunk = 0;
    for (index, node) in split.nodes.iter().enumerate() {
        if node.prims().len() != 1 {
            continue;
        }
        let position = node.prims().start;
        let mut other = split.clone();
        other.prim_ids[position] = (split.prim_ids[position] + 1) % triangles.len() as u32;
        assert!(validate_references(&other, &boxes, objects).is_err(), "{index}");
        let object = split.prim_ids[position];
        let parts = split.prim_ids.iter().filter(|&&id| id == object).count();
        if parts > 1 && node.aabb.extent().y > 0.1 {
            let mut smaller = split.clone();
            smaller.nodes[index].aabb.max.y -= 0.05;
            let fault = Err(InvalidBvh::Uncovered { object: object as usize });
            assert_eq!(validate_references(&smaller, &boxes, objects), fault, "{index}");
            shrunk += 1;
        }
    }
    assert!(shrunk > 10, "{shrunk}");
}

#[test]
fn a_triangle_that_is_not_finite_is_rejected_whole_and_divided() {
    let broken = Triangle::from([[0.0; 3], [1.0, 0.0, f32::NAN], [0.0, f32::INFINITY, 0.0]]);
    let root = Aabb::from([[-1.0; 3], [1.0; 3]]);
    let whole = Bvh::new(vec![Node::leaf(root, 0, 1)], vec![0]);
    let nodes = vec![Node::inner(root, 1, 2), Node::leaf(root, 0, 1), Node::leaf(root, 1, 1)];
    for tree in [whole, Bvh::new(nodes, vec![0, 0])] {
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
