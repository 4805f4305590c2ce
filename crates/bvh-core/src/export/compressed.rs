//! Nodes of eight children in 80 bytes. The children's boxes are rounded outwards to a grid of 8
//! bits per axis.

use super::unpack::{Part, unpack};
use crate::collapse::{binary, collect};
use crate::wide::{areas, children, decide};
use crate::{Aabb, Bvh, InvalidBvh, validate};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// The largest number of objects in a leaf. Three bits store the number in unary.
const LEAF: usize = 3;

/// A node of up to eight children in 80 bytes.
///
/// | bytes | type | field |
/// |---|---|---|
/// | 0..12 | `f32[3]` | lower corner of the node: the grid's origin |
/// | 12..15 | `u8[3]` | the grid's step along x, y and z: the biased exponent of an `f32` power of two |
/// | 15 | `u8` | bit `i` is set if the child in slot `i` is a node |
/// | 16..20 | `u32` | index of the first child that is a node; other such children follow in the order of their slots |
/// | 20..24 | `u32` | position of the first object id of the node's leaves |
/// | 24..32 | `u8[8]` | one byte per slot. Empty slot: 0. Node: `0b001` in the upper three bits and 24 + slot in the lower five. Leaf: as many ones as it has objects (1 to 3) in the upper three bits, and the position of its first object relative to the node's first in the lower five |
/// | 32..56 | `u8[3][8]` | lower x of all slots, lower y, lower z, in steps from the origin |
/// | 56..80 | `u8[3][8]` | upper x, upper y, upper z |
///
/// The child in slot `i` is on the upper side along x if bit 2 of `i` is set, along y for bit 1,
/// and along z for bit 0, as far as the children allow it. Rays can therefore visit slots in the
/// order of `slot ^ octant` without sorting.
///
/// Source: Ylitie, Karras & Laine 2017, 'Efficient incoherent ray traversal on GPUs through
/// compressed wide BVHs', section 3. Differs from the paper: slots are assigned greedily, as in
/// `tinybvh`. `tinybvh` stores exponents minus 127. `obvhs` stores the planes in the order lower x,
/// upper x, lower y and so on. Everything else is the same in both libraries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CompressedNode {
    origin: Vec3,
    exponents: [u8; 3],
    inner: u8,
    first_node: u32,
    first_object: u32,
    meta: [u8; 8],
    low: [[u8; 8]; 3],
    high: [[u8; 8]; 3],
}

/// A tree of compressed nodes, the root first, and its object ids.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompressedBvh {
    /// The nodes.
    pub nodes: Vec<CompressedNode>,
    /// The object ids in the order of the leaves.
    pub prim_ids: Vec<u32>,
}

/// Returns the step of a grid. An exponent of 0 would mean a step of 0.
fn step(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

impl CompressedNode {
    fn around(aabb: &Aabb) -> Self {
        let mut exponents = aabb.extent().to_array().map(exponent);
        for (axis, exponent) in exponents.iter_mut().enumerate() {
            // The extent may be rounded to 255 steps, past which the upper corner lies.
            let last = aabb.min[axis] + 255.0 * step(*exponent);
            *exponent += u8::from(last < aabb.max[axis]);
        }
        Self { origin: aabb.min, exponents, ..Self::zeroed() }
    }

    /// Stores the box of a slot, rounded outwards. The division by a power of two is exact. The
    /// difference may round to a plane of the grid, past which the corner lies.
    fn set_box(&mut self, slot: usize, aabb: &Aabb) {
        let steps = DVec3::from(self.exponents.map(|exponent| f64::from(step(exponent))));
        let origin = self.origin.as_dvec3();
        let low = (aabb.min.as_dvec3() - origin) / steps;
        let high = (aabb.max.as_dvec3() - origin) / steps;
        for axis in 0..3 {
            self.low[axis][slot] = libm::floor(low[axis]) as u8;
            self.high[axis][slot] = libm::ceil(high[axis]) as u8;
        }
        let rounded = self.slot_box(slot);
        for axis in 0..3 {
            self.low[axis][slot] -= u8::from(rounded.min[axis] > aabb.min[axis]);
            self.high[axis][slot] += u8::from(rounded.max[axis] < aabb.max[axis]);
        }
    }

    /// Returns the box of a slot. Rounding to f32 is monotone: everything inside the grid's planes
    /// is inside the rounded planes.
    fn slot_box(&self, slot: usize) -> Aabb {
        Aabb { min: self.corner(slot, &self.low), max: self.corner(slot, &self.high) }
    }

    fn corner(&self, slot: usize, planes: &[[u8; 8]; 3]) -> Vec3 {
        let offset =
            [0, 1, 2].map(|axis| f32::from(planes[axis][slot]) * step(self.exponents[axis]));
        // The last plane of a huge grid may overflow, and boxes are finite.
        (self.origin + Vec3::from(offset)).min(Vec3::MAX)
    }
}

/// Returns the exponent of the smallest step such that 255 steps cover `extent`.
fn exponent(extent: f64) -> u8 {
    let rounded_down = libm::ilogb(extent / 255.0).saturating_add(127);
    let exponent = rounded_down.clamp(1, 253) as u8;
    // One more where the power of two below is too small.
    exponent + u8::from(255.0 * f64::from(step(exponent)) < extent)
}

impl CompressedBvh {
    /// Compresses `tree`, which must be valid over `boxes`. The result has the least expected time
    /// for a random line among all wide trees that can be made by removing nodes of `tree`. Leaves
    /// of more than three objects are divided first. O(objects).
    pub fn new(tree: &Bvh, boxes: &[Aabb]) -> Result<Self, InvalidBvh> {
        validate(tree, boxes)?;
        let mut compressed = Self::default();
        if tree.nodes.is_empty() {
            return Ok(compressed);
        }
        let mut tree = binary(tree).into_owned();
        tree.halve_leaves(LEAF);
        tree.refit(boxes);
        let tree = &tree;
        let visits = areas(tree);
        let (decisions, _) =
            decide(tree, &visits, |objects| (objects <= LEAF as u32).then_some(1.0));
        compressed.nodes.push(CompressedNode::around(&tree.nodes[0].aabb));
        // The node of `tree` for each compressed node, in the same order.
        let mut subtrees = alloc::vec![0];
        let mut index = 0;
        while let Some(&subtree) = subtrees.get(index) {
            // A root that is a leaf becomes a node with one child.
            let (below, count) = match decisions[subtree].is_leaf {
                true => ([subtree; 8], 1),
                false => children(tree, &decisions, subtree),
            };
            let slots = slots(&tree.nodes[subtree].aabb, &below[..count], tree);
            let first_object = compressed.prim_ids.len();
            let mut node = compressed.nodes[index];
            node.first_node = compressed.nodes.len() as u32;
            node.first_object = first_object as u32;
            for (slot, child) in slots.into_iter().enumerate() {
                let Some(child) = child else { continue };
                let aabb = &tree.nodes[child].aabb;
                node.set_box(slot, aabb);
                if decisions[child].is_leaf {
                    let before = compressed.prim_ids.len();
                    collect(tree, child, &mut compressed.prim_ids);
                    let unary = (1u8 << (compressed.prim_ids.len() - before)) - 1;
                    node.meta[slot] = unary << 5 | (before - first_object) as u8;
                } else {
                    node.inner |= 1 << slot;
                    node.meta[slot] = 1 << 5 | (24 + slot as u8);
                    subtrees.push(child);
                    compressed.nodes.push(CompressedNode::around(aabb));
                }
            }
            compressed.nodes[index] = node;
            index += 1;
        }
        Ok(compressed)
    }

    /// Makes a tree from the compressed nodes, with up to eight children per node. Boxes keep the
    /// rounding of the grids: they are too large by up to a step, and not always inside their
    /// parent's box. [`Bvh::refit`] makes them tight. With either boxes, traversals find the same
    /// hits as in the tree that was compressed. Rejects indices out of bounds and nodes with two
    /// parents. O(nodes).
    pub fn decode(&self) -> Result<Bvh, InvalidBvh> {
        unpack(self.nodes.len(), &self.prim_ids, None, |index, parts| {
            let node = &self.nodes[index];
            let mut child = node.first_node as usize;
            for (slot, &meta) in node.meta.iter().enumerate() {
                if meta == 0 {
                    continue;
                }
                let part = if node.inner >> slot & 1 == 1 {
                    child += 1;
                    Part::Node(child - 1)
                } else {
                    // A saturated sum of a forged node is out of range, and `unpack` rejects it.
                    let first = node.first_object.saturating_add(u32::from(meta & 31));
                    Part::Leaf { first, count: (meta >> 5).count_ones() }
                };
                parts.push((node.slot_box(slot), part));
            }
            Ok(())
        })
    }
}

/// Puts every child into the slot whose corner of the node it is nearest to. The child with the
/// clearest preference is placed first.
fn slots(aabb: &Aabb, children: &[usize], tree: &Bvh) -> [Option<usize>; 8] {
    let mut slots = [None; 8];
    let mut open: Vec<usize> = children.to_vec();
    let middle = aabb.doubled_centroid();
    while !open.is_empty() {
        let mut best = (f64::NEG_INFINITY, 0, 0);
        for (position, &child) in open.iter().enumerate() {
            let offset = tree.nodes[child].aabb.doubled_centroid() - middle;
            for (slot, occupant) in slots.iter().enumerate() {
                let along = offset.dot(direction(slot));
                if occupant.is_none() && along > best.0 {
                    best = (along, position, slot);
                }
            }
        }
        let (_, position, slot) = best;
        slots[slot] = Some(open.remove(position));
    }
    slots
}

/// Returns the direction from a node's centre to the corner of a slot.
fn direction(slot: usize) -> DVec3 {
    DVec3::from([2, 1, 0].map(|bit| if slot >> bit & 1 == 1 { 1.0 } else { -1.0 }))
}
