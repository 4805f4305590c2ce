//! Conversion from any layout: nodes that are read one by one become a tree in depth-first order.

use crate::validate::Marks;
use crate::{Aabb, Bvh, InvalidBvh, MAX_OBJECTS, Node};

/// What is below a node of a layout.
pub(super) enum Below {
    /// Two nodes, by their indices in the layout, and the number by which the node names them.
    Children { named: u32, at: [usize; 2] },
    /// A range of the object ids.
    Objects { first: u32, count: u32 },
}

/// Makes a tree from a layout of `nodes` nodes, the root first. `read` returns the box of a node and
/// what is below it. Nodes and ids that cannot be reached are skipped. Rejects indices out of bounds
/// and nodes with two parents. O(nodes).
pub(super) fn unpack(
    nodes: usize,
    prim_ids: &[u32],
    read: impl Fn(usize) -> (Aabb, Below),
) -> Result<Bvh, InvalidBvh> {
    let objects = prim_ids.len();
    if nodes > 2 * MAX_OBJECTS || objects > MAX_OBJECTS {
        return Err(InvalidBvh::TooManyObjects { objects: objects.max(nodes / 2) });
    }
    let mut tree = Bvh::default();
    let mut reached = Marks::new(nodes);
    let unread = Node::leaf(Aabb::EMPTY, 0, 0);
    // Nodes of the layout, with their indices in the tree.
    let mut open = Vec::new();
    if nodes > 0 {
        tree.nodes.push(unread);
        open.push((0, 0));
    }
    while let Some((node, to)) = open.pop() {
        // One parent per node excludes cycles.
        if !reached.set(node) {
            return Err(InvalidBvh::Parents { node, parents: 2 });
        }
        let (aabb, below) = read(node);
        tree.nodes[to] = match below {
            Below::Children { named: first, at: [low, high] } => {
                if low.max(high) >= nodes {
                    return Err(InvalidBvh::BadChildren { node, first, count: 2, nodes });
                }
                let first = tree.nodes.len();
                tree.nodes.extend([unread; 2]);
                // The first child is popped first.
                open.extend([(high, first + 1), (low, first)]);
                Node::inner(aabb, first as u32, 2)
            }
            Below::Objects { first, count } => {
                let range = first as usize..(first as usize).saturating_add(count as usize);
                let ids = prim_ids.get(range).filter(|ids| !ids.is_empty());
                let ids = ids.ok_or(InvalidBvh::BadLeaf { node, first, count, objects })?;
                // The leaves of a forged array may share ids and together have more than there are.
                let start = tree.prim_ids.len();
                let named = start + ids.len();
                if named > objects {
                    return Err(InvalidBvh::ObjectCount { named, objects });
                }
                tree.prim_ids.extend_from_slice(ids);
                Node::leaf(aabb, start as u32, count)
            }
        };
    }
    Ok(tree)
}
