//! Conversion from any layout: nodes that are read one by one become a tree in depth-first order.

use crate::validate::Marks;
use crate::{Aabb, Bvh, InvalidBvh, MAX_OBJECTS, Node};
use alloc::vec::Vec;

/// A part of a node in a layout.
#[derive(Clone, Copy)]
pub(super) enum Part {
    /// A node, by its index in the layout.
    Node(usize),
    /// A range of the object ids.
    Leaf { first: u32, count: u32 },
}

/// A part that is not yet in the tree.
struct Pending {
    part: Part,
    /// The node that the part belongs to, by its index in the layout, for errors.
    parent: usize,
    /// The index of the part's node in the tree.
    to: usize,
}

/// Makes a tree from a layout of `nodes` nodes. Node 0 is the root. Its box is `root`, or the box
/// around its parts if `root` is `None`. `read` appends the parts of a node: two or more children,
/// or a single part that replaces the node. Nodes and ids that cannot be reached are skipped.
/// Rejects indices out of bounds and nodes with two parents. O(nodes).
pub(super) fn unpack(
    nodes: usize,
    prim_ids: &[u32],
    root: Option<Aabb>,
    read: impl Fn(usize, &mut Vec<(Aabb, Part)>) -> Result<(), InvalidBvh>,
) -> Result<Bvh, InvalidBvh> {
    let objects = prim_ids.len();
    if nodes > 2 * MAX_OBJECTS || objects > MAX_OBJECTS {
        return Err(InvalidBvh::TooManyObjects { objects: objects.max(nodes / 2) });
    }
    let mut tree = Bvh::default();
    let mut reached = Marks::new(nodes);
    let mut open: Vec<Pending> = Vec::new();
    let mut parts = Vec::new();
    if nodes > 0 {
        tree.nodes.push(Node::leaf(root.unwrap_or(Aabb::EMPTY), 0, 0));
        open.push(Pending { part: Part::Node(0), parent: 0, to: 0 });
    }
    while let Some(Pending { part, parent, to }) = open.pop() {
        match part {
            Part::Node(index) => {
                if index >= nodes {
                    let first = index as u32;
                    return Err(InvalidBvh::BadChildren { node: parent, first, count: 1, nodes });
                }
                // One parent per node excludes cycles.
                if !reached.set(index) {
                    return Err(InvalidBvh::Parents { node: index, parents: 2 });
                }
                parts.clear();
                read(index, &mut parts)?;
                if to == 0 && root.is_none() {
                    tree.nodes[0].aabb = around(&parts);
                }
                match parts[..] {
                    [] => {
                        return Err(InvalidBvh::BadChildren {
                            node: index,
                            first: 0,
                            count: 0,
                            nodes,
                        });
                    }
                    [(_, part)] => open.push(Pending { part, parent: index, to }),
                    _ => {
                        let first = tree.nodes.len();
                        tree.nodes[to] =
                            Node::inner(tree.nodes[to].aabb, first as u32, parts.len() as u32);
                        // Leaves without objects until the parts are read.
                        for (aabb, _) in &parts {
                            tree.nodes.push(Node::leaf(*aabb, 0, 0));
                        }
                        // Reversed, so that the first part is popped first.
                        for (offset, &(_, part)) in parts.iter().enumerate().rev() {
                            open.push(Pending { part, parent: index, to: first + offset });
                        }
                    }
                }
            }
            Part::Leaf { first, count } => {
                // `first + count` could overflow, so `count` is subtracted instead.
                if count == 0
                    || count as usize > objects
                    || first as usize > objects - count as usize
                {
                    return Err(InvalidBvh::BadLeaf { node: parent, first, count, objects });
                }
                // The leaves of a forged array may share ids and together have more than there are.
                let named = tree.prim_ids.len() + count as usize;
                if named > objects {
                    return Err(InvalidBvh::ObjectCount { named, objects });
                }
                tree.nodes[to] = Node::leaf(tree.nodes[to].aabb, tree.prim_ids.len() as u32, count);
                tree.prim_ids.extend_from_slice(&prim_ids[first as usize..][..count as usize]);
            }
        }
    }
    Ok(tree)
}

fn around(parts: &[(Aabb, Part)]) -> Aabb {
    let mut aabb = Aabb::EMPTY;
    for (part, _) in parts {
        aabb = aabb.union(part);
    }
    aabb
}
