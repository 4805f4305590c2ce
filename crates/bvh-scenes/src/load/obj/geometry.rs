//! The `v` and `f` statements of an OBJ file for `tobj`: one per line, without colours, texture
//! indices and normal indices.

use super::check;
use super::error::{ObjError, Place};
use super::statements::{Keyword, MOST_CORNERS, Statements, shown, vertex_index};
use std::io::{self, BufRead, Read};
use std::path::Path;

/// The number of bytes that are prepared at a time.
const BLOCK: usize = 1 << 16;

/// A reader of checked statements, which ends at the first fault.
pub struct Geometry<'a> {
    path: &'a Path,
    statements: Statements<'a>,
    words: Vec<&'a [u8]>,
    /// Prepared statements; `tobj` has taken the first `taken` bytes.
    block: Vec<u8>,
    taken: usize,
    fault: Option<ObjError>,
    /// The highest index of a vertex so far, and the first line that names it.
    highest: (usize, usize),
    /// The number of `v` statements so far.
    pub vertices: usize,
    /// The number of `f` statements with fewer than three vertices so far; they are skipped.
    pub short_faces: usize,
}

impl<'a> Geometry<'a> {
    /// Creates a reader of a file's bytes; `path` only names the file in errors.
    pub fn new(bytes: &'a [u8], path: &'a Path) -> Self {
        Self {
            path,
            statements: Statements::new(bytes),
            words: Vec::new(),
            block: Vec::new(),
            taken: 0,
            fault: None,
            highest: (0, 0),
            vertices: 0,
            short_faces: 0,
        }
    }

    /// Returns the number of lines so far that begin with no keyword, with the first such line's
    /// number and first word.
    pub fn unknown(&self) -> Option<(usize, usize, String)> {
        self.statements.unknown.map(|(count, line, word)| (count, line, shown(word)))
    }

    /// Checks the rest of the file.
    ///
    /// # Errors
    ///
    /// The first fault in the order of the file. An index above the number of vertices is found
    /// only at the end of the file, because a face may come before its vertices, and is reported
    /// last.
    pub fn finish(&mut self) -> Result<(), ObjError> {
        while self.add_statement() {}
        let (index, line) = self.highest;
        let vertices = self.vertices;
        match self.fault.take() {
            Some(fault) => Err(fault),
            None if index > vertices => {
                Err(ObjError::IndexAbove { place: self.place(line), index, vertices })
            }
            None => Ok(()),
        }
    }

    fn place(&self, line: usize) -> Place {
        Place { path: self.path.to_path_buf(), line }
    }

    /// Adds the next statement to the block. Returns false at the end of the file and at a fault.
    fn add_statement(&mut self) -> bool {
        if self.fault.is_some() {
            return false;
        }
        let Some((keyword, line)) = self.statements.next(&mut self.words, MOST_CORNERS + 1) else {
            return false;
        };
        self.fault = self.add_checked(keyword, line).err();
        self.fault.is_none()
    }

    fn add_checked(&mut self, keyword: Keyword, line: usize) -> Result<(), ObjError> {
        match keyword {
            Keyword::Vertex => {
                let words = check::vertex(&self.words, || self.place(line))?;
                add(b'v', words.iter().copied(), &mut self.block);
                self.vertices += 1;
            }
            Keyword::Face => {
                let index = check::face(&self.words, self.vertices, || self.place(line))?;
                if index > self.highest.0 {
                    self.highest = (index, line);
                }
                if self.words.len() < 3 {
                    self.short_faces += 1;
                } else {
                    let corners = self.words.iter().map(|corner| vertex_index(corner));
                    add(b'f', corners, &mut self.block);
                }
            }
        }
        Ok(())
    }
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
