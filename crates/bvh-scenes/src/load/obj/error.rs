//! The reasons why an OBJ file is rejected.

use super::statements::MOST_CORNERS;
use std::path::PathBuf;
use thiserror::Error;

/// A line of a file, displayed as `path:line`.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}:{line}", .path.display())]
pub struct Place {
    /// The file's path as the caller gave it.
    pub path: PathBuf,
    /// The line's number, counted from 1. A continued statement has the number of its first line.
    pub line: usize,
}

/// The reason why a file gave no triangles.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message describes its fields")]
pub enum ObjError {
    /// The file has nothing to build a hierarchy over.
    #[error(
        "{} has {vertices} vertices and no face of three or more; expected a Wavefront OBJ file \
         with at least one such face",
        .path.display()
    )]
    NoFaces { path: PathBuf, vertices: usize },
    /// A `v` statement has a wrong length.
    #[error(
        "{place}: vertex of length {found}; expected 3 (x y z), 4 (x y z and a weight), or 6 or 7 \
         (x y z and a colour)"
    )]
    VertexLength { place: Place, found: usize },
    /// A coordinate is no finite `f32`. Vertices that no face uses are checked as well.
    #[error("{place}: vertex coordinate `{found}`; expected a finite number up to ±3.4e38")]
    Coordinate { place: Place, found: String },
    /// A weight leaves no finite coordinates.
    #[error(
        "{place}: vertex weight `{found}`; expected a finite number other than 0 that keeps the \
         divided coordinates within ±3.4e38"
    )]
    Weight { place: Place, found: String },
    /// The triangles of a face would need many times the memory of its text.
    #[error("{place}: face of more than {MOST_CORNERS} vertices; expected at most {MOST_CORNERS}")]
    LongFace { place: Place },
    /// A face names a vertex by a word that is not an index.
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
    /// `tobj` rejected statements in which this crate found no fault.
    #[error("{}: {source}; expected a Wavefront OBJ file", .path.display())]
    Tobj { path: PathBuf, source: tobj::LoadError },
}
