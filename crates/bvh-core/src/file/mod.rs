//! Tree files: bytes out, bytes in, refused unless they are exactly what was saved for exactly this scene.
//!
//! ```
//! use bvh_core::{Aabb, Bvh, Node, file::{self, TreeFile}};
//! let boxes = [Aabb::from([[0.0; 3], [1.0; 3]]), Aabb::from([[2.0; 3], [3.0; 3]])];
//! let root = Node::inner(boxes[0].union(&boxes[1]), 1, 2);
//! let tree = Bvh { nodes: vec![root, Node::leaf(boxes[0], 0, 1), Node::leaf(boxes[1], 1, 1)], prim_ids: vec![0, 1] };
//!
//! let bytes = file::save(&tree, &boxes, &file::Origin { method: "by hand", ..Default::default() })?;
//! assert_eq!(file::load(&bytes, &boxes)?, tree);
//! assert!(file::load(&bytes, &boxes[..1]).is_err(), "another scene");
//! let header = TreeFile::open(&bytes)?.header().clone();
//! assert_eq!((header.method.as_str(), header.cost), ("by hand", 27.0));
//! # Ok::<(), bvh_core::file::FileError>(())
//! ```
//!
//! # Format
//!
//! Version 1. All numbers are little-endian, floats are IEEE 754, sections follow each other without gaps.
//!
//! | bytes | type | field |
//! |---|---|---|
//! | 0..8 | `u8[8]` | magic, `89 42 56 48 0d 0a 1a 0a` |
//! | 8..12 | `u32` | version, 1 |
//! | 12..16 | `u32` | endianness mark, 0x01020304: the bytes `04 03 02 01` |
//! | 16..20 | `u32` | layout: 0 tree, 1 wide |
//! | 20..24 | `u32` | objective: 0 internal area, 1 Goldsmith–Salmon, 2 surface area heuristic |
//! | 24..32 | `u64` | number of nodes |
//! | 32..40 | `u64` | number of objects |
//! | 40..48 | `u64` | number of blocks; 0 for a tree |
//! | 48..56 | `f64` | cost by the objective, when saved |
//! | 56..64 | `f64` | traversal constant of the surface area heuristic, else 0 |
//! | 64..72 | `f64` | its intersection constant, else 0 |
//! | 72..80 | `u64` | seed of the search |
//! | 80..88 | `u64` | work of the search, in nodes made or visited |
//! | 88..96 | `u64` | checksum of the scene: of its boxes, min then max; for a wide layout of its triangles' corners |
//! | 96..120 | `f32[6]` | box of the root, min then max; min +∞ and max −∞ without objects |
//! | 120..184 | `u8[64]` | name of the method, UTF-8, zeros after it |
//! | 184..192 | `u64` | checksum of the whole file, see below |
//! | 192.. | | the nodes |
//!
//! **Tree**: nodes of 32 bytes, then a `u32` per object.
//!
//! | bytes of a node | type | field |
//! |---|---|---|
//! | 0..12 | `f32[3]` | lower corner of the box |
//! | 12..24 | `f32[3]` | upper corner |
//! | 24..28 | `u32` | first: index of the first child, or position of the leaf's first object id |
//! | 28..32 | `u32` | number of children (two or more) or of object ids (one or more); 2^31 added marks a leaf |
//!
//! Node 0 is the root; siblings are adjacent and come after their parent; the object ids are a permutation.
//!
//! **Wide layout**: nodes of 256 bytes, then blocks of 160. Without nodes the root is the leaf of block 0.
//!
//! | bytes of a node | type | field |
//! |---|---|---|
//! | 0..192 | `f32[6][8]` | min x, min y, min z, max x, max y, max z of eight children; all six NaN in unused lanes |
//! | 192..224 | `u32[8]` | index of the child, or 2^31 + the first block of a leaf; 0 in unused lanes |
//! | 224..256 | | zeros |
//!
//! | bytes of a block | type | field |
//! |---|---|---|
//! | 0..144 | `f32[3][3][4]` | corner, axis, lane of up to four triangles; +∞ in unused lanes |
//! | 144..160 | `u32[4]` | object ids, 2^32 − 1 in unused lanes; 2^30 added to the first marks a leaf's last block |
//!
//! The checksum of the whole file is that of the header, in which the checksum of all that follows the header takes its
//! place.
//!
//! A checksum, in full, with arithmetic modulo 2^64 and `mix(h, x) = rotate_left((h xor x) · 0x9e3779b97f4a7c15, 29)`:
//! of `b` bytes, let `q` be the least multiple of 256 with `4q` no less than `b`. The four quarters begin at 0, `q`,
//! `2q` and `3q` and end where the next begins or all bytes do. For each, let `w` be its words of eight bytes, padded
//! by zeros to a multiple of 256 bytes. Of 32 lanes, lane `k` begins as `k + 1`, and word `i` changes lane `i mod 32`:
//! with `x = rotate_left(lane xor w[i], 16)` and `y = x + (x << 5)` it becomes `y xor (y >> 23)`. The quarter's sum is
//! `mix(… mix(mix(n, lane 0), lane 1) …, lane 31)` with `n` its number of bytes before padding, and the result
//! `mix(mix(mix(mix(b, sum 0), sum 1), sum 2), sum 3)`. The readers in Python and C++ that come with the repository
//! compute it too.
//!
//! # Loading without copying
//!
//! On little-endian machines [`TreeFile::view`] and [`TreeFile::wide_view`] borrow the bytes: a check and a cast. The
//! bytes must lie at a multiple of 4 for a tree and of 64 for a wide layout, as mapped files do. [`load`] and
//! [`load_wide`] copy, and work anywhere.

mod header;

pub use crate::checksum::{boxes_checksum, triangles_checksum};
pub use header::{Header, Layout};

use crate::checksum::{checksum, le_bytes};
use crate::cost::Objective;
use crate::validate::check_structure;
use crate::validate_plain::checksum_and_is_plain;
use crate::validate_wide::check_wide;
use crate::wide::node::WideNode;
use crate::wide::triangle4::Triangle4;
use crate::{Aabb, Bvh, BvhView, InvalidBvh, InvalidWide, Node, Triangle, WideBvh, WideView, validate};
use alloc::vec::Vec;
use bytemuck::Pod;

/// Why bytes were not accepted as a tree, or a tree not written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FileError {
    /// The first eight bytes are others.
    #[error("not a tree file")]
    Magic,
    /// Fewer bytes than a header has.
    #[error("the file ends within its header")]
    Header,
    /// Another version of the format.
    #[error("the file has version {found} of the format; this program reads version {}", Header::VERSION)]
    Version {
        /// The version found.
        found: u32,
    },
    /// Written most significant byte first.
    #[error("the file is big-endian; the format is little-endian")]
    Endianness,
    /// A field of the header with a value it cannot have.
    #[error("the header's {0} is out of range; the file is damaged")]
    Field(&'static str),
    /// Names have at most 64 bytes of UTF-8, none of them zero.
    #[error("the method's name is not one of 64 bytes at most")]
    Method,
    /// Cut or extended.
    #[error("the file has {found} bytes where its header asks for {expected}; it was cut or extended")]
    Length {
        /// Bytes there are.
        found: u64,
        /// Bytes there should be.
        expected: u64,
    },
    /// Some byte is not what was written.
    #[error("the file's checksum is wrong; it is damaged")]
    Checksum,
    /// A tree where a wide layout was asked for, or the reverse.
    #[error("the file holds a {found}, not a {expected}")]
    Layout {
        /// What the file holds.
        found: Layout,
        /// What was asked for.
        expected: Layout,
    },
    /// Saved for a scene of another size.
    #[error("the file is for a scene of {expected} objects; this one has {found}")]
    ObjectCount {
        /// Objects of the scene.
        found: usize,
        /// Objects of the file.
        expected: usize,
    },
    /// Saved for another scene, or for one whose objects have another order.
    #[error(
        "the file is for another scene: its objects' checksum is {expected:016x}, this scene's is {found:016x}"
    )]
    OtherScene {
        /// The scene's checksum.
        found: u64,
        /// The file's.
        expected: u64,
    },
    /// The checksum is right, but what it covers is no tree.
    #[error(transparent)]
    Tree(#[from] InvalidBvh),
    /// The checksum is right, but what it covers is no wide layout.
    #[error(transparent)]
    Wide(#[from] InvalidWide),
    /// Views need aligned bytes.
    #[error("the bytes do not lie at a multiple of {0}; load them instead")]
    Alignment(usize),
    /// Views need a little-endian machine.
    #[error("this machine is big-endian; load the bytes instead of viewing them")]
    Machine,
}

/// Where a tree comes from, for its file's header.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Origin<'a> {
    /// Name of the method, at most 64 bytes.
    pub method: &'a str,
    /// The seed of its random numbers.
    pub seed: u64,
    /// The work it did, in nodes made or visited.
    pub work: u64,
    /// What it minimised: the cost that the header reports.
    pub objective: Objective,
}

/// The file of a tree over `boxes`: see [the format](self). Refuses a tree that is not [valid](validate()) over them.
/// O(nodes + objects).
pub fn save(tree: &Bvh, boxes: &[Aabb], origin: &Origin) -> Result<Vec<u8>, FileError> {
    validate(tree, boxes)?;
    let (cost, bounds) = (origin.objective.cost(tree), tree.root_aabb().unwrap_or(Aabb::EMPTY));
    let mut header = Header::new(Layout::Tree, origin, cost, boxes_checksum(boxes), bounds);
    (header.nodes, header.objects) = (tree.nodes.len(), boxes.len());
    write(&header, &[&le_bytes(&tree.nodes), &le_bytes(&tree.prim_ids)])
}

/// The file of a wide layout of `tree`, over `triangles`; cost and bounds are the tree's. Refuses a tree that is not
/// valid over the triangles' boxes. O(nodes + objects).
pub fn save_wide(tree: &Bvh, triangles: &[Triangle], origin: &Origin) -> Result<Vec<u8>, FileError> {
    let wide = WideBvh::new(tree, triangles)?;
    let scene = triangles_checksum(triangles);
    let mut header = Header::new(Layout::Wide, origin, origin.objective.cost(tree), scene, wide.bounds);
    (header.nodes, header.objects, header.blocks) = (wide.nodes.len(), triangles.len(), wide.blocks.len());
    write(&header, &[&le_bytes(&wide.nodes), &le_bytes(&wide.blocks)])
}

/// The tree over `boxes` that `bytes` hold, copied out of them. O(bytes).
pub fn load(bytes: &[u8], boxes: &[Aabb]) -> Result<Bvh, FileError> {
    TreeFile::open(bytes)?.for_boxes(boxes)?.tree()
}

/// The wide layout over `triangles` that `bytes` hold, copied out of them. O(bytes).
pub fn load_wide(bytes: &[u8], triangles: &[Triangle]) -> Result<WideBvh, FileError> {
    TreeFile::open(bytes)?.for_triangles(triangles)?.wide()
}

fn write(header: &Header, sections: &[&[u8]]) -> Result<Vec<u8>, FileError> {
    let mut bytes = header.encode()?;
    bytes.reserve_exact(sections.iter().map(|section| section.len()).sum());
    sections.iter().for_each(|section| bytes.extend_from_slice(section));
    let (header, body) = bytes.split_at_mut(Header::BYTES);
    let sum = whole_checksum(header, checksum(body));
    header[Header::CHECKSUM].copy_from_slice(&sum.to_le_bytes());
    Ok(bytes)
}

/// The checksum of a file: of its header, with the checksum of what follows it in that place.
fn whole_checksum(header: &[u8], rest: u64) -> u64 {
    let mut covered = [0; Header::BYTES];
    covered.copy_from_slice(header);
    covered[Header::CHECKSUM].copy_from_slice(&rest.to_le_bytes());
    checksum(&covered)
}

/// Bytes whose length and checksum are right; what they hold is checked when it is asked for.
///
/// For files that are mapped, not read: with `bytes` any `&[u8]`, `TreeFile::open(bytes)?.for_boxes(&boxes)?.view()?`
/// is a tree to trace, whatever the bytes are: nothing in a view that was handed out leads out of bounds or in circles.
/// Only [`for_boxes`](Self::for_boxes) refuses a tree of another scene.
#[derive(Clone, Debug)]
pub struct TreeFile<'a> {
    header: Header,
    /// The nodes, and what follows them.
    sections: [&'a [u8]; 2],
    /// Whether the bytes are, where they lie, a tree known to be sound.
    is_sound: bool,
}

impl<'a> TreeFile<'a> {
    /// Checks header, length and checksum. O(bytes), at the speed of memory.
    pub fn open(bytes: &'a [u8]) -> Result<Self, FileError> {
        let header = Header::decode(bytes)?;
        let (node, other) = match header.layout {
            Layout::Tree => (size_of::<Node>(), size_of::<u32>() * header.objects),
            Layout::Wide => (size_of::<WideNode>(), size_of::<Triangle4>() * header.blocks),
        };
        // No overflow in 64 bits: counts are below 2^31.
        let (found, nodes) = (bytes.len() as u64, node as u64 * header.nodes as u64);
        let expected = Header::BYTES as u64 + nodes + other as u64;
        if found != expected {
            return Err(FileError::Length { found, expected });
        }
        let (start, body) = bytes.split_at(Header::BYTES);
        let sections: [&[u8]; 2] = body.split_at(nodes as usize).into();
        let tree = if header.layout == Layout::Tree { view_of(sections).ok() } else { None };
        let (sum, is_sound) = match tree {
            Some(tree) => checksum_and_is_plain(body, tree, header.objects),
            None => (checksum(body), false),
        };
        if whole_checksum(start, sum).to_le_bytes() != start[Header::CHECKSUM] {
            return Err(FileError::Checksum);
        }
        Ok(Self { header, sections, is_sound })
    }

    /// What the file says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Refuses all boxes but those the tree was saved for. O(objects).
    pub fn for_boxes(self, boxes: &[Aabb]) -> Result<Self, FileError> {
        self.expect(Layout::Tree)?;
        self.same_scene(boxes.len(), || boxes_checksum(boxes))
    }

    /// Refuses all triangles but those the wide layout was saved for. O(objects).
    pub fn for_triangles(self, triangles: &[Triangle]) -> Result<Self, FileError> {
        self.expect(Layout::Wide)?;
        self.same_scene(triangles.len(), || triangles_checksum(triangles))
    }

    fn same_scene(self, objects: usize, checksum: impl FnOnce() -> u64) -> Result<Self, FileError> {
        if objects != self.header.objects {
            return Err(FileError::ObjectCount { found: objects, expected: self.header.objects });
        }
        match (checksum(), self.header.scene) {
            (found, expected) if found != expected => Err(FileError::OtherScene { found, expected }),
            _ => Ok(self),
        }
    }

    /// The tree, copied, its structure checked: what makes traversals end and stay in bounds. What the boxes contain is
    /// left to the checksum, or to [`validate`](validate()). O(nodes + objects).
    pub fn tree(&self) -> Result<Bvh, FileError> {
        self.expect(Layout::Tree)?;
        let tree = Bvh { nodes: copied(self.sections[0]), prim_ids: copied(self.sections[1]) };
        self.check((&tree).into())?;
        Ok(tree)
    }

    /// The tree where it lies, checked likewise.
    pub fn view(&self) -> Result<BvhView<'a>, FileError> {
        self.expect(Layout::Tree)?;
        let tree = view_of(self.sections)?;
        self.check(tree)?;
        Ok(tree)
    }

    /// Checks the structure of the tree that the file holds, if that has not been done yet.
    fn check(&self, tree: BvhView) -> Result<(), InvalidBvh> {
        if self.is_sound { Ok(()) } else { check_structure(tree, self.header.objects) }
    }

    /// The wide layout, copied, its structure and the nesting of its boxes checked. O(nodes + objects).
    pub fn wide(&self) -> Result<WideBvh, FileError> {
        self.expect(Layout::Wide)?;
        let (nodes, blocks) = (copied(self.sections[0]), copied(self.sections[1]));
        let view = WideView::over(self.header.bounds, &nodes, &blocks);
        check_wide(view, self.header.objects)?;
        Ok(WideBvh { bounds: view.bounds, root: view.root, nodes, blocks })
    }

    /// The wide layout where it lies, checked likewise.
    pub fn wide_view(&self) -> Result<WideView<'a>, FileError> {
        self.expect(Layout::Wide)?;
        let (nodes, blocks) = (cast(self.sections[0])?, cast(self.sections[1])?);
        let view = WideView::over(self.header.bounds, nodes, blocks);
        check_wide(view, self.header.objects)?;
        Ok(view)
    }

    fn expect(&self, expected: Layout) -> Result<(), FileError> {
        let found = self.header.layout;
        if found == expected { Ok(()) } else { Err(FileError::Layout { found, expected }) }
    }
}

/// A tree's nodes and object ids, where they lie.
fn view_of([nodes, ids]: [&[u8]; 2]) -> Result<BvhView<'_>, FileError> {
    Ok(BvhView { nodes: cast(nodes)?, prim_ids: cast(ids)? })
}

/// Bytes as values of four-byte words, where they lie.
fn cast<T: Pod>(bytes: &[u8]) -> Result<&[T], FileError> {
    if cfg!(target_endian = "big") {
        return Err(FileError::Machine);
    }
    if bytes.is_empty() {
        return Ok(&[]);
    }
    bytemuck::try_cast_slice(bytes).map_err(|_| FileError::Alignment(align_of::<T>()))
}

/// Bytes as values of four-byte words, copied.
fn copied<T: Pod>(bytes: &[u8]) -> Vec<T> {
    let mut values = alloc::vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(bytes);
    for word in bytemuck::cast_slice_mut::<T, u32>(&mut values) {
        *word = u32::from_le(*word);
    }
    values
}

#[cfg(test)]
mod tests;
