//! The one validator. It checks that nodes and object ids form a tree over exactly the given
//! objects.

mod covering;

use crate::cost::{CallBoth, call_in_turn};
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
    /// The leaves of an object overlap so much that the check of their covering would take long.
    #[error("the {leaves} leaves of object {object} overlap too much to be checked")]
    Entangled { object: usize, leaves: usize },
}

/// Checks that `tree` is a tree over exactly the objects of `boxes`. Every node must be reached
/// once, every object must be in exactly one leaf, and every box must be finite and inside its
/// parent's box. Boxes are compared without tolerance. O(nodes + objects), without recursion; safe
/// on any bits.
pub fn validate(tree: &Bvh, boxes: &[Aabb]) -> Result<(), InvalidBvh> {
    validate_whole(tree, boxes, &call_in_turn)
}

fn validate_whole(tree: &Bvh, boxes: &[Aabb], both: CallBoth) -> Result<(), InvalidBvh> {
    let mut structure = Ok(());
    let mut nesting = Ok(());
    both(&mut || structure = check_structure(tree.into(), boxes.len(), Leaves::One), &mut || {
        nesting = check_nesting(tree, boxes, |_| true)
    });
    structure.and(nesting)
}

/// Checks a tree in which an object may be in several leaves. The boxes of these leaves together
/// must cover the object; everything else is as for [`validate`]. `boxes` are the boxes of
/// `objects`. O(nodes + references), and O(k log² k) for an object that k leaves share:
/// of leaves that overlap far more than parts do, no more is checked, which is an error.
pub fn validate_references(
    tree: &Bvh,
    boxes: &[Aabb],
    objects: &dyn Clip,
) -> Result<(), InvalidBvh> {
    validate_parts(tree, boxes, Some(objects), &call_in_turn)
}

/// Checks a tree as [`validate_references`] does. Of divided objects of an unknown shape, their
/// leaves together must reach as far as they do.
pub(crate) fn validate_parts(
    tree: &Bvh,
    boxes: &[Aabb],
    objects: Option<&dyn Clip>,
    both: CallBoth,
) -> Result<(), InvalidBvh> {
    if tree.prim_ids.len() == boxes.len() {
        return validate_whole(tree, boxes, both);
    }
    check_structure(tree.into(), boxes.len(), Leaves::OneOrMore)?;
    let mut leaf_counts = vec![0u32; boxes.len()];
    for &object in &tree.prim_ids {
        leaf_counts[object as usize] += 1;
    }
    let is_whole = |object: u32| leaf_counts[object as usize] == 1;
    check_nesting(tree, boxes, is_whole)?;
    // Objects and leaves, for every divided object.
    let mut parts: Vec<(u32, u32)> = Vec::new();
    for (index, node) in tree.nodes.iter().enumerate() {
        let divided = tree.prim_ids[node.prims()].iter().filter(|&&object| !is_whole(object));
        parts.extend(divided.map(|&object| (object, index as u32)));
    }
    // Sorting gathers the leaves of each object.
    parts.sort_unstable();
    let mut leaves = Vec::new();
    for parts_of_object in parts.chunk_by(|a, b| a.0 == b.0) {
        let (object, _) = parts_of_object[0];
        leaves.clear();
        leaves.extend(parts_of_object.iter().map(|&(_, leaf)| tree.nodes[leaf as usize].aabb));
        let aabb = &boxes[object as usize];
        let uncovered = Err(InvalidBvh::Uncovered { object: object as usize });
        // Parts of a triangle that is not finite would be empty, and covered by anything.
        match objects {
            _ if aabb.check().is_err() => return uncovered,
            Some(objects) => covering::check(objects, object, aabb, &leaves)?,
            None if Aabb::union_of(&leaves).contains(aabb) => {}
            None => return uncovered,
        }
    }
    Ok(())
}

/// Checks that every child, and every object that is whole, is inside its node's box. Leaves what
/// does not exist to [`check_structure`].
pub(crate) fn check_nesting(
    tree: &Bvh,
    boxes: &[Aabb],
    is_whole: impl Fn(u32) -> bool,
) -> Result<(), InvalidBvh> {
    for (index, node) in tree.nodes.iter().enumerate() {
        for child in node.children() {
            let Some(part) = tree.nodes.get(child) else { break };
            if !node.aabb.contains(&part.aabb) {
                return Err(InvalidBvh::ChildOutside { node: index, child });
            }
        }
        for position in node.prims() {
            let Some(&object) = tree.prim_ids.get(position) else { break };
            let Some(aabb) = boxes.get(object as usize) else { continue };
            if is_whole(object) && !node.aabb.contains(aabb) {
                return Err(InvalidBvh::ObjectOutside { node: index, object: object as usize });
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
                    let (node, objects) = (index, references);
                    return Err(InvalidBvh::BadLeaf { node, first, count, objects });
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
