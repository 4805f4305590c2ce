//! Nodes of eight children in 80 bytes, whose boxes are rounded outwards to a grid of 8 bits per axis.

use super::unpack::{Part, unpack};
use crate::collapse::{binary, collect};
use crate::wide::{areas, children, decide};
use crate::{Aabb, Bvh, InvalidBvh, Node, validate};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// The most objects of a leaf: their number is written in unary.
const LEAF: usize = 3;

/// A node of eight children, or fewer, in 80 bytes.
///
/// | bytes | type | field |
/// |---|---|---|
/// | 0..12 | `f32[3]` | lower corner of the node: the grid's origin |
/// | 12..15 | `u8[3]` | the grid's step along x, y and z: a power of two, of which this is the `f32`'s exponent |
/// | 15 | `u8` | bit `i` is set if the child in slot `i` is a node |
/// | 16..20 | `u32` | index of the first child that is a node; the others follow in the order of their slots |
/// | 20..24 | `u32` | position of the first object id of the node's leaves |
/// | 24..32 | `u8[8]` | of each slot: 0 if it is empty; `0b001` in the upper bits and 24 + slot in the lower five for a node; for a leaf, as many ones as it has objects (1 to 3) in the upper three bits, and the position of its first object after the node's first in the lower five |
/// | 32..56 | `u8[3][8]` | lower x of all slots, lower y, lower z, in steps from the origin |
/// | 56..80 | `u8[3][8]` | upper x, upper y, upper z |
///
/// Slots are filled so that the child in slot `i` lies on the upper side along x if bit 2 of `i` is set, along y for bit 1, along z for
/// bit 0, as far as that can be: rays visit slots in the order of `slot ^ octant` without sorting.
///
/// Source: Ylitie, Karras & Laine 2017, 'Efficient incoherent ray traversal on GPUs through compressed wide BVHs', section 3. Differs from
/// the paper: slots are assigned greedily, as in `tinybvh`. `tinybvh` keeps the exponents less 127, `obvhs` the planes in the order
/// lower x, upper x, lower y and so on; all else is the same in both.
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

/// A tree as compressed nodes, the root first, and its objects in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompressedBvh {
    /// The nodes.
    pub nodes: Vec<CompressedNode>,
    /// The object ids, in the order in which leaves name them.
    pub prim_ids: Vec<u32>,
}

/// The size of a grid's step. An exponent of 0 would stand for a step of 0.
fn step(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

impl CompressedNode {
    /// A node around `aabb` without children.
    fn around(aabb: &Aabb) -> Self {
        let exponent = |extent: f64| {
            let exponent = (libm::ilogb(extent / 255.0).saturating_add(127)).clamp(1, 253) as u8;
            exponent + u8::from(255.0 * f64::from(step(exponent)) < extent)
        };
        Self { origin: aabb.min, exponents: aabb.extent().to_array().map(exponent), ..Self::zeroed() }
    }

    /// Writes the box of a slot, rounded outwards. In f64 all is exact but the quotient by a power of two, which is too.
    fn set_box(&mut self, slot: usize, aabb: &Aabb) {
        let steps = DVec3::from(self.exponents.map(|exponent| f64::from(step(exponent))));
        let (low, high) = (
            (aabb.min.as_dvec3() - self.origin.as_dvec3()) / steps,
            (aabb.max.as_dvec3() - self.origin.as_dvec3()) / steps,
        );
        for axis in 0..3 {
            self.low[axis][slot] = libm::floor(low[axis]) as u8;
            self.high[axis][slot] = libm::ceil(high[axis]) as u8;
        }
    }

    /// The box of a slot. Rounding to f32 is monotone: what is inside the grid's planes is inside the rounded ones.
    fn slot_box(&self, slot: usize) -> Aabb {
        let plane = |planes: &[[u8; 8]; 3]| {
            let steps =
                Vec3::from([0, 1, 2].map(|axis| f32::from(planes[axis][slot]) * step(self.exponents[axis])));
            (self.origin + steps).min(Vec3::MAX)
        };
        Aabb { min: plane(&self.low), max: plane(&self.high) }
    }
}

impl CompressedBvh {
    /// The compressed nodes of `tree`, valid over `boxes`, of least expected time for a random line among those that leave nodes of
    /// the tree out. Larger leaves are divided into leaves of three objects at most. O(objects).
    pub fn new(tree: &Bvh, boxes: &[Aabb]) -> Result<Self, InvalidBvh> {
        validate(tree, boxes)?;
        let mut compressed = Self::default();
        if tree.nodes.is_empty() {
            return Ok(compressed);
        }
        let tree = &with_small_leaves(binary(tree).into_owned(), boxes);
        let visits = areas(tree);
        let decisions = decide(tree, &visits, |objects| (objects <= LEAF as u32).then_some(1.0));
        compressed.nodes.push(CompressedNode::around(&tree.nodes[0].aabb));
        let mut subtrees = alloc::vec![0];
        let mut at = 0;
        while let Some(&subtree) = subtrees.get(at) {
            let (below, count) = match decisions[subtree].leaf {
                true => ([subtree; 8], 1),
                false => children(tree, &decisions, subtree),
            };
            let slots = slots(&tree.nodes[subtree].aabb, &below[..count], tree);
            let (first_node, first_object) = (compressed.nodes.len(), compressed.prim_ids.len());
            let mut node = compressed.nodes[at];
            (node.first_node, node.first_object) = (first_node as u32, first_object as u32);
            for (slot, child) in slots.into_iter().enumerate() {
                let Some(child) = child else { continue };
                let aabb = &tree.nodes[child].aabb;
                node.set_box(slot, aabb);
                if decisions[child].leaf {
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
            compressed.nodes[at] = node;
            at += 1;
        }
        Ok(compressed)
    }

    /// The tree of compressed nodes, with up to eight children per node and the boxes as the grids have them: too large by up to a
    /// step, and so not always inside their parent's. [`Bvh::refit`] makes them tight. Traversals find in either what they
    /// find in the tree that was compressed. Refuses indices out of bounds and nodes with two parents. O(nodes).
    pub fn decode(&self) -> Result<Bvh, InvalidBvh> {
        unpack(self.nodes.len(), &self.prim_ids, None, |from, parts| {
            let node = &self.nodes[from];
            let mut child = node.first_node as usize;
            for (slot, &meta) in node.meta.iter().enumerate().filter(|(_, meta)| **meta > 0) {
                let part = if node.inner >> slot & 1 == 1 {
                    child += 1;
                    Part::Node(child - 1)
                } else {
                    let first = node.first_object.saturating_add(u32::from(meta & 31));
                    Part::Leaf { first, count: (meta >> 5).count_ones() }
                };
                parts.push((node.slot_box(slot), part));
            }
            Ok(())
        })
    }
}

/// The binary tree with its larger leaves halved, in their order.
fn with_small_leaves(mut tree: Bvh, boxes: &[Aabb]) -> Bvh {
    let mut at = 0;
    while at < tree.nodes.len() {
        let prims = tree.nodes[at].prims();
        if prims.len() > LEAF {
            let middle = prims.start + prims.len() / 2;
            let halves = [prims.start..middle, middle..prims.end].map(|half| {
                let ids = tree.prim_ids[half.clone()].iter();
                let aabb = ids.fold(Aabb::EMPTY, |around, &id| around.union(&boxes[id as usize]));
                Node::leaf(aabb, half.start as u32, half.len() as u32)
            });
            tree.nodes[at] = Node::inner(tree.nodes[at].aabb, tree.nodes.len() as u32, 2);
            tree.nodes.extend(halves);
        }
        at += 1;
    }
    tree
}

/// Puts every child into the slot whose corner of the node it is nearest to, the most decided first.
fn slots(aabb: &Aabb, below: &[usize], tree: &Bvh) -> [Option<usize>; 8] {
    let mut slots = [None; 8];
    let mut open: Vec<usize> = below.to_vec();
    let middle = aabb.doubled_centroid();
    let along = |child: usize, slot: usize| {
        let towards = DVec3::from([2, 1, 0].map(|bit| if slot >> bit & 1 == 1 { 1.0 } else { -1.0 }));
        (tree.nodes[child].aabb.doubled_centroid() - middle).dot(towards)
    };
    while !open.is_empty() {
        let mut best = (f64::NEG_INFINITY, 0, 0);
        for (at, &child) in open.iter().enumerate() {
            for slot in (0..8).filter(|&slot| slots[slot].is_none()) {
                let along = along(child, slot);
                if along > best.0 {
                    best = (along, at, slot);
                }
            }
        }
        slots[best.2] = Some(open.remove(best.1));
    }
    slots
}
