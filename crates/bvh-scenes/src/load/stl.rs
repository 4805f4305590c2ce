//! Triangles from STL files, of text or binary.
//!
//! Read here and not by `stl_io` 0.11, which stops at the first of several solids, takes `solid` without a name for a binary file,
//! and names no line.

use super::mesh::{Fault, Mesh, Place};
use bvh_core::Triangle;
use glam::Vec3;
use std::path::Path;

/// Bytes before the triangles of a binary file: a comment, and the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: a normal, three corners, and two bytes that mean nothing.
const FACET: usize = 50;

/// The number of triangles that a binary file promises.
fn promised(bytes: &[u8]) -> Option<usize> {
    Some(u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?) as usize)
}

/// Whether the bytes are as many as a binary file of so many triangles has, which may well begin with `solid`.
pub fn is_binary(bytes: &[u8]) -> bool {
    promised(bytes).is_some_and(|facets| facets > 0 && bytes.len() == HEADER + FACET * facets)
}

/// Whether text begins as an STL file does: `solid`, and a facet soon.
pub fn is_text(text: &[u8]) -> bool {
    let mut words = text[..text.len().min(4096)]
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty());
    words
        .next()
        .is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && words.any(|word| {
            word.eq_ignore_ascii_case(b"facet") || word.eq_ignore_ascii_case(b"endsolid")
        })
}

/// Reads the bytes of an STL file; `path` only names it in errors.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let text = bytes
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(bytes);
    let is_text = !is_binary(bytes) && is_text(text.trim_ascii_start());
    let triangles = if is_text { of_text(text, path)? } else { of_binary(bytes, path)? };
    match triangles.is_empty() {
        true => {
            Err(Fault::new(path, Place::File, "no facet; expected an STL file with at least one"))
        }
        false => Ok(Mesh::new(triangles)),
    }
}

fn of_binary(bytes: &[u8], path: &Path) -> Result<Vec<Triangle>, Fault> {
    let facets = promised(bytes).ok_or_else(|| {
        let message =
            format!("{} bytes; expected the {HEADER} of a binary STL file's header", bytes.len());
        Fault::new(path, Place::File, message)
    })?;
    let body = bytes[HEADER..].chunks_exact(FACET);
    if body.len() < facets {
        let message = format!(
            "{} whole facets; expected the {facets} of the header: the file was cut",
            body.len()
        );
        return Err(Fault::new(path, Place::File, message));
    }
    let triangle = |(number, facet): (usize, &[u8])| {
        let (words, _) = facet[12..48].as_chunks();
        let corners: [f32; 9] = std::array::from_fn(|at| f32::from_le_bytes(words[at]));
        match corners.iter().find(|x| !x.is_finite()) {
            None => Ok(Triangle::from(corners)),
            Some(found) => {
                let place = Place::Element(format!("facet {number}, counted from 0"));
                Err(Fault::new(
                    path,
                    place,
                    format!("coordinate {found}; expected a finite number"),
                ))
            }
        }
    };
    body.take(facets)
        .enumerate()
        .map(triangle)
        .collect()
}

/// The corners of every loop, three at a time. All keywords but `vertex` and `endloop` are passed over.
fn of_text(bytes: &[u8], path: &Path) -> Result<Vec<Triangle>, Fault> {
    let mut triangles = Vec::new();
    let mut corners: Vec<Vec3> = Vec::new();
    let mut line = 0;
    let mut inside = false;
    for text in bytes.split(|&byte| byte == b'\n') {
        line += 1;
        let fault = |message: String| Err(Fault::new(path, Place::Line(line), message));
        let text = String::from_utf8_lossy(text);
        let mut words = text.split_whitespace();
        match words
            .next()
            .map(str::to_ascii_lowercase)
            .as_deref()
        {
            Some("vertex") => {
                let found: Vec<&str> = words.collect();
                let numbers: Vec<f32> = found
                    .iter()
                    .filter_map(|word| word.parse().ok())
                    .filter(|x: &f32| x.is_finite())
                    .collect();
                match *numbers {
                    [x, y, z] if found.len() == 3 => corners.push(Vec3::new(x, y, z)),
                    _ => {
                        return fault(format!(
                            "vertex `{}`; expected three finite numbers",
                            found.join(" ")
                        ));
                    }
                }
                if corners.len() > 3 {
                    return fault("a fourth vertex in a loop; expected three".into());
                }
            }
            Some("endloop" | "endfacet") if !corners.is_empty() => match *corners {
                [a, b, c] => {
                    triangles.push(Triangle([a, b, c]));
                    corners.clear();
                }
                _ => return fault(format!("a loop of {} vertices; expected three", corners.len())),
            },
            Some("facet") => inside = true,
            Some("endfacet") => inside = false,
            Some("solid" | "endsolid" | "outer" | "endloop") | None => {}
            Some(word) => {
                let expected = "expected a keyword of an STL file, such as facet or vertex";
                return fault(format!("`{word}`; {expected}"));
            }
        }
    }
    if inside || !corners.is_empty() {
        return Err(Fault::new(
            path,
            Place::Line(line),
            "the file ends in a facet; expected `endfacet`",
        ));
    }
    Ok(triangles)
}
