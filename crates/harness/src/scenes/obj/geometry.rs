//! The `v` and `f` statements of an OBJ file, one per line and without colours, texture and normal indices, for `tobj`.

use super::statements::{Keyword, Statements, shown, vertex_index};
use std::io::{self, BufRead, Read};

/// Most vertices of one face. The fan of a larger one would take a hundred bytes for each two bytes of the file.
pub const MOST_CORNERS: usize = 1 << 16;

/// Bytes that are prepared at a time.
const BLOCK: usize = 1 << 16;

/// Reads like a file of checked length and shape; no number is parsed here.
pub struct Geometry<'a> {
    statements: Statements<'a>,
    words: Vec<&'a [u8]>,
    /// Statements that are ready, from `taken` on.
    block: Vec<u8>,
    taken: usize,
    /// `v` statements so far.
    pub vertices: usize,
    /// `f` statements of fewer than three vertices so far; they are left out.
    pub short_faces: usize,
    /// Whether there was a statement in which `tobj` might not see a fault.
    pub doubtful: bool,
}

impl<'a> Geometry<'a> {
    /// Of the bytes of a file.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            statements: Statements::new(bytes),
            words: Vec::new(),
            block: Vec::new(),
            taken: 0,
            vertices: 0,
            short_faces: 0,
            doubtful: false,
        }
    }

    /// Lines so far that begin with no keyword, the number of the first and its first word.
    pub fn unknown(&self) -> Option<(usize, usize, String)> {
        self.statements.unknown.map(|(count, line, word)| (count, line, shown(word)))
    }

    /// Adds the next statement to the block; `false` at the end of the file.
    fn add_statement(&mut self) -> bool {
        let Some((keyword, _)) = self.statements.next(&mut self.words, MOST_CORNERS + 1) else { return false };
        match keyword {
            Keyword::Vertex => self.add_vertex(),
            Keyword::Face => self.add_face(),
        }
        true
    }

    fn add_vertex(&mut self) {
        self.vertices += 1;
        let kept = match self.words.len() {
            3 | 6 | 7 => 3,
            4 => 4,
            _ => 0,
        };
        // A weight may be zero, or take a coordinate beyond all numbers.
        self.doubtful |= kept != 3 || !self.words[..kept].iter().all(|word| is_plainly_finite(word));
        add(b'v', self.words[..kept].iter().copied(), &mut self.block);
    }

    fn add_face(&mut self) {
        let corners = self.words.len();
        let is_index =
            |word: &[u8]| !word.is_empty() && word.iter().all(|b| b.is_ascii_digit() || b"+-".contains(b));
        let indices = self.words.iter().map(|corner| vertex_index(corner));
        self.doubtful |= corners > MOST_CORNERS || !indices.clone().all(is_index);
        if corners < 3 {
            self.short_faces += 1;
            self.doubtful = true;
        } else if corners <= MOST_CORNERS {
            add(b'f', indices, &mut self.block);
        }
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

/// Whether a word that parses as a number is surely finite as `f32`: at most 38 digits, no positive exponent, no name.
fn is_plainly_finite(word: &[u8]) -> bool {
    let digits = |part: &[u8]| part.iter().all(|b| b.is_ascii_digit() || b"+-.".contains(b));
    let mut parts = word.splitn(2, |b| b.eq_ignore_ascii_case(&b'e'));
    let (mantissa, exponent) = (parts.next().unwrap_or_default(), parts.next());
    word.len() <= 38 && digits(mantissa) && exponent.is_none_or(|e| e.starts_with(b"-") && digits(e))
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
