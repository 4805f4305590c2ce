//! The `v` and `f` statements of an OBJ file for `tobj`: checked, one per line, without colours,
//! texture indices and normal indices.

use super::super::mesh::counted;
use super::super::polygon::MOST_CORNERS;
use super::super::text::{number, shown};
use super::statements::{Keyword, Statements};

/// A line, counted from 1, and what is wrong with it.
type Fault = (usize, String);

/// The checked statements of a file.
#[derive(Default)]
pub struct Geometry {
    /// The statements for `tobj`.
    pub text: Vec<u8>,
    /// The line of each face in `text`.
    pub lines: Vec<usize>,
    /// The number of `v` statements.
    pub vertices: usize,
    /// The number of `f` statements with fewer than three vertices, which are skipped.
    pub short_faces: usize,
    /// The clause about lines that begin with no keyword.
    pub unknown: Option<String>,
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
    pub fn of(bytes: &[u8]) -> Result<Self, Fault> {
        let mut geometry = Self::default();
        let mut statements = Statements::new(bytes);
        let mut words = Vec::new();
        while let Some((keyword, line)) = statements.next(&mut words, MOST_CORNERS + 1) {
            match keyword {
                Keyword::Vertex => {
                    geometry.add_vertex(&words, line).map_err(|message| (line, message))?;
                }
                Keyword::Face => geometry.add_face(&words, line)?,
            }
        }
        for &(vertex, line) in &geometry.ahead {
            if vertex > geometry.vertices {
                let most = geometry.vertices;
                let expected = format!("expected at most {most}, the file's vertex count");
                return Err((line, format!("face vertex {vertex}; {expected}")));
            }
            geometry.usable(vertex)?;
        }
        geometry.unknown = statements.unknown.and_then(|(count, line, word)| {
            let (one, many) =
                ("line with an unknown keyword was", "lines with unknown keywords were");
            let lines = counted(count, one, many)?;
            Some(format!("{lines} ignored (`{}` in line {line})", shown(word)))
        });
        Ok(geometry)
    }

    /// Adds a vertex without its colour: its coordinates, and its weight if it has one.
    fn add_vertex(&mut self, words: &[&[u8]], line: usize) -> Result<(), String> {
        self.vertices += 1;
        let length = words.len();
        if !matches!(length, 3 | 4 | 6..=8) {
            let expected = "3 (x y z), 4 (x y z and a weight), or 3 or 4 more (a colour)";
            return Err(format!("vertex of length {length}; expected {expected}"));
        }
        let words = &words[..if matches!(length, 4 | 8) { 4 } else { 3 }];
        let mut position = [0.0; 3];
        for (coordinate, word) in position.iter_mut().zip(words) {
            let message = || {
                let expected = "expected a finite number up to ±3.4e38";
                format!("vertex coordinate `{}`; {expected}", shown(word))
            };
            *coordinate = number(word).ok_or_else(message)?;
            // Some programs write vertices that they do not use in this way.
            if !coordinate.is_finite() {
                self.invalid.push((self.vertices, (line, message())));
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
                .ok_or_else(|| format!("vertex weight `{}`; {expected}", shown(word)))?;
        }
        add(b'v', words.iter().copied(), &mut self.text);
        Ok(())
    }

    fn add_face(&mut self, words: &[&[u8]], line: usize) -> Result<(), Fault> {
        if words.len() > MOST_CORNERS {
            let message =
                format!("face of more than {MOST_CORNERS} vertices; expected at most as many");
            return Err((line, message));
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
                    (line, format!("face vertex `{}`; {expected}", shown(corner)))
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
                    return Err((line, format!("face vertex {index}; {expected}")));
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
