//! Reads the triangles of a Wavefront OBJ file, or reports the first invalid line.
//!
//! `tobj` parses the numbers in f64 and resolves relative indices. It receives only the `v` and `f`
//! statements that `Geometry` finds, because `tobj` 4.0.5 reads a polyline `l 1 2 3` as a triangle,
//! skips the first vertex after a byte order mark, and rejects Latin-1 comments, comments at the end
//! of a line, continued lines, and files in which only some vertices have a colour. Its errors name
//! no line. `Geometry` therefore checks every number before `tobj` receives it. `tobj` would make
//! fans of polygons, so that `Polygons` splits them instead.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and
//! texture coordinates are ignored. Lines may end in LF, CRLF or CR, and a backslash at the end
//! continues a statement on the next line.

use super::mesh::{Fault, FromFile, Mesh, Rounding, counted};
use super::polygon::{MOST_CORNERS, Polygons};
use super::text::{self, number, shown};
use glam::{DMat3, DVec3};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// Reads the bytes of an OBJ file. Any bytes give a mesh or an error. O(bytes), and more for faces
/// that are not convex.
pub fn parse<T: FromFile>(bytes: &[u8]) -> Result<Mesh<T>, Fault> {
    let geometry = Geometry::<T>::of(bytes)?;
    let options =
        tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // No statement names a material, so that `tobj` asks for no material file.
    let no_material = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let loaded = tobj::load_obj_buf(&mut &geometry.text[..], &options, no_material);
    let (models, _) = loaded
        .map_err(|error| Fault::of_file(format!("{error}; expected a Wavefront OBJ file")))?;
    // Nothing divides the statements, so that there is one model at most.
    let mesh = models.into_iter().next().map(|model| model.mesh).unwrap_or_default();
    // `tobj` keeps exactly the vertices that faces use, and names no lengths of faces if all are
    // triangles.
    let positions = mesh.positions.as_chunks().0.iter();
    let vertices: Vec<DVec3> = positions.map(|&p| DVec3::from(p).map(T::round)).collect();
    let mut polygons = Polygons::new(&vertices);
    let mut indices = &mesh.indices[..];
    let mut arities = mesh.face_arities.iter();
    for &line in &geometry.lines {
        let (face, rest) = indices.split_at(arities.next().map_or(3, |&arity| arity as usize));
        polygons.add(face).map_err(|message| Fault::in_line(line, format!("face: {message}")))?;
        indices = rest;
    }
    if polygons.triangles.is_empty() {
        let found = format!("{} vertices and no face of three or more", geometry.vertices);
        let message = format!("{found}; expected a Wavefront OBJ file with at least one such face");
        return Err(Fault::of_file(message));
    }
    polygons.short += geometry.short_faces;
    let mut remarks = polygons.remarks(geometry.vertices);
    remarks.extend(geometry.unknown);
    remarks.extend(geometry.rounding.remark(&polygons.triangles));
    Ok(Mesh::new(polygons.triangles, remarks))
}

/// Turns the vertices and the normals of a file that [`parse`] accepts, in double precision, which
/// other programs may read. The first line becomes a comment with the inverse.
pub fn turned(bytes: &[u8], rotation: &DMat3) -> Result<Vec<u8>, Fault> {
    let rows = rotation.to_cols_array().map(|number| number.to_string()).join(" ");
    let mut turned = format!("# scene = matrix * vertex, matrix by rows: {rows}\n").into_bytes();
    let mut statements = Statements::new(bytes);
    loop {
        let start = statements.rest;
        let Some((code, is_continued)) = statements.line() else { return Ok(turned) };
        let line = &start[..start.len() - statements.rest.len()];
        let mut words = text::words(code);
        let keyword = words.next().unwrap_or_default();
        let is_vector = matches!(keyword, b"v" | b"V" | b"vn" | b"VN");
        let words: Vec<&[u8]> = words.take(if is_vector { 3 } else { 0 }).collect();
        let numbers = words.iter().map_while(|word| str::from_utf8(word).ok()?.parse().ok());
        match numbers.filter(|x: &f64| x.is_finite()).collect::<Vec<f64>>()[..] {
            [x, y, z] => {
                let [x, y, z] = (*rotation * DVec3::new(x, y, z)).to_array();
                let end = words[2].as_ptr_range().end.addr() - line.as_ptr().addr();
                turned.extend([keyword, format!(" {x} {y} {z}").as_bytes(), &line[end..]].concat());
            }
            _ if is_vector && is_continued => {
                let message = "a vertex on two lines; expected it on one, to be turned";
                return Err(Fault::in_line(statements.lines, message));
            }
            // A vertex that is no number is used by no face.
            _ => turned.extend(line),
        }
    }
}

/// The checked statements of a file.
struct Geometry<T> {
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
    invalid: BTreeMap<usize, Fault>,
    /// The vertices below a face that the face names, counted from 1, and the face's line.
    ahead: Vec<(usize, usize)>,
    rounding: Rounding<T>,
}

impl<T: FromFile> Geometry<T> {
    /// Checks the statements of a file.
    ///
    /// # Errors
    ///
    /// The first fault in the order of the file. A fault of a vertex below the face that names it
    /// is found only at the end of the file, and is reported last.
    fn of(bytes: &[u8]) -> Result<Self, Fault> {
        let mut geometry = Self {
            text: Vec::new(),
            lines: Vec::new(),
            vertices: 0,
            short_faces: 0,
            unknown: None,
            invalid: BTreeMap::new(),
            ahead: Vec::new(),
            rounding: Rounding::default(),
        };
        let mut statements = Statements::new(bytes);
        let mut words = Vec::new();
        while let Some((keyword, line)) = statements.next(&mut words) {
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
            geometry.check(vertex)?;
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
        let fault = |place: usize| {
            let (part, expected) = match place {
                3 => (
                    "weight",
                    "expected a finite number other than 0 that keeps the divided coordinates \
                     within ±3.4e38",
                ),
                _ => ("coordinate", "expected a finite number up to ±3.4e38"),
            };
            let word = shown(words[place]);
            Fault::in_line(line, format!("vertex {part} `{word}`; {expected}"))
        };
        let mut numbers = [1.0; 4];
        for (place, word) in words.iter().enumerate() {
            numbers[place] = number(word, &mut self.rounding).ok_or_else(|| fault(place))?;
        }
        // `tobj` divides by the weight, and x / ∞ is finite.
        let [position @ .., weight] = numbers;
        let is_divisible = position.iter().all(|x| T::round(x / weight).is_finite());
        let infinite = numbers.iter().position(|number| !number.is_finite());
        match infinite.or((!is_divisible).then_some(3)) {
            None => {
                let is_divided = words.len() == 4;
                let numbers = words.iter().zip(numbers);
                self.add(b'v', numbers.map(|(word, x)| digits::<T>(word, x, is_divided)));
            }
            Some(place) => {
                // Some programs write vertices that they do not use in this way.
                self.invalid.insert(self.vertices, fault(place));
                self.text.extend(b"v 0 0 0\n");
            }
        }
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
            let size = index.unsigned_abs();
            if index < 0 && size > vertices {
                let expected =
                    format!("expected at least -{vertices}, the number of vertices above");
                return Err(Fault::in_line(line, format!("face vertex {index}; {expected}")));
            }
            let vertex = if index > 0 { size } else { vertices + 1 - size };
            if vertex > vertices {
                self.ahead.push((vertex, line));
            }
            self.check(vertex)?;
        }
        if words.len() < 3 {
            self.short_faces += 1;
        } else {
            self.add(b'f', words.iter().map(|word| vertex_index(word).into()));
            self.lines.push(line);
        }
        Ok(())
    }

    /// Adds a statement to the text for `tobj`.
    fn add<'a>(&mut self, keyword: u8, words: impl Iterator<Item = Cow<'a, [u8]>>) {
        self.text.push(keyword);
        for word in words {
            self.text.push(b' ');
            self.text.extend_from_slice(&word);
        }
        self.text.push(b'\n');
    }

    fn check(&self, vertex: usize) -> Result<(), Fault> {
        self.invalid.get(&vertex).map_or(Ok(()), |fault| Err(fault.clone()))
    }
}

/// Returns the digits for `tobj` of a coordinate or weight `number` that `word` spells: the word
/// itself if [`FromFile::round`] of what `tobj` makes of it is what it must be. It is not if rounding
/// to f64 first changes the number, or if a vertex is divided before it is rounded.
fn digits<T: FromFile>(word: &[u8], number: f64, is_divided: bool) -> Cow<'_, [u8]> {
    let in_f64: Option<f64> = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
    let kept = if is_divided { in_f64 } else { in_f64.map(T::round) };
    if kept == Some(number) { word.into() } else { format!("{number:e}").into_bytes().into() }
}

/// Returns the `7` of `7`, `7/1`, `7//3` and `7/1/3`.
fn vertex_index(corner: &[u8]) -> &[u8] {
    corner.split(|&b| b == b'/').next().unwrap_or_default()
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
    /// Capitals and the obsolete `fo` count as well. Replaces the contents of `words` by the words
    /// after the keyword, of which only one more than a face may have are read.
    fn next(&mut self, words: &mut Vec<&'a [u8]>) -> Option<(u8, usize)> {
        let most = MOST_CORNERS + 1;
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
    use bvh_core::{DTriangle, Triangle};

    #[test]
    fn a_number_in_f32_is_rounded_once_and_divided_afterwards() {
        let mut differ = [0; 2];
        for k in 0..1000 {
            let below = f32::from_bits(1.0f32.to_bits() + 7919 * k);
            // A little more than half the way to the next number, which f64 cannot tell from half.
            let half = f64::from(below) + 2f64.powi(-24);
            let (word, divisor) = (format!("{half:.60}1"), (0.37 * f64::from(k + 1)).to_string());
            let (exact, weight): (f64, f64) = (word.parse().unwrap(), divisor.parse().unwrap());
            let file = format!("v {word} 0 0\nv 0 1 0\nv {word} 0 1 {divisor}\nf 1 2 3");
            let x = |file: &str| parse::<Triangle>(file.as_bytes()).unwrap().triangles[0].0;
            let [whole, _, divided] = x(&file).map(|corner| corner.x);
            assert_eq!(whole.to_bits(), below.next_up().to_bits(), "{word}");
            assert_eq!(divided.to_bits(), (whole / weight as f32).to_bits(), "{word} {divisor}");
            let in_f64 = parse::<DTriangle>(file.as_bytes()).unwrap().triangles[0].0;
            assert_eq!(in_f64.map(|corner| corner.x), [exact, 0.0, exact / weight]);
            differ[0] += u32::from(exact as f32 != whole);
            differ[1] += u32::from((exact / weight) as f32 != divided);
        }
        assert!(differ.iter().all(|&count| count > 100), "{differ:?}");
    }

    #[test]
    fn an_endless_statement_needs_memory_for_a_limited_number_of_words() {
        for line in [" 1 2 3", " 1 \\\n2 3"] {
            let text = format!("f{}", line.repeat(MOST_CORNERS));
            let mut words = Vec::new();
            assert_eq!(Statements::new(text.as_bytes()).next(&mut words), Some((b'f', 1)));
            assert_eq!(words.len(), MOST_CORNERS + 1);
            let first = [b"1", b"2", b"3"].into_iter().cycle();
            assert!(words.iter().zip(first).all(|(word, first)| word == first));
        }
    }
}
