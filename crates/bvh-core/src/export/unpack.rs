//! The way back from any layout: its nodes, read one by one, become a tree in depth-first order.

use crate::validate::Marks;
use crate::{Aabb, Bvh, InvalidBvh, MAX_OBJECTS, Node};
use alloc::vec::Vec;

/// What a node of a layout refers to.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Node(usize),
    /// A range of the object ids.
    Leaf {
        first: u32,
        count: u32,
    },
}

/// The tree of `nodes` nodes, of which node 0 is the root, with the box `root` or else that around its parts. `read` appends
/// the parts of a node: two or more children, or one thing that takes its place. Nodes and ids that cannot be reached are
/// left out. Refuses indices out of bounds and nodes with two parents. O(nodes).
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
    // Parts, the nodes that name them, and their places in the tree.
    let mut open: Vec<(Part, usize, usize)> = Vec::new();
    let mut parts = Vec::new();
    if nodes > 0 {
        tree.nodes.push(Node::leaf(root.unwrap_or(Aabb::EMPTY), 0, 0));
        open.push((Part::Node(0), 0, 0));
    }
    while let Some((part, node, to)) = open.pop() {
        match part {
            Part::Node(from) => {
                if from >= nodes {
                    return Err(InvalidBvh::BadChildren { node, first: from as u32, count: 1, nodes });
                }
                if !reached.set(from) {
                    return Err(InvalidBvh::Parents { node: from, parents: 2 });
                }
                parts.clear();
                read(from, &mut parts)?;
                if to == 0 && root.is_none() {
                    tree.nodes[0].aabb = parts.iter().fold(Aabb::EMPTY, |around, (aabb, _)| around.union(aabb));
                }
                match parts[..] {
                    [] => return Err(InvalidBvh::BadChildren { node: from, first: 0, count: 0, nodes }),
                    [(_, part)] => open.push((part, from, to)),
                    _ => {
                        let below = tree.nodes.len();
                        tree.nodes[to] = Node::inner(tree.nodes[to].aabb, below as u32, parts.len() as u32);
                        tree.nodes.extend(parts.iter().map(|(aabb, _)| Node::leaf(*aabb, 0, 0)));
                        open.extend(
                            (below..tree.nodes.len())
                                .zip(&parts)
                                .map(|(to, &(_, part))| (part, from, to))
                                .rev(),
                        );
                    }
                }
            }
            Part::Leaf { first, count } => {
                // No overflow: `first` is compared before it is added to.
                if count == 0 || count as usize > objects || first as usize > objects - count as usize {
                    return Err(InvalidBvh::BadLeaf { node, first, count, objects });
                }
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
