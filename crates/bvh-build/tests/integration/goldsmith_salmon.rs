//! Goldsmith–Salmon compared with a plain tree that recomputes all costs, and the laws of the
//! method.

use crate::plain_tree::brute_force;
use crate::{hash, sized_box};
use bvh_build::goldsmith_salmon::{Config, Descent, InvalidOrder, Scene, Workspace};
use bvh_build::{Builder, Watch};
use bvh_core::{Aabb, Bvh, NodeKind, cost, validate};
use proptest::prelude::*;

const CONFIGS: [Config; 4] = [
    Config { descent: Descent::Cost, pair_inner: false },
    Config { descent: Descent::Cost, pair_inner: true },
    Config { descent: Descent::Area, pair_inner: false },
    Config { descent: Descent::Area, pair_inner: true },
];

/// Returns the nodes depth first: the number of children of an inner node, the object of a leaf.
fn topology(tree: &Bvh) -> Vec<Result<usize, u32>> {
    let mut stack = if tree.nodes.is_empty() { vec![] } else { vec![0] };
    let mut nodes = vec![];
    while let Some(index) = stack.pop() {
        let node = &tree.nodes[index];
        nodes.push(match node.kind() {
            NodeKind::Inner { count, .. } => Ok(count as usize),
            NodeKind::Leaf { first, .. } => Err(tree.prim_ids[first as usize]),
        });
        stack.extend(node.children().rev());
    }
    nodes
}

fn insert(config: &Config, boxes: &[Aabb], order: &[u32], workspace: &mut Workspace) -> (Bvh, f64) {
    let scene = Scene::new(boxes, None).unwrap();
    let cost = config.insert_all(&scene, order, workspace, &Watch::default()).unwrap();
    let mut tree = Bvh::default();
    workspace.write(&mut tree);
    validate(&tree, boxes).unwrap();
    assert!(tree.is_tight(boxes));
    let recomputed = cost::goldsmith_salmon(&tree);
    assert!(
        (cost - recomputed).abs() <= 1e-12 * recomputed,
        "{cost} kept, {recomputed} recomputed"
    );
    (tree, cost)
}

/// Makes boxes with integer corners. Their areas and the sums of areas are exact in any order.
fn whole(cells: i32, size: i32, max: usize) -> impl Strategy<Value = (Vec<Aabb>, Vec<u32>)> {
    let corner = prop::array::uniform3((-cells..cells).prop_map(|x| x as f32));
    let size = prop::array::uniform3((0..size).prop_map(|x| x as f32));
    let boxes = (corner, size).prop_map(sized_box);
    with_order(prop::collection::vec(boxes, 1..max))
}

/// Makes boxes anywhere, a third of them without extent along some axis.
fn real(max: usize) -> impl Strategy<Value = (Vec<Aabb>, Vec<u32>)> {
    let corner = prop::array::uniform3(-1e3f32..1e3);
    let size = prop::array::uniform3(0f32..300.0);
    let boxes = (corner, size, 0..9usize).prop_map(|(low, mut size, flat)| {
        if flat < 3 {
            size[flat] = 0.0;
        }
        sized_box((low, size))
    });
    with_order(prop::collection::vec(boxes, 1..max))
}

fn with_order(
    boxes: impl Strategy<Value = Vec<Aabb>>,
) -> impl Strategy<Value = (Vec<Aabb>, Vec<u32>)> {
    boxes.prop_flat_map(|boxes| {
        let order: Vec<u32> = (0..boxes.len() as u32).collect();
        (Just(boxes), Just(order).prop_shuffle())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(250))]

    #[test]
    fn the_tree_is_the_brute_force_one(
        (boxes, order) in prop_oneof![whole(3, 3, 40), whole(20, 60, 40), whole(1 << 17, 1 << 16, 50)]
    ) {
        for config in &CONFIGS {
            let plain = brute_force(config, &boxes, &order);
            let (tree, cost) = insert(config, &boxes, &order, &mut Workspace::default());
            prop_assert_eq!(topology(&tree), plain.topology(), "{:?}", config);
            let root = plain.aabb(&boxes).half_area();
            prop_assert_eq!(cost, if root > 0.0 { plain.cost(&boxes) / root } else { 0.0 });
        }
    }

    #[test]
    fn after_every_insertion_the_cost_is_the_recomputed_one((boxes, _) in real(100)) {
        let order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut workspace = Workspace::default();
        for config in &CONFIGS {
            for inserted in 0..=boxes.len() {
                insert(config, &boxes[..inserted], &order[..inserted], &mut workspace);
            }
        }
    }

    #[test]
    fn the_tree_depends_on_the_order_given_and_on_nothing_else((boxes, order) in real(300)) {
        let renumbered: Vec<Aabb> = order.iter().map(|&object| boxes[object as usize]).collect();
        let mut reversed = order.clone();
        reversed.reverse();
        for config in &CONFIGS {
            // The workspace has been used for another order.
            let mut used = Workspace::default();
            insert(config, &boxes, &reversed, &mut used);
            let (tree, cost) = insert(config, &boxes, &order, &mut used);
            let mut by_index = config.build(&renumbered).unwrap();
            for id in &mut by_index.prim_ids {
                *id = order[*id as usize];
            }
            prop_assert!(tree == by_index);
            let (_, cost_again) = insert(config, &boxes, &order, &mut used);
            prop_assert_eq!(cost_again.to_bits(), cost.to_bits());
        }
    }
}

#[test]
fn the_tree_is_the_brute_force_one_with_wide_nodes_too() {
    // Large overlapping boxes, and small ones between them.
    let mut boxes = Vec::new();
    for i in 0..240 {
        let low = integer_corner(i, 3);
        let high = if i % 3 == 0 {
            let size = 1.0 + (hash(i, 1, 1021) / 64.0).floor();
            low.map(|x| x + size)
        } else {
            integer_corner(i, 17)
        };
        boxes.push(Aabb::around([low.into(), high.into()]));
    }
    let order: Vec<u32> = (0..boxes.len() as u32).collect();
    for config in &CONFIGS {
        let (tree, _) = insert(config, &boxes, &order, &mut Workspace::default());
        assert_eq!(topology(&tree), brute_force(config, &boxes, &order).topology(), "{config:?}");
        let widest = most_inner_children(&tree);
        assert!(widest > 4, "{config:?}: at most {widest} inner children");
    }
}

fn integer_corner(i: u32, salt: u32) -> [f32; 3] {
    [hash(i, salt, 1021), hash(i, salt + 5, 1021), hash(i, salt + 9, 1021)]
}

fn most_inner_children(tree: &Bvh) -> usize {
    let mut most = 0;
    for node in &tree.nodes {
        let children = &tree.nodes[node.children()];
        most = most.max(children.iter().filter(|child| !child.is_leaf()).count());
    }
    most
}

fn cube(low: [f32; 3], size: f32) -> Aabb {
    Aabb::from((low, low.map(|c| c + size)))
}

fn by_index(boxes: &[Aabb], config: &Config) -> (Bvh, f64) {
    let order: Vec<u32> = (0..boxes.len() as u32).collect();
    insert(config, boxes, &order, &mut Workspace::default())
}

#[test]
fn no_object_one_and_two_make_no_node_a_leaf_and_a_pair() {
    let boxes = [cube([0.0; 3], 1.0), cube([2.0, 0.0, 0.0], 1.0)];
    for config in &CONFIGS {
        for (n, expected, cost) in
            [(0, vec![], 0.0), (1, vec![Err(0)], 0.0), (2, vec![Ok(2), Err(0), Err(1)], 2.0)]
        {
            let (tree, found) = by_index(&boxes[..n], config);
            assert_eq!((topology(&tree), found), (expected, cost), "{config:?}");
        }
    }
}

#[test]
fn identical_boxes_points_and_objects_on_a_line_make_one_wide_node() {
    let n = 100_000;
    let line = |i: usize| Aabb::from(([i as f32, 0.0, 0.0], [i as f32 + 1.0, 0.0, 0.0]));
    let cases: [(Vec<Aabb>, f64); 3] = [
        (vec![cube([0.1; 3], 1.0); n], n as f64),
        (vec![cube([0.1; 3], 0.0); n], 0.0),
        ((0..n).map(line).collect(), 0.0),
    ];
    for (boxes, cost) in &cases {
        for config in &CONFIGS {
            let (tree, found) = by_index(boxes, config);
            assert_eq!((tree.depth(), found), (1, *cost), "{config:?}");
        }
    }
}

#[test]
fn a_hundred_thousand_objects_in_sorted_order_make_a_shallow_tree() {
    let mut boxes = Vec::new();
    for i in 0..100_000 {
        let low = [i as f32, hash(i, 11, 65_521), hash(i, 19, 65_521)];
        boxes.push(cube(low, 1.0 + hash(i, 27, 65_521) / 65.0));
    }
    for config in &CONFIGS {
        let (tree, _) = by_index(&boxes, config);
        assert!(tree.depth() < 200, "{config:?}: depth {}", tree.depth());
    }
}

#[test]
fn an_invalid_order_is_rejected_and_the_tree_is_kept() {
    let boxes = [0.0, 2.0, 4.0].map(|x| cube([x; 3], 1.0));
    let scene = Scene::new(&boxes, None).unwrap();
    let mut workspace = Workspace::default();
    let mut before = Bvh::default();
    let mut after = Bvh::default();
    Config::default().insert_all(&scene, &[2, 0, 1], &mut workspace, &Watch::default()).unwrap();
    workspace.write(&mut before);
    for (order, expected) in [
        (vec![0, 1], InvalidOrder::Length { named: 2, objects: 3 }),
        (vec![0, 1, 2, 0], InvalidOrder::Length { named: 4, objects: 3 }),
        (vec![0, 3, 1], InvalidOrder::NoObject { position: 1, object: 3, objects: 3 }),
        (
            vec![0, u32::MAX, 1],
            InvalidOrder::NoObject { position: 1, object: u32::MAX, objects: 3 },
        ),
        (vec![1, 0, 1], InvalidOrder::Repeated { position: 2, object: 1 }),
    ] {
        assert_eq!(
            Config::default().insert_all(&scene, &order, &mut workspace, &Watch::default()),
            Err(expected)
        );
    }
    workspace.write(&mut after);
    assert_eq!(before, after);
}
