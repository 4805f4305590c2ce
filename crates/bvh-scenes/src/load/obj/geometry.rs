//! The `v` and `f` statements of an OBJ file for `tobj`: checked, one per line, without colours,
//! texture indices and normal indices.

use super::super::mesh::counted;
use super::super::polygon::MOST_CORNERS;
use super::super::text::{number, shown};
use super::statements::{Keyword, Statements};
use std::io::{self, BufRead, Read};

/// The number of bytes that are prepared at a time.
const BLOCK: usize = 1 << 16;

/// A line, counted from 1, and what is wrong with it.
type Fault = (usize, String);

/// A reader of checked statements, which ends at the first fault.
pub struct Geometry<'a> {
    statements: Statements<'a>,
    words: Vec<&'a [u8]>,
    /// Prepared statements; `tobj` has taken the first `taken` bytes.
    block: Vec<u8>,
    taken: usize,
    fault: Option<Fault>,
    /// The numbers of the vertices that no face may use, counted from 1, with the reasons.
    invalid: Vec<(usize, Fault)>,
    /// The vertices below a face that the face names, counted from 1, and the face's line.
    ahead: Vec<(usize, usize)>,
    /// The number of `v` statements so far.
    pub vertices: usize,
    /// The number of `f` statements with fewer than three vertices so far; they are skipped.
    pub short_faces: usize,
}

impl<'a> Geometry<'a> {
    /// Creates a reader of a file's bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            statements: Statements::new(bytes),
            words: Vec::new(),
            block: Vec::new(),
            taken: 0,
            fault: None,
            invalid: Vec::new(),
            ahead: Vec::new(),
            vertices: 0,
            short_faces: 0,
        }
    }

    /// Returns the clause about lines that begin with no keyword.
    pub fn remark(&self) -> Option<String> {
        let (count, line, word) = self.statements.unknown?;
        let lines =
            counted(count, "line with an unknown keyword was", "lines with unknown keywords were")?;
        Some(format!("{lines} ignored (`{}` in line {line})", shown(word)))
    }

    /// Checks the rest of the file.
    ///
    /// # Errors
    ///
    /// The first fault in the order of the file. A fault of a vertex below the face that names it
    /// is found only at the end of the file, and is reported last.
    pub fn finish(&mut self) -> Result<(), Fault> {
        while self.add_statement() {}
        if let Some(fault) = self.fault.take() {
            return Err(fault);
        }
        for &(vertex, line) in &self.ahead {
            if vertex > self.vertices {
                let vertices = self.vertices;
                let expected = format!("expected at most {vertices}, the file's vertex count");
                return Err((line, format!("face vertex {vertex}; {expected}")));
            }
            self.usable(vertex)?;
        }
        Ok(())
    }

    /// Adds the next statement to the block. Returns false at the end of the file and at a fault.
    fn add_statement(&mut self) -> bool {
        if self.fault.is_some() {
            return false;
        }
        let Some((keyword, line)) = self.statements.next(&mut self.words, MOST_CORNERS + 1) else {
            return false;
        };
        let checked = match keyword {
            Keyword::Vertex => self.add_vertex(line).map_err(|message| (line, message)),
            Keyword::Face => self.add_face(line),
        };
        self.fault = checked.err();
        self.fault.is_none()
    }

    /// Adds a vertex without its colour: its coordinates, and its weight if it has one.
    fn add_vertex(&mut self, line: usize) -> Result<(), String> {
        self.vertices += 1;
        let length = self.words.len();
        if !matches!(length, 3 | 4 | 6..=8) {
            let expected = "3 (x y z), 4 (x y z and a weight), or 3 or 4 more (a colour)";
            return Err(format!("vertex of length {length}; expected {expected}"));
        }
        let words = &self.words[..if matches!(length, 4 | 8) { 4 } else { 3 }];
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
                add(b'v', [&b"0"[..]; 3].into_iter(), &mut self.block);
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
        add(b'v', words.iter().copied(), &mut self.block);
        Ok(())
    }

    fn add_face(&mut self, line: usize) -> Result<(), Fault> {
        if self.words.len() > MOST_CORNERS {
            let message =
                format!("face of more than {MOST_CORNERS} vertices; expected at most as many");
            return Err((line, message));
        }
        let vertices = self.vertices;
        for corner in &self.words {
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
        if self.words.len() < 3 {
            self.short_faces += 1;
        } else {
            let corners = self.words.iter().map(vertex_index);
            add(b'f', corners, &mut self.block);
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

fn add<'a>(keyword: u8, words: impl Iterator<Item = &'a [u8]>, block: &mut Vec<u8>) {
    block.push(keyword);
    for word in words {
        block.push(b' ');
        block.extend_from_slice(word);
    }
    block.push(b'\n');
}

impl BufRead for Geometry<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken == self.block.len() {
            self.block.clear();
            self.taken = 0;
            while self.block.len() < BLOCK && self.add_statement() {}
        }
        Ok(&self.block[self.taken..])
    }

    fn consume(&mut self, bytes: usize) {
        self.taken += bytes;
    }
}

impl Read for Geometry<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(buffer)?;
        self.consume(read);
        Ok(read)
    }
}
