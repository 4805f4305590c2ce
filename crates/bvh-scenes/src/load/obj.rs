//! Reads the triangles of a Wavefront OBJ file, or reports the first invalid line.
//!
//! This module does not use `tobj` 4.0.5, because that crate reads a polyline `l 1 2 3` as a
//! triangle, skips the first vertex after a byte order mark, and rejects Latin-1 comments, comments
//! at the end of a line, continued lines, and files in which only some vertices have a colour; its
//! errors name no line, and it accepts `nan`.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and
//! texture coordinates are ignored. Lines may end in LF, CRLF or CR, and a backslash at the end
//! continues a statement on the next line.

use super::mesh::{Fault, Mesh, Place, counted, unused};
use super::polygon::{MOST_CORNERS, Polygons, open};
use super::text::{self, number, shown};
use glam::Vec3;
use std::collections::BTreeMap;
use std::path::Path;

/// Reads the bytes of an OBJ file; `path` only names it in errors. Any bytes give a mesh or an
/// error. O(bytes), and more for faces that are not convex.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let at = |(line, message): LineFault| Fault::new(path, Place::Line(line), message);
    let geometry = Geometry::of(bytes).map_err(at)?;
    let vertices = geometry.vertices.len();
    let mut polygons = Polygons::default();
    let mut used = vec![false; vertices];
    let mut corners = Vec::new();
    let mut indices = &geometry.indices[..];
    for &(line, length) in &geometry.faces {
        let (face, rest) = indices.split_at(length);
        indices = rest;
        corners.clear();
        for &index in open(face) {
            corners.push(geometry.vertex(index, line).map_err(at)?);
            used[index] |= length >= 3;
        }
        polygons.add(&corners).map_err(|message| at((line, format!("face of {message}"))))?;
    }
    if polygons.triangles.is_empty() {
        let found = format!("{vertices} vertices and no face of three or more");
        let message = format!("{found}; expected a Wavefront OBJ file with at least one such face");
        return Err(Fault::new(path, Place::File, message));
    }
    let unused = unused(used.iter().filter(|used| !**used).count());
    let remarks = unused.into_iter().chain(polygons.remarks()).chain(geometry.unknown).collect();
    Ok(Mesh::new(polygons.triangles, remarks))
}

/// A line, counted from 1, and what is wrong with it.
type LineFault = (usize, String);

/// The vertices and faces of a file.
#[derive(Default)]
struct Geometry {
    vertices: Vec<Vec3>,
    /// The vertices that no face may use, with the reasons.
    invalid: BTreeMap<usize, LineFault>,
    /// The vertices of all faces, counted from 0. A face may name vertices below it.
    indices: Vec<usize>,
    /// The line of each face, and its number of vertices.
    faces: Vec<(usize, usize)>,
    /// The clause about lines that begin with no keyword.
    unknown: Option<String>,
}

impl Geometry {
    /// Reads the statements of a file, up to the first that is none.
    fn of(bytes: &[u8]) -> Result<Self, LineFault> {
        let mut geometry = Self::default();
        let mut statements = Statements::new(bytes);
        let mut words = Vec::new();
        while let Some((keyword, line)) = statements.next(&mut words, MOST_CORNERS + 1) {
            match keyword {
                Keyword::Vertex => geometry.add_vertex(&words, line),
                Keyword::Face => geometry.add_face(&words, line),
            }
            .map_err(|message| (line, message))?;
        }
        geometry.unknown = statements.unknown.and_then(|(count, line, word)| {
            let (one, many) =
                ("line with an unknown keyword was", "lines with unknown keywords were");
            let lines = counted(count, one, many)?;
            Some(format!("{lines} ignored (`{}` in line {line})", shown(word)))
        });
        Ok(geometry)
    }

    /// Adds a vertex without its colour: its coordinates, divided by its weight if it has one.
    fn add_vertex(&mut self, words: &[&[u8]], line: usize) -> Result<(), String> {
        let length = words.len();
        if !matches!(length, 3 | 4 | 6..=8) {
            let expected = "3 (x y z), 4 (x y z and a weight), or 3 or 4 more (a colour)";
            return Err(format!("vertex of length {length}; expected {expected}"));
        }
        let mut position = Vec3::ZERO;
        for (axis, word) in words[..3].iter().enumerate() {
            let message = || {
                let expected = "expected a finite number up to ±3.4e38";
                format!("vertex coordinate `{}`; {expected}", shown(word))
            };
            position[axis] = number(word).ok_or_else(message)?;
            // Some programs write vertices that they do not use in this way.
            if !position[axis].is_finite() {
                self.invalid.insert(self.vertices.len(), (line, message()));
                self.vertices.push(Vec3::NAN);
                return Ok(());
            }
        }
        if matches!(length, 4 | 8) {
            // The quotients reject the weight 0; an infinite weight needs its own test, because
            // x / ∞ is finite.
            let expected = "expected a finite number other than 0 that keeps the divided \
                            coordinates within ±3.4e38";
            let weight = number(words[3]).filter(|weight| weight.is_finite());
            position = weight
                .map(|weight| position / weight)
                .filter(|position| position.is_finite())
                .ok_or_else(|| format!("vertex weight `{}`; {expected}", shown(words[3])))?;
        }
        self.vertices.push(position);
        Ok(())
    }

    fn add_face(&mut self, words: &[&[u8]], line: usize) -> Result<(), String> {
        if words.len() > MOST_CORNERS {
            return Err(format!(
                "face of more than {MOST_CORNERS} vertices; expected at most as many"
            ));
        }
        let above = self.vertices.len();
        for corner in words {
            let index: isize = std::str::from_utf8(vertex_index(corner))
                .ok()
                .and_then(|word| word.parse().ok())
                .filter(|&index| index != 0)
                .ok_or_else(|| {
                    let expected = "expected a whole number, from 1 for the first vertex of the \
                                    file or from -1 for the latest one";
                    format!("face vertex `{}`; {expected}", shown(corner))
                })?;
            let vertex = match usize::try_from(index) {
                Ok(index) => Some(index - 1),
                Err(_) => above.checked_sub(index.unsigned_abs()),
            };
            self.indices.push(vertex.ok_or_else(|| {
                let expected = format!("expected at least -{above}, the number of vertices above");
                format!("face vertex {index}; {expected}")
            })?);
        }
        self.faces.push((line, words.len()));
        Ok(())
    }

    /// Returns a vertex of the face in this line.
    fn vertex(&self, index: usize, line: usize) -> Result<Vec3, LineFault> {
        if let Some(fault) = self.invalid.get(&index) {
            return Err(fault.clone());
        }
        self.vertices.get(index).copied().ok_or_else(|| {
            let expected =
                format!("expected at most {}, the file's vertex count", self.vertices.len());
            (line, format!("face vertex {}; {expected}", index + 1))
        })
    }
}

/// Returns the `7` of `7`, `7/1`, `7//3` and `7/1/3`.
fn vertex_index<'a>(corner: &&'a [u8]) -> &'a [u8] {
    corner.split(|&b| b == b'/').next().unwrap_or_default()
}

/// A statement that defines geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Keyword {
    /// `v`, or a capital one.
    Vertex,
    /// `f`, a capital one, or the obsolete `fo`.
    Face,
}

/// Keywords of the format that are ignored (Wavefront, "Object Files", version 3.0).
const IGNORED: &str = "vt vn vp p l curv curv2 surf parm trim hole scrv sp end con cstype deg bmat \
    step g o s mg bevel c_interp d_interp lod maplib usemap usemtl mtllib shadow_obj trace_obj \
    ctech stech call csh bsp bzp cdc cdp res vw";

/// The statements of a file, in order.
struct Statements<'a> {
    rest: &'a [u8],
    /// The number of lines taken so far.
    lines: usize,
    /// True if the previous line was ignored and continues on the next one.
    ignoring: bool,
    /// The number of lines whose first word is no keyword, with the first such line's number and
    /// word.
    unknown: Option<(usize, usize, &'a [u8])>,
}

impl<'a> Statements<'a> {
    /// Starts at the first statement.
    fn new(bytes: &'a [u8]) -> Self {
        let mut rest = bytes;
        // A file can have several byte order marks if several programs have each added one.
        while let Some(further) = rest.strip_prefix(b"\xef\xbb\xbf") {
            rest = further;
        }
        Self { rest, lines: 0, ignoring: false, unknown: None }
    }

    /// Returns the next `v` or `f` statement and the number of its first line. Replaces the
    /// contents of `words` by the words after the keyword, at most `most` of them.
    fn next(&mut self, words: &mut Vec<&'a [u8]>, most: usize) -> Option<(Keyword, usize)> {
        loop {
            let (code, mut continued) = self.line()?;
            let number = self.lines;
            let mut on_line = text::words(code);
            let keyword = match on_line.next() {
                Some(b"v" | b"V") => Keyword::Vertex,
                Some(b"f" | b"F" | b"fo") => Keyword::Face,
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
                words.extend(text::words(code).take(most - words.len()));
                continued = more;
            }
            return Some((keyword, number));
        }
    }

    /// Returns the next line without its end (LF, CRLF or CR) and comment, and whether a backslash
    /// continues it.
    fn line(&mut self) -> Option<(&'a [u8], bool)> {
        let line = text::line(&mut self.rest)?;
        self.lines += 1;
        // `1.#QNAN` is a number of Microsoft's C library and no comment.
        let comment = (0..line.len()).find(|&i| line[i] == b'#' && !line[..i].ends_with(b"."));
        let code = line[..comment.unwrap_or(line.len())].trim_ascii_end();
        Some(match code.strip_suffix(b"\\") {
            Some(code) => (code, true),
            None => (code, false),
        })
    }
}

fn is_ignored(word: &[u8]) -> bool {
    IGNORED.split(' ').any(|known| known.as_bytes().eq_ignore_ascii_case(word))
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
