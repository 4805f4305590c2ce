//! The first 192 bytes of a tree file: format, sizes, cost, origin, and the checksum of the scene.

use super::error::{FileError, LATEST};
use crate::cost::{Objective, SahConstants};
use crate::{Aabb, MAX_OBJECTS};
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// The header of a tree file. [The format](super) says where each field lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of objects.
    pub objects: usize,
    /// Number of object ids in all leaves: more than there are objects if objects are divided among leaves.
    pub references: usize,
    /// The objective that `cost` is a value of.
    pub objective: Objective,
    /// The tree's cost when it was saved.
    pub cost: f64,
    /// The seed of the search.
    pub seed: u64,
    /// The search's work, in nodes made or visited.
    pub work: u64,
    /// The [checksum](super::boxes_checksum) of the boxes that the tree was built over.
    pub scene: u32,
    /// The root's box; [`Aabb::EMPTY`] if there are no objects.
    pub bounds: Aabb,
    /// The name of the method that built the tree.
    pub method: String,
    /// Whether the file says how often rays visit each node; see [`TreeFile::visits`](super::TreeFile::visits).
    pub has_visits: bool,
}

impl Header {
    /// Bytes of a header.
    pub const BYTES: usize = 192;
    /// The first eight bytes of every tree file, chosen after PNG's: a transfer that converts line ends or clears high
    /// bits changes them.
    pub const MAGIC: [u8; 8] = *b"\x89BVH\r\n\x1a\n";
    /// The latest version of the format, that of trees whose objects are divided among leaves, or whose cost is that of the wide
    /// layout. This crate also reads versions 2 and 3, and writes them where they suffice, so that older programs read them.
    pub const VERSION: u32 = LATEST;
    const WITH_VISITS: u32 = 3;
    const PLAIN: u32 = 2;
    /// The flag of files of version 4 that have visits.
    const VISITS: u32 = 1;
    /// Stored in the file's byte order, so that its bytes tell the order.
    const ENDIANNESS: u32 = 0x0102_0304;
    /// The box of the root, as in the node.
    pub(super) const BOUNDS: core::ops::Range<usize> = 80..104;
    /// Where the fields of version 4 begin.
    const REFERENCES: usize = 168;
    /// The last field, which every other byte of the file is covered by.
    pub(super) const CHECKSUM: core::ops::Range<usize> = 188..192;

    /// The bytes, with a checksum of 0.
    pub(super) fn encode(&self) -> Result<Vec<u8>, FileError> {
        let name = self.method.as_bytes();
        if name.len() > 64 || name.contains(&0) {
            return Err(FileError::Method);
        }
        let (objective, constants) = match self.objective {
            Objective::InternalArea => (0u32, [0.0; 2]),
            Objective::GoldsmithSalmon => (1, [0.0; 2]),
            Objective::Sah(constants) => (2, [constants.traversal, constants.intersection]),
            Objective::Layout => (3, [0.0; 2]),
        };
        let mut bytes = Vec::with_capacity(Self::BYTES);
        bytes.extend_from_slice(&Self::MAGIC);
        let version = self.version();
        for word in [version, Self::ENDIANNESS, objective, self.scene] {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
        for word in [self.nodes as u64, self.objects as u64, self.seed, self.work] {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
        for number in [self.cost, constants[0], constants[1]] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        for coordinate in [self.bounds.min, self.bounds.max].iter().flat_map(|corner| corner.to_array()) {
            bytes.extend_from_slice(&coordinate.to_le_bytes());
        }
        bytes.extend_from_slice(name);
        bytes.resize(Self::REFERENCES, 0);
        if version == Self::VERSION {
            bytes.extend_from_slice(&(self.references as u64).to_le_bytes());
            bytes.extend_from_slice(&(if self.has_visits { Self::VISITS } else { 0 }).to_le_bytes());
        }
        bytes.resize(Self::BYTES, 0);
        Ok(bytes)
    }

    /// The first version that has all that the file says.
    fn version(&self) -> u32 {
        if self.references != self.objects || self.objective == Objective::Layout {
            Self::VERSION
        } else if self.has_visits {
            Self::WITH_VISITS
        } else {
            Self::PLAIN
        }
    }

    /// Reads all fields but the checksum. Of several faults it reports the one that says most about the file: that it
    /// is no tree file before its byte order, the byte order before the version, the version before any other field.
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
        match version {
            Self::PLAIN..=Self::VERSION => {}
            found if found < Self::PLAIN => return Err(FileError::OldVersion { found }),
            found => return Err(FileError::NewVersion { found }),
        }
        if mark != Self::ENDIANNESS.to_le_bytes() {
            return Err(FileError::Field("endianness mark"));
        }
        let [objective, scene] = [fields.need()?, fields.need()?].map(u32::from_le_bytes);
        let [nodes, objects, seed, work]: [u64; 4] = fields.words()?;
        // A binary tree with one object per leaf has the most nodes.
        let most = |limit: u64| move |count: &u64| *count <= limit;
        let objects = Some(objects).filter(most(MAX_OBJECTS as u64)).ok_or(FileError::Field("objects"))?;
        let [cost, traversal, intersection] = fields.words()?.map(f64::from_bits);
        if !(cost.is_finite() && cost >= 0.0) {
            return Err(FileError::Field("cost"));
        }
        let constants =
            SahConstants::new(traversal, intersection).map_err(|_| FileError::Field("constants"))?;
        let objective = match objective {
            0 => Objective::InternalArea,
            1 => Objective::GoldsmithSalmon,
            2 => Objective::Sah(constants),
            3 if version == Self::VERSION => Objective::Layout,
            _ => return Err(FileError::Field("objective")),
        };
        if objective != Objective::Sah(constants) && [traversal, intersection].map(f64::to_bits) != [0; 2] {
            return Err(FileError::Field("constants"));
        }
        let mut corners = [[0.0; 3]; 2];
        for coordinate in corners.as_flattened_mut() {
            *coordinate = f32::from_le_bytes(fields.need()?);
        }
        let name: [u8; 64] = fields.need()?;
        let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
        let method = core::str::from_utf8(&name[..end]).map_err(|_| FileError::Method)?.to_owned();
        let (references, flags): ([u8; 8], [u8; 4]) = (fields.need()?, fields.need()?);
        let (references, flags) = (u64::from_le_bytes(references), u32::from_le_bytes(flags));
        let (references, has_visits, unused) = match version {
            Self::VERSION => (references, flags & Self::VISITS != 0, u64::from(flags & !Self::VISITS)),
            _ => (objects, version == Self::WITH_VISITS, references | u64::from(flags)),
        };
        let possible =
            |&count: &u64| (objects..=MAX_OBJECTS as u64).contains(&count) && (objects > 0 || count == 0);
        let references = Some(references).filter(possible).ok_or(FileError::Field("references"))?;
        let nodes = Some(nodes).filter(most(2 * references)).ok_or(FileError::Field("nodes"))?;
        let reserved: [u8; 8] = fields.need()?;
        let _checksum: [u8; 4] = fields.need()?;
        if reserved != [0; 8] || unused != 0 || name[end..].iter().any(|&byte| byte != 0) {
            return Err(FileError::Field("padding"));
        }
        let [nodes, objects, references] = [nodes, objects, references].map(|count| count as usize);
        let bounds = Aabb::from(corners);
        Ok(Self { nodes, objects, references, objective, cost, seed, work, scene, bounds, method, has_visits })
    }
}

/// The bytes that are still to be read.
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
