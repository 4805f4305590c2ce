//! Triangles from STL files, text or binary.
//!
//! This module does not use `stl_io` 0.11, because `stl_io` stops after the first of several
//! solids, mistakes `solid` without a name for a binary file, names no line, and knows neither of
//! the ways in which programs write comments, colours, `end loop` and counts.

use super::mesh::{AFTER_END, Fault, FromFile, Mesh, Rounding, counted};
use super::{text, without_mark};
use glam::DVec3;
use std::iter::Peekable;
use std::str::SplitWhitespace;

/// The number of bytes before the triangles of a binary file: a comment of 80 bytes, and the number
/// of triangles.
const HEADER: usize = 84;
/// The number of bytes of a triangle: a normal, three corners, and two bytes that programs use for
/// a colour.
const FACET: usize = 50;

fn promised(bytes: &[u8]) -> Option<usize> {
    Some(u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?) as usize)
}

/// Returns whether the number of bytes matches the header of a binary file.
pub fn is_binary(bytes: &[u8]) -> bool {
    // The first bytes do not decide, because the comment of a binary file may begin with `solid`.
    promised(bytes).is_some_and(|facets| facets > 0 && bytes.len() == HEADER + FACET * facets)
}

/// Returns whether text is that of an STL file: whether it begins with `solid` or `facet`, after
/// comments, and has a word that follows these. The beginning of a binary file contains zeros.
pub fn is_text(text: &[u8]) -> bool {
    let mut rest = text;
    let first = std::iter::from_fn(|| text::line(&mut rest)).find(|line| !is_comment(line));
    let mut words = first.into_iter().flat_map(text::words).chain(text::words(rest));
    let is = |word: &[u8], keywords: &[&[u8]]| {
        keywords.iter().any(|keyword| word.eq_ignore_ascii_case(keyword))
    };
    words.next().is_some_and(|word| is(word, &[b"solid", b"facet"]))
        && !text[..text.len().min(HEADER + FACET)].contains(&0)
        && words.any(|word| is(word, &[b"facet", b"endfacet", b"endsolid", b"end"]))
}

fn is_comment(line: &[u8]) -> bool {
    matches!(line.trim_ascii_start(), [] | [b';' | b'#', ..])
}

/// Reads the bytes of an STL file. O(bytes).
pub fn parse<T: FromFile>(bytes: &[u8]) -> Result<Mesh<T>, Fault> {
    let text = without_mark(bytes).trim_ascii_end();
    // Programs of DOS end a text with Ctrl-Z.
    let text = text.strip_suffix(b"\x1a").unwrap_or(text);
    let is_text = !is_binary(bytes) && is_text(text);
    let (triangles, remarks) = match is_text {
        true => parse_text(text)?,
        false => parse_binary(bytes)?,
    };
    if triangles.is_empty() {
        return Err(Fault::of_file("no facet; expected an STL file with at least one"));
    }
    Ok(Mesh::new(triangles, remarks.into_iter().collect()))
}

/// Reads the triangles of a binary file, and returns a remark if the header does not give their
/// number or bytes follow them.
fn parse_binary<T: FromFile>(bytes: &[u8]) -> Result<(Vec<T>, Option<String>), Fault> {
    let promised = promised(bytes).ok_or_else(|| {
        let message =
            format!("{} bytes; expected the {HEADER} of a binary STL file's header", bytes.len());
        Fault::of_file(message)
    })?;
    let body = &bytes[HEADER..];
    let (room, after) = (body.len() / FACET, body.len() % FACET);
    // Programs that write while they compute do not always return to the header, where zeros, ones
    // or blanks then stand.
    let is_unwritten = matches!(promised, 0 | 0xffff_ffff | 0x2020_2020) && after == 0;
    if !is_unwritten && (room < promised || room > promised && after == 0) {
        let message = format!("room for {room} facets; expected the {promised} of the header");
        return Err(Fault::of_file(message));
    }
    let facets = if is_unwritten { room } else { promised };
    let (body, rest) = body.split_at(facets * FACET);
    if !rest.is_empty() && have_attributes(&bytes[HEADER..], facets) {
        let found = rest.len();
        return Err(Fault::of_file(format!(
            "facets with attributes and {found} bytes after the last; expected {FACET} bytes per facet"
        )));
    }
    let mut triangles = Vec::with_capacity(facets);
    for (number, facet) in body.as_chunks::<FACET>().0.iter().enumerate() {
        // The normal in the first 12 bytes is ignored: many programs write zeros there.
        let (words, _) = facet[12..48].as_chunks();
        let corners: [f32; 9] = std::array::from_fn(|i| f32::from_le_bytes(words[i]));
        if let Some(found) = corners.iter().find(|x| !x.is_finite()) {
            let message = format!("coordinate {found}; expected a finite number");
            return Err(Fault::of(&format!("facet {number}, counted from 0"), message));
        }
        let corner = |i: usize| DVec3::from_array([i, i + 1, i + 2].map(|i| corners[i].into()));
        triangles.push(T::of([corner(0), corner(3), corner(6)]));
    }
    let ignored = counted(AFTER_END, rest.len());
    let unwritten = (is_unwritten && facets > 0)
        .then(|| format!("the header counts {promised} facets and the file has {facets}"));
    Ok((triangles, unwritten.or(ignored)))
}

/// Returns whether the facets, each with as many bytes after it as its last two bytes say, end where
/// the file does.
fn have_attributes(body: &[u8], facets: usize) -> bool {
    let rest = (0..facets).try_fold(body, |rest, _| {
        let (facet, after) = rest.split_at_checked(FACET)?;
        after.get(usize::from(u16::from_le_bytes([facet[48], facet[49]]))..)
    });
    rest.is_some_and(<[u8]>::is_empty)
}

/// Words that begin a part of a text file. Any other words after `facet`, `normal` and `color` are
/// numbers that nobody needs, whatever they look like.
const KEYWORDS: [&str; 9] =
    ["color", "end", "endfacet", "endloop", "endsolid", "facet", "outer", "solid", "vertex"];

/// Reads the corners of every loop, three at a time, and returns a remark on their rounding.
/// Normals, colours and names are ignored.
fn parse_text<T: FromFile>(bytes: &[u8]) -> Result<(Vec<T>, Option<String>), Fault> {
    let mut rounding = Rounding::<T>::default();
    let mut triangles = Vec::new();
    let mut corners: Vec<DVec3> = Vec::new();
    let mut rest = bytes;
    let mut line = 0;
    let mut inside = false;
    while let Some(text) = text::line(&mut rest) {
        line += 1;
        if is_comment(text) {
            continue;
        }
        let fault = |message: String| Fault::in_line(line, message);
        let text = String::from_utf8_lossy(text).to_ascii_lowercase();
        // A line may have several keywords, because STL knows only words.
        let mut words = text.split_whitespace().peekable();
        while let Some(word) = words.next() {
            let part = if word == "end" { words.next().unwrap_or_default() } else { word };
            match (word, part) {
                ("vertex", _) => {
                    let found: Vec<&str> = words.by_ref().take(3).collect();
                    corners.push(corner(&found, &mut rounding).ok_or_else(|| {
                        let found = found.join(" ");
                        fault(format!("vertex `{found}`; expected three finite numbers"))
                    })?);
                    if corners.len() > 3 {
                        return Err(fault("a fourth vertex in a loop; expected three".into()));
                    }
                }
                // The end of a facet closes a loop as well, because some programs omit `endloop`.
                ("endloop" | "endfacet", _) | ("end", "loop" | "facet") => {
                    match *corners {
                        [] => {}
                        [a, b, c] => triangles.push(T::of([a, b, c])),
                        _ => {
                            let count = corners.len();
                            return Err(fault(format!(
                                "a loop of {count} vertices; expected three"
                            )));
                        }
                    }
                    corners.clear();
                    inside &= part.ends_with("loop");
                }
                ("facet" | "color", _) => {
                    inside |= word == "facet";
                    while words.next_if(|word| !KEYWORDS.contains(word)).is_some() {}
                }
                ("outer", _) => {
                    words.next_if(|word| *word == "loop");
                }
                // A name follows, up to the end of the line or, if all is in one line, to a facet.
                ("solid", _) | ("end", "solid") => skip_name(&mut words),
                (word, _) if word.starts_with("endsolid") => skip_name(&mut words),
                _ => {
                    let expected = "expected a keyword of an STL file, such as facet or vertex";
                    return Err(fault(format!("`{word}`; {expected}")));
                }
            }
        }
    }
    if inside || !corners.is_empty() {
        let message = "the file ends in a facet; expected `endfacet`";
        return Err(Fault::in_line(line, message));
    }
    let remark = rounding.remark(&triangles);
    Ok((triangles, remark))
}

fn skip_name(words: &mut Peekable<SplitWhitespace>) {
    let is_name = |rest: &Peekable<SplitWhitespace>| !rest.clone().take(2).eq(["facet", "normal"]);
    while is_name(words) && words.next().is_some() {}
}

fn corner<T: FromFile>(words: &[&str], rounding: &mut Rounding<T>) -> Option<DVec3> {
    let &[x, y, z] = words else { return None };
    let mut number = |word: &str| text::number(word.as_bytes(), rounding);
    let corner = DVec3::new(number(x)?, number(y)?, number(z)?);
    corner.is_finite().then_some(corner)
}
