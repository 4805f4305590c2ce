//! Reads the triangles of a Wavefront OBJ file, or reports the first invalid line.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and
//! texture coordinates are ignored. Lines may end in LF, CRLF or CR, and a backslash at the end
//! continues a statement on the next line. The crate `tobj` reads a polyline `l 1 2 3` as a
//! triangle, rejects Latin-1 comments, continued lines and files in which only some vertices have
//! a colour, accepts `nan`, and names no line.

use super::mesh::Mesh;
use bvh_core::Triangle;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::str::FromStr;
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
}

/// The largest number of vertices of one face. The fan of a larger face would need a hundred bytes
/// of memory for every two bytes of the file.
const MOST_CORNERS: usize = 1 << 16;

/// Reads the bytes of an OBJ file; `path` only names it in errors. Any bytes give a mesh or an
/// error. O(bytes).
///
/// # Errors
///
/// The first fault in the order of the file. An index above the number of vertices is found only at
/// the end of the file, because a face may come before its vertices, and is reported last.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, ObjError> {
    let mut statements = Statements::new(bytes);
    let mut words = Vec::new();
    let mut vertices: Vec<Vec3> = Vec::new();
    let mut faces: Vec<[usize; 3]> = Vec::new();
    let mut face = Vec::new();
    let mut short_faces = 0;
    let mut highest = (0, 0);
    let place = |line| Place { path: path.to_path_buf(), line };
    while let Some((keyword, line)) = statements.next(&mut words, MOST_CORNERS + 1) {
        let place = || place(line);
        match keyword {
            Keyword::Vertex => vertices.push(vertex(&words, place)?),
            Keyword::Face => {
                corners(&words, vertices.len(), &mut face, place)?;
                let highest_here = face.iter().map(|corner| corner + 1).max().unwrap_or(0);
                if highest_here > highest.0 {
                    highest = (highest_here, line);
                }
                short_faces += usize::from(face.len() < 3);
                if let [first, others @ ..] = &face[..] {
                    faces.extend(others.windows(2).map(|pair| [*first, pair[0], pair[1]]));
                }
            }
        }
    }
    let (index, line) = highest;
    if index > vertices.len() {
        return Err(ObjError::IndexAbove { place: place(line), index, vertices: vertices.len() });
    }
    if faces.is_empty() {
        return Err(ObjError::NoFaces { path: path.to_path_buf(), vertices: vertices.len() });
    }
    let mut is_used = vec![false; vertices.len()];
    faces.iter().flatten().for_each(|&corner| is_used[corner] = true);
    let triangles = faces.iter().map(|face| Triangle(face.map(|corner| vertices[corner])));
    Ok(Mesh {
        unused_vertices: is_used.iter().filter(|&&is_used| !is_used).count(),
        short_faces,
        unknown: statements.unknown.map(|(count, line, word)| (count, line, shown(word))),
        ..Mesh::new(triangles.collect())
    })
}

/// Returns the vertex of a `v` statement: three coordinates, and a weight that divides them or a
/// colour.
fn vertex(words: &[&[u8]], place: impl Fn() -> Place) -> Result<Vec3, ObjError> {
    if !matches!(words.len(), 3 | 4 | 6 | 7) {
        return Err(ObjError::VertexLength { place: place(), found: words.len() });
    }
    let mut position = [0.0_f32; 3];
    for (coordinate, word) in position.iter_mut().zip(words) {
        *coordinate = number(word)
            .filter(|x: &f32| x.is_finite())
            .ok_or_else(|| ObjError::Coordinate { place: place(), found: shown(word) })?;
    }
    let position = Vec3::from(position);
    let [_, _, _, word] = words else { return Ok(position) };
    // The quotients reject the weight 0; an infinite weight needs its own test, because x / ∞ is
    // finite.
    number(word)
        .filter(|weight: &f32| weight.is_finite() && (position / *weight).is_finite())
        .map(|weight| position / weight)
        .ok_or_else(|| ObjError::Weight { place: place(), found: shown(word) })
}

/// Replaces the contents of `face` by the vertices of an `f` statement, counted from 0. `vertices`
/// is the number of vertices above it.
fn corners(
    words: &[&[u8]],
    vertices: usize,
    face: &mut Vec<usize>,
    place: impl Fn() -> Place,
) -> Result<(), ObjError> {
    if words.len() > MOST_CORNERS {
        return Err(ObjError::LongFace { place: place() });
    }
    face.clear();
    for corner in words {
        let index: isize = number(vertex_index(corner))
            .filter(|&index| index != 0)
            .ok_or_else(|| ObjError::Index { place: place(), found: shown(corner) })?;
        face.push(if index > 0 {
            index.unsigned_abs() - 1
        } else {
            vertices.checked_sub(index.unsigned_abs()).ok_or_else(|| ObjError::IndexBelow {
                place: place(),
                index,
                vertices,
            })?
        });
    }
    Ok(())
}

fn number<T: FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A statement that defines geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Keyword {
    Vertex,
    Face,
}

/// Keywords of the format that are ignored (Wavefront, "Object Files", version 3.0).
const IGNORED: &str = "vt vn vp p l curv curv2 surf parm trim hole scrv sp end con cstype deg bmat \
    step g o s mg bevel c_interp d_interp lod maplib usemap usemtl mtllib shadow_obj trace_obj \
    ctech stech call csh bsp bzp cdc cdp res vw";

/// The statements of a file, in order.
struct Statements<'a> {
    unread: &'a [u8],
    /// The number of lines taken so far.
    lines: usize,
    /// True if the previous line was ignored and continues on the next one.
    ignoring: bool,
    /// The number of lines whose first word is no keyword, with the first such line's number and
    /// word.
    unknown: Option<(usize, usize, &'a [u8])>,
}

impl<'a> Statements<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let mut unread = bytes;
        // A file can have several byte order marks if several programs have each added one.
        while let Some(further) = unread.strip_prefix(b"\xef\xbb\xbf") {
            unread = further;
        }
        Self { unread, lines: 0, ignoring: false, unknown: None }
    }

    /// Returns the next `v` or `f` statement and the number of its first line. Replaces the
    /// contents of `words` by the words after the keyword, at most `most` of them.
    fn next(&mut self, words: &mut Vec<&'a [u8]>, most: usize) -> Option<(Keyword, usize)> {
        loop {
            let (code, mut continued) = self.line()?;
            let number = self.lines;
            let mut on_line = split(code);
            let keyword = match on_line.next() {
                Some(b"v") => Keyword::Vertex,
                Some(b"f") => Keyword::Face,
                word => {
                    // A line that ends in a backslash by accident, such as a path, must not swallow
                    // a vertex. The line after it is therefore ignored only if it is no `v` or `f`
                    // statement.
                    if let Some(word) = word.filter(|word| !self.ignoring && !is_ignored(word)) {
                        let (count, line, first) = self.unknown.unwrap_or((0, number, word));
                        self.unknown = Some((count + 1, line, first));
                    }
                    self.ignoring = continued;
                    continue;
                }
            };
            self.ignoring = false;
            words.clear();
            words.extend(on_line.take(most));
            while continued && let Some((code, more)) = self.line() {
                words.extend(split(code).take(most - words.len()));
                continued = more;
            }
            return Some((keyword, number));
        }
    }

    /// Returns the next line without its end (LF, CRLF or CR) and comment, and whether a backslash
    /// continues it.
    fn line(&mut self) -> Option<(&'a [u8], bool)> {
        if self.unread.is_empty() {
            return None;
        }
        let end = self.unread.iter().position(|&b| b == b'\n' || b == b'\r');
        let (line, tail) = self.unread.split_at(end.unwrap_or(self.unread.len()));
        self.unread = tail.strip_prefix(b"\r\n").unwrap_or(tail.get(1..).unwrap_or_default());
        self.lines += 1;
        let code = line.split(|&b| b == b'#').next().unwrap_or_default().trim_ascii_end();
        Some(match code.strip_suffix(b"\\") {
            Some(code) => (code, true),
            None => (code, false),
        })
    }
}

fn is_ignored(word: &[u8]) -> bool {
    IGNORED.split(' ').any(|known| known.as_bytes() == word)
}

fn split(code: &[u8]) -> impl Iterator<Item = &[u8]> {
    code.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Returns the `7` of `7`, `7/1`, `7//3` and `7/1/3`.
fn vertex_index(corner: &[u8]) -> &[u8] {
    corner.split(|&b| b == b'/').next().unwrap_or_default()
}

/// Makes a word printable for an error message, and short even if the file is one endless word.
fn shown(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let cut = if word.len() > LONGEST { "…" } else { "" };
    format!("{}{cut}", word[..word.len().min(LONGEST)].escape_ascii())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endless_statement_needs_memory_for_a_limited_number_of_words() {
        for text in ["f 1 2 3 4 5 6 7 8 9", "f 1 2 \\\n3 4 \\\n5 6 7 8 9"] {
            let mut words = Vec::new();
            let found = Statements::new(text.as_bytes()).next(&mut words, 4);
            assert_eq!(
                (found, words),
                (Some((Keyword::Face, 1)), vec![b"1", b"2", b"3", &b"4"[..]]),
                "{text}"
            );
        }
    }
}
