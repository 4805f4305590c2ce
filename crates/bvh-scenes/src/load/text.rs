//! Lines, words and numbers of text files.

use super::mesh::{FromFile, Rounding};

/// Takes the first line off `rest`, without its end: LF, CRLF or CR.
pub fn line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    if rest.is_empty() {
        return None;
    }
    let end = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r');
    let (line, tail) = rest.split_at(end.unwrap_or(rest.len()));
    *rest = tail.strip_prefix(b"\r\n").unwrap_or(tail.get(1..).unwrap_or_default());
    Some(line)
}

/// Returns the words of a line.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Returns the number that a word spells, rounded for triangles `T`. Accepts the spellings of NaN
/// and of infinity in Microsoft's C library, such as `-nan(ind)` and `1.#INF`.
pub fn number<T: FromFile>(word: &[u8], rounding: &mut Rounding<T>) -> Option<f64> {
    let word = std::str::from_utf8(word).ok()?;
    if let Some(number) = T::parse(word) {
        rounding.note(number, || word.parse().ok());
        return Some(number);
    }
    let word = word.trim_start_matches(['+', '-']).to_ascii_lowercase();
    (word.starts_with("nan(") || word.starts_with("1.#")).then_some(f64::NAN)
}

/// Makes a word printable for an error message, and short even if the file is one endless word.
pub fn shown(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let cut = if word.len() > LONGEST { "…" } else { "" };
    format!("{}{cut}", word[..word.len().min(LONGEST)].escape_ascii())
}
