//! Every kind of damage to a tree is found.

use crate::support::{Random, SHAPES, chain, tree};
use bvh_core::{Aabb, Bvh, InvalidBoxReason, InvalidBvh, Node, validate};
use glam::Vec3;

fn cube(x: f32) -> Aabb {
    Aabb::from([[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]])
}

#[test]
fn every_kind_of_damage_is_reported() {
    type Damage = fn(&mut Bvh);
    let cases: [(Damage, InvalidBvh); 12] = [
        (|t| t.prim_ids.truncate(2), InvalidBvh::ObjectCount { named: 2, objects: 3 }),
        (|t| t.nodes.clear(), InvalidBvh::NodeCount { nodes: 0, objects: 3 }),
        (
            |t| t.nodes[2] = Node::inner(t.nodes[2].aabb, 2, 2),
            InvalidBvh::BadChildren { node: 2, first: 2, count: 2, nodes: 5 },
        ),
        (
            |t| t.nodes[2] = Node::inner(t.nodes[2].aabb, 4, 2),
            InvalidBvh::BadChildren { node: 2, first: 4, count: 2, nodes: 5 },
        ),
        (
            |t| t.nodes[4] = Node::leaf(t.nodes[4].aabb, 2, 2),
            InvalidBvh::BadLeaf { node: 4, first: 2, count: 2, objects: 3 },
        ),
        (
            |t| t.nodes[0] = Node::leaf(t.nodes[0].aabb, 0, 1),
            InvalidBvh::Parents { node: 1, parents: 0 },
        ),
        (
            |t| t.nodes[0].aabb.min.x = f32::NEG_INFINITY,
            InvalidBvh::Box { node: 0, reason: InvalidBoxReason::NotFinite },
        ),
        (
            |t| t.nodes[3].aabb.max.z = -1.0,
            InvalidBvh::Box { node: 3, reason: InvalidBoxReason::Inverted },
        ),
        (|t| t.prim_ids[1] = 3, InvalidBvh::BadObject { node: 3, object: 3, objects: 3 }),
        (|t| t.nodes[4] = Node::leaf(cube(2.0), 1, 1), InvalidBvh::Leaves { object: 1, leaves: 2 }),
        (|t| t.nodes[0].aabb.max.x = 4.5, InvalidBvh::ChildOutside { node: 0, child: 2 }),
        (|t| t.nodes[4].aabb.min.y = 0.5, InvalidBvh::ObjectOutside { node: 4, object: 2 }),
    ];
    let boxes = [0.0, 2.0, 4.0].map(cube);
    assert_eq!(validate(&chain(&boxes), &boxes), Ok(()));
    for (damage, expected) in cases {
        let mut tree = chain(&boxes);
        damage(&mut tree);
        assert_eq!(validate(&tree, &boxes), Err(expected));
    }
}

const UNIT: Aabb = Aabb { min: Vec3::ZERO, max: Vec3::ONE };

#[test]
fn no_change_of_a_node_or_of_an_object_id_passes() {
    assert_eq!(validate(&Bvh::default(), &[]), Ok(()));
    let mut random = Random(1);
    for objects in [3, 20] {
        // Equal boxes, so that every fault is one of structure.
        let boxes = vec![UNIT; objects as usize];
        let [binary, wide] = [2, 3].map(|shape| tree(&boxes, SHAPES[shape], &mut random));
        for mut tree in [chain(&boxes), binary, wide] {
            tree.prim_ids.rotate_left(2);
            let passes = |tree: &Bvh| validate(tree, &boxes).is_ok();
            assert!(passes(&tree));
            // Every `first` around the indices of the tree, with and without the highest bit.
            let low_words = 0..2 * objects + 2;
            let high_words = low_words.clone().map(|word| word | 1 << 31);
            for first in low_words.chain(high_words).chain([u32::MAX]) {
                for count in 0..4 {
                    for node in [Node::inner(UNIT, first, count), Node::leaf(UNIT, first, count)] {
                        for index in 0..tree.nodes.len() {
                            let mut changed = tree.clone();
                            changed.nodes[index] = node;
                            assert_eq!(passes(&changed), changed == tree, "{:?}", changed.nodes);
                        }
                    }
                }
            }
            for position in 0..tree.prim_ids.len() {
                for id in 0..objects + 3 {
                    let mut changed = tree.clone();
                    changed.prim_ids[position] = id;
                    assert_eq!(passes(&changed), changed == tree);
                }
            }
        }
    }
}
