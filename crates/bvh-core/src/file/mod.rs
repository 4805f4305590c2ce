//! Tree files: a tree and its origin as bytes, refused on loading unless they are whole and for the same scene.
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
//! Versions 2 to 4; each file has the first that suffices. All numbers are little-endian, floats are IEEE 754, and sections follow each other without gaps.
//!
//! | bytes | type | field |
//! |---|---|---|
//! | 0..8 | `u8[8]` | magic number, `89 42 56 48 0d 0a 1a 0a` |
//! | 8..12 | `u32` | version: 2; 3 with visits; 4 with more references than objects, or the cost of the layout |
//! | 12..16 | `u32` | endianness mark, 0x01020304: the bytes `04 03 02 01` |
//! | 16..20 | `u32` | objective: 0 internal area, 1 Goldsmith–Salmon, 2 surface area heuristic, 3 (version 4) wide layout |
//! | 20..24 | `u32` | checksum of the scene: of its boxes, each min x, y, z, max x, y, z as `f32` |
//! | 24..32 | `u64` | number of nodes |
//! | 32..40 | `u64` | number of objects |
//! | 40..48 | `u64` | seed of the search |
//! | 48..56 | `u64` | work of the search, in nodes made or visited |
//! | 56..64 | `f64` | cost by the objective, when saved |
//! | 64..72 | `f64` | traversal constant of the surface area heuristic, else 0 |
//! | 72..80 | `f64` | its intersection constant, else 0 |
//! | 80..104 | `f32[6]` | the root's box, min then max; min +∞ and max −∞ without objects |
//! | 104..168 | `u8[64]` | name of the method, UTF-8, padded with zeros |
//! | 168..176 | `u64` | version 4: number of references, the object ids in all leaves; else 0 |
//! | 176..180 | `u32` | version 4: 1 if there are visits, else 0; in other versions 0 |
//! | 180..188 | | zeros |
//! | 188..192 | `u32` | checksum of the file: of the bytes from 192 to the end, then of bytes 0..188 |
//! | 192.. | | the nodes, 32 bytes each, then a `u32` object id per reference, then the visits if there are any, an `f32` per node |
//!
//! | bytes of a node | type | field |
//! |---|---|---|
//! | 0..12 | `f32[3]` | lower corner of the box |
//! | 12..24 | `f32[3]` | upper corner |
//! | 24..28 | `u32` | first: index of the first child, or position of the leaf's first object id |
//! | 28..32 | `u32` | number of children (two or more) or of object ids (one or more); 2^31 added marks a leaf |
//!
//! The visits of a node are 0 to 1: how many of the rays that enter the scene enter its box, as a part of the measure that the
//! tree was searched by. No child has more than its parent.
//!
//! Node 0 is the root; siblings are adjacent and come after their parent; the object ids are a permutation, or in version 4
//! name every object once or more.
//!
//! Both checksums are the CRC-32 of zlib, gzip and PNG (reversed polynomial 0xedb88320), which standard libraries have:
//! `zlib.crc32` in Python. It detects every change confined to 32 consecutive bits, and any other change but for one in
//! 2^32. It does not protect against forgery; the checks of the tree's structure do. `scripts/read_tree.py` and
//! `scripts/read_tree.cpp` of the repository read this format.
//!
//! Version 1 had a checksum of its own and could also hold wide layouts. This crate refuses it by name.
//!
//! # Loading without copying
//!
//! On little-endian machines [`TreeFile::view`] borrows the bytes, which must lie at a multiple of 4, as mapped files
//! do. [`load`] copies, and works everywhere.

mod error;
mod header;

pub use error::FileError;
pub use header::Header;

use crate::cost::Objective;
use crate::validate::{FastPath, Leaves, check_structure, find_fault};
use crate::{Aabb, Bvh, BvhView, Clip, InvalidBvh, Node, validate, validate_references};
use alloc::borrow::Cow;
use alloc::vec::Vec;
use bytemuck::Pod;
use core::ops::Range;
use crc32fast::Hasher;

/// Where a tree comes from, as its file's header records it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Origin<'a> {
    /// Name of the method, at most 64 bytes.
    pub method: &'a str,
    /// The seed of the method's random numbers.
    pub seed: u64,
    /// The method's work, in nodes made or visited.
    pub work: u64,
    /// What the method minimised; the header reports the tree's cost by it.
    pub objective: Objective,
    /// How often rays visit each node, such as [`RayDensity::visits`](crate::RayDensity::visits), for
    /// [`WideBvh::for_rays`](crate::WideBvh::for_rays). Empty if the tree was not searched for any rays.
    pub visits: &'a [f32],
}

/// The file of a tree over `boxes`, in [this format](self). Refuses a tree that is not [valid](validate()) over them.
/// O(nodes + objects).
pub fn save(tree: &Bvh, boxes: &[Aabb], origin: &Origin) -> Result<Vec<u8>, FileError> {
    validate(tree, boxes)?;
    saved(tree, boxes, origin)
}

/// As [`save`], for trees whose `objects` may be divided among leaves: refuses those that are not
/// [valid](validate_references()).
pub fn save_references(
    tree: &Bvh,
    boxes: &[Aabb],
    objects: &dyn Clip,
    origin: &Origin,
) -> Result<Vec<u8>, FileError> {
    validate_references(tree, boxes, objects)?;
    saved(tree, boxes, origin)
}

/// The file of a valid tree.
fn saved(tree: &Bvh, boxes: &[Aabb], origin: &Origin) -> Result<Vec<u8>, FileError> {
    let Origin { method, seed, work, objective, visits } = *origin;
    if !visits.is_empty() {
        check_visits(&tree.nodes, visits)?;
    }
    let header = Header {
        nodes: tree.nodes.len(),
        objects: boxes.len(),
        references: tree.prim_ids.len(),
        objective,
        cost: objective.cost(tree),
        seed,
        work,
        scene: boxes_checksum(boxes),
        bounds: tree.root_aabb().unwrap_or(Aabb::EMPTY),
        method: method.into(),
        has_visits: !visits.is_empty(),
    };
    let mut bytes = header.encode()?;
    let sections = [le_bytes(&tree.nodes), le_bytes(&tree.prim_ids), le_bytes(visits)];
    bytes.reserve_exact(sections.iter().map(|section| section.len()).sum());
    sections.iter().for_each(|section| bytes.extend_from_slice(section));
    seal(&mut bytes);
    Ok(bytes)
}

/// Refuses visits that no measure gives: a monotone one gives no child more than its parent.
fn check_visits(nodes: &[Node], visits: &[f32]) -> Result<(), FileError> {
    if visits.len() != nodes.len() {
        return Err(FileError::Visits(visits.len().min(nodes.len())));
    }
    let accepts =
        |most: f32, at: usize| (0.0..=most).contains(&visits[at]).then_some(()).ok_or(FileError::Visits(at));
    if !visits.is_empty() {
        accepts(1.0, 0)?;
    }
    for (parent, node) in nodes.iter().enumerate() {
        node.children().try_for_each(|child| accepts(visits[parent], child))?;
    }
    Ok(())
}

/// The tree over `boxes` that `bytes` hold, copied out of them. O(bytes).
pub fn load(bytes: &[u8], boxes: &[Aabb]) -> Result<Bvh, FileError> {
    TreeFile::open(bytes)?.for_boxes(boxes)?.tree()
}

/// The checksum by which a tree file recognises its scene: the CRC-32 of min x, y, z, max x, y, z of each box, as
/// little-endian `f32`. O(n).
pub fn boxes_checksum(boxes: &[Aabb]) -> u32 {
    crc32fast::hash(&le_bytes(boxes))
}

/// Bytes that the checksum and the check of the structure take in turns: enough that neither is slowed down by the
/// change, and few enough that the second finds them in the cache.
const PIECE: usize = 8192;

/// The checksum of a file of at least a header's length. Shows every piece of what follows the header to `visit`.
fn checksum(file: &[u8], mut visit: impl FnMut(Range<usize>)) -> u32 {
    let (header, body) = file.split_at(Header::BYTES);
    let mut hasher = Hasher::new();
    let mut start = 0;
    for piece in body.chunks(PIECE) {
        hasher.update(piece);
        visit(start..start + piece.len());
        start += piece.len();
    }
    hasher.update(&header[..Header::CHECKSUM.start]);
    hasher.finalize()
}

/// Writes the checksum into a file.
fn seal(file: &mut [u8]) {
    let sum = checksum(file, |_| ());
    file[Header::CHECKSUM].copy_from_slice(&sum.to_le_bytes());
}

/// Bytes whose length and checksum are right; their tree is checked when it is asked for.
///
/// Serves files that are mapped rather than read: with `bytes` any `&[u8]`, forged ones included,
/// `TreeFile::open(bytes)?.for_boxes(&boxes)?.view()?` is a tree that traversals can follow to the end and within
/// bounds. Only [`for_boxes`](Self::for_boxes) refuses a tree of another scene.
#[derive(Clone, Debug)]
pub struct TreeFile<'a> {
    header: Header,
    nodes: &'a [u8],
    prim_ids: &'a [u8],
    visits: &'a [u8],
    /// Whether the tree has passed the check of its structure where it lies.
    is_sound: bool,
}

impl<'a> TreeFile<'a> {
    /// Checks header, length and checksum. O(bytes).
    pub fn open(bytes: &'a [u8]) -> Result<Self, FileError> {
        let header = Header::decode(bytes)?;
        // No overflow in 64 bits: counts are below 2^32.
        let (nodes, references) = (header.nodes as u64, header.references as u64);
        let node_bytes = nodes * size_of::<Node>() as u64;
        let id_bytes = references * size_of::<u32>() as u64;
        let visit_bytes = if header.has_visits { nodes * size_of::<f32>() as u64 } else { 0 };
        let expected = Header::BYTES as u64 + node_bytes + id_bytes + visit_bytes;
        let found = bytes.len() as u64;
        if found != expected {
            return Err(FileError::Length { found, expected });
        }
        let (nodes, rest) = bytes[Header::BYTES..].split_at(node_bytes as usize);
        let (prim_ids, visits) = rest.split_at(id_bytes as usize);
        let mut file = Self { header, nodes, prim_ids, visits, is_sound: false };
        let mut fast_path = file.cast().ok().and_then(|tree| FastPath::new(tree, file.header.objects));
        let sum = checksum(bytes, |piece| fast_path.iter_mut().for_each(|check| check.add(piece.clone())));
        if sum.to_le_bytes() != bytes[Header::CHECKSUM] {
            return Err(FileError::Checksum);
        }
        file.is_sound = fast_path.is_some_and(FastPath::finish);
        let bounds = file.nodes.get(..size_of::<Aabb>());
        if bounds.map_or(file.header.bounds != Aabb::EMPTY, |root| *root != bytes[Header::BOUNDS]) {
            return Err(FileError::Field("box of the root"));
        }
        Ok(file)
    }

    /// The origin, size and cost of the tree.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Refuses all boxes but those that the tree was saved for. O(objects).
    pub fn for_boxes(self, boxes: &[Aabb]) -> Result<Self, FileError> {
        let (found, expected) = (boxes.len(), self.header.objects);
        if found != expected {
            return Err(FileError::ObjectCount { found, expected });
        }
        match (boxes_checksum(boxes), self.header.scene) {
            (found, expected) if found != expected => Err(FileError::OtherScene { found, expected }),
            _ => Ok(self),
        }
    }

    /// A copy of the tree. Checks its structure, so that traversals end and stay in bounds, and that its boxes are finite.
    /// What the boxes contain is left to the checksum, or to [`validate`](validate()). O(nodes + objects).
    pub fn tree(&self) -> Result<Bvh, FileError> {
        let tree = Bvh { nodes: copied(self.nodes), prim_ids: copied(self.prim_ids) };
        self.check((&tree).into())?;
        Ok(tree)
    }

    /// The tree where it lies, checked as by [`tree`](Self::tree).
    pub fn view(&self) -> Result<BvhView<'a>, FileError> {
        let tree = self.cast()?;
        self.check(tree)?;
        Ok(tree)
    }

    /// How often rays visit each node, if the file says so, for [`WideBvh::for_rays`](crate::WideBvh::for_rays). O(nodes).
    pub fn visits(&self) -> Result<Option<Vec<f32>>, FileError> {
        if !self.header.has_visits {
            return Ok(None);
        }
        let visits = copied(self.visits);
        check_visits(&self.tree()?.nodes, &visits)?;
        Ok(Some(visits))
    }

    fn cast(&self) -> Result<BvhView<'a>, FileError> {
        Ok(BvhView { nodes: cast(self.nodes)?, prim_ids: cast(self.prim_ids)? })
    }

    /// Checks the structure of the file's tree unless that was done with the checksum.
    fn check(&self, tree: BvhView) -> Result<(), InvalidBvh> {
        match self.header {
            _ if self.is_sound => Ok(()),
            Header { objects, references, .. } if references > objects => {
                find_fault(tree, objects, Leaves::OneOrMore)
            }
            Header { objects, .. } => check_structure(tree, objects),
        }
    }
}

/// The bytes of values that consist of four-byte words, little-endian on any machine.
fn le_bytes<T: Pod>(values: &[T]) -> Cow<'_, [u8]> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytes)
    } else {
        Cow::Owned(bytes.as_chunks::<4>().0.iter().flat_map(|&[a, b, c, d]| [d, c, b, a]).collect())
    }
}

/// Bytes as values that consist of four-byte words, where they lie.
fn cast<T: Pod>(bytes: &[u8]) -> Result<&[T], FileError> {
    if cfg!(target_endian = "big") {
        return Err(FileError::Machine);
    }
    if bytes.is_empty() {
        return Ok(&[]);
    }
    bytemuck::try_cast_slice(bytes).map_err(|_| FileError::Alignment(align_of::<T>()))
}

/// Bytes as values that consist of four-byte words, copied.
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
