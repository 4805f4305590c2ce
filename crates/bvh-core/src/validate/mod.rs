//! The one validator: whether nodes and object ids form a tree over exactly the given objects.

mod covering;
mod fast_path;

pub(crate) use fast_path::FastPath;

use crate::{Aabb, Bvh, BvhView, Clip, InvalidBoxReason, MAX_OBJECTS, NodeKind};
use alloc::vec::Vec;

/// Why a tree was refused. Nodes and objects are named by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the indices that the messages name
pub enum InvalidBvh {
    /// The tree was built for another number of objects.
    #[error("the tree names {named} objects but the scene has {objects}")]
    ObjectCount { named: usize, objects: usize },
    /// Counts and indices are 31 bits wide.
    #[error("{objects} objects are more than the {MAX_OBJECTS} a tree can hold")]
    TooManyObjects { objects: usize },
    /// Objects without nodes, or nodes without objects.
    #[error("the tree has {nodes} nodes over {objects} objects")]
    NodeCount { nodes: usize, objects: usize },
    /// A node's box is not finite or is inverted.
    #[error("the box of node {node} {reason}")]
    Box { node: usize, reason: InvalidBoxReason },
    /// Children must follow their parent and lie inside the array, two at least.
    #[error("inner node {node} names children {first}..{first}+{count}, of {nodes} nodes")]
    BadChildren { node: usize, first: u32, count: u32, nodes: usize },
    /// A leaf's range must be non-empty and inside `prim_ids`.
    #[error("leaf {node} names objects {first}..{first}+{count}, of {objects}")]
    BadLeaf { node: usize, first: u32, count: u32, objects: usize },
    /// A node that no parent or more than one parent names; only two are counted.
    #[error("node {node} has {parents} parents")]
    Parents { node: usize, parents: u32 },
    /// An object id outside the scene.
    #[error("leaf {node} names object {object}, of {objects}")]
    BadObject { node: usize, object: u32, objects: usize },
    /// An object in no leaf or in several.
    #[error("object {object} is in {leaves} leaves")]
    Leaves { object: usize, leaves: u32 },
    /// A child's box that is not inside its parent's.
    #[error("node {child} is not inside its parent {node}")]
    ChildOutside { node: usize, child: usize },
    /// An object's box that is not inside its leaf's.
    #[error("object {object} is not inside its leaf {node}")]
    ObjectOutside { node: usize, object: usize },
    /// A part of an object that is in none of its leaves.
    #[error("the leaves of object {object} do not cover it")]
    Uncovered { object: usize },
}

/// Checks that `tree` is a tree over exactly the objects of `boxes`: every node is reached once, every object is in
/// exactly one leaf, and every box is finite and lies inside its parent's, compared without tolerance.
/// O(nodes + objects), no recursion; safe on any bits.
pub fn validate(tree: &Bvh, boxes: &[Aabb]) -> Result<(), InvalidBvh> {
    check_structure(tree.into(), boxes.len())?;
    check_nesting(tree)?;
    for (node, at) in tree.nodes.iter().enumerate() {
        let mut objects = tree.prim_ids[at.prims()].iter().map(|&object| object as usize);
        if let Some(object) = objects.find(|&object| !at.aabb.contains(&boxes[object])) {
            return Err(InvalidBvh::ObjectOutside { node, object });
        }
    }
    Ok(())
}

/// As [`validate`], for trees in which an object may be in several leaves: their boxes together must cover it. `objects` are
/// those whose boxes are `boxes`. O(nodes + references), and O(k²) for an object that k leaves share.
pub fn validate_references(tree: &Bvh, boxes: &[Aabb], objects: &dyn Clip) -> Result<(), InvalidBvh> {
    if tree.prim_ids.len() == boxes.len() {
        return validate(tree, boxes);
    }
    find_fault(tree.into(), boxes.len(), Leaves::OneOrMore)?;
    check_nesting(tree)?;
    let mut leaves_of = alloc::vec![0u32; boxes.len()];
    tree.prim_ids.iter().for_each(|&object| leaves_of[object as usize] += 1);
    let mut parts: Vec<(u32, u32)> = Vec::new();
    for (node, at) in tree.nodes.iter().enumerate() {
        for &object in &tree.prim_ids[at.prims()] {
            if leaves_of[object as usize] > 1 {
                parts.push((object, node as u32));
            } else if !at.aabb.contains(&boxes[object as usize]) {
                return Err(InvalidBvh::ObjectOutside { node, object: object as usize });
            }
        }
    }
    parts.sort_unstable();
    let mut leaves = Vec::new();
    for parts in parts.chunk_by(|a, b| a.0 == b.0) {
        let object = parts[0].0;
        leaves.clear();
        leaves.extend(parts.iter().map(|&(_, node)| tree.nodes[node as usize].aabb));
        if !covering::is_covered(objects, object, &boxes[object as usize], &leaves) {
            return Err(InvalidBvh::Uncovered { object: object as usize });
        }
    }
    Ok(())
}

/// Refuses a child's box that is not inside its parent's.
fn check_nesting(tree: &Bvh) -> Result<(), InvalidBvh> {
    for (node, at) in tree.nodes.iter().enumerate() {
        if let Some(child) = at.children().find(|&child| !at.aabb.contains(&tree.nodes[child].aabb)) {
            return Err(InvalidBvh::ChildOutside { node, child });
        }
    }
    Ok(())
}

/// [`validate`] without the nesting of the boxes: the properties that make a traversal end and stay in bounds, and boxes
/// and costs finite.
///
/// Loading a tree spends most of its time here, so the most common kind of tree is passed by a check without
/// unpredictable branches. Any other tree, and any fault, goes to [`find_fault`].
pub(crate) fn check_structure(tree: BvhView, objects: usize) -> Result<(), InvalidBvh> {
    if FastPath::passes(tree, objects) { Ok(()) } else { find_fault(tree, objects, Leaves::One) }
}

/// How many leaves an object may be in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leaves {
    One,
    OneOrMore,
}

/// The first fault in a tree's structure, if it has any.
pub(crate) fn find_fault(tree: BvhView, objects: usize, leaves: Leaves) -> Result<(), InvalidBvh> {
    let (nodes, references) = (tree.nodes.len(), tree.prim_ids.len());
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
    let (mut reached, mut placed) = (Marks::new(nodes), Marks::new(objects));
    // Positions in `prim_ids`. Without splits, each is in one leaf if each object is.
    let mut positions = Marks::new(if split { references } else { 0 });
    // Every node but the root is a child once, every object in a leaf once, if none is repeated and the sums are right.
    let (mut children, mut prims, mut distinct) = (0, 0, 0);
    let mut repeated = None;
    for (index, node) in tree.nodes.iter().enumerate() {
        node.aabb.check().map_err(|reason| InvalidBvh::Box { node: index, reason })?;
        match node.kind() {
            NodeKind::Inner { first, count } => {
                let range = node.children();
                // Children after parents: together with one parent each this excludes cycles.
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
                    return Err(InvalidBvh::BadLeaf { node: index, first, count, objects: references });
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
    // Nothing is named in vain.
    if prims < references {
        return Err(InvalidBvh::ObjectCount { named: references, objects: prims });
    }
    Ok(())
}

/// One bit per index.
pub(crate) struct Marks(Vec<u64>);

impl Marks {
    pub(crate) fn new(len: usize) -> Self {
        Self(alloc::vec![0; len.div_ceil(64)])
    }

    /// Marks an index and returns whether it was unmarked before.
    #[inline(always)]
    pub(crate) fn set(&mut self, index: usize) -> bool {
        let (word, bit) = (&mut self.0[index / 64], 1 << (index % 64));
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
    use alloc::vec;

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
    fn every_kind_of_damage_is_named() {
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
            (|t| t.nodes[0] = Node::leaf(t.nodes[0].aabb, 0, 1), InvalidBvh::Parents { node: 1, parents: 0 }),
            (
                |t| t.nodes[0].aabb.min.x = f32::NEG_INFINITY,
                InvalidBvh::Box { node: 0, reason: InvalidBoxReason::NotFinite },
            ),
            (|t| t.nodes[3].aabb.max.z = -1.0, InvalidBvh::Box { node: 3, reason: InvalidBoxReason::Inverted }),
            (|t| t.prim_ids[1] = 3, InvalidBvh::BadObject { node: 3, object: 3, objects: 3 }),
            (|t| t.nodes[4] = Node::leaf(cube(2.0), 1, 1), InvalidBvh::Leaves { object: 1, leaves: 2 }),
            (|t| t.nodes[0].aabb.max.x = 4.5, InvalidBvh::ChildOutside { node: 0, child: 2 }),
            (|t| t.nodes[4].aabb.min.y = 0.5, InvalidBvh::ObjectOutside { node: 4, object: 2 }),
        ];
        for (damage, expected) in cases {
            let (mut tree, boxes) = valid();
            damage(&mut tree);
            assert_eq!(validate(&tree, &boxes), Err(expected));
        }
    }
}
