//! The one validator. It checks that nodes and object ids form a tree over exactly the given
//! objects.

mod covering;

use crate::{Aabb, Bvh, BvhView, Clip, InvalidBoxReason, MAX_OBJECTS, NodeKind};

/// The reason why a tree is rejected. Nodes and objects are identified by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // The messages explain the fields.
pub enum InvalidBvh {
    /// The tree was built for another number of objects.
    #[error("the tree names {named} objects but the scene has {objects}")]
    ObjectCount { named: usize, objects: usize },
    /// Counts and indices have 31 bits.
    #[error("{objects} objects are more than the {MAX_OBJECTS} a tree can hold")]
    TooManyObjects { objects: usize },
    /// There are objects without nodes, nodes without objects, or too many nodes.
    #[error("the tree has {nodes} nodes over {objects} objects")]
    NodeCount { nodes: usize, objects: usize },
    /// A node's box is not finite or is inverted.
    #[error("the box of node {node} {reason}")]
    Box { node: usize, reason: InvalidBoxReason },
    /// There must be at least two children, after their parent and inside the array.
    #[error("inner node {node} names children {first}..{first}+{count}, of {nodes} nodes")]
    BadChildren { node: usize, first: u32, count: u32, nodes: usize },
    /// A leaf's range must not be empty and must be inside `prim_ids`.
    #[error("leaf {node} names objects {first}..{first}+{count}, of {objects}")]
    BadLeaf { node: usize, first: u32, count: u32, objects: usize },
    /// A node has no parent or more than one parent. At most two parents are counted.
    #[error("node {node} has {parents} parents")]
    Parents { node: usize, parents: u32 },
    /// An object id is outside the scene.
    #[error("leaf {node} names object {object}, of {objects}")]
    BadObject { node: usize, object: u32, objects: usize },
    /// An object is in no leaf or in several leaves.
    #[error("object {object} is in {leaves} leaves")]
    Leaves { object: usize, leaves: u32 },
    /// A child's box is not inside its parent's box.
    #[error("node {child} is not inside its parent {node}")]
    ChildOutside { node: usize, child: usize },
    /// An object's box is not inside its leaf's box.
    #[error("object {object} is not inside its leaf {node}")]
    ObjectOutside { node: usize, object: usize },
    /// A part of an object is in none of the object's leaves.
    #[error("the leaves of object {object} do not cover it")]
    Uncovered { object: usize },
}

/// Checks that `tree` is a tree over exactly the objects of `boxes`. Every node must be reached
/// once, every object must be in exactly one leaf, and every box must be finite and inside its
/// parent's box. Boxes are compared without tolerance. O(nodes + objects), without recursion; safe
/// on any bits.
pub fn validate(tree: &Bvh, boxes: &[Aabb]) -> Result<(), InvalidBvh> {
    check_structure(tree.into(), boxes.len(), Leaves::One)?;
    check_nesting(tree)?;
    for (index, node) in tree.nodes.iter().enumerate() {
        for &object in &tree.prim_ids[node.prims()] {
            if !node.aabb.contains(&boxes[object as usize]) {
                return Err(InvalidBvh::ObjectOutside { node: index, object: object as usize });
            }
        }
    }
    Ok(())
}

/// Checks a tree in which an object may be in several leaves. The boxes of these leaves together
/// must cover the object; everything else is as for [`validate`]. `boxes` are the boxes of
/// `objects`. O(nodes + references), and O(k²) for an object that k leaves share.
pub fn validate_references(
    tree: &Bvh,
    boxes: &[Aabb],
    objects: &dyn Clip,
) -> Result<(), InvalidBvh> {
    if tree.prim_ids.len() == boxes.len() {
        return validate(tree, boxes);
    }
    check_structure(tree.into(), boxes.len(), Leaves::OneOrMore)?;
    check_nesting(tree)?;
    let mut leaf_counts = vec![0u32; boxes.len()];
    for &object in &tree.prim_ids {
        leaf_counts[object as usize] += 1;
    }
    // Objects and leaves, for every divided object.
    let mut parts: Vec<(u32, u32)> = Vec::new();
    for (index, node) in tree.nodes.iter().enumerate() {
        for &object in &tree.prim_ids[node.prims()] {
            if leaf_counts[object as usize] > 1 {
                parts.push((object, index as u32));
            } else if !node.aabb.contains(&boxes[object as usize]) {
                return Err(InvalidBvh::ObjectOutside { node: index, object: object as usize });
            }
        }
    }
    // Sorting gathers the leaves of each object.
    parts.sort_unstable();
    let mut leaves = Vec::new();
    for parts_of_object in parts.chunk_by(|a, b| a.0 == b.0) {
        let (object, _) = parts_of_object[0];
        leaves.clear();
        leaves.extend(parts_of_object.iter().map(|&(_, leaf)| tree.nodes[leaf as usize].aabb));
        let aabb = &boxes[object as usize];
        // Parts of a triangle that is not finite would be empty, and covered by anything.
        if aabb.check().is_err() || !covering::is_covered(objects, object, aabb, &leaves) {
            return Err(InvalidBvh::Uncovered { object: object as usize });
        }
    }
    Ok(())
}

fn check_nesting(tree: &Bvh) -> Result<(), InvalidBvh> {
    for (index, node) in tree.nodes.iter().enumerate() {
        for child in node.children() {
            if !node.aabb.contains(&tree.nodes[child].aabb) {
                return Err(InvalidBvh::ChildOutside { node: index, child });
            }
        }
    }
    Ok(())
}

/// The number of leaves that an object may be in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leaves {
    One,
    OneOrMore,
}

/// Checks a tree as [`validate`] does, except for the nesting of the boxes. A tree that passes has
/// the properties that make traversals end and stay in bounds, and its boxes and costs are finite.
pub(crate) fn check_structure(
    tree: BvhView,
    objects: usize,
    leaves: Leaves,
) -> Result<(), InvalidBvh> {
    let nodes = tree.nodes.len();
    let references = tree.prim_ids.len();
    if objects.max(references) > MAX_OBJECTS {
        return Err(InvalidBvh::TooManyObjects { objects: objects.max(references) });
    }
    let split = leaves == Leaves::OneOrMore;
    if references < objects || references > objects && (!split || objects == 0) {
        return Err(InvalidBvh::ObjectCount { named: references, objects });
    }
    if (nodes == 0) != (objects == 0) || nodes > 2 * references {
        return Err(InvalidBvh::NodeCount { nodes, objects });
    }
    let mut reached = Marks::new(nodes);
    let mut placed = Marks::new(objects);
    // Positions in `prim_ids`. Without splits they need no marks: every position is in one leaf if
    // every object is.
    let mut positions = Marks::new(if split { references } else { 0 });
    // If nothing is repeated and these sums are right, every node except the root is a child once,
    // and every object is in a leaf once.
    let mut children = 0;
    let mut prims = 0;
    let mut distinct = 0;
    let mut repeated = None;
    for (index, node) in tree.nodes.iter().enumerate() {
        node.aabb.check().map_err(|reason| InvalidBvh::Box { node: index, reason })?;
        match node.kind() {
            NodeKind::Inner { first, count } => {
                let range = node.children();
                // Children after parents and one parent per child: both together exclude cycles.
                if count < 2 || range.start <= index || range.end > nodes {
                    return Err(InvalidBvh::BadChildren { node: index, first, count, nodes });
                }
                children += range.len();
                for child in range {
                    if !reached.set(child) {
                        return Err(InvalidBvh::Parents { node: child, parents: 2 });
                    }
                }
            }
            NodeKind::Leaf { first, count } => {
                let range = node.prims();
                if count < 1 || range.end > references {
                    return Err(InvalidBvh::BadLeaf {
                        node: index,
                        first,
                        count,
                        objects: references,
                    });
                }
                prims += range.len();
                for position in range {
                    let object = tree.prim_ids[position];
                    if object as usize >= objects {
                        return Err(InvalidBvh::BadObject { node: index, object, objects });
                    }
                    let is_new = placed.set(object as usize);
                    distinct += usize::from(is_new);
                    if split && !positions.set(position) || !split && !is_new {
                        repeated = Some(object as usize);
                    }
                }
            }
        }
    }
    if children + 1 < nodes
        && let Some(node) = (1..nodes).find(|&node| !reached.get(node))
    {
        return Err(InvalidBvh::Parents { node, parents: 0 });
    }
    if let Some(object) = repeated {
        return Err(InvalidBvh::Leaves { object, leaves: 2 });
    }
    if distinct < objects
        && let Some(object) = (0..objects).find(|&object| !placed.get(object))
    {
        return Err(InvalidBvh::Leaves { object, leaves: 0 });
    }
    // Every position in `prim_ids` must be in a leaf.
    if prims < references {
        return Err(InvalidBvh::ObjectCount { named: references, objects: prims });
    }
    Ok(())
}

/// A set of indices, one bit per index.
pub(crate) struct Marks(Vec<u64>);

impl Marks {
    pub(crate) fn new(len: usize) -> Self {
        Self(vec![0; len.div_ceil(64)])
    }

    /// Marks an index. Returns whether it was not marked before.
    #[inline(always)]
    pub(crate) fn set(&mut self, index: usize) -> bool {
        let word = &mut self.0[index / 64];
        let bit = 1 << (index % 64);
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    pub(crate) fn get(&self, index: usize) -> bool {
        self.0[index / 64] & 1 << (index % 64) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Node;

    fn cube(x: f32) -> Aabb {
        Aabb::from(([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]))
    }

    fn valid() -> (Bvh, Vec<Aabb>) {
        let boxes = vec![cube(0.0), cube(2.0), cube(4.0)];
        let right = boxes[1].union(&boxes[2]);
        let nodes = vec![
            Node::inner(boxes[0].union(&right), 1, 2),
            Node::leaf(boxes[0], 0, 1),
            Node::inner(right, 3, 2),
            Node::leaf(boxes[1], 1, 1),
            Node::leaf(boxes[2], 2, 1),
        ];
        (Bvh { nodes, prim_ids: vec![0, 1, 2] }, boxes)
    }

    #[test]
    fn a_valid_tree_and_the_empty_tree_pass() {
        let (tree, boxes) = valid();
        assert_eq!(validate(&tree, &boxes), Ok(()));
        assert_eq!(validate(&Bvh::default(), &[]), Ok(()));
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
            (
                |t| t.nodes[4] = Node::leaf(cube(2.0), 1, 1),
                InvalidBvh::Leaves { object: 1, leaves: 2 },
            ),
            (|t| t.nodes[0].aabb.max.x = 4.5, InvalidBvh::ChildOutside { node: 0, child: 2 }),
            (|t| t.nodes[4].aabb.min.y = 0.5, InvalidBvh::ObjectOutside { node: 4, object: 2 }),
        ];
        for (damage, expected) in cases {
            let (mut tree, boxes) = valid();
            damage(&mut tree);
            assert_eq!(validate(&tree, &boxes), Err(expected));
        }
    }

    const UNIT: Aabb = Aabb { min: glam::Vec3::ZERO, max: glam::Vec3::ONE };

    /// A chain: each pair is a leaf and the parent of the next pair, on alternating sides.
    fn chain(objects: u32) -> Bvh {
        let last_leaf = Node::leaf(UNIT, objects - 1, 1);
        let mut nodes = vec![last_leaf];
        let mut parent = 0;
        for object in 0..objects - 1 {
            let first = nodes.len();
            nodes.extend([Node::leaf(UNIT, object, 1), last_leaf]);
            nodes[parent] = Node::inner(UNIT, first as u32, 2);
            parent = first + 1;
            if object % 2 == 0 {
                nodes.swap(first, parent);
                parent = first;
            }
        }
        Bvh { nodes, prim_ids: (0..objects).map(|object| (object + 2) % objects).collect() }
    }

    fn passes(tree: &Bvh) -> bool {
        validate(tree, &vec![UNIT; tree.prim_ids.len()]).is_ok()
    }

    #[test]
    fn no_change_of_a_node_or_of_an_object_id_passes() {
        // Fewer under Miri, which takes thousands of times as long as a processor.
        for objects in [3, if cfg!(miri) { 6 } else { 20 }] {
            let tree = chain(objects);
            assert!(passes(&tree));
            // Every `first` around the indices of the tree, with and without the highest bit.
            let low_words = 0..2 * objects + 2;
            let high_words = low_words.clone().map(|word| word | 1 << 31);
            let firsts = low_words.chain(high_words).chain([u32::MAX]);
            for first in firsts {
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
