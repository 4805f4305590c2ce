//! Splits the bytes of an OBJ file into statements and words, without parsing any number.

/// A statement that defines geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keyword {
    /// `v`
    Vertex,
    /// `f`
    Face,
}

/// The largest number of vertices of one face. The fan of a larger face would need a hundred bytes
/// of memory for every two bytes of the file.
pub const MOST_CORNERS: usize = 1 << 16;

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
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&b| b == b'\n' || b == b'\r');
        let (line, tail) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = tail.strip_prefix(b"\r\n").unwrap_or(tail.get(1..).unwrap_or_default());
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
pub fn vertex_index(corner: &[u8]) -> &[u8] {
    corner.split(|&b| b == b'/').next().unwrap_or_default()
}

/// Makes a word printable for an error message, and short even if the file is one endless word.
pub fn shown(word: &[u8]) -> String {
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
