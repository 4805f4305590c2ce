use super::*;
use crate::run::stream;
use crate::scatter::scatter;
use crate::tree::HalfArea;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{layout_area, total_area};
use bvh_core::{Triangle, validate_references};

/// Long diagonal triangles, which boxes describe badly.
fn diagonals(n: u32) -> Vec<Triangle> {
    scatter(n)
        .iter()
        .map(|aabb| {
            let far = aabb.min + (aabb.max - aabb.min) * 40.0;
            Triangle([aabb.min, far, aabb.max])
        })
        .collect()
}

#[test]
fn passes_divide_and_reunite_within_the_limit_and_every_reference_saves_its_price() {
    let triangles = diagonals(150);
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let objects = &triangles.as_slice();
    let quota = Quota { work: 40_000, moves: u64::MAX };
    for by_layout in [false, true] {
        let cost =
            |tree: &bvh_core::Bvh| if by_layout { layout_area(tree) } else { total_area(tree) };
        let start = muller_fellner::Config::default().build(&boxes).unwrap();
        let mut before = cost(&start);
        let metric = HalfArea::default().with_leaves();
        let mut tree = Working::from_bvh(&start, metric).unwrap();
        let mut most_seen = 0;
        let mut is_given_up = false;
        // With fewer allowed references than the tree has, nothing is divided, and leaves that
        // pay little are still reunited.
        for most in [180, 200, 160, 150] {
            let mut divider = Divider::new(Splits { objects, most, divided: None }, by_layout);
            let mut references = tree.objects();
            for round in 0..4 {
                let tally = divider.pass(&mut tree, quota, &mut stream(7, round), &());
                assert!(tally.work > 0);
                let flat = tree.to_bvh();
                validate_references(&flat, &boxes, objects).unwrap();
                assert!(
                    flat.prim_ids.len() <= most.max(references),
                    "{} {most}",
                    flat.prim_ids.len()
                );
                assert!((tree.area() - total_area(&flat)).abs() <= 1e-9 * tree.area());
                let after = cost(&flat);
                // Every added reference has saved its price, and no removed reference cost
                // more.
                let gone = references as f64 - flat.prim_ids.len() as f64;
                let price = PRICE_OF_A_REFERENCE * before;
                let least_leave = if gone > 0.0 { gone / 150.0 } else { gone / 200.0 };
                assert!(
                    after <= before * (1.0 + 1e-9) + price * least_leave,
                    "{after} {before} {gone}"
                );
                // Divisions only save, so one that saved less than its price was reversed.
                is_given_up |= gone > 0.0 && after > before;
                references = flat.prim_ids.len();
                (before, most_seen) = (after, most_seen.max(flat.prim_ids.len()));
            }
        }
        assert!(most_seen > 160 && is_given_up == by_layout, "{most_seen} {is_given_up}");
    }
}

#[test]
fn a_leaf_may_be_cut_where_an_ancestor_would_end_without_it_and_in_its_middle() {
    let boxes = [10.0, 4.0, 7.0].map(|x: f32| Aabb::from(([0.0; 3], [x, 1.0, 1.0])));
    let inner = |first| bvh_core::Node::inner(Aabb::EMPTY, first, 2);
    let leaf = |object| bvh_core::Node::leaf(Aabb::EMPTY, object, 1);
    let nodes = vec![inner(1), inner(3), leaf(2), leaf(0), leaf(1)];
    let mut tree = bvh_core::Bvh::new(nodes, vec![0, 1, 2]);
    tree.refit(&boxes);
    let tree = Working::from_bvh(&tree, HalfArea::default()).unwrap();
    let objects: &[Triangle] = &[];
    let splits = Splits { objects: &objects, most: 4, divided: None };
    let mut divider = Divider::new(splits, false);
    for (object, planes) in [(0, &[(0, 4.0), (0, 7.0), (0, 5.0)][..]), (1, &[(0, 2.0)])] {
        let is_it = |node: &Node| node.is_leaf() && node.children[1] == object;
        divider.find_planes(&tree, tree.nodes.iter().position(is_it).unwrap() as u32);
        assert_eq!(divider.planes, planes, "{object}");
    }
}
