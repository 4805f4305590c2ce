//! The contents of a mesh file, and the faults of all formats.

use bvh_core::Triangle;
use std::fmt;
use std::path::{Path, PathBuf};

/// The largest number of triangles that one file may contain. Together with boxes and a tree they
/// need ten gigabytes. The limit matters because a small file can name one mesh many times.
pub const MOST_TRIANGLES: usize = 100_000_000;

/// The triangles of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The triangles in world units with finite corners, in the order of the file across its
    /// objects and groups. A face of n ≥ 3 vertices becomes the n − 2 triangles of the fan around
    /// its first vertex. The fan is exact for convex faces; for a concave face it can reach
    /// outside.
    pub triangles: Vec<Triangle>,
    /// The number of vertices that are a corner of no triangle. They must be finite.
    pub unused_vertices: usize,
    /// The number of faces that were skipped because they have fewer than three vertices.
    pub short_faces: usize,
    /// The number of triangles without area (collinear or repeated corners). `triangles` contains
    /// them.
    pub degenerate_triangles: usize,
    /// The number of lines that begin with no keyword of the format, with the first such line's
    /// number, counted from 1, and its first word.
    pub unknown: Option<(usize, usize, String)>,
}

impl Mesh {
    /// Creates a mesh of these triangles and nothing else.
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

    /// Describes the file's contents besides plain triangles in one sentence, if there are any.
    pub fn remark(&self) -> Option<String> {
        let unknown = self.unknown.as_ref().and_then(|(count, line, word)| {
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
                "face has fewer than three vertices and was skipped",
                "faces have fewer than three vertices and were skipped",
            ),
            counted(self.degenerate_triangles, "triangle has no area", "triangles have no area"),
            unknown,
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

fn counted(count: usize, one: &str, many: &str) -> Option<String> {
    match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        _ => Some(format!("{count} {many}")),
    }
}

/// The place of a fault in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The whole file.
    File,
    /// A line, counted from 1.
    Line(usize),
    /// A part of the file, with the name or number that its format gives it.
    Element(String),
}

/// The reason why a file was rejected, in the words of its format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{place}: {message}", .path.display())]
pub struct Fault {
    /// The file's path as the caller gave it.
    pub path: PathBuf,
    /// The place in the file.
    pub place: Place,
    /// The contents that were found, and the contents that would be accepted.
    pub message: String,
}

impl Fault {
    /// Creates a fault of the file at `path`.
    pub fn new(path: &Path, place: Place, message: impl fmt::Display) -> Self {
        // A message must fit a terminal, whatever names and numbers the file contains.
        let place = match place {
            Place::Element(name) => Place::Element(shortened(&name, 80)),
            Place::File | Place::Line(_) => place,
        };
        let message = shortened(&message.to_string(), 300);
        Self { path: path.to_path_buf(), place, message }
    }
}

fn shortened(text: &str, most: usize) -> String {
    // Messages of third-party parsers may span lines and quote the file at any length.
    let words: Vec<&str> = text.split_whitespace().collect();
    let line = words.join(" ");
    if line.chars().nth(most).is_none() {
        return line;
    }
    let beginning: String = line.chars().take(most - 1).collect();
    format!("{beginning}…")
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
