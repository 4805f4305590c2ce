//! The header of a tree file, its first 192 bytes: format, sizes, cost, origin, and the checksum of
//! the scene.

use super::FileError;
use crate::cost::{Objective, SahConstants};
use crate::{Aabb, Frame, MAX_OBJECTS, Node};
use bytemuck::{Pod, Zeroable};

/// The header of a tree file. [The format](super) documents the position of each field.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The number of nodes.
    pub nodes: usize,
    /// The number of objects.
    pub objects: usize,
    /// The number of object ids in all leaves. It exceeds the number of objects if objects are
    /// divided among leaves.
    pub references: usize,
    /// The objective of `cost`.
    pub objective: Objective,
    /// The cost of the tree when it was saved.
    pub cost: f64,
    /// The seed of the search.
    pub seed: u64,
    /// The work of the search, in nodes made or visited.
    pub work: u64,
    /// The checksum of the objects: of their [boxes](super::boxes_checksum), and of corners in f64.
    pub scene: u32,
    /// The root's box; [`Aabb::EMPTY`] if there are no objects.
    pub bounds: Aabb,
    /// The name of the method that built the tree.
    pub method: String,
    /// True if the file records how often rays visit each node; see
    /// [`TreeFile::visits`](super::TreeFile::visits).
    pub has_visits: bool,
    /// True if the boxes lie in a frame; see [`TreeFile::frame`](super::TreeFile::frame).
    pub has_frame: bool,
    /// True if the objects are triangles in f64, which [`scene`](Self::scene) identifies.
    pub is_double: bool,
}

impl Header {
    /// The number of bytes of a header.
    pub const BYTES: usize = 192;
    /// The first eight bytes of every tree file, modelled on PNG's: a transfer that converts line
    /// ends or clears high bits changes them.
    pub const MAGIC: [u8; 8] = *b"\x89BVH\r\n\x1a\n";
    /// The version of the format, the only one that is written and read.
    pub const VERSION: u32 = 4;
    /// The flags.
    const VISITS: u32 = 1;
    const FRAME: u32 = 2;
    const DOUBLE: u32 = 4;
    /// A number whose stored bytes identify the byte order of the file.
    pub(super) const ENDIANNESS: u32 = 0x0102_0304;
    /// The bytes of the root's box. They equal the box in the first node.
    pub(super) const BOUNDS: core::ops::Range<usize> = 80..104;
    /// The last field, the checksum of every other byte of the file.
    pub(super) const CHECKSUM: core::ops::Range<usize> = 188..192;

    /// Returns the header of a file of `length` bytes. `beginning` holds at least the first
    /// [`BYTES`](Self::BYTES) of them. Rejects a file whose length differs from the length that its
    /// header requires, before the caller reads the rest. Does not verify the checksum;
    /// [`TreeFile::open`](super::TreeFile::open) does.
    pub fn of_file(beginning: &[u8], length: u64) -> Result<Self, FileError> {
        let header = Self::decode(beginning)?;
        let expected = Self::BYTES as u64 + header.sections().iter().sum::<u64>();
        if length == expected {
            Ok(header)
        } else {
            Err(FileError::Length { found: length, expected })
        }
    }

    /// Returns the lengths of the nodes, of the object ids, of the visits and of the frame, in bytes.
    /// Counts are below 2^32, so nothing overflows.
    pub(super) fn sections(&self) -> [u64; 4] {
        let nodes = self.nodes as u64;
        let references = self.references as u64;
        let visits = if self.has_visits { nodes } else { 0 };
        [
            nodes * size_of::<Node>() as u64,
            references * size_of::<u32>() as u64,
            visits * size_of::<f32>() as u64,
            if self.has_frame { Frame::BYTES as u64 } else { 0 },
        ]
    }

    /// Returns the bytes of the header, with a checksum of 0.
    pub(super) fn encode(&self) -> Result<Vec<u8>, FileError> {
        let name = self.method.as_bytes();
        // The name is padded with zeros, so it cannot contain any.
        if name.len() > 64 || name.contains(&0) {
            return Err(FileError::Method);
        }
        let mut method = [0; 64];
        method[..name.len()].copy_from_slice(name);
        let (objective, constants) = match self.objective {
            Objective::InternalArea => (0, [0.0; 2]),
            Objective::GoldsmithSalmon => (1, [0.0; 2]),
            Objective::Sah(constants) => (2, [constants.traversal, constants.intersection]),
            Objective::Layout => (3, [0.0; 2]),
        };
        let stored = Stored {
            magic: Self::MAGIC,
            version: Self::VERSION,
            endianness: Self::ENDIANNESS,
            objective,
            scene: self.scene,
            nodes: self.nodes as u64,
            objects: self.objects as u64,
            seed: self.seed,
            work: self.work,
            cost: self.cost,
            constants,
            bounds: self.bounds,
            method,
            references: self.references as u64,
            flags: if self.has_visits { Self::VISITS } else { 0 }
                | if self.has_frame { Self::FRAME } else { 0 }
                | if self.is_double { Self::DOUBLE } else { 0 },
            reserved: [0; 2],
            checksum: 0,
        };
        Ok(bytemuck::bytes_of(&stored).to_vec())
    }

    /// Reads all fields except the checksum.
    ///
    /// If there are several faults, reports the most informative one: first a wrong magic number,
    /// then the version, then any other field.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, FileError> {
        if !bytes.starts_with(&Self::MAGIC) {
            return Err(FileError::Magic);
        }
        let bytes = bytes.get(..Self::BYTES).ok_or(FileError::Header)?;
        let stored: Stored = bytemuck::pod_read_unaligned(bytes);
        if stored.version != Self::VERSION {
            return Err(FileError::Version { found: stored.version });
        }
        if stored.endianness != Self::ENDIANNESS {
            return Err(FileError::Field("endianness mark"));
        }
        let Stored { nodes, objects, references, cost, constants, flags, .. } = stored;
        if objects > MAX_OBJECTS as u64 {
            return Err(FileError::Field("objects"));
        }
        if !(cost.is_finite() && cost >= 0.0) {
            return Err(FileError::Field("cost"));
        }
        let objective = decode_objective(stored.objective, constants)?;
        let end = stored.method.iter().position(|&byte| byte == 0).unwrap_or(64);
        let (name, padding) = stored.method.split_at(end);
        let method = core::str::from_utf8(name).map_err(|_| FileError::Method)?;
        // Every object has a reference, and there are none without objects.
        let fits = (objects..=MAX_OBJECTS as u64).contains(&references);
        if !fits || (objects == 0 && references > 0) {
            return Err(FileError::Field("references"));
        }
        // A binary tree with one reference per leaf has the most nodes.
        if nodes > 2 * references {
            return Err(FileError::Field("nodes"));
        }
        let has_other_flags = flags & !(Self::VISITS | Self::FRAME | Self::DOUBLE) != 0;
        let is_padded = stored.reserved == [0; 2] && padding.iter().all(|&byte| byte == 0);
        if has_other_flags || !is_padded {
            return Err(FileError::Field("padding"));
        }
        Ok(Self {
            nodes: nodes as usize,
            objects: objects as usize,
            references: references as usize,
            objective,
            cost,
            seed: stored.seed,
            work: stored.work,
            scene: stored.scene,
            bounds: stored.bounds,
            method: method.to_owned(),
            has_visits: flags & Self::VISITS != 0,
            has_frame: flags & Self::FRAME != 0,
            is_double: flags & Self::DOUBLE != 0,
        })
    }
}

/// The header as it is stored, without gaps.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Stored {
    magic: [u8; 8],
    version: u32,
    endianness: u32,
    objective: u32,
    scene: u32,
    nodes: u64,
    objects: u64,
    seed: u64,
    work: u64,
    cost: f64,
    constants: [f64; 2],
    bounds: Aabb,
    method: [u8; 64],
    references: u64,
    flags: u32,
    reserved: [u32; 2],
    checksum: u32,
}

/// Returns the objective with this number. Constants must be 0 unless the objective uses them.
fn decode_objective(number: u32, constants: [f64; 2]) -> Result<Objective, FileError> {
    let [traversal, intersection] = constants;
    let accepted =
        SahConstants::new(traversal, intersection).map_err(|_| FileError::Field("constants"))?;
    let objective = match number {
        0 => Objective::InternalArea,
        1 => Objective::GoldsmithSalmon,
        2 => return Ok(Objective::Sah(accepted)),
        3 => Objective::Layout,
        _ => return Err(FileError::Field("objective")),
    };
    // Bits, because −0 is not what `encode` writes.
    if constants.map(f64::to_bits) != [0; 2] {
        return Err(FileError::Field("constants"));
    }
    Ok(objective)
}
