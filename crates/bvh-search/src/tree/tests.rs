//! Compares the working form with brute force, move by move.

use super::*;
use crate::run::stream;
use crate::scatter::{built, density};
use bvh_build::muller_fellner;
use bvh_core::{Aabb, validate};
use rand::RngExt;

fn scene(n: usize) -> (Vec<Aabb>, Working) {
    let mut rng = stream(1, 0);
    let mut coordinate = |scale: f32| scale * rng.random::<f32>();
    let boxes: Vec<Aabb> = (0..n)
        .map(|_| {
            let low = [(); 3].map(|()| coordinate(1.0));
            let size = coordinate(0.3);
            Aabb::from((low, low.map(|c| c + coordinate(size))))
        })
        .collect();
    let working = built(&muller_fellner::Config::default(), &boxes);
    (boxes, working)
}

/// Asserts that every box is the union below it and that every parent link is right.
fn assert_tight(tree: &Working, boxes: &[Aabb]) {
    let bvh = tree.to_bvh();
    validate(&bvh, boxes).unwrap();
    let mut tight = bvh.clone();
    tight.refit(boxes);
    assert_eq!(bvh, tight);
    for index in tree.preorder() {
        let node = &tree.nodes[index as usize];
        assert!(
            node.is_leaf()
                || node.children.iter().all(|&child| tree.nodes[child as usize].parent == index)
        );
        assert_eq!(node.area, node.aabb.half_area());
    }
}

/// A random node that is not the root.
fn any(tree: &Working<impl Metric>, rng: &mut impl RngExt) -> u32 {
    loop {
        let node = rng.random_range(1..tree.nodes.len() as u32);
        if tree.nodes[node as usize].parent != ANCHOR {
            return node;
        }
    }
}

#[test]
fn conversion_there_and_back_changes_nothing() {
    for n in [0, 1, 2, 3, 50] {
        let (boxes, tree) = scene(n);
        let again = Working::from_bvh(&tree.to_bvh(), HalfArea::default()).unwrap();
        assert_tight(&again, &boxes);
        assert_eq!((again.area(), again.to_bvh()), (tree.internal_area(), tree.to_bvh()));
        let mut sorted = tree.clone();
        for _ in 0..2 {
            sorted.sort_in_preorder();
            assert!(sorted.preorder().into_iter().eq(1..sorted.nodes.len() as u32));
            assert_eq!(sorted.to_bvh(), tree.to_bvh());
            assert!((sorted.area() - tree.area()).abs() <= 1e-12 * tree.area());
        }
        assert_eq!(tree.objects(), n);
    }
}

#[test]
fn the_shape_alone_gives_the_sorted_tree() {
    for n in [0, 1, 2, 3, 50] {
        let (boxes, mut tree) = scene(n);
        let shape = tree.shape();
        let (_, mut again) = scene(n);
        again.begin();
        again.reshape(&shape, &boxes);
        tree.sort_into_spare();
        assert_eq!(format!("{:?}", again.nodes), format!("{:?}", tree.nodes));
        assert_eq!(again.area().to_bits(), tree.area().to_bits());
    }
}

#[test]
fn sorting_in_place_gives_the_same_nodes() {
    for n in [0, 1, 2, 3, 50, 300] {
        for spare_leaves in 0..3 {
            let (_, mut tree) = scene(n);
            for _ in 0..spare_leaves {
                tree.push_spare(0);
                // A subtree out of the tree leaves gaps between the nodes.
                if let Some(&node) = tree.preorder().get(2) {
                    tree.detach(node);
                }
            }
            let unsorted = tree.clone();
            tree.sort_into_spare();
            for at_once in [1, 7, 4096] {
                let mut in_place = unsorted.clone();
                in_place.sort_in_place(at_once);
                let [nodes, nodes_in_place] =
                    [&tree, &in_place].map(|tree| format!("{:?}", tree.nodes));
                assert_eq!(nodes, nodes_in_place);
                assert_eq!(tree.area().to_bits(), in_place.area().to_bits());
            }
        }
    }
}

#[test]
fn a_tree_of_a_million_nodes_is_sorted_like_any_other() {
    // Level by level, the children of node i are 2i and 2i + 1.
    let n = 1 << 20;
    let node = |index: u32| {
        let below = 2 * index;
        let children = if below < n { [below, below + 1] } else { [NONE, 0] };
        Node { parent: index / 2, children, ..Node::ANCHOR }
    };
    let root = Node { children: [1, NONE], ..Node::ANCHOR };
    let nodes = [root].into_iter().chain((1..n).map(node)).collect();
    let mut tree = Working::from_nodes(nodes, HalfArea::default());
    tree.sort_in_preorder();
    assert!(tree.preorder().into_iter().eq(1..n));
}

#[test]
fn undoing_restores_every_bit() {
    let (_, mut tree) = scene(40);
    let mut rng = stream(3, 0);
    for _ in 0..1000 {
        let before = (tree.to_bvh(), tree.area().to_bits());
        tree.begin();
        for _ in 0..rng.random_range(1..5) {
            let node = any(&tree, &mut rng);
            tree.detach(node);
            let root = tree.nodes[0].children[0];
            tree.attach(node, root);
        }
        tree.undo();
        assert_eq!(before, (tree.to_bvh(), tree.area().to_bits()));
    }
}

#[test]
fn the_best_place_is_the_best_of_all_whether_the_node_is_out_or_only_thought_to_be() {
    let (boxes, tree) = scene(60);
    let density = density(&boxes).unwrap();
    let measure = Measured::new(&density);
    assert_best_places(Working::from_bvh(&tree.to_bvh(), measure).unwrap());
    assert_best_places(tree);
}

fn assert_best_places(mut tree: Working<impl Metric>) {
    let mut rng = stream(4, 0);
    let mut search = PositionSearch::default();
    for _ in 0..300 {
        let node = any(&tree, &mut rng);
        let start = tree.area();
        let (found, current) = search.position_of_attached(&tree, node, 0.0);
        tree.begin();
        let (saved, sibling, _) = tree.detach(node);
        assert!((saved - current).abs() <= 1e-12 * saved);
        let without = tree.clone();
        let costs = without.preorder().into_iter().map(|place| {
            let mut tree = without.clone();
            tree.attach(node, place).0
        });
        let least = costs.fold(f64::INFINITY, f64::min);
        let aabb = tree.nodes[node as usize].aabb;
        let area = tree.nodes[node as usize].area;
        for first in [sibling, NONE, any(&tree, &mut rng)] {
            let place = search
                .position_of_detached(&tree, Scope::ALL, (&aabb, area), first, f64::INFINITY)
                .unwrap();
            assert!((place.cost - least).abs() <= 1e-12 * least, "{} {least}", place.cost);
        }
        let below = least * (1.0 - 1e-9);
        assert!(
            search.position_of_detached(&tree, Scope::ALL, (&aabb, area), sibling, below).is_none()
        );
        assert!((found.map_or(current, |place| place.cost) - least).abs() <= 1e-12 * least);
        let place = found.map_or(sibling, |place| place.sibling);
        let (added, _) = tree.attach(node, place);
        assert!((added - least).abs() <= 1e-12 * least && tree.area() <= start * (1.0 + 1e-12));
    }
}

#[test]
fn the_best_place_in_a_region_is_the_best_there_and_costs_what_it_adds() {
    let (_, tree) = scene(60);
    let mut rng = stream(5, 0);
    let mut search = PositionSearch::default();
    let mut elsewhere = 0;
    for _ in 0..200 {
        let mut tree = tree.clone();
        // Random moves, after which the best place is often far away.
        for _ in 0..20 {
            let node = any(&tree, &mut rng);
            tree.detach(node);
            let places = tree.preorder();
            tree.attach(node, places[rng.random_range(0..places.len())]);
        }
        let node = any(&tree, &mut rng);
        let (_, sibling, _) = tree.detach(node);
        let aabb = tree.nodes[node as usize].aabb;
        let area = tree.nodes[node as usize].area;
        let above = tree.nodes[sibling as usize].parent;
        let region = Scope::of(&tree, above, sibling).around(&tree, &aabb);
        let root = region.root(&tree);
        let inside = |&place: &u32| {
            let mut index = place;
            while index != root && index != ANCHOR {
                index = tree.nodes[index as usize].parent;
            }
            index == root
        };
        assert!(
            region == Scope::ALL
                || tree.nodes[root as usize].aabb.union(&aabb) == tree.nodes[root as usize].aabb
        );
        let cost = |place| tree.clone().attach(node, place).0;
        let [least, everywhere] =
            [tree.preorder().into_iter().filter(inside).collect(), tree.preorder()]
                .map(|places: Vec<u32>| places.into_iter().map(cost).fold(f64::INFINITY, f64::min));
        for first in [sibling, NONE] {
            let place = search
                .position_of_detached(&tree, region, (&aabb, area), first, f64::INFINITY)
                .unwrap();
            assert!(inside(&place.sibling));
            assert!((place.cost - least).abs() <= 1e-12 * least, "{} {least}", place.cost);
        }
        elsewhere += u32::from(everywhere < least * (1.0 - 1e-9));
    }
    assert!(elsewhere > 20, "{elsewhere}");
}
