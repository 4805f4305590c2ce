//! Tree files: a tree and its origin as bytes. Loading rejects bytes that are damaged or
//! incomplete, and trees of another scene.
//!
//! ```
//! use bvh_core::{Aabb, Bvh, Node, file::{self, TreeFile}};
//! let boxes = [Aabb::from([[0.0; 3], [1.0; 3]]), Aabb::from([[2.0; 3], [3.0; 3]])];
//! let root = Node::inner(boxes[0].union(&boxes[1]), 1, 2);
//! let tree = Bvh::new(vec![root, Node::leaf(boxes[0], 0, 1), Node::leaf(boxes[1], 1, 1)], vec![0, 1]);
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
//! All numbers are little-endian, floats are IEEE 754, and sections follow each other without gaps.
//!
//! | bytes | type | field |
//! |---|---|---|
//! | 0..8 | `u8[8]` | magic number, `89 42 56 48 0d 0a 1a 0a` |
//! | 8..12 | `u32` | version: 4 |
//! | 12..16 | `u32` | endianness mark, 0x01020304: the bytes `04 03 02 01` |
//! | 16..20 | `u32` | objective: 0 internal area, 1 Goldsmith–Salmon, 2 surface area heuristic, 3 wide layout |
//! | 20..24 | `u32` | checksum of the scene: of the boxes, each min x, y, z, max x, y, z as `f32`, then of triangles in f64, each nine `f64`; 0 for −0 |
//! | 24..32 | `u64` | number of nodes |
//! | 32..40 | `u64` | number of objects |
//! | 40..48 | `u64` | seed of the search |
//! | 48..56 | `u64` | work of the search, in nodes made or visited |
//! | 56..64 | `f64` | cost under the objective when saved |
//! | 64..72 | `f64` | traversal constant of the surface area heuristic, otherwise 0 |
//! | 72..80 | `f64` | its intersection constant, otherwise 0 |
//! | 80..104 | `f32[6]` | the root's box, min then max; min +∞ and max −∞ without objects |
//! | 104..168 | `u8[64]` | name of the method, UTF-8, padded with zeros |
//! | 168..176 | `u64` | number of references, the object ids in all leaves |
//! | 176..180 | `u32` | 1 if there are visits, otherwise 0; 2 more if there is a frame; 4 more if the objects are triangles in f64 |
//! | 180..188 | | zeros |
//! | 188..192 | `u32` | checksum of the file: of the bytes from 192 to the end, then of bytes 0..188 |
//! | 192.. | | the nodes, 32 bytes each, then a `u32` object id per reference, then the visits if there are any, an `f32` per node, then the frame if there is one, `f64[12]` |
//!
//! | bytes of a node | type | field |
//! |---|---|---|
//! | 0..12 | `f32[3]` | lower corner of the box |
//! | 12..24 | `f32[3]` | upper corner |
//! | 24..28 | `u32` | first: index of the first child, or position of the leaf's first object id |
//! | 28..32 | `u32` | number of children (two or more) or of object ids (one or more); 2^31 added marks a leaf |
//!
//! The visits of a node are a number from 0 to 1: the fraction of the rays entering the scene that
//! enter the node's box, by the measure of boxes that the tree was searched with. No child has more
//! visits than its parent.
//!
//! The [frame](crate::Frame) is its rotation, row by row, and its centre. The boxes of all nodes lie
//! in it; the checksum of the scene is always that of boxes along the file's axes. Boxes in `f32` do
//! not tell triangles in f64 apart, so that the checksum is of their corners, too. Files without the
//! flag 4 may also be for such triangles, which only their boxes then identify.
//!
//! Node 0 is the root. Siblings are adjacent and come after their parent. Every object id occurs
//! once, or more often if its object is divided among leaves.
//!
//! Both checksums are the CRC-32 of zlib, gzip and PNG (reversed polynomial 0xedb88320), which
//! standard libraries have: `zlib.crc32` in Python. It detects every change confined to 32
//! consecutive bits, and all other changes except one in 2^32. It does not protect against forgery;
//! the checks of the tree do. `scripts/read_tree.py` and `scripts/read_tree.cpp` of the
//! repository read this format.
//!
//! Versions 1 to 3 were never released. This crate rejects them with [`FileError::Version`].
//!
//! # Loading without copying
//!
//! [`TreeFile::view`] borrows the bytes. Their address must be a multiple of 4, which mapped files
//! ensure. [`load`] copies bytes of any address.

mod error;
mod header;

pub use error::FileError;
pub use header::Header;

use crate::cost::{CallBoth, Objective, call_in_turn};
use crate::validate::{Leaves, check_nesting, check_structure, validate_parts};
use crate::{Aabb, Bvh, BvhView, DTriangle, Frame, InvalidBvh, Node, Primitives, validate};
use bytemuck::Pod;
use core::iter::repeat;
use crc32fast::Hasher;
use glam::{DVec3, Vec3};
use std::borrow::Cow;

const _: () = assert!(cfg!(target_endian = "little"), "tree files have the bytes of memory");

/// The origin of a tree, as the header of its file records it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Origin<'a> {
    /// The name of the method, at most 64 bytes.
    pub method: &'a str,
    /// The seed of the method's random numbers.
    pub seed: u64,
    /// The method's work, in nodes made or visited.
    pub work: u64,
    /// The objective that the method minimised. The header records the tree's cost under this
    /// objective.
    pub objective: Objective,
    /// The number of visits that rays make to each node, as
    /// [`RayDensity::visits`](crate::RayDensity::visits) returns it, for
    /// [`WideBvh::for_rays`](crate::WideBvh::for_rays). Empty if the tree was not searched for
    /// rays.
    pub visits: &'a [f32],
    /// The objects if they are triangles in f64; otherwise empty.
    pub doubles: &'a [DTriangle],
}

/// Returns the file of a tree over `boxes`, in [this format](self). Rejects a tree that is not
/// [valid](validate()) over `boxes`, and a tree in a [frame](crate::Frame), whose objects are more
/// than boxes. O(nodes + objects).
pub fn save(tree: &Bvh, boxes: &[Aabb], origin: &Origin) -> Result<Vec<u8>, FileError> {
    if tree.frame.is_some() {
        return Err(FileError::Frame);
    }
    validate(tree, boxes)?;
    let cost = origin.objective.cost(tree);
    Ok(sections(tree, boxes, cost, origin, &call_in_turn)?.concat())
}

/// Returns the sections of a file like that of [`save`], to be written one after the other: the
/// header, the nodes, the object ids, the visits and the frame. The nodes, ids and visits are the
/// tree's memory, which a file of gigabytes does not need twice. The tree's objects may be divided
/// among leaves. `boxes` lie along the file's axes, also those of a tree in a frame.
///
/// The caller has [validated](crate::validate_references()) the tree and knows its cost under the
/// origin's objective. Neither is checked here, because each takes as long as everything else, and
/// several threads can do both at once. Passes to `both` the check of the visits with the scene's
/// checksum, and the file's checksum. Rejects visits that no measure gives.
pub fn sections<'a>(
    tree: &'a Bvh,
    boxes: &[Aabb],
    cost: f64,
    origin: &Origin<'a>,
    both: CallBoth,
) -> Result<[Cow<'a, [u8]>; 5], FileError> {
    let Origin { method, seed, work, objective, visits, doubles } = *origin;
    let nodes = bytemuck::cast_slice(&tree.nodes);
    let prim_ids = bytemuck::cast_slice(&tree.prim_ids);
    let visit_bytes = bytemuck::cast_slice(visits);
    let frame = tree.frame.map_or_else(Vec::new, |frame| frame.to_bytes());
    let mut checked = Ok(());
    let mut scene = 0;
    let mut hasher = Hasher::new();
    both(
        &mut || {
            if !visits.is_empty() {
                checked = check_visits(&tree.nodes, visits);
            }
            scene = scene_checksum(boxes, doubles);
        },
        &mut || {
            for section in [nodes, prim_ids, visit_bytes, &frame] {
                hasher.update(section);
            }
        },
    );
    checked?;
    let header = Header {
        nodes: tree.nodes.len(),
        objects: boxes.len(),
        references: tree.prim_ids.len(),
        objective,
        cost,
        seed,
        work,
        scene,
        bounds: tree.root_aabb().unwrap_or(Aabb::EMPTY),
        method: method.into(),
        has_visits: !visits.is_empty(),
        has_frame: tree.frame.is_some(),
        is_double: !doubles.is_empty(),
    };
    let mut header = header.encode()?;
    hasher.update(&header[..Header::CHECKSUM.start]);
    header[Header::CHECKSUM].copy_from_slice(&hasher.finalize().to_le_bytes());
    Ok([header.into(), nodes.into(), prim_ids.into(), visit_bytes.into(), frame.into()])
}

/// Rejects visits that no measure can give. Measures are monotone, so no child has more visits than
/// its parent.
fn check_visits(nodes: &[Node], visits: &[f32]) -> Result<(), FileError> {
    if visits.len() != nodes.len() {
        return Err(FileError::Visits(visits.len().min(nodes.len())));
    }
    let below =
        nodes.iter().zip(visits).flat_map(|(node, most)| node.children().zip(repeat(*most)));
    let root = nodes.iter().take(1).map(|_| (0, 1.0));
    // NaN is in no range.
    match root.chain(below).find(|&(node, most)| !(0.0..=most).contains(&visits[node])) {
        Some((node, _)) => Err(FileError::Visits(node)),
        None => Ok(()),
    }
}

/// Returns a copy of the tree over `boxes` that is in `bytes`, with the checks of
/// [`TreeFile::tree_over`]. O(bytes).
pub fn load(bytes: &[u8], boxes: &[Aabb]) -> Result<Bvh, FileError> {
    TreeFile::open(bytes)?.for_boxes(boxes)?.tree_over(boxes, None, &call_in_turn)
}

/// Returns the checksum that identifies a scene in a tree file: the CRC-32 of min x, y, z, max x,
/// y, z of each box, as little-endian `f32`, with 0 for −0. O(n).
pub fn boxes_checksum(boxes: &[Aabb]) -> u32 {
    scene_checksum(boxes, &[])
}

/// Returns the checksum of the boxes and then of triangles in f64, their coordinates as
/// little-endian `f64`.
fn scene_checksum(boxes: &[Aabb], doubles: &[DTriangle]) -> u32 {
    let mut hasher = Hasher::new();
    // Mirrored objects have −0 where others have 0; −0 + 0 is 0.
    let zero = Vec3::ZERO;
    update(&mut hasher, boxes, |b| Aabb { min: b.min + zero, max: b.max + zero });
    update(&mut hasher, doubles, |t| DTriangle(t.0.map(|corner| corner + DVec3::ZERO)));
    hasher.finalize()
}

fn update<T: Pod>(hasher: &mut Hasher, items: &[T], without_sign: impl Fn(&T) -> T) {
    let mut piece = [T::zeroed(); 256];
    for items in items.chunks(piece.len()) {
        for (to, item) in piece.iter_mut().zip(items) {
            *to = without_sign(item);
        }
        hasher.update(bytemuck::cast_slice(&piece[..items.len()]));
    }
}

/// A tree file of the correct length and checksum. The tree is checked when it is requested.
///
/// Files can be mapped instead of read. For any bytes, forged ones included, traversals of
/// `TreeFile::open(bytes)?.for_boxes(&boxes)?.view()?` end and stay in bounds. Only
/// [`for_boxes`](Self::for_boxes) rejects a tree of another scene.
#[derive(Clone, Debug)]
pub struct TreeFile<'a> {
    header: Header,
    nodes: &'a [u8],
    prim_ids: &'a [u8],
    visits: &'a [u8],
    frame: Option<Frame>,
}

impl<'a> TreeFile<'a> {
    /// Checks header, length and checksum. O(bytes).
    pub fn open(bytes: &'a [u8]) -> Result<Self, FileError> {
        let header = Header::of_file(bytes, bytes.len() as u64)?;
        let [node_bytes, id_bytes, visit_bytes, _] = header.sections();
        let (nodes, rest) = bytes[Header::BYTES..].split_at(node_bytes as usize);
        let (prim_ids, rest) = rest.split_at(id_bytes as usize);
        let (visits, frame) = rest.split_at(visit_bytes as usize);
        let mut hasher = Hasher::new();
        hasher.update(&bytes[Header::BYTES..]);
        hasher.update(&bytes[..Header::CHECKSUM.start]);
        if hasher.finalize().to_le_bytes() != bytes[Header::CHECKSUM] {
            return Err(FileError::Checksum);
        }
        let frame = match frame.try_into() {
            Ok(frame) => Some(Frame::of_bytes(frame).map_err(|_| FileError::Field("frame"))?),
            Err(_) => None,
        };
        let file = Self { header, nodes, prim_ids, visits, frame };
        // The header repeats the first 24 bytes of the first node.
        let agrees = match file.nodes.get(..size_of::<Aabb>()) {
            Some(root) => *root == bytes[Header::BOUNDS],
            None => file.header.bounds == Aabb::EMPTY,
        };
        if !agrees {
            return Err(FileError::Field("box of the root"));
        }
        Ok(file)
    }

    /// Returns the frame that the boxes lie in; `None` for the file's axes.
    pub fn frame(&self) -> Option<&Frame> {
        self.frame.as_ref()
    }

    /// Returns the origin, size and cost of the tree.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Rejects all boxes except the boxes that the tree was saved for, along the file's axes, and
    /// trees over triangles in f64. O(objects).
    pub fn for_boxes(self, boxes: &[Aabb]) -> Result<Self, FileError> {
        self.for_objects(boxes, None)
    }

    /// Rejects all objects except those that the tree was saved for: by their boxes, along the
    /// file's axes, and by the corners of `objects` if they are triangles in f64. O(objects).
    pub fn for_objects(
        self,
        boxes: &[Aabb],
        objects: Option<&Primitives>,
    ) -> Result<Self, FileError> {
        let doubles: &[DTriangle] = match objects {
            _ if !self.header.is_double => &[],
            Some(Primitives::Doubles(triangles)) => triangles,
            _ => return Err(FileError::Double),
        };
        let expected = self.header.objects;
        if boxes.len() != expected {
            return Err(FileError::ObjectCount { found: boxes.len(), expected });
        }
        let scene = scene_checksum(boxes, doubles);
        if scene != self.header.scene {
            if let (false, Some(Primitives::Doubles(_))) = (self.header.is_double, objects) {
                return Err(FileError::Single);
            }
            return Err(FileError::OtherScene { found: scene, expected: self.header.scene });
        }
        Ok(self)
    }

    /// Returns a copy of the tree. Checks its structure, so that traversals end and stay in bounds,
    /// and checks that its boxes are finite. It does not check whether boxes contain their
    /// children and objects; [`tree_over`](Self::tree_over) does. O(nodes + objects).
    pub fn tree(&self) -> Result<Bvh, FileError> {
        let tree = self.copied();
        self.check((&tree).into())?;
        Ok(tree)
    }

    fn copied(&self) -> Bvh {
        // The bytes may have any address.
        let nodes = bytemuck::pod_collect_to_vec(self.nodes);
        let prim_ids = bytemuck::pod_collect_to_vec(self.prim_ids);
        Bvh { nodes, prim_ids, frame: self.frame }
    }

    /// Returns a copy of the tree, which is [valid](crate::validate_references()) over `boxes`,
    /// along the file's axes: a forged tree can have right checksums. `objects` are the shapes in
    /// the boxes. Without them, the leaves of an object that is divided are only known to reach as
    /// far as its box, and the leaves in a frame only to be in their nodes.
    ///
    /// Passes two checks of a tree that divides no object to `both`. O(nodes + references), and
    /// O(k²) for an object that k leaves share.
    pub fn tree_over(
        &self,
        boxes: &[Aabb],
        objects: Option<&Primitives>,
        both: CallBoth,
    ) -> Result<Bvh, FileError> {
        let tree = self.copied();
        let frame = self.frame();
        let parts = objects.and_then(|objects| objects.parts_in(frame));
        match (frame, objects, parts.as_deref()) {
            (None, _, parts) => validate_parts(&tree, boxes, parts, both)?,
            (_, Some(objects), Some(parts)) => {
                validate_parts(&tree, &objects.boxes_in(frame), Some(parts), both)?;
            }
            _ => {
                self.check((&tree).into())?;
                check_nesting(&tree, &[], |_| false)?;
            }
        }
        Ok(tree)
    }

    /// Returns the tree without copying it, after the same checks as [`tree`](Self::tree).
    pub fn view(&self) -> Result<BvhView<'_>, FileError> {
        fn cast<T: Pod>(bytes: &[u8]) -> Result<&[T], FileError> {
            // An empty slice may have any address, and `bytemuck` would reject it as misaligned.
            if bytes.is_empty() {
                return Ok(&[]);
            }
            bytemuck::try_cast_slice(bytes).map_err(|_| FileError::Alignment(align_of::<T>()))
        }
        let (nodes, prim_ids) = (cast(self.nodes)?, cast(self.prim_ids)?);
        let tree = BvhView { nodes, prim_ids, frame: self.frame() };
        self.check(tree)?;
        Ok(tree)
    }

    /// Returns the number of visits that rays make to each node, for
    /// [`WideBvh::for_rays`](crate::WideBvh::for_rays); `None` if the file has no visits. O(nodes).
    pub fn visits(&self) -> Result<Option<Vec<f32>>, FileError> {
        if !self.header.has_visits {
            return Ok(None);
        }
        let visits = bytemuck::pod_collect_to_vec(self.visits);
        check_visits(&self.tree()?.nodes, &visits)?;
        Ok(Some(visits))
    }

    fn check(&self, tree: BvhView) -> Result<(), InvalidBvh> {
        let Header { objects, references, .. } = self.header;
        let leaves = if references > objects { Leaves::OneOrMore } else { Leaves::One };
        check_structure(tree, objects, leaves)
    }
}
