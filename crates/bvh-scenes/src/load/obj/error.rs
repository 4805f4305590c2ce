//! Why an OBJ file was refused.

use super::statements::MOST_CORNERS;
use std::path::PathBuf;
use thiserror::Error;

/// A line of a file; shown as `path:line`.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}:{line}", .path.display())]
pub struct Place {
    /// The file, as it was given.
    pub path: PathBuf,
    /// The line's number, from 1; of a continued statement the first line's.
    pub line: usize,
}

/// Why a file gave no triangles.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ObjError {
    /// Nothing to build a hierarchy over.
    #[error(
        "{} has {vertices} vertices and no face of three or more; expected a Wavefront OBJ file \
         with at least one such face",
        .path.display()
    )]
    NoFaces { path: PathBuf, vertices: usize },
    /// A `v` statement of a wrong length.
    #[error(
        "{place}: vertex of length {found}; expected 3 (x y z), 4 (x y z and a weight), or 6 or 7 \
         (x y z and a colour)"
    )]
    VertexLength { place: Place, found: usize },
    /// A coordinate that is no finite `f32`, also of a vertex that no face uses.
    #[error("{place}: vertex coordinate `{found}`; expected a finite number up to ±3.4e38")]
    Coordinate { place: Place, found: String },
    /// A weight that leaves no finite coordinates.
    #[error(
        "{place}: vertex weight `{found}`; expected a finite number other than 0 by which the \
         coordinates can be divided and stay within ±3.4e38"
    )]
    Weight { place: Place, found: String },
    /// A face whose triangles would take many times the memory of its text.
    #[error("{place}: face of more than {MOST_CORNERS} vertices; expected at most as many")]
    LongFace { place: Place },
    /// A face names a vertex by something that is not an index.
    #[error(
        "{place}: face vertex `{found}`; expected a whole number, from 1 for the first vertex of \
         the file or from -1 for the latest one"
    )]
    Index { place: Place, found: String },
    /// A face names a vertex after the last one.
    #[error("{place}: face vertex {index}; expected at most {vertices}, the file's vertex count")]
    IndexAbove { place: Place, index: usize, vertices: usize },
    /// A face counts back to before the first vertex.
    #[error(
        "{place}: face vertex {index}; expected at least -{vertices}, the number of vertices above"
    )]
    IndexBelow { place: Place, index: isize, vertices: usize },
    /// `tobj` refused statements in which no fault was found here.
    #[error("{}: {source}; expected a Wavefront OBJ file", .path.display())]
    Tobj { path: PathBuf, source: tobj::LoadError },
}
