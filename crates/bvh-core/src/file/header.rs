//! The first 192 bytes of a tree file: what it is, how large, how good, and for which scene.

use super::{FileError, Origin};
use crate::cost::{Objective, SahConstants};
use crate::{Aabb, MAX_OBJECTS};
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// A [`Bvh`](crate::Bvh).
    Tree,
    /// A [`WideBvh`](crate::WideBvh).
    Wide,
}

impl core::fmt::Display for Layout {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str(match self {
            Self::Tree => "tree",
            Self::Wide => "wide layout",
        })
    }
}

/// The header of a tree file. [The format](super) says where each field lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// What the file holds.
    pub layout: Layout,
    /// Number of nodes, of the layout's own kind.
    pub nodes: usize,
    /// Number of objects.
    pub objects: usize,
    /// Number of blocks of four triangles; 0 for a tree.
    pub blocks: usize,
    /// Which cost `cost` is.
    pub objective: Objective,
    /// The tree's cost when it was saved.
    pub cost: f64,
    /// The seed of the search.
    pub seed: u64,
    /// Its work, in nodes made or visited.
    pub work: u64,
    /// The [checksum](super::boxes_checksum) of the boxes the tree is for; of the [triangles](super::triangles_checksum)
    /// for a wide layout.
    pub scene: u64,
    /// The root's box; [`Aabb::EMPTY`] without objects.
    pub bounds: Aabb,
    /// The name of the method that made the tree.
    pub method: String,
}

impl Header {
    /// Bytes of a header.
    pub const BYTES: usize = 192;
    /// The first eight bytes of every tree file. Transfers that change line ends or strip high bits show in them.
    pub const MAGIC: [u8; 8] = *b"\x89BVH\r\n\x1a\n";
    /// The version of the format that this crate writes and reads.
    pub const VERSION: u32 = 1;
    /// Written in the file's byte order.
    const ENDIANNESS: u32 = 0x0102_0304;
    /// Where the checksum lies.
    pub(super) const CHECKSUM: core::ops::Range<usize> = 184..192;

    pub(super) fn new(layout: Layout, origin: &Origin, cost: f64, scene: u64, bounds: Aabb) -> Self {
        let Origin { method, seed, work, objective } = *origin;
        let method = method.to_owned();
        Self { layout, nodes: 0, objects: 0, blocks: 0, objective, cost, seed, work, scene, bounds, method }
    }

    /// The bytes, checksum left 0.
    pub(super) fn encode(&self) -> Result<Vec<u8>, FileError> {
        let name = self.method.as_bytes();
        if name.len() > 64 || name.contains(&0) {
            return Err(FileError::Method);
        }
        let (objective, constants) = match self.objective {
            Objective::InternalArea => (0u32, [0.0; 2]),
            Objective::GoldsmithSalmon => (1, [0.0; 2]),
            Objective::Sah(constants) => (2, [constants.traversal, constants.intersection]),
        };
        let mut bytes = Vec::with_capacity(Self::BYTES);
        bytes.extend_from_slice(&Self::MAGIC);
        for word in [Self::VERSION, Self::ENDIANNESS, self.layout as u32, objective] {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
        for count in [self.nodes, self.objects, self.blocks] {
            bytes.extend_from_slice(&(count as u64).to_le_bytes());
        }
        for number in [self.cost, constants[0], constants[1]] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        for number in [self.seed, self.work, self.scene] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        for coordinate in [self.bounds.min, self.bounds.max].iter().flat_map(|corner| corner.to_array()) {
            bytes.extend_from_slice(&coordinate.to_le_bytes());
        }
        bytes.extend_from_slice(name);
        bytes.resize(Self::BYTES, 0);
        Ok(bytes)
    }

    /// Reads a header, in the order in which errors help most; the checksum is not looked at.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, FileError> {
        let mut fields = Fields(bytes);
        let magic: [u8; 8] = fields.take().ok_or(FileError::Magic)?;
        if magic != Self::MAGIC {
            return Err(FileError::Magic);
        }
        let (version, mark): ([u8; 4], [u8; 4]) = (fields.need()?, fields.need()?);
        if mark == Self::ENDIANNESS.to_be_bytes() {
            return Err(FileError::Endianness);
        }
        let version = u32::from_le_bytes(version);
        if version != Self::VERSION {
            return Err(FileError::Version { found: version });
        }
        if mark != Self::ENDIANNESS.to_le_bytes() {
            return Err(FileError::Field("endianness mark"));
        }
        let layout = match u32::from_le_bytes(fields.need()?) {
            0 => Layout::Tree,
            1 => Layout::Wide,
            _ => return Err(FileError::Field("layout")),
        };
        let objective = u32::from_le_bytes(fields.need()?);
        let [nodes, objects, blocks]: [u64; 3] = fields.words()?;
        // The most nodes are those of a binary tree with one object per leaf, and as many blocks as objects.
        let most = |limit: u64| move |count: &u64| *count <= limit;
        let objects = Some(objects).filter(most(MAX_OBJECTS as u64)).ok_or(FileError::Field("objects"))?;
        let nodes = Some(nodes).filter(most(2 * objects)).ok_or(FileError::Field("nodes"))?;
        let blocks = Some(blocks).filter(most(objects)).ok_or(FileError::Field("blocks"))?;
        let [cost, traversal, intersection] = fields.words()?.map(f64::from_bits);
        let objective = match objective {
            0 => Objective::InternalArea,
            1 => Objective::GoldsmithSalmon,
            2 => Objective::Sah(SahConstants { traversal, intersection }),
            _ => return Err(FileError::Field("objective")),
        };
        let [seed, work, scene] = fields.words()?;
        let mut corners = [[0.0; 3]; 2];
        for coordinate in corners.as_flattened_mut() {
            *coordinate = f32::from_le_bytes(fields.need()?);
        }
        let name: [u8; 64] = fields.need()?;
        let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
        let method = core::str::from_utf8(&name[..end]).map_err(|_| FileError::Method)?.to_owned();
        let [_checksum] = fields.words()?;
        let (nodes, objects, blocks) = (nodes as usize, objects as usize, blocks as usize);
        let bounds = Aabb::from(corners);
        Ok(Self { layout, nodes, objects, blocks, objective, cost, seed, work, scene, bounds, method })
    }
}

/// The bytes that have not been read yet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (field, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*field)
    }

    fn need<const N: usize>(&mut self) -> Result<[u8; N], FileError> {
        self.take().ok_or(FileError::Header)
    }

    fn words<const N: usize>(&mut self) -> Result<[u64; N], FileError> {
        let mut words = [0; N];
        for word in &mut words {
            *word = u64::from_le_bytes(self.need()?);
        }
        Ok(words)
    }
}
