//! Triangles from STL files, text or binary.
//!
//! This module does not use `stl_io` 0.11, because `stl_io` stops after the first of several
//! solids, mistakes `solid` without a name for a binary file, and names no line.

use super::mesh::{Fault, Mesh, Place};
use super::without_mark;
use bvh_core::Triangle;
use glam::Vec3;
use std::path::Path;

/// The number of bytes before the triangles of a binary file: a comment of 80 bytes, and the number
/// of triangles.
const HEADER: usize = 84;
/// The number of bytes of a triangle: a normal, three corners, and two bytes without a meaning.
const FACET: usize = 50;

fn promised(bytes: &[u8]) -> Option<usize> {
    Some(u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?) as usize)
}

/// Returns whether the number of bytes matches the header of a binary file.
pub fn is_binary(bytes: &[u8]) -> bool {
    // The first bytes do not decide, because the comment of a binary file may begin with `solid`.
    promised(bytes).is_some_and(|facets| facets > 0 && bytes.len() == HEADER + FACET * facets)
}

/// Returns whether text begins like an STL file: with `solid`, and a facet within 4096 bytes.
pub fn is_text(text: &[u8]) -> bool {
    let mut words =
        text[..text.len().min(4096)].split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && words.any(|word| {
            word.eq_ignore_ascii_case(b"facet") || word.eq_ignore_ascii_case(b"endsolid")
        })
}

/// Reads the bytes of an STL file; `path` only names it in errors.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let text = without_mark(bytes);
    let is_text = !is_binary(bytes) && is_text(text.trim_ascii_start());
    let triangles = if is_text { parse_text(text, path)? } else { parse_binary(bytes, path)? };
    if triangles.is_empty() {
        let message = "no facet; expected an STL file with at least one";
        return Err(Fault::new(path, Place::File, message));
    }
    Ok(Mesh::new(triangles))
}

/// Reads the triangles that the header promises. Bytes after them are ignored, because some programs
/// append their own data.
fn parse_binary(bytes: &[u8], path: &Path) -> Result<Vec<Triangle>, Fault> {
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
    let mut triangles = Vec::new();
    for (number, facet) in body.take(facets).enumerate() {
        // The normal in the first 12 bytes is ignored: many programs write zeros there.
        let (words, _) = facet[12..48].as_chunks();
        let corners: [f32; 9] = std::array::from_fn(|i| f32::from_le_bytes(words[i]));
        if let Some(found) = corners.iter().find(|x| !x.is_finite()) {
            let place = Place::Element(format!("facet {number}, counted from 0"));
            let message = format!("coordinate {found}; expected a finite number");
            return Err(Fault::new(path, place, message));
        }
        triangles.push(Triangle::from(corners));
    }
    Ok(triangles)
}

/// Reads the corners of every loop, three at a time. Normals and names are ignored.
fn parse_text(bytes: &[u8], path: &Path) -> Result<Vec<Triangle>, Fault> {
    let mut triangles = Vec::new();
    let mut corners: Vec<Vec3> = Vec::new();
    let mut line = 0;
    let mut inside = false;
    for text in bytes.split(|&byte| byte == b'\n') {
        line += 1;
        let place = Place::Line(line);
        let text = String::from_utf8_lossy(text);
        // A line may have several keywords, because STL knows only words.
        let mut words = text.split_whitespace().peekable();
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                "vertex" => {
                    let found: Vec<&str> = words.by_ref().take(3).collect();
                    corners.push(corner(&found).ok_or_else(|| {
                        let found = found.join(" ");
                        let message = format!("vertex `{found}`; expected three finite numbers");
                        Fault::new(path, place.clone(), message)
                    })?);
                    if corners.len() > 3 {
                        let message = "a fourth vertex in a loop; expected three";
                        return Err(Fault::new(path, place, message));
                    }
                }
                keyword @ ("endloop" | "endfacet") => {
                    // `endfacet` closes a loop as well, because some programs omit `endloop`.
                    match *corners {
                        [] => {}
                        [a, b, c] => triangles.push(Triangle([a, b, c])),
                        _ => {
                            let count = corners.len();
                            let message = format!("a loop of {count} vertices; expected three");
                            return Err(Fault::new(path, place, message));
                        }
                    }
                    corners.clear();
                    inside &= keyword != "endfacet";
                }
                "facet" => {
                    inside = true;
                    words.next_if(|word| word.eq_ignore_ascii_case("normal"));
                    while words.next_if(|word| word.parse::<f32>().is_ok()).is_some() {}
                }
                "outer" => {
                    words.next_if(|word| word.eq_ignore_ascii_case("loop"));
                }
                // A name follows.
                "solid" | "endsolid" => break,
                _ => {
                    let expected = "expected a keyword of an STL file, such as facet or vertex";
                    return Err(Fault::new(path, place, format!("`{word}`; {expected}")));
                }
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

fn corner(words: &[&str]) -> Option<Vec3> {
    let [x, y, z] = words else { return None };
    let corner = Vec3::new(x.parse().ok()?, y.parse().ok()?, z.parse().ok()?);
    corner.is_finite().then_some(corner)
}
