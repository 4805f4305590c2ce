//! Splits the bytes of an OBJ file into statements and words, without parsing any number.

use super::super::text;

/// A statement that defines geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keyword {
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
pub struct Statements<'a> {
    rest: &'a [u8],
    /// The number of lines taken so far.
    lines: usize,
    /// True if the previous line was ignored and continues on the next one.
    ignoring: bool,
    /// The number of lines whose first word is no keyword, with the first such line's number and
    /// word.
    pub unknown: Option<(usize, usize, &'a [u8])>,
}

impl<'a> Statements<'a> {
    /// Starts at the first statement.
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut rest = bytes;
        // A file can have several byte order marks if several programs have each added one.
        while let Some(further) = rest.strip_prefix(b"\xef\xbb\xbf") {
            rest = further;
        }
        Self { rest, lines: 0, ignoring: false, unknown: None }
    }

    /// Returns the next `v` or `f` statement and the number of its first line. Replaces the
    /// contents of `words` by the words after the keyword, at most `most` of them.
    pub fn next(&mut self, words: &mut Vec<&'a [u8]>, most: usize) -> Option<(Keyword, usize)> {
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
