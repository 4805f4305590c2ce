//! Conversion from and to the nodes of the JavaScript library `three-mesh-bvh`, whose trees
//! `three-gpu-pathtracer` traces too.

use super::unpack::{Below, unpack};
use crate::collapse::binary;
use crate::{Aabb, Bvh, InvalidBvh, Node};
use bytemuck::{Pod, Zeroable};

/// A node of 32 bytes in the first version of the format that `MeshBVH.deserialize` reads. Nodes
/// are in depth-first order, so that the first child follows its parent.
///
/// | bytes | type | field |
/// |---|---|---|
/// | 0..12 | `f32[3]` | lower corner of the box |
/// | 12..24 | `f32[3]` | upper corner |
/// | 24..28 | `u32` | distance to the second child in nodes, or position of the leaf's first triangle |
/// | 28..32 | `u32` | axis along which the first child is the lower one; of a leaf, the number of triangles, with 0xffff in the upper half |
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs)] // The table explains the fields.
pub struct ThreeMeshNode {
    pub min: [f32; 3],
    pub max: [f32; 3],
    pub below: u32,
    pub axis_or_count: u32,
}

impl ThreeMeshNode {
    pub(super) fn aabb(&self) -> Aabb {
        Aabb::from([self.min, self.max])
    }
}

/// The upper half of `axis_or_count` in a leaf.
pub(super) const LEAF: u32 = 0xffff << 16;

impl Bvh {
    /// Converts the tree to nodes of `three-mesh-bvh`. The positions of leaves refer to the tree's
    /// [`prim_ids`](Bvh::prim_ids), which are the library's `indirectBuffer`, or the order of the
    /// triangles in the index of its geometry. O(nodes).
    ///
    /// Boxes grow by a few units in the last place, as the library's own do, because its arithmetic
    /// is not watertight. They lie in the tree's [frame](Bvh::frame). A node with more than two children
    /// becomes several nodes.
    ///
    /// # Panics
    /// Panics if a leaf has more than 65 535 objects; [`Target::fit`](super::Target::fit) divides
    /// such leaves.
    pub fn to_three_mesh(&self) -> Vec<ThreeMeshNode> {
        let tree = binary(self);
        let mut nodes: Vec<ThreeMeshNode> = Vec::with_capacity(tree.nodes.len());
        // Nodes of `tree`, each with the index of the converted parent if it is the second child.
        let mut open: Vec<(usize, Option<usize>)> =
            if tree.nodes.is_empty() { vec![] } else { vec![(0, None)] };
        while let Some((index, parent)) = open.pop() {
            let to = nodes.len();
            if let Some(parent) = parent {
                nodes[parent].below = (to - parent) as u32;
            }
            let node = &tree.nodes[index];
            let [min, max] = grown(&node.aabb);
            let (below, axis_or_count) = if node.is_leaf() {
                let range = node.prims();
                let count = u16::try_from(range.len()).expect("at most 65535 objects in a leaf");
                (range.start as u32, LEAF | u32::from(count))
            } else {
                let first = node.children().start;
                let (axis, [low, high]) = order(&tree.nodes, first);
                open.extend([(high, Some(to)), (low, None)]);
                (0, axis)
            };
            nodes.push(ThreeMeshNode { min, max, below, axis_or_count });
        }
        nodes
    }

    /// Makes a tree from nodes of `three-mesh-bvh`, such as one of its `roots`, and the ids of the
    /// triangles in the order of its leaves. Rejects indices out of bounds and nodes with two
    /// parents. O(nodes).
    ///
    /// The boxes are the library's; [`refit`](Bvh::refit) makes them tight.
    pub fn from_three_mesh(nodes: &[ThreeMeshNode], prim_ids: &[u32]) -> Result<Self, InvalidBvh> {
        unpack(nodes.len(), prim_ids, |index| {
            let ThreeMeshNode { below, axis_or_count, .. } = nodes[index];
            let below = match axis_or_count.checked_sub(LEAF) {
                Some(count) => Below::Objects { first: below, count },
                None => {
                    let at = [index + 1, index.saturating_add(below as usize)];
                    Below::Children { named: below, at }
                }
            };
            (nodes[index].aabb(), below)
        })
    }
}

/// Returns the axis by which the library should visit two siblings, and the siblings in its order.
///
/// A ray visits the lower sibling first if it goes up the axis, and leaves the other out if its hit
/// lies before that one's box:
///
/// ```text
///   low   ┌────────┐                  hit at x, and the other box begins at or behind x:
///         │    x   │ gap  ┌───────┐   nothing in it can be nearer
///         └────────┘ ←──→ │ high  │
///  ─────── axis ───────→  └───────┘
/// ```
///
/// Hence the axis with the greatest gap between the boxes, relative to both together. It is
/// negative where they overlap.
fn order(nodes: &[Node], first: usize) -> (u32, [usize; 2]) {
    let [a, b] = [first, first + 1].map(|child| nodes[child].aabb);
    let mut best = (f32::NEG_INFINITY, 0, [first, first + 1]);
    for axis in 0..3 {
        let is_swapped = a.min[axis] + a.max[axis] > b.min[axis] + b.max[axis];
        let (low, high) = if is_swapped { (b, a) } else { (a, b) };
        let extent = a.max[axis].max(b.max[axis]) - a.min[axis].min(b.min[axis]);
        let gap = (high.min[axis] - low.max[axis]) / extent;
        // NaN, of boxes without extent along the axis, is not greater.
        if gap > best.0 {
            let children = if is_swapped { [first + 1, first] } else { [first, first + 1] };
            best = (gap, axis as u32, children);
        }
    }
    (best.1, best.2)
}

/// Returns the corners of a box that is larger by about two units in the last place.
fn grown(aabb: &Aabb) -> [[f32; 3]; 2] {
    // Halved before the subtraction, which could overflow.
    let half = 0.5 * aabb.max - 0.5 * aabb.min;
    let margin = |corner: glam::Vec3| f32::EPSILON * corner.abs() + f32::EPSILON * half;
    let largest = glam::Vec3::splat(f32::MAX);
    let min = (aabb.min - margin(aabb.min)).max(-largest);
    let max = (aabb.max + margin(aabb.max)).min(largest);
    [min.to_array(), max.to_array()]
}
