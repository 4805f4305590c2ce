//! Goldsmith–Salmon against a plain tree whose costs are always computed anew, and the laws it must obey.

use bvh_build::Builder;
use bvh_build::goldsmith_salmon::{Config, Descent, InvalidOrder, Scene, Workspace};
use bvh_core::{Aabb, Bvh, NodeKind, cost, validate};
use proptest::prelude::*;

const CONFIGS: [Config; 4] = [
    Config { descent: Descent::Cost, pair_inner: false },
    Config { descent: Descent::Cost, pair_inner: true },
    Config { descent: Descent::Area, pair_inner: false },
    Config { descent: Descent::Area, pair_inner: true },
];

/// A node of the plain tree: a leaf has an object and no children.
#[derive(Clone)]
struct Plain {
    object: Option<u32>,
    children: Vec<Plain>,
}

impl Plain {
    fn leaf(object: u32) -> Self {
        Self { object: Some(object), children: vec![] }
    }

    fn aabb(&self, boxes: &[Aabb]) -> Aabb {
        let own = self.object.map_or(Aabb::EMPTY, |object| boxes[object as usize]);
        self.children.iter().fold(own, |b, child| b.union(&child.aabb(boxes)))
    }

    /// Σ S · children of the whole subtree.
    fn cost(&self, boxes: &[Aabb]) -> f64 {
        let below: f64 = self.children.iter().map(|child| child.cost(boxes)).sum();
        self.aabb(boxes).half_area() * self.children.len() as f64 + below
    }

    /// This tree after object `id` was put at the node that the path of child positions leads to.
    fn with(&self, path: &[usize], id: u32, pair: bool) -> Self {
        let mut tree = self.clone();
        let Some((&last, above)) = path.split_last() else {
            if pair {
                return Self { object: None, children: vec![tree, Self::leaf(id)] };
            }
            tree.children.push(Self::leaf(id));
            return tree;
        };
        let parent = above.iter().fold(&mut tree, |node, &child| &mut node.children[child]);
        let child = &mut parent.children[last];
        let was_leaf = child.object.is_some();
        *child = child.with(&[], id, pair);
        if was_leaf {
            // Inner nodes stay in front.
            let front = parent.children.iter().position(|child| child.object.is_some());
            parent.children.swap(last, front.filter(|&front| front < last).unwrap_or(last));
        }
        tree
    }

    /// Tries every stop of the path and keeps the cheapest tree; of equals the first, from the last inner node that
    /// contains the object downwards.
    fn insert(&self, config: &Config, boxes: &[Aabb], id: u32) -> Self {
        let added = boxes[id as usize];
        let (mut node, mut path, mut stops, mut last_containing) = (self, vec![], vec![], 0);
        let contains = |node: &Self| node.object.is_none() && node.aabb(boxes).contains(&added);
        loop {
            if contains(node) {
                last_containing = stops.len();
            }
            if node.object.is_none() {
                stops.push((path.clone(), false));
            }
            if node.object.is_some() || config.pair_inner {
                stops.push((path.clone(), true));
            }
            if node.object.is_some() {
                break;
            }
            let growth = |child: &Self| {
                let before = child.aabb(boxes).half_area();
                let after = child.aabb(boxes).union(&added).half_area();
                match (config.descent, child.object) {
                    (Descent::Area, _) => after - before,
                    (Descent::Cost, None) => (after - before) * child.children.len() as f64,
                    (Descent::Cost, Some(_)) => 2.0 * after,
                }
            };
            let next = node.children.iter().position(&contains).unwrap_or_else(|| {
                let growths: Vec<f64> = node.children.iter().map(growth).collect();
                (0..growths.len()).min_by(|&a, &b| growths[a].total_cmp(&growths[b])).unwrap()
            });
            node = &node.children[next];
            path.push(next);
        }
        let trees: Vec<Self> = stops.iter().map(|(path, pair)| self.with(path, id, *pair)).collect();
        let cheapest =
            |trees: &[Self]| trees.iter().min_by(|a, b| a.cost(boxes).total_cmp(&b.cost(boxes))).cloned();
        let best = cheapest(&trees[last_containing..]).unwrap();
        assert_eq!(best.cost(boxes), cheapest(&trees).unwrap().cost(boxes), "no node above is cheaper");
        best
    }

    /// As [`topology`].
    fn topology(&self) -> Vec<Result<usize, u32>> {
        let own = self.object.map_or(Ok(self.children.len()), Err);
        std::iter::once(own).chain(self.children.iter().flat_map(Self::topology)).collect()
    }
}

fn brute_force(config: &Config, boxes: &[Aabb], order: &[u32]) -> Plain {
    order[1..].iter().fold(Plain::leaf(order[0]), |tree, &id| tree.insert(config, boxes, id))
}

/// The nodes depth first: of an inner node the number of children, of a leaf its object.
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

/// Builds, checks the tree and its cost, and returns both.
fn insert(config: &Config, boxes: &[Aabb], order: &[u32], workspace: &mut Workspace) -> (Bvh, f64) {
    let cost = config.insert_all(&Scene::new(boxes).unwrap(), order, workspace).unwrap();
    let mut tree = Bvh::default();
    workspace.write(&mut tree);
    validate(&tree, boxes).unwrap();
    assert!(tree.is_tight(boxes));
    let recomputed = cost::goldsmith_salmon(&tree);
    assert!((cost - recomputed).abs() <= 1e-12 * recomputed, "{cost} kept, {recomputed} recomputed");
    (tree, cost)
}

/// Boxes whose corners are whole numbers: the areas and their sums are exact in any order.
fn whole(cells: i32, size: i32, max: usize) -> impl Strategy<Value = (Vec<Aabb>, Vec<u32>)> {
    let whole = |range: std::ops::Range<i32>| prop::array::uniform3(range.prop_map(|c| c as f32));
    let boxed = |(low, size): ([f32; 3], [f32; 3])| {
        Aabb::from((low, std::array::from_fn(|axis| low[axis] + size[axis])))
    };
    with_order(prop::collection::vec((whole(-cells..cells), whole(0..size)).prop_map(boxed), 1..max))
}

/// Boxes anywhere, a third of them without extent along some axis.
fn real(max: usize) -> impl Strategy<Value = (Vec<Aabb>, Vec<u32>)> {
    let boxed = |(low, size, flat): ([f32; 3], [f32; 3], usize)| {
        let size = |axis: usize| if axis == flat { 0.0 } else { size[axis] };
        Aabb::from((low, std::array::from_fn(|axis| low[axis] + size(axis))))
    };
    let corner = prop::array::uniform3(-1e3f32..1e3);
    with_order(prop::collection::vec(
        (corner, prop::array::uniform3(0f32..300.0), 0..9usize).prop_map(boxed),
        1..max,
    ))
}

fn with_order(boxes: impl Strategy<Value = Vec<Aabb>>) -> impl Strategy<Value = (Vec<Aabb>, Vec<u32>)> {
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
        for config in &CONFIGS {
            let mut used = Workspace::default();
            let reversed: Vec<u32> = order.iter().rev().copied().collect();
            insert(config, &boxes, &reversed, &mut used);
            let (tree, cost) = insert(config, &boxes, &order, &mut used);
            let mut by_index = config.build(&renumbered).unwrap();
            by_index.prim_ids.iter_mut().for_each(|id| *id = order[*id as usize]);
            prop_assert!(tree == by_index);
            prop_assert_eq!(insert(config, &boxes, &order, &mut used).1.to_bits(), cost.to_bits());
        }
    }
}

#[test]
fn the_tree_is_the_brute_force_one_with_wide_nodes_too() {
    let hash = |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 1021) as f32;
    let corner = |i: u32, salt: u32| [hash(i, salt), hash(i, salt + 5), hash(i, salt + 9)];
    // Any overlapping boxes, and small ones between them.
    let boxes: Vec<Aabb> = (0..240)
        .map(|i| {
            let low = corner(i, 3);
            let high =
                if i % 3 == 0 { low.map(|c| c + 1.0 + (hash(i, 1) / 64.0).floor()) } else { corner(i, 17) };
            Aabb::from((low, low)).union(&Aabb::from((high, high)))
        })
        .collect();
    let order: Vec<u32> = (0..boxes.len() as u32).collect();
    for config in &CONFIGS {
        let (tree, _) = insert(config, &boxes, &order, &mut Workspace::default());
        assert_eq!(topology(&tree), brute_force(config, &boxes, &order).topology(), "{config:?}");
        let inner =
            |range: std::ops::Range<usize>| tree.nodes[range].iter().filter(|node| !node.is_leaf()).count();
        let widest = tree.nodes.iter().map(|node| inner(node.children())).max();
        assert!(widest > Some(4), "{config:?}: at most {widest:?} inner nodes under one");
    }
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
fn a_small_object_beside_a_small_one_pairs_with_it_in_a_large_scene() {
    let boxes = [cube([0.0; 3], 1.0), cube([100.0; 3], 1.0), cube([102.0, 100.0, 100.0], 1.0)];
    let (tree, _) = by_index(&boxes, &Config::default());
    assert_eq!(topology(&tree), [Ok(2), Ok(2), Err(1), Err(2), Err(0)]);
}

#[test]
fn an_object_as_large_as_the_scene_stays_with_the_root() {
    let boxes = [cube([0.0; 3], 1.0), cube([9.0; 3], 1.0), cube([0.0; 3], 10.0)];
    for config in &CONFIGS {
        assert_eq!(topology(&by_index(&boxes, config).0), [Ok(3), Err(0), Err(1), Err(2)], "{config:?}");
    }
}

#[test]
fn pairing_with_inner_nodes_happens_when_allowed_and_cheaper() {
    // A cluster of six, then a far object: enlarging the six's node costs more than a node above it.
    let mut boxes: Vec<Aabb> = (0..6).map(|i| cube([0.1 * i as f32, 0.0, 0.0], 10.0)).collect();
    boxes.push(cube([1000.0; 3], 10.0));
    let root = |pair_inner| topology(&by_index(&boxes, &Config { pair_inner, ..Config::default() }).0)[0];
    assert_eq!((root(false), root(true)), (Ok(7), Ok(2)));
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
    let hash = |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 65_521) as f32;
    let boxes: Vec<Aabb> =
        (0..100_000).map(|i| cube([i as f32, hash(i, 11), hash(i, 19)], 1.0 + hash(i, 27) / 65.0)).collect();
    for config in &CONFIGS {
        let (tree, _) = by_index(&boxes, config);
        assert!(tree.depth() < 200, "{config:?}: depth {}", tree.depth());
    }
}

#[test]
fn what_is_no_order_of_the_scene_is_refused_by_name_and_the_tree_kept() {
    let boxes = [0.0, 2.0, 4.0].map(|x| cube([x; 3], 1.0));
    let scene = Scene::new(&boxes).unwrap();
    let (mut workspace, mut before, mut after) = (Workspace::default(), Bvh::default(), Bvh::default());
    Config::default().insert_all(&scene, &[2, 0, 1], &mut workspace).unwrap();
    workspace.write(&mut before);
    for (order, expected) in [
        (vec![0, 1], InvalidOrder::Length { named: 2, objects: 3 }),
        (vec![0, 1, 2, 0], InvalidOrder::Length { named: 4, objects: 3 }),
        (vec![0, 3, 1], InvalidOrder::NoObject { position: 1, object: 3, objects: 3 }),
        (vec![0, u32::MAX, 1], InvalidOrder::NoObject { position: 1, object: u32::MAX, objects: 3 }),
        (vec![1, 0, 1], InvalidOrder::Repeated { position: 2, object: 1 }),
    ] {
        assert_eq!(Config::default().insert_all(&scene, &order, &mut workspace), Err(expected));
    }
    workspace.write(&mut after);
    assert_eq!(before, after);
}
