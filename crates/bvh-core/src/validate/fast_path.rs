//! The fast path of validation: passes sound trees with two children per inner node and one object per leaf.
//!
//! Most trees are of this kind, and this check is most of the time that loading one takes. Whether a node is a leaf is
//! unpredictable, so no branch depends on it, and eight nodes are looked at together. The caller feeds the tree piece by
//! piece, so that a file can be checked while its checksum has it in the cache.

use crate::{Aabb, BvhView, MAX_OBJECTS, Node};
use alloc::vec::Vec;
use core::ops::Range;
use glam::{BVec4A, Vec4};

/// Nodes whose slots are bounds-checked together.
const NODES: usize = 32;

/// A tree of the right size that is checked piece by piece.
///
/// Every node and every object id refers to one slot: of a pair of siblings, of a position in `prim_ids`, or of an
/// object. There are as many slots as references, so if every slot is marked in the end, each is referred to once.
pub(crate) struct FastPath<'a> {
    tree: BvhView<'a>,
    /// Marks of the pairs of siblings, then of the positions in `prim_ids`, then of the objects.
    marks: Vec<u8>,
    lanes: Lanes,
    boxes: Boxes,
    in_bounds: bool,
}

impl<'a> FastPath<'a> {
    /// `None` if the sizes are those of no tree of this kind over `objects` objects.
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

    /// Whether a whole tree is sound. O(nodes).
    pub(crate) fn passes(tree: BvhView<'a>, objects: usize) -> bool {
        Self::new(tree, objects).is_some_and(|mut check| {
            check.add(0..size_of_val(tree.nodes) + size_of_val(tree.prim_ids));
            check.finish()
        })
    }

    /// Checks the nodes and object ids in a range of bytes, counted from the first node; the object ids follow the last
    /// node, and what comes after them is left out. Every piece begins at a multiple of 256 and is added once.
    pub(crate) fn add(&mut self, bytes: Range<usize>) {
        let nodes = size_of_val(self.tree.nodes);
        let node = |byte: usize| byte.min(nodes) / size_of::<Node>();
        let ids = self.tree.prim_ids.len();
        let id = |byte: usize| (byte.saturating_sub(nodes) / size_of::<u32>()).min(ids);
        self.add_nodes(node(bytes.start)..node(bytes.end));
        let ids = &self.tree.prim_ids[id(bytes.start)..id(bytes.end)];
        self.in_bounds &= mark(&mut self.marks[self.tree.nodes.len()..], ids);
    }

    fn add_nodes(&mut self, range: Range<usize>) {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        {
            #[target_feature(enable = "avx2")]
            fn vectorised(check: &mut FastPath, range: Range<usize>) {
                check.add_nodes_with(range, |nodes| avx2::words(nodes));
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has AVX2, checked on the line above.
                return unsafe { vectorised(self, range) };
            }
        }
        self.add_nodes_with(range, words);
    }

    #[inline(always)]
    fn add_nodes_with(&mut self, range: Range<usize>, words: impl Fn(&[Node; 8]) -> [[u32; 8]; 2]) {
        let (all, pairs) = (self.tree.nodes.len(), self.tree.prim_ids.len() as u32 - 1);
        let (mut index, marks) = (range.start as u32, &mut self.marks[..all]);
        let nodes = &self.tree.nodes[range];
        // Local copies stay in registers.
        let mut boxes = self.boxes;
        nodes.iter().for_each(|node| boxes.add(node));
        self.boxes = boxes;
        let (blocks, rest) = nodes.as_chunks::<NODES>();
        let (mut lanes, mut in_bounds) = (self.lanes, self.in_bounds);
        for block in blocks {
            let mut slots = [0; NODES];
            for (nodes, slots) in block.as_chunks::<8>().0.iter().zip(slots.as_chunks_mut::<8>().0) {
                *slots = lanes.add(words(nodes), index, pairs);
                index += 8;
            }
            in_bounds &= mark(marks, &slots);
        }
        for nodes in rest.chunks(8) {
            // Padded with leaves, whose slots are not marked.
            let mut padded = [Node::leaf(Aabb::EMPTY, 0, 1); 8];
            padded[..nodes.len()].copy_from_slice(nodes);
            let slots = lanes.add(words(&padded), index, pairs);
            in_bounds &= mark(marks, &slots[..nodes.len()]);
            index += 8;
        }
        (self.lanes, self.in_bounds) = (lanes, in_bounds);
    }

    /// Whether the tree, all of which has been added, is sound: every index is in bounds, children come after their
    /// parents, every node but the root has one parent, every object is in one leaf, and every box is finite and not
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

/// Results for all nodes so far, by position modulo 8.
#[derive(Clone, Copy)]
struct Lanes {
    /// Not zero if any node has a wrong count, or children that do not follow it or do not begin at an odd index.
    wrong: [u32; 8],
    /// The highest position in `prim_ids` that a leaf names, or number of a pair of siblings, from 1 on, that an inner
    /// node names: both below the number of objects.
    highest: [u32; 8],
}

impl Lanes {
    /// Checks eight nodes from `index` on, given their [`words`], in a tree of `pairs` pairs. Returns their slots.
    #[inline(always)]
    fn add(&mut self, [firsts, tagged_counts]: [[u32; 8]; 2], index: u32, pairs: u32) -> [u32; 8] {
        const LEAF: u32 = 1 << 31;
        let mut slots = [0; 8];
        for lane in 0..8 {
            let (first, tagged_count) = (firsts[lane], tagged_counts[lane]);
            // All bits or none.
            let leaf = (tagged_count as i32 >> 31) as u32;
            let select = |of_leaf: u32, of_inner: u32| of_inner ^ (of_inner ^ of_leaf) & leaf;
            // The highest bit is set if the children come later. Pairs of siblings fill the nodes from 1 on, so that
            // each begins at an odd index.
            let follows = (index + lane as u32).wrapping_sub(first);
            let wrong_first = !(follows & LEAF | first & 1 | leaf) & (LEAF | 1);
            self.wrong[lane] |= tagged_count ^ select(LEAF | 1, 2) | wrong_first;
            let number = select(first, first >> 1);
            self.highest[lane] = self.highest[lane].max(number.wrapping_sub(!leaf));
            slots[lane] = number.wrapping_add(pairs & leaf);
        }
        slots
    }
}

/// Results for the boxes of all nodes so far. The first three lanes are the axes; the last one has no meaning.
#[derive(Clone, Copy)]
struct Boxes {
    /// The box around all of them.
    min: Vec4,
    max: Vec4,
    /// Whether each has its lower corner below its upper one, and neither is NaN.
    ordered: BVec4A,
}

impl Boxes {
    const NONE: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY, ordered: BVec4A::TRUE };

    #[inline(always)]
    fn add(&mut self, node: &Node) {
        let bytes = bytemuck::bytes_of(node);
        let [min, max]: [Vec4; 2] = [0, 12].map(|at| bytemuck::pod_read_unaligned(&bytes[at..at + 16]));
        self.ordered &= min.cmple(max);
        (self.min, self.max) = (min.min(self.min), max.max(self.max));
    }

    /// Whether all are finite and none is inverted.
    fn are_right(&self) -> bool {
        let finite = self.min.cmpgt(Vec4::NEG_INFINITY) & self.max.cmplt(Vec4::INFINITY);
        (self.ordered & finite).bitmask() & 0b111 == 0b111
    }
}

/// The two words after the boxes of eight nodes.
#[inline(always)]
fn words(nodes: &[Node; 8]) -> [[u32; 8]; 2] {
    let words = nodes.each_ref().map(Node::words);
    [words.map(|[first, _]| first), words.map(|[_, tagged_count]| tagged_count)]
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2 {
    use super::Node;
    use core::arch::x86_64::*;

    /// As [`words`](super::words()). Compilers do not find these shuffles, without which the check takes twice as long.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn words(nodes: &[Node; 8]) -> [[u32; 8]; 2] {
        let upper_half = |node: usize| bytemuck::cast::<Node, [__m128i; 2]>(nodes[node])[1];
        let two = |node: usize| _mm256_set_m128i(upper_half(node + 4), upper_half(node));
        let four = |node: usize| _mm256_castsi256_ps(_mm256_unpackhi_epi64(two(node), two(node + 1)));
        let (low, high) = (four(0), four(2));
        let words = [_mm256_shuffle_ps::<0x88>(low, high), _mm256_shuffle_ps::<0xdd>(low, high)];
        bytemuck::cast(words)
    }
}

/// Marks these slots if all of them exist, and returns whether they do.
#[inline(always)]
fn mark(marks: &mut [u8], slots: &[u32]) -> bool {
    let highest = slots.iter().fold(0, |highest, &slot| highest.max(slot));
    let in_bounds = (highest as usize) < marks.len();
    if in_bounds {
        for &slot in slots {
            // SAFETY: `slot` is at most `highest`, which is in bounds. One comparison for many slots takes a fifth off
            // the time of this check.
            unsafe { *marks.get_unchecked_mut(slot as usize) = 1 };
        }
    }
    in_bounds
}

#[cfg(test)]
mod tests {
    use super::super::{Leaves, find_fault as fault};
    use super::*;
    use crate::{Bvh, InvalidBvh};

    fn find_fault(tree: BvhView, objects: usize) -> Result<(), InvalidBvh> {
        fault(tree, objects, Leaves::One)
    }

    const UNIT: Aabb = Aabb { min: glam::Vec3::ZERO, max: glam::Vec3::ONE };

    /// A chain: each pair is a leaf and the parent of the next pair, on alternating sides.
    fn chain(objects: u32) -> Bvh {
        let leaf = |object: u32| Node::leaf(UNIT, object, 1);
        let mut nodes: Vec<Node> = alloc::vec![leaf(objects - 1)];
        let mut parent = 0;
        for object in 0..objects - 1 {
            let first = nodes.len();
            nodes.extend([leaf(object), leaf(objects - 1)]);
            nodes[parent] = Node::inner(UNIT, first as u32, 2);
            parent = first + 1;
            if object % 2 == 0 {
                nodes.swap(first, parent);
                parent = first;
            }
        }
        Bvh { nodes, prim_ids: (0..objects).map(|object| (object + 2) % objects).collect() }
    }

    /// The answer, on which all ways to ask agree.
    fn passes(tree: &Bvh) -> bool {
        let objects = tree.prim_ids.len();
        let new = || FastPath::new(tree.into(), objects);
        let (Some(mut pieces), Some(mut portable)) = (new(), new()) else { return false };
        let bytes = size_of_val(&tree.nodes[..]) + size_of_val(&tree.prim_ids[..]);
        (0..bytes).step_by(256).for_each(|start| pieces.add(start..bytes.min(start + 256)));
        portable.add_nodes_with(0..tree.nodes.len(), words);
        portable.add(size_of_val(&tree.nodes[..])..bytes);
        let found = FastPath::passes(tree.into(), objects);
        assert_eq!([pieces.finish(), portable.finish()], [found; 2]);
        found
    }

    #[test]
    fn sound_trees_pass() {
        for objects in (1..140).chain([1000]) {
            let tree = chain(objects);
            assert_eq!(find_fault((&tree).into(), objects as usize), Ok(()));
            assert!(passes(&tree), "{objects}");
        }
    }

    #[test]
    fn no_unsound_tree_passes() {
        // Fewer nodes than a block, and a block with some more.
        for objects in [3, 20] {
            let tree = chain(objects);
            let mut passed = 0;
            for at in 0..tree.nodes.len() {
                let words =
                    [0, 1 << 31].into_iter().flat_map(|high| (0..2 * objects + 2).map(move |low| high | low));
                for first in words.chain([u32::MAX]) {
                    for (count, node) in
                        (0..4).flat_map(|count| [(count, Node::inner as fn(_, _, _) -> _), (count, Node::leaf)])
                    {
                        let mut damaged = tree.clone();
                        damaged.nodes[at] = node(UNIT, first, count);
                        let sound = find_fault((&damaged).into(), objects as usize).is_ok();
                        assert_eq!(passes(&damaged), sound, "{:?}", damaged.nodes);
                        passed += usize::from(sound);
                    }
                }
            }
            assert_eq!(passed, tree.nodes.len(), "only changes that change nothing pass");
            for (at, id) in (0..objects as usize).flat_map(|at| (0..objects + 3).map(move |id| (at, id))) {
                let mut damaged = tree.clone();
                damaged.prim_ids[at] = id;
                assert_eq!(passes(&damaged), damaged == tree);
            }
        }
    }

    #[test]
    fn no_tree_with_a_box_that_is_not_finite_or_is_inverted_passes() {
        let tree = chain(20);
        for (at, plane) in (0..tree.nodes.len()).flat_map(|at| (0..6).map(move |plane| (at, plane))) {
            let mut damaged = tree.clone();
            let inverted = if plane < 3 { 1.5 } else { -0.5 };
            for wrong in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, inverted] {
                let Aabb { min, max } = &mut damaged.nodes[at].aabb;
                if plane < 3 {
                    min[plane] = wrong
                } else {
                    max[plane - 3] = wrong
                }
                assert!(!passes(&damaged), "{wrong} in plane {plane} of node {at}");
                assert!(matches!(find_fault((&damaged).into(), 20), Err(InvalidBvh::Box { .. })));
            }
            let Aabb { min, max } = &mut damaged.nodes[at].aabb;
            if plane < 3 {
                min[plane] = f32::MIN
            } else {
                max[plane - 3] = f32::MAX
            }
            assert!(passes(&damaged));
        }
    }

    #[test]
    fn sound_trees_of_another_kind_do_not_pass() {
        let mut tree = chain(4);
        let of_objects = |objects| FastPath::passes((&tree).into(), objects);
        assert!(!of_objects(3) && !of_objects(5) && !of_objects(0));
        tree.nodes.truncate(5);
        tree.nodes[4] = Node::leaf(UNIT, 2, 2);
        assert_eq!(find_fault((&tree).into(), 4), Ok(()));
        assert!(!passes(&tree));
    }
}
