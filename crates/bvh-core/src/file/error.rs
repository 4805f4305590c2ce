//! Why bytes are not accepted as a tree, or a tree is not written.

use crate::InvalidBvh;

/// The latest version of the format.
pub(super) const LATEST: u32 = 4;

/// Why bytes were not accepted as a tree, or a tree was not written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FileError {
    /// The first eight bytes are not those of a tree file.
    #[error("not a tree file")]
    Magic,
    /// Fewer bytes than a header has.
    #[error("the file ends within its header")]
    Header,
    /// Written by an earlier version of this program.
    #[error(
        "the tree was written by version {found} of the format; this program reads version {}: bake it again",
        LATEST
    )]
    OldVersion {
        /// The version found.
        found: u32,
    },
    /// Written by a later version of this program.
    #[error(
        "the tree was written by version {found} of the format; this program reads version {}: update the program",
        LATEST
    )]
    NewVersion {
        /// The version found.
        found: u32,
    },
    /// Written most significant byte first.
    #[error("the file is big-endian; the format is little-endian")]
    Endianness,
    /// A field of the header has a value that no tree can give it.
    #[error("the header's {0} is out of range; the file is damaged")]
    Field(&'static str),
    /// A method's name has at most 64 bytes of UTF-8, none of them zero.
    #[error("the method's name is not at most 64 bytes of UTF-8 without zeros")]
    Method,
    /// The file was cut or extended.
    #[error("the file has {found} bytes where its header asks for {expected}; it was cut or extended")]
    Length {
        /// Bytes in the file.
        found: u64,
        /// Bytes that the header asks for.
        expected: u64,
    },
    /// Some byte is not the one that was written.
    #[error("the file's checksum is wrong; it is damaged")]
    Checksum,
    /// Saved for a scene of another size.
    #[error("the file is for a scene of {expected} objects; this one has {found}")]
    ObjectCount {
        /// Objects in the scene.
        found: usize,
        /// Objects in the file.
        expected: usize,
    },
    /// Saved for another scene, or for the same objects in another order.
    #[error(
        "the file is for another scene: its objects' checksum is {expected:08x}, this scene's is {found:08x}"
    )]
    OtherScene {
        /// The scene's checksum.
        found: u32,
        /// The checksum in the file.
        expected: u32,
    },
    /// The checksum is right, but the nodes and object ids that it covers are not a tree.
    #[error(transparent)]
    Tree(#[from] InvalidBvh),
    /// The visits of a node are no number from 0 to those of its parent, or not as many as there are nodes.
    #[error("the visits of node {0} are not from 0 to those of its parent")]
    Visits(usize),
    /// Views need aligned bytes.
    #[error("the bytes do not lie at a multiple of {0}; load them instead")]
    Alignment(usize),
    /// Views need a little-endian machine.
    #[error("this machine is big-endian; load the bytes instead of viewing them")]
    Machine,
}
