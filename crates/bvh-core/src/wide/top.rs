//! The wide layout of the tree over instances, for batches of rays.

use super::build::lay_out_nodes;
use super::decide::{BLOCK_COST, areas, decide};
use super::kernel::Kernel;
use super::layout::WideBvh;
use super::node::Child;
use crate::collapse::binary;
use crate::{Aabb, Bvh, Node};

/// Lays out a valid tree over the boxes of instances, or over boxes around them, with a leaf for
/// each instance. Rays go on in `parts`: the parts of the instances. The layout has the kernel of
/// the parts if all have the same, otherwise the portable one. O(instances +
/// parts).
pub(crate) fn lay_out_instances<'p>(
    tree: &Bvh,
    boxes: &[Aabb],
    parts: impl Iterator<Item = &'p WideBvh>,
) -> WideBvh {
    let mut wide = WideBvh::without_nodes(tree.root_aabb().unwrap_or(Aabb::EMPTY));
    if tree.nodes.is_empty() {
        return wide;
    }
    let mut tree = one_per_leaf(tree, boxes);
    tree.refit(boxes);
    let tree = binary(&tree);
    let visits = areas(&tree);
    // A node is cheap compared with an instance, so a box for each instance pays.
    let (decisions, _) = decide(&tree, &visits, |objects| (objects == 1).then_some(BLOCK_COST));
    let instance = |subtree: usize| {
        let place = tree.nodes[subtree].prims().start;
        Some(Child::instance(tree.prim_ids[place]))
    };
    // Rays that ask for any hit visit the largest child first.
    lay_out_nodes(&mut wide, &tree, &decisions, &visits, boxes.len().div_ceil(4), instance);
    let mut kernel = None;
    let mut need = 0;
    for part in parts {
        need = need.max(part.stack_need);
        if kernel.is_some_and(|kernel| kernel != part.kernel) {
            return wide;
        }
        kernel = Some(part.kernel);
    }
    // A mark waits between the children of this layout and those of a part. An index below the
    // greatest two is never a mark's.
    wide.stack_need += need + 1;
    if boxes.len() < Child::INSTANCE as usize - 2 {
        wide.kernel = kernel.unwrap_or(Kernel::Portable);
    }
    wide
}

/// Returns the same tree with leaves of one object each.
fn one_per_leaf(tree: &Bvh, boxes: &[Aabb]) -> Bvh {
    let mut divided = tree.clone();
    for index in 0..tree.nodes.len() {
        let node = tree.nodes[index];
        let objects = node.prims();
        if objects.len() < 2 {
            continue;
        }
        let first = divided.nodes.len() as u32;
        for place in objects.clone() {
            let aabb = boxes[tree.prim_ids[place] as usize];
            divided.nodes.push(Node::leaf(aabb, place as u32, 1));
        }
        divided.nodes[index] = Node::inner(node.aabb, first, objects.len() as u32);
    }
    divided
}
