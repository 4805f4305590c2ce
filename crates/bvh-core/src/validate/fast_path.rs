//! The fast path of validation. It passes sound trees with two children per inner node and one
//! object per leaf.
//!
//! Most trees are of this kind, and loading such a tree spends most of its time in this check. The
//! processor cannot predict whether a node is a leaf, so no branch depends on it, and eight nodes
//! are checked together. The caller adds the tree piece by piece. A file can therefore be checked
//! while its checksum has it in the cache.

use crate::{Aabb, BvhView, MAX_OBJECTS, Node};
use alloc::vec::Vec;
use core::ops::Range;
use glam::{BVec4A, Vec4};

/// The number of nodes whose slots are bounds-checked together.
const NODES: usize = 32;

/// A tree of the right size that is checked piece by piece.
///
/// Every node and every object id refers to one slot. A slot is a pair of siblings, a position in
/// `prim_ids`, or an object. The number of slots equals the number of references. If every slot is
/// marked at the end, each slot is referred to exactly once.
pub(crate) struct FastPath<'a> {
    tree: BvhView<'a>,
    /// One mark per slot: the pairs of siblings, then the positions in `prim_ids`, then the
    /// objects.
    marks: Vec<u8>,
    lanes: Lanes,
    boxes: Boxes,
    in_bounds: bool,
}

impl<'a> FastPath<'a> {
    /// Begins a check. Returns `None` if no tree of this kind over `objects` objects has these
    /// sizes.
    pub(crate) fn new(tree: BvhView<'a>, objects: usize) -> Option<Self> {
        let fits = (1..=MAX_OBJECTS).contains(&objects)
            && tree.nodes.len() == 2 * objects - 1
            && tree.prim_ids.len() == objects;
        fits.then(|| Self {
            tree,
            marks: alloc::vec![0; tree.nodes.len() + objects],
            lanes: Lanes { wrong: [0; 8], highest: [0; 8] },
            boxes: Boxes::NONE,
            in_bounds: true,
        })
    }

    /// Returns whether a complete tree is sound. O(nodes).
    pub(crate) fn passes(tree: BvhView<'a>, objects: usize) -> bool {
        Self::new(tree, objects).is_some_and(|mut check| {
            check.add(0..size_of_val(tree.nodes) + size_of_val(tree.prim_ids));
            check.finish()
        })
    }

    /// Checks the nodes and object ids in a range of bytes, counted from the first node. The object
    /// ids follow the last node. Bytes after the object ids are ignored. Every piece must begin at
    /// a multiple of 256 and be added once.
    pub(crate) fn add(&mut self, bytes: Range<usize>) {
        let nodes = self.node_at(bytes.start)..self.node_at(bytes.end);
        let ids = self.id_at(bytes.start)..self.id_at(bytes.end);
        self.add_nodes(nodes);
        let marks_of_objects = &mut self.marks[self.tree.nodes.len()..];
        self.in_bounds &= mark(marks_of_objects, &self.tree.prim_ids[ids]);
    }

    /// Returns the index of the node at a byte; the number of nodes after the last one.
    fn node_at(&self, byte: usize) -> usize {
        byte.min(size_of_val(self.tree.nodes)) / size_of::<Node>()
    }

    /// Returns the position of the object id at a byte; 0 before the first one and their number
    /// after the last one.
    fn id_at(&self, byte: usize) -> usize {
        let byte_of_ids = byte.saturating_sub(size_of_val(self.tree.nodes));
        self.tree.prim_ids.len().min(byte_of_ids / size_of::<u32>())
    }

    fn add_nodes(&mut self, range: Range<usize>) {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        {
            #[target_feature(enable = "avx2")]
            fn vectorised(check: &mut FastPath, range: Range<usize>) {
                check.add_nodes_with(range, |nodes| avx2::words(nodes));
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: `vectorised` needs AVX2, and the processor has it by the test above.
                return unsafe { vectorised(self, range) };
            }
        }
        self.add_nodes_with(range, words);
    }

    #[inline(always)]
    fn add_nodes_with(&mut self, range: Range<usize>, words: impl Fn(&[Node; 8]) -> [[u32; 8]; 2]) {
        // `new` has checked that there is at least one object.
        let pairs = self.tree.prim_ids.len() as u32 - 1;
        let mut index = range.start as u32;
        // All references of nodes are to the first slots: one bounds check serves pairs and
        // positions.
        let marks = &mut self.marks[..self.tree.nodes.len()];
        let nodes = &self.tree.nodes[range];
        // Local copies stay in registers.
        let mut boxes = self.boxes;
        for node in nodes {
            boxes.add(node);
        }
        self.boxes = boxes;
        let (blocks, rest) = nodes.as_chunks::<NODES>();
        let mut lanes = self.lanes;
        let mut in_bounds = self.in_bounds;
        for block in blocks {
            let mut slots = [0; NODES];
            let (eights, _) = block.as_chunks::<8>();
            let (slots_of_eights, _) = slots.as_chunks_mut::<8>();
            for (eight, slots_of_eight) in eights.iter().zip(slots_of_eights) {
                *slots_of_eight = lanes.add(words(eight), index, pairs);
                index += 8;
            }
            in_bounds &= mark(marks, &slots);
        }
        for few in rest.chunks(8) {
            // The padding is a leaf that passes the checks, and its slots are not marked.
            let mut padded = [Node::leaf(Aabb::EMPTY, 0, 1); 8];
            padded[..few.len()].copy_from_slice(few);
            let slots = lanes.add(words(&padded), index, pairs);
            in_bounds &= mark(marks, &slots[..few.len()]);
            index += 8;
        }
        self.lanes = lanes;
        self.in_bounds = in_bounds;
    }

    /// Returns whether the tree is sound. All of the tree must have been added.
    ///
    /// In a sound tree every index is in bounds, children come after their parents, every node
    /// except the root has one parent, every object is in one leaf, and every box is finite and not
    /// inverted.
    pub(crate) fn finish(self) -> bool {
        let Lanes { wrong, highest } = self.lanes;
        let objects = self.tree.prim_ids.len() as u32;
        self.in_bounds
            && wrong == [0; 8]
            && highest.into_iter().all(|number| number < objects)
            && self.boxes.are_right()
            && self.marks.iter().fold(1, |all, mark| all & mark) == 1
    }
}

/// Results for all nodes so far, by node index modulo 8.
#[derive(Clone, Copy)]
struct Lanes {
    /// Not zero if a node has a wrong count, or children that do not follow it or that begin at an
    /// even index.
    wrong: [u32; 8],
    /// The largest number that a node refers to. For a leaf the number is a position in `prim_ids`,
    /// from 0 on. For an inner node it is the number of a pair of siblings, from 1 on. Both must be
    /// below the number of objects.
    highest: [u32; 8],
}

impl Lanes {
    /// Checks eight nodes from `index` on, given by their [`words`], in a tree of `pairs` pairs of
    /// siblings. Returns their slots.
    #[inline(always)]
    fn add(&mut self, [firsts, tagged_counts]: [[u32; 8]; 2], index: u32, pairs: u32) -> [u32; 8] {
        const LEAF: u32 = 1 << 31;
        let mut slots = [0; 8];
        for lane in 0..8 {
            let first = firsts[lane];
            let tagged_count = tagged_counts[lane];
            // An arithmetic shift: all bits are set for a leaf, and none for an inner node.
            let leaf = (tagged_count as i32 >> 31) as u32;
            let select = |of_leaf: u32, of_inner: u32| of_inner ^ (of_inner ^ of_leaf) & leaf;
            // The highest bit of `follows` is set if the children come later. Pairs of siblings
            // fill the nodes from 1 on, so each pair begins at an odd index.
            let follows = (index + lane as u32).wrapping_sub(first);
            let wrong_first = !(follows & LEAF | first & 1 | leaf) & (LEAF | 1);
            self.wrong[lane] |= tagged_count ^ select(LEAF | 1, 2) | wrong_first;
            let number = select(first, first >> 1);
            // Minus `!leaf` adds 1 for an inner node: pairs are numbered from 1 on.
            self.highest[lane] = self.highest[lane].max(number.wrapping_sub(!leaf));
            slots[lane] = number.wrapping_add(pairs & leaf);
        }
        slots
    }
}

/// Results for the boxes of all nodes so far. The first three lanes are the axes. The last lane has
/// no meaning.
#[derive(Clone, Copy)]
struct Boxes {
    /// The lower corner of the box around all boxes.
    min: Vec4,
    /// The upper corner of the box around all boxes.
    max: Vec4,
    /// True if no box is inverted or has a NaN.
    ordered: BVec4A,
}

impl Boxes {
    const NONE: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY, ordered: BVec4A::TRUE };

    #[inline(always)]
    fn add(&mut self, node: &Node) {
        // One load of 16 bytes per corner. The fourth lane has bytes of the next field.
        let bytes = bytemuck::bytes_of(node);
        let min: Vec4 = bytemuck::pod_read_unaligned(&bytes[0..16]);
        let max: Vec4 = bytemuck::pod_read_unaligned(&bytes[12..28]);
        self.ordered &= min.cmple(max);
        // If one operand is NaN, either may be the result; `ordered` has caught the NaN.
        self.min = min.min(self.min);
        self.max = max.max(self.max);
    }

    /// Returns whether all boxes are finite and none is inverted.
    fn are_right(&self) -> bool {
        let finite = self.min.cmpgt(Vec4::NEG_INFINITY) & self.max.cmplt(Vec4::INFINITY);
        (self.ordered & finite).bitmask() & 0b111 == 0b111
    }
}

/// Returns the two words after the boxes of eight nodes.
#[inline(always)]
fn words(nodes: &[Node; 8]) -> [[u32; 8]; 2] {
    let words = nodes.each_ref().map(Node::words);
    [words.map(|[first, _]| first), words.map(|[_, tagged_count]| tagged_count)]
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2 {
    use super::Node;
    use core::arch::x86_64::*;

    /// Returns the same as [`words`](super::words()). Compilers do not find these shuffles, and the
    /// check takes twice as long without them.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn words(nodes: &[Node; 8]) -> [[u32; 8]; 2] {
        let upper_half = |node: usize| bytemuck::cast::<Node, [__m128i; 2]>(nodes[node])[1];
        let two = |node: usize| _mm256_set_m128i(upper_half(node + 4), upper_half(node));
        let four =
            |node: usize| _mm256_castsi256_ps(_mm256_unpackhi_epi64(two(node), two(node + 1)));
        let low = four(0);
        let high = four(2);
        let words = [_mm256_shuffle_ps::<0x88>(low, high), _mm256_shuffle_ps::<0xdd>(low, high)];
        bytemuck::cast(words)
    }
}

/// Marks these slots if all of them exist. Returns whether all of them exist.
#[inline(always)]
fn mark(marks: &mut [u8], slots: &[u32]) -> bool {
    let highest = slots.iter().fold(0, |highest, &slot| highest.max(slot));
    let in_bounds = (highest as usize) < marks.len();
    if in_bounds {
        for &slot in slots {
            // SAFETY: `highest < marks.len()` by the condition above, and `slot <= highest` because
            // `highest` is the maximum of all slots. One comparison for many slots instead of one
            // each saves a fifth of the time of this check.
            unsafe { *marks.get_unchecked_mut(slot as usize) = 1 };
        }
    }
    in_bounds
}

#[cfg(test)]
mod tests;
