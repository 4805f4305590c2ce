//! What every mesh file gives, and how every format names a fault.

use bvh_core::Triangle;
use std::fmt;
use std::path::{Path, PathBuf};

/// The largest number of triangles that one file may stand for: with boxes and a tree they take ten gigabytes. A small file can
/// name one mesh many times.
pub const MOST_TRIANGLES: usize = 100_000_000;

/// The triangles of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// In world units with finite corners, in the order of the file across its objects and groups. A face of n ≥ 3
    /// vertices gives the n − 2 triangles of the fan around its first vertex: exact for convex faces, while the fan of
    /// a concave one can reach outside it.
    pub triangles: Vec<Triangle>,
    /// Vertices that are a corner of no triangle. They must be finite, and count for nothing else.
    pub unused_vertices: usize,
    /// Faces left out because they have fewer than three vertices.
    pub short_faces: usize,
    /// Triangles without area (collinear or repeated corners). They are kept in `triangles`.
    pub degenerate_triangles: usize,
    /// Lines that begin with no keyword of the format, and the first of them: its number from 1 and its first word.
    pub unknown: Option<(usize, usize, String)>,
}

impl Mesh {
    /// These triangles, with nothing beside them.
    pub fn new(triangles: Vec<Triangle>) -> Self {
        Self {
            degenerate_triangles: triangles
                .iter()
                .filter(|triangle| triangle.is_degenerate())
                .count(),
            triangles,
            unused_vertices: 0,
            short_faces: 0,
            unknown: None,
        }
    }

    /// What the file contains besides plain triangles, as one sentence; none if nothing does.
    pub fn remark(&self) -> Option<String> {
        let counted = |count: usize, one: &str, many: &str| {
            (count > 0)
                .then(|| if count == 1 { format!("1 {one}") } else { format!("{count} {many}") })
        };
        let unknown = self
            .unknown
            .as_ref()
            .and_then(|(count, line, word)| {
                let lines = counted(
                    *count,
                    "line with an unknown keyword was",
                    "lines with unknown keywords were",
                )?;
                Some(format!("{lines} ignored (`{word}` in line {line})"))
            });
        let parts = [
            counted(
                self.unused_vertices,
                "vertex is used by no face",
                "vertices are used by no face",
            ),
            counted(
                self.short_faces,
                "face has fewer than three vertices and was left out",
                "faces have fewer than three vertices and were left out",
            ),
            counted(self.degenerate_triangles, "triangle has no area", "triangles have no area"),
            unknown,
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// Where in a file a fault is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the file as a whole.
    File,
    /// In a line, counted from 1.
    Line(usize),
    /// In a part of the file that its format gives a name or a number.
    Element(String),
}

/// Why a file was refused, in the words of its format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{place}: {message}", .path.display())]
pub struct Fault {
    /// The file, as it was given.
    pub path: PathBuf,
    /// Where in it.
    pub place: Place,
    /// What was found, and what would be accepted.
    pub message: String,
}

impl Fault {
    /// A fault of the file at `path`.
    pub fn new(path: &Path, place: Place, message: impl fmt::Display) -> Self {
        // Other libraries' messages may span lines and quote the file.
        let words = message
            .to_string()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        let message = if words.len() > 300 {
            format!("{}…", words.chars().take(280).collect::<String>())
        } else {
            words
        };
        Self { path: path.to_path_buf(), place, message }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ":{line}"),
            Self::Element(name) => write!(f, ": {name}"),
        }
    }
}
