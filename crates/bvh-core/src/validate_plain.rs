//! The quick check of trees of the common kind: two children per inner node, one object per leaf.
//!
//! Loading is to take no time, so nothing branches on where leaves are, which nobody can predict, and what can be said
//! of several nodes at once is computed in vector registers.

use crate::checksum::{checksum_and_visit, checksum_plain};
use crate::{Aabb, BvhView, MAX_OBJECTS, Node};
use alloc::vec::Vec;
use core::ops::Range;

/// Nodes looked at together; as many as registers hold.
const NODES: usize = 32;

/// Whether this is a sound tree of that kind: nothing in it leads out of bounds or in circles, every node has one
/// parent and every object is in one leaf. O(nodes).
pub(crate) fn is_plain(tree: BvhView, objects: usize) -> bool {
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    {
        #[target_feature(enable = "avx2")]
        fn vectorised(tree: BvhView, objects: usize) -> bool {
            is_plain_with(tree, objects, |nodes| avx2::words(nodes))
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2, checked on the line above.
            return unsafe { vectorised(tree, objects) };
        }
    }
    is_plain_with(tree, objects, words)
}

#[inline(always)]
fn is_plain_with(tree: BvhView, objects: usize, words: impl Fn(&[Node; 8]) -> [[u32; 8]; 2]) -> bool {
    Check::new(tree, objects).is_some_and(|mut check| {
        check.add_nodes(0..tree.nodes.len(), words);
        check.add_ids(0..objects);
        check.passes()
    })
}

/// The checksum of `bytes`, which are those of `tree`, nodes first, and whether the tree is [plain](is_plain). Every
/// byte comes from memory once. O(bytes).
pub(crate) fn checksum_and_is_plain(bytes: &[u8], tree: BvhView, objects: usize) -> (u64, bool) {
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    {
        #[target_feature(enable = "avx2")]
        fn vectorised(bytes: &[u8], tree: BvhView, objects: usize) -> (u64, bool) {
            checksum_and_is_plain_with(bytes, tree, objects, |nodes| avx2::words(nodes))
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2, checked on the line above.
            return unsafe { vectorised(bytes, tree, objects) };
        }
    }
    checksum_and_is_plain_with(bytes, tree, objects, words)
}

#[inline(always)]
fn checksum_and_is_plain_with(
    bytes: &[u8],
    tree: BvhView,
    objects: usize,
    words: impl Fn(&[Node; 8]) -> [[u32; 8]; 2],
) -> (u64, bool) {
    let Some(mut check) = Check::new(tree, objects) else { return (checksum_plain(bytes), false) };
    let nodes = size_of_val(tree.nodes);
    let node = |byte: usize| byte.min(nodes) / size_of::<Node>();
    let id = |byte: usize| byte.saturating_sub(nodes) / size_of::<u32>();
    let sum = checksum_and_visit(bytes, |start, piece| {
        let end = start + piece.len();
        check.add_nodes(node(start)..node(end), &words);
        check.add_ids(id(start)..id(end));
    });
    (sum, check.passes())
}

/// The first word after the box of eight nodes, and the second. For any machine.
#[inline(always)]
fn words(nodes: &[Node; 8]) -> [[u32; 8]; 2] {
    let words = nodes.each_ref().map(Node::words);
    [words.map(|[first, _]| first), words.map(|[_, tagged_count]| tagged_count)]
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2 {
    use super::Node;
    use core::arch::x86_64::*;

    /// As [`words`](super::words()); compilers do not find these shuffles.
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

/// What all nodes looked at have in common, by lane.
#[derive(Clone, Copy)]
struct Common {
    /// The highest bit if the children of all inner nodes come after them, the lowest if they begin at odd indices.
    follow: [u32; 8],
    /// The bits in which a count is not what it should be.
    wrong_counts: [u32; 8],
    /// The highest number of a pair or of a place in a leaf.
    highest: [u32; 8],
    leaves: [u32; 8],
}

impl Common {
    /// Looks at nodes from `index` on, of which `words` are given. Returns the marks that they set: of the pair of
    /// siblings, or, after all `pairs`, of the place in a leaf.
    #[inline(always)]
    fn add(&mut self, [firsts, tagged_counts]: [[u32; 8]; 2], index: u32, pairs: u32) -> [u32; 8] {
        let mut marks = [0; 8];
        for lane in 0..8 {
            let (first, tagged_count) = (firsts[lane], tagged_counts[lane]);
            // All bits or none.
            let leaf = (tagged_count as i32 >> 31) as u32;
            let select = |of_leaf: u32, of_inner: u32| of_inner ^ (of_inner ^ of_leaf) & leaf;
            let distance = (index + lane as u32).wrapping_sub(first);
            self.follow[lane] &= distance & 1 << 31 | first & 1 | leaf;
            self.wrong_counts[lane] |= tagged_count ^ select(1 << 31 | 1, 2);
            self.leaves[lane] = self.leaves[lane].wrapping_sub(leaf);
            // Pairs fill the nodes from 1 on.
            let number = select(first, first >> 1);
            self.highest[lane] = self.highest[lane].max(number);
            marks[lane] = number.wrapping_add(pairs & leaf);
        }
        marks
    }
}

/// A tree of the right size that is looked at piece by piece.
///
/// Marks are only written: as many places as there are to name are named, and all are, hence each once.
struct Check<'a> {
    tree: BvhView<'a>,
    /// One per pair of siblings, place in a leaf, and object.
    marks: Vec<u8>,
    common: Common,
    /// Whether all marks to be set are there.
    in_bounds: bool,
}

impl<'a> Check<'a> {
    fn new(tree: BvhView<'a>, objects: usize) -> Option<Self> {
        let fits = (1..=MAX_OBJECTS).contains(&objects)
            && tree.nodes.len() == 2 * objects - 1
            && tree.prim_ids.len() == objects;
        fits.then(|| Self {
            tree,
            marks: alloc::vec![0; tree.nodes.len() + objects],
            common: Common { follow: [u32::MAX; 8], wrong_counts: [0; 8], highest: [0; 8], leaves: [0; 8] },
            in_bounds: true,
        })
    }

    /// Looks at nodes from a multiple of eight on, of the last to the end or a multiple of eight.
    #[inline(always)]
    fn add_nodes(&mut self, range: Range<usize>, words: impl Fn(&[Node; 8]) -> [[u32; 8]; 2]) {
        let (all, pairs) = (self.tree.nodes.len(), self.tree.prim_ids.len() as u32 - 1);
        let (mut index, marks) = (range.start as u32, &mut self.marks[..all]);
        let (blocks, rest) = self.tree.nodes[range].as_chunks::<NODES>();
        // In registers.
        let (mut common, mut in_bounds) = (self.common, true);
        for block in blocks {
            let mut numbers = [0; NODES];
            for (nodes, numbers) in block.as_chunks::<8>().0.iter().zip(numbers.as_chunks_mut::<8>().0) {
                *numbers = common.add(words(nodes), index, pairs);
                index += 8;
            }
            in_bounds &= mark(marks, &numbers);
        }
        for nodes in rest.chunks(8) {
            // Leaves after the last node, which set no marks.
            let mut padded = [Node::leaf(Aabb::EMPTY, 0, 1); 8];
            padded[..nodes.len()].copy_from_slice(nodes);
            let numbers = common.add(words(&padded), index, pairs);
            in_bounds &= mark(marks, &numbers[..nodes.len()]);
            index += 8;
        }
        self.common = common;
        self.in_bounds &= in_bounds;
    }

    #[inline(always)]
    fn add_ids(&mut self, range: Range<usize>) {
        let marks = &mut self.marks[self.tree.nodes.len()..];
        self.in_bounds &= mark(marks, &self.tree.prim_ids[range]);
    }

    /// Whether the tree, of which all has been looked at, is sound.
    #[inline(always)]
    fn passes(self) -> bool {
        let Common { follow, wrong_counts, highest, leaves } = self.common;
        let (nodes, objects) = (self.tree.nodes.len(), self.tree.prim_ids.len());
        let follow = follow.into_iter().fold(u32::MAX, |all, lane| all & lane);
        let leaves = leaves.into_iter().sum::<u32>() as usize - (nodes.next_multiple_of(8) - nodes);
        // With `highest` no more than `pairs`, an inner node that names one pair too many sets the mark of a leaf's
        // place; then one too few are left for the pairs.
        self.in_bounds
            && follow & (1 << 31 | 1) == 1 << 31 | 1
            && wrong_counts == [0; 8]
            && highest.into_iter().all(|number| number < objects as u32)
            && leaves == objects
            && self.marks.iter().fold(1, |all, mark| all & mark) == 1
    }
}

/// The greatest of some numbers, 0 of none.
#[inline(always)]
fn greatest(numbers: &[u32]) -> u32 {
    numbers.iter().fold(0, |greatest, &number| greatest.max(number))
}

/// Sets the marks with these numbers, if there are such. Returns whether there are.
#[inline(always)]
fn mark(marks: &mut [u8], numbers: &[u32]) -> bool {
    let in_bounds = (greatest(numbers) as usize) < marks.len();
    if in_bounds {
        for &number in numbers {
            // SAFETY: not greater than the greatest number, for which there is a mark. One comparison for many numbers
            // takes a fifth off the time of the structure's check, which is the longest part of loading.
            unsafe { *marks.get_unchecked_mut(number as usize) = 1 };
        }
    }
    in_bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bvh;
    use crate::checksum::{checksum, le_bytes};
    use crate::validate::name_damage;

    /// A chain: each pair is a leaf and the parent of the next, in turns left and right.
    fn chain(objects: u32) -> Bvh {
        let leaf = |object: u32| Node::leaf(Aabb::EMPTY, object, 1);
        let mut nodes: Vec<Node> = Vec::new();
        for pair in 0..objects - 1 {
            let at = if pair == 0 { 0 } else { nodes.len() - 1 - pair as usize % 2 };
            let first = nodes.len().max(1) as u32;
            let inner = Node::inner(Aabb::EMPTY, first, 2);
            if pair == 0 {
                nodes.push(inner)
            } else {
                nodes[at] = inner
            }
            nodes.extend([leaf(pair), leaf(pair)]);
        }
        if let Some(last) = nodes.last_mut() {
            *last = leaf(objects - 1);
        }
        if nodes.is_empty() {
            nodes.push(leaf(0));
        }
        Bvh { nodes, prim_ids: (0..objects).map(|object| (object + 2) % objects).collect() }
    }

    /// The answer, in which all ways must agree.
    fn passes(tree: &Bvh) -> bool {
        let objects = tree.prim_ids.len();
        let bytes = [le_bytes(&tree.nodes), le_bytes(&tree.prim_ids)].concat();
        let found = is_plain(tree.into(), objects);
        assert_eq!(found, is_plain_with(tree.into(), objects, words));
        let both = (checksum(&bytes), found);
        assert_eq!(checksum_and_is_plain(&bytes, tree.into(), objects), both);
        assert_eq!(checksum_and_is_plain_with(&bytes, tree.into(), objects, words), both);
        found
    }

    #[test]
    fn sound_trees_of_any_number_of_blocks_pass() {
        for objects in (1..140).chain([1000]) {
            let tree = chain(objects);
            assert_eq!(name_damage((&tree).into(), objects as usize), Ok(()));
            assert!(passes(&tree), "{objects}");
        }
    }

    #[test]
    fn what_passes_is_sound() {
        // Less than a block, and a block with some more.
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
                        damaged.nodes[at] = node(Aabb::EMPTY, first, count);
                        let sound = name_damage((&damaged).into(), objects as usize).is_ok();
                        assert_eq!(passes(&damaged), sound, "{:?}", damaged.nodes);
                        passed += usize::from(sound);
                    }
                }
            }
            assert_eq!(passed, tree.nodes.len(), "only the changes that are none");
            for (at, id) in (0..objects as usize).flat_map(|at| (0..objects + 3).map(move |id| (at, id))) {
                let mut damaged = tree.clone();
                damaged.prim_ids[at] = id;
                assert_eq!(passes(&damaged), damaged == tree);
            }
        }
    }

    #[test]
    fn trees_with_other_leaves_or_numbers_of_objects_do_not_pass() {
        let mut tree = chain(4);
        assert!(!is_plain((&tree).into(), 3) && !is_plain((&tree).into(), 5) && !is_plain((&tree).into(), 0));
        tree.nodes.truncate(5);
        tree.nodes[4] = Node::leaf(Aabb::EMPTY, 2, 2);
        assert_eq!(name_damage((&tree).into(), 4), Ok(()));
        assert!(!passes(&tree), "sound, but of another kind");
    }
}
