//! Reads the triangles of a Wavefront OBJ file, or reports the first invalid line.
//!
//! `tobj` parses the numbers and resolves relative indices. It receives only the `v` and `f`
//! statements that `Geometry` finds, because `tobj` 4.0.5 reads a polyline `l 1 2 3` as a triangle,
//! skips the first vertex after a byte order mark, and rejects Latin-1 comments, comments at the end
//! of a line, continued lines, and files in which only some vertices have a colour. Its errors name
//! no line, and it accepts `nan`. `Geometry` therefore checks every number before `tobj` receives
//! it. `tobj` splits every polygon into a fan, so that `Polygons` splits them instead.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and
//! texture coordinates are ignored. Lines may end in LF, CRLF or CR, and a backslash at the end
//! continues a statement on the next line.

use super::mesh::{Fault, Mesh, UNUSED, counted};
use super::polygon::{MOST_CORNERS, Polygons, open};
use super::text::{self, number, shown};
use glam::Vec3;
use std::path::Path;

/// Reads the bytes of an OBJ file. Any bytes give a mesh or an error. O(bytes), and more for faces
/// that are not convex.
pub fn parse(bytes: &[u8]) -> Result<Mesh, Fault> {
    let geometry = Geometry::of(bytes)?;
    let options =
        tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // No statement names a material, so that `tobj` asks for no material file.
    let no_material = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let loaded = tobj::load_obj_buf(&mut &geometry.text[..], &options, no_material);
    let (models, _) = loaded
        .map_err(|error| Fault::of_file(format!("{error}; expected a Wavefront OBJ file")))?;
    let mut polygons = Polygons::default();
    let mut lines = geometry.lines.iter();
    let mut corners = Vec::new();
    let mut used = 0;
    for tobj::Model { mesh, .. } in models {
        // `tobj` keeps exactly the vertices that faces use, each once, and names no lengths of
        // faces if all are triangles.
        let (positions, _) = mesh.positions.as_chunks::<3>();
        let mut indices = &mesh.indices[..];
        let mut arities = mesh.face_arities.iter();
        while !indices.is_empty() {
            let (face, rest) = indices.split_at(arities.next().map_or(3, |&arity| arity as usize));
            corners.clear();
            corners.extend(open(face).iter().map(|&index| Vec3::from(positions[index as usize])));
            let line = lines.next().copied().unwrap_or_default();
            polygons
                .add(&corners)
                .map_err(|message| Fault::in_line(line, format!("face of {message}")))?;
            indices = rest;
        }
        used += positions.len();
    }
    if polygons.triangles.is_empty() {
        let found = format!("{} vertices and no face of three or more", geometry.vertices);
        let message = format!("{found}; expected a Wavefront OBJ file with at least one such face");
        return Err(Fault::of_file(message));
    }
    polygons.short += geometry.short_faces;
    let unused = counted(UNUSED, geometry.vertices - used);
    let remarks = unused.into_iter().chain(polygons.remarks()).chain(geometry.unknown);
    let remarks = remarks.collect();
    Ok(Mesh::new(polygons.triangles, remarks))
}

/// The checked statements of a file.
#[derive(Default)]
struct Geometry {
    /// The statements for `tobj`.
    text: Vec<u8>,
    /// The line of each face in `text`.
    lines: Vec<usize>,
    /// The number of `v` statements.
    vertices: usize,
    /// The number of `f` statements with fewer than three vertices, which are skipped.
    short_faces: usize,
    /// The clause about lines that begin with no keyword.
    unknown: Option<String>,
    /// The numbers of the vertices that no face may use, counted from 1, with the reasons.
    invalid: Vec<(usize, Fault)>,
    /// The vertices below a face that the face names, counted from 1, and the face's line.
    ahead: Vec<(usize, usize)>,
}

impl Geometry {
    /// Checks the statements of a file.
    ///
    /// # Errors
    ///
    /// The first fault in the order of the file. A fault of a vertex below the face that names it
    /// is found only at the end of the file, and is reported last.
    fn of(bytes: &[u8]) -> Result<Self, Fault> {
        let mut geometry = Self::default();
        let mut statements = Statements::new(bytes);
        let mut words = Vec::new();
        while let Some((keyword, line)) = statements.next(&mut words, MOST_CORNERS + 1) {
            match keyword {
                b'v' => geometry.add_vertex(&words, line)?,
                _ => geometry.add_face(&words, line)?,
            }
        }
        for &(vertex, line) in &geometry.ahead {
            if vertex > geometry.vertices {
                let most = geometry.vertices;
                let expected = format!("expected at most {most}, the file's vertex count");
                return Err(Fault::in_line(line, format!("face vertex {vertex}; {expected}")));
            }
            geometry.usable(vertex)?;
        }
        geometry.unknown = statements.unknown.and_then(|(count, line, word)| {
            let lines = counted("lines with unknown keywords ignored", count)?;
            Some(format!("{lines} (`{}` in line {line})", shown(word)))
        });
        Ok(geometry)
    }

    /// Adds a vertex without its colour: its coordinates, and its weight if it has one.
    fn add_vertex(&mut self, words: &[&[u8]], line: usize) -> Result<(), Fault> {
        self.vertices += 1;
        let length = words.len();
        if !matches!(length, 3 | 4 | 6..=8) {
            let expected = "3 (x y z), 4 (x y z and a weight), or 3 or 4 more (a colour)";
            let message = format!("vertex of length {length}; expected {expected}");
            return Err(Fault::in_line(line, message));
        }
        let words = &words[..if matches!(length, 4 | 8) { 4 } else { 3 }];
        let mut position = [0.0; 3];
        for (coordinate, word) in position.iter_mut().zip(words) {
            let message = || {
                let expected = "expected a finite number up to ±3.4e38";
                Fault::in_line(line, format!("vertex coordinate `{}`; {expected}", shown(word)))
            };
            *coordinate = number(word).ok_or_else(message)?;
            // Some programs write vertices that they do not use in this way.
            if !coordinate.is_finite() {
                self.invalid.push((self.vertices, message()));
                add(b'v', [&b"0"[..]; 3].into_iter(), &mut self.text);
                return Ok(());
            }
        }
        if let [_, _, _, word] = words {
            // `tobj` divides by the weight. The quotients reject the weight 0; an infinite weight
            // needs its own test, because x / ∞ is finite.
            let expected = "expected a finite number other than 0 that keeps the divided \
                            coordinates within ±3.4e38";
            number(word)
                .filter(|w| w.is_finite() && position.iter().all(|x| (x / w).is_finite()))
                .ok_or_else(|| {
                    Fault::in_line(line, format!("vertex weight `{}`; {expected}", shown(word)))
                })?;
        }
        add(b'v', words.iter().copied(), &mut self.text);
        Ok(())
    }

    fn add_face(&mut self, words: &[&[u8]], line: usize) -> Result<(), Fault> {
        if words.len() > MOST_CORNERS {
            let message =
                format!("face of more than {MOST_CORNERS} vertices; expected at most as many");
            return Err(Fault::in_line(line, message));
        }
        let vertices = self.vertices;
        for corner in words {
            let index: isize = std::str::from_utf8(vertex_index(corner))
                .ok()
                .and_then(|word| word.parse().ok())
                .filter(|&index| index != 0)
                .ok_or_else(|| {
                    let expected = "expected a whole number, from 1 for the first vertex of the \
                                    file or from -1 for the latest one";
                    Fault::in_line(line, format!("face vertex `{}`; {expected}", shown(corner)))
                })?;
            let vertex = match usize::try_from(index) {
                Ok(index) => Some(index),
                Err(_) => (vertices + 1).checked_sub(index.unsigned_abs()).filter(|&v| v > 0),
            };
            match vertex {
                Some(vertex) if vertex > vertices => self.ahead.push((vertex, line)),
                Some(vertex) => self.usable(vertex)?,
                None => {
                    let expected =
                        format!("expected at least -{vertices}, the number of vertices above");
                    return Err(Fault::in_line(line, format!("face vertex {index}; {expected}")));
                }
            }
        }
        if words.len() < 3 {
            self.short_faces += 1;
        } else {
            add(b'f', words.iter().map(vertex_index), &mut self.text);
            self.lines.push(line);
        }
        Ok(())
    }

    /// Rejects a vertex without finite coordinates.
    fn usable(&self, vertex: usize) -> Result<(), Fault> {
        match self.invalid.binary_search_by_key(&vertex, |(invalid, _)| *invalid) {
            Ok(found) => Err(self.invalid[found].1.clone()),
            Err(_) => Ok(()),
        }
    }
}

/// Returns the `7` of `7`, `7/1`, `7//3` and `7/1/3`.
fn vertex_index<'a>(corner: &&'a [u8]) -> &'a [u8] {
    corner.split(|&b| b == b'/').next().unwrap_or_default()
}

fn add<'a>(keyword: u8, words: impl Iterator<Item = &'a [u8]>, text: &mut Vec<u8>) {
    text.push(keyword);
    for word in words {
        text.push(b' ');
        text.extend_from_slice(word);
    }
    text.push(b'\n');
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

    /// Returns the keyword `v` or `f` of the next such statement, and the number of its first line.
    /// Capitals and the obsolete `fo` count as well. Replaces the contents of `words` by the words after the keyword, at most `most` of them.
    fn next(&mut self, words: &mut Vec<&'a [u8]>, most: usize) -> Option<(u8, usize)> {
        loop {
            let (code, mut continued) = self.line()?;
            let number = self.lines;
            let mut on_line = text::words(code);
            let keyword = match on_line.next() {
                Some(b"v" | b"V") => b'v',
                Some(b"f" | b"F" | b"fo") => b'f',
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
                (Some((b'f', 1)), vec![b"1", b"2", b"3", &b"4"[..]]),
                "{text}"
            );
        }
    }
}
