//! The `v` and `f` statements of an OBJ file, one per line and without colours, texture and normal indices, for `tobj`.

use super::check;
use super::error::{ObjError, Place};
use super::statements::{Keyword, MOST_CORNERS, Statements, shown, vertex_index};
use std::io::{self, BufRead, Read};
use std::path::Path;

/// Bytes that are prepared at a time.
const BLOCK: usize = 1 << 16;

/// Reads like a file of checked numbers, up to the first fault.
pub struct Geometry<'a> {
    path: &'a Path,
    statements: Statements<'a>,
    words: Vec<&'a [u8]>,
    /// Statements that are ready, from `taken` on.
    block: Vec<u8>,
    taken: usize,
    fault: Option<ObjError>,
    /// The highest index of a vertex so far, and the first line that names it.
    highest: (usize, usize),
    /// `v` statements so far.
    pub vertices: usize,
    /// `f` statements of fewer than three vertices so far; they are left out.
    pub short_faces: usize,
}

impl<'a> Geometry<'a> {
    /// Of the bytes of a file; `path` only names it in errors.
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

    /// Lines so far that begin with no keyword, the number of the first and its first word.
    pub fn unknown(&self) -> Option<(usize, usize, String)> {
        self.statements
            .unknown
            .map(|(count, line, word)| (count, line, shown(word)))
    }

    /// Reads on to the end of the file.
    ///
    /// # Errors
    ///
    /// The first fault in the order of the file. An index above the number of vertices can be told only at the end of the
    /// file, since faces may name vertices below them, and comes last.
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

    /// Adds the next statement to the block; `false` at the end of the file and at a fault.
    fn add_statement(&mut self) -> bool {
        if self.fault.is_some() {
            return false;
        }
        let Some((keyword, line)) = self
            .statements
            .next(&mut self.words, MOST_CORNERS + 1)
        else {
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
                match self.words.len() {
                    0..3 => self.short_faces += 1,
                    _ => add(
                        b'f',
                        self.words
                            .iter()
                            .map(|corner| vertex_index(corner)),
                        &mut self.block,
                    ),
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
