//! Files of wide layouts, which can be mapped and traced without a copy.
//!
//! All numbers are little-endian.
//!
//! | bytes | type | field |
//! |---|---|---|
//! | 0..8 | `u8[8]` | magic number, `89 57 42 56 0d 0a 1a 0a` |
//! | 8..12 | `u32` | version: 1 |
//! | 12..16 | `u32` | endianness mark, as in a tree file |
//! | 16..24 | `u64` | number of nodes |
//! | 24..32 | `u64` | number of blocks |
//! | 32..56 | `f32[6]` | the box of the scene, min then max; min +∞ and max −∞ without triangles |
//! | 56..60 | `u32` | the root: a child, as in a node; 0 without triangles |
//! | 60..124 | | zeros |
//! | 124..128 | `u32` | CRC-32 of the bytes from 128 to the end, then of bytes 0..124 |
//! | 128.. | | the nodes, 256 bytes each, then the blocks, 160 bytes each |
//!
//! A node has eight lanes: `f32[6][8]` with the lower x, y, z, then the upper x, y, z of all lanes,
//! NaN in unused ones; `u32[8]` children; 32 zeros. A child is the index of a node, which comes
//! after its parent, or 2^31 and the index of a leaf's first block. A block has four lanes, the
//! used ones first: `f32[3][3][4]` corners by corner and axis, unused lanes repeating the last used
//! one; `u32[4]` object ids, 2^32 − 1 in unused lanes. 2^30 is added to the first id of a leaf's
//! last block.

use super::FileError;
use super::header::{Fields, Header};
use super::words::{cast, copied, le_bytes};
use crate::wide::{Child, TriangleBlock, WideNode};
use crate::{Aabb, WideBvh};
use alloc::borrow::Cow;
use alloc::vec;
use alloc::vec::Vec;
use core::marker::PhantomData;
use core::ops::{Deref, Range};
use crc32fast::Hasher;

const MAGIC: [u8; 8] = *b"\x89WBV\r\n\x1a\n";
const VERSION: u32 = 1;
const BYTES: usize = 128;
const CHECKSUM: Range<usize> = 124..128;

/// A wide layout in bytes that it borrows, for example of a mapped file.
///
/// ```
/// # use bvh_core::{Aabb, Bvh, Node, Ray, Triangle, WideBvh, file};
/// # let triangles = [Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])];
/// # let leaf = Node::leaf(triangles[0].aabb(), 0, 1);
/// let wide = WideBvh::new(&Bvh { nodes: vec![leaf], prim_ids: vec![0] }, &triangles)?;
/// let bytes = file::save_layout(&wide);
/// // A mapped file begins at a multiple of 64. A vector need not.
/// let copy = file::load_layout(&bytes)?;
/// let ray = Ray::half_line([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]).unwrap();
/// assert_eq!(copy.nearest_hit(&ray), wide.nearest_hit(&ray));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct WideView<'a> {
    wide: WideBvh,
    bytes: PhantomData<&'a [u8]>,
}

impl Deref for WideView<'_> {
    type Target = WideBvh;

    fn deref(&self) -> &WideBvh {
        &self.wide
    }
}

/// Returns the file of a layout. O(nodes + blocks).
pub fn save_layout(wide: &WideBvh) -> Vec<u8> {
    let bounds: [f32; 6] = bytemuck::cast(wide.bounds);
    let root = wide.root.map_or(0, Child::bits);
    let sections = [le_bytes(&wide.nodes), le_bytes(&wide.blocks)];
    let length: usize = sections.iter().map(|section| section.len()).sum();
    let mut bytes = Vec::with_capacity(BYTES + length);
    bytes.extend(MAGIC);
    bytes.extend([VERSION, Header::ENDIANNESS].map(u32::to_le_bytes).as_flattened());
    for count in [wide.nodes.len(), wide.blocks.len()] {
        bytes.extend((count as u64).to_le_bytes());
    }
    bytes.extend(bounds.map(f32::to_le_bytes).as_flattened());
    bytes.extend(root.to_le_bytes());
    bytes.resize(BYTES, 0);
    for section in sections {
        bytes.extend_from_slice(&section);
    }
    let sum = checksum(&bytes);
    bytes[CHECKSUM].copy_from_slice(&sum.to_le_bytes());
    bytes
}

/// Returns a copy of the layout in `bytes`, which may have any address. O(bytes).
pub fn load_layout(bytes: &[u8]) -> Result<WideBvh, FileError> {
    let file = LayoutFile::open(bytes)?;
    file.checked(Cow::Owned(copied(file.nodes)), Cow::Owned(copied(file.blocks)))
}

/// Returns the layout in `bytes` without a copy. Their address must be a multiple of 64, which
/// mapped files ensure. For any bytes, forged ones included, traversals end and stay in bounds.
/// O(bytes).
pub fn view_layout(bytes: &[u8]) -> Result<WideView<'_>, FileError> {
    let file = LayoutFile::open(bytes)?;
    let nodes = cast(file.nodes)?;
    let blocks = cast(file.blocks)?;
    // SAFETY: the view lends the layout only as long as the bytes live, and clones copy the arrays.
    let wide = unsafe { file.checked(forever(nodes), forever(blocks)) }?;
    Ok(WideView { wide, bytes: PhantomData })
}

/// Returns a slice without the end of its life.
///
/// # Safety
/// The result is not used after that end.
unsafe fn forever<T: Clone>(slice: &[T]) -> Cow<'static, [T]> {
    // SAFETY: the caller's promise.
    Cow::Borrowed(unsafe { &*core::ptr::from_ref(slice) })
}

/// Returns the checksum of a file that has at least the length of a header.
fn checksum(file: &[u8]) -> u32 {
    let mut hasher = Hasher::new();
    hasher.update(&file[BYTES..]);
    hasher.update(&file[..CHECKSUM.start]);
    hasher.finalize()
}

/// A file of the correct length and checksum, whose layout is not checked.
struct LayoutFile<'a> {
    bounds: Aabb,
    root: u32,
    nodes: &'a [u8],
    blocks: &'a [u8],
}

impl<'a> LayoutFile<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, FileError> {
        let mut fields = Fields(bytes);
        if fields.take() != Some(MAGIC) {
            return Err(FileError::Magic);
        }
        let found = fields.word()?;
        if found != VERSION {
            return Err(FileError::LayoutVersion { found });
        }
        if fields.word()? != Header::ENDIANNESS {
            return Err(FileError::Endianness);
        }
        let [node_count, block_count]: [u64; 2] = fields.words()?;
        let mut corners = [[0.0; 3]; 2];
        for coordinate in corners.as_flattened_mut() {
            *coordinate = f32::from_le_bytes(fields.need()?);
        }
        let root = fields.word()?;
        if fields.need::<64>()? != [0; 64] {
            return Err(FileError::Field("padding"));
        }
        let _checksum: [u8; 4] = fields.need()?;
        // References have 31 bits, so nothing overflows below.
        if node_count.max(block_count) > 1 << 31 {
            return Err(FileError::Field("nodes or blocks"));
        }
        let node_bytes = node_count * size_of::<WideNode>() as u64;
        let expected = BYTES as u64 + node_bytes + block_count * size_of::<TriangleBlock>() as u64;
        let found = bytes.len() as u64;
        if found != expected {
            return Err(FileError::Length { found, expected });
        }
        if checksum(bytes).to_le_bytes() != bytes[CHECKSUM] {
            return Err(FileError::Checksum);
        }
        let (nodes, blocks) = bytes[BYTES..].split_at(node_bytes as usize);
        Ok(Self { bounds: Aabb::from(corners), root, nodes, blocks })
    }

    /// Returns the layout if its traversals end and stay in bounds.
    fn checked(
        &self,
        nodes: Cow<'static, [WideNode]>,
        blocks: Cow<'static, [TriangleBlock]>,
    ) -> Result<WideBvh, FileError> {
        if self.bounds != Aabb::EMPTY {
            let checked = self.bounds.check();
            checked.map_err(|_| FileError::Field("box of the scene"))?;
        }
        // There is nothing to hit, or no triangle at all.
        if nodes.is_empty() && blocks.is_empty() && self.root == 0 {
            return Ok(WideBvh::from_arrays(self.bounds, None, nodes, blocks, 0));
        }
        let root = Child::from_bits(self.root);
        let depth = Structure::check(root, &nodes, &blocks)?;
        Ok(WideBvh::from_arrays(self.bounds, Some(root), nodes, blocks, depth))
    }
}

/// The references that have been checked: each node and each leaf is named once, so no traversal
/// visits anything twice.
struct Structure {
    /// The depth of each node that has been named; 0 before.
    depths: Vec<u32>,
    is_named: Vec<bool>,
}

impl Structure {
    /// Returns the number of nodes on the longest way.
    fn check(
        root: Child,
        nodes: &[WideNode],
        blocks: &[TriangleBlock],
    ) -> Result<usize, FileError> {
        let depths = vec![0; nodes.len()];
        let mut structure = Structure { depths, is_named: vec![false; blocks.len()] };
        structure.name(root, 0, 1)?;
        for (index, node) in nodes.iter().enumerate() {
            let depth = structure.depths[index];
            let is_reached = depth > 0;
            for lane in 0..WideNode::LANES {
                let planes = node.planes.map(|plane| plane[lane]);
                if planes.iter().all(|plane| plane.is_finite()) {
                    structure.name(node.children[lane], index + 1, depth + 1)?;
                } else if planes != [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]].concat()[..] {
                    // A box that is unused in part could be entered.
                    return Err(FileError::Layout { node: index });
                }
            }
            if !is_reached {
                return Err(FileError::Layout { node: index });
            }
        }
        let are_sound = blocks.iter().all(TriangleBlock::is_sound);
        // Every leaf is named at its first block, and its last one is marked.
        let firsts = core::iter::once(true).chain(blocks.iter().map(TriangleBlock::is_last));
        let are_named = firsts.zip(&structure.is_named).all(|(first, &named)| first == named);
        let ends = blocks.last().is_none_or(TriangleBlock::is_last);
        if !(are_sound && are_named && ends) {
            return Err(FileError::Field("blocks"));
        }
        Ok(structure.depths.into_iter().max().unwrap_or(0) as usize)
    }

    /// Names a child of a node, which comes before `least`.
    fn name(&mut self, child: Child, least: usize, depth: u32) -> Result<(), FileError> {
        let index = child.index();
        let is_new = if child.is_node() {
            index >= least
                && self
                    .depths
                    .get_mut(index)
                    .is_some_and(|known| core::mem::replace(known, depth) == 0)
        } else {
            self.is_named.get_mut(index).is_some_and(|known| !core::mem::replace(known, true))
        };
        if is_new { Ok(()) } else { Err(FileError::Layout { node: least.saturating_sub(1) }) }
    }
}
