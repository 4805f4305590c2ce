//! The errors of tree files.

use super::Header;
use crate::InvalidBvh;

/// The reason why bytes are rejected as a tree file, or why a tree cannot be written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // The messages explain the fields.
pub enum FileError {
    /// The first eight bytes are not the magic number of tree files.
    #[error("not a tree file")]
    Magic,
    /// The file is shorter than a header.
    #[error("the file ends within its header")]
    Header,
    /// The file has another version of the format. None before this one was released.
    #[error(
        "the tree was written by version {found} of the format; this program reads version {}: bake it again, or update the program",
        Header::VERSION
    )]
    Version { found: u32 },
    /// A field of the header has a value that no tree can have.
    #[error("the header's {0} is out of range; the file is damaged")]
    Field(&'static str),
    /// The name of a method must have at most 64 bytes of UTF-8, and no zeros.
    #[error("the method's name is not at most 64 bytes of UTF-8 without zeros")]
    Method,
    /// The file is too short or too long.
    #[error(
        "the file has {found} bytes where its header asks for {expected}; it was cut or extended"
    )]
    Length { found: u64, expected: u64 },
    /// A byte of the file has changed.
    #[error("the file's checksum is wrong; it is damaged")]
    Checksum,
    /// The tree was saved for a scene with another number of objects.
    #[error("the file is for a scene of {expected} objects; this one has {found}")]
    ObjectCount { found: usize, expected: usize },
    /// The tree was saved for another scene, or for the same objects in another order.
    #[error(
        "the file is for another scene: its objects' checksum is {expected:08x}, this scene's is {found:08x}"
    )]
    OtherScene { found: u32, expected: u32 },
    /// The tree is over triangles in f64, and the objects are others.
    #[error("the tree is over triangles in f64; accepted: the same triangles in double precision")]
    Double,
    /// The tree is over triangles in f32, and the objects are triangles in f64 with other boxes.
    #[error("the tree is over triangles in f32; accepted: the same triangles in single precision")]
    Single,
    /// The tree lies in a frame, and boxes along the file's axes cannot validate it.
    #[error("the boxes of the tree lie in a frame: save it together with its triangles")]
    Frame,
    /// The checksum is correct, but the nodes and object ids are not a tree.
    #[error(transparent)]
    Tree(#[from] InvalidBvh),
    /// The visits of a node are not between 0 and the visits of its parent, or the number of visits
    /// is not the number of nodes.
    #[error("the visits of node {0} are not between 0 and the visits of its parent")]
    Visits(usize),
    /// Views need aligned bytes.
    #[error("the address of the bytes is not a multiple of {0}; load them instead")]
    Alignment(usize),
}
