//! Triangles from PLY files, text or binary, which `ply-rs-bw` parses.

use super::mesh::{Fault, MOST_TRIANGLES, Mesh, Place};
use super::without_mark;
use bvh_core::Triangle;
use glam::Vec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};
use std::collections::HashSet;
use std::path::Path;

/// A position, with NaN where the file has no coordinate. Elements that are neither vertices nor
/// faces are read as positions, too, and dropped: a type for them would compile the parser again.
struct Vertex([f32; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f32::NAN; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        // A list stays without a coordinate, which only a vertex needs.
        match property.to_f32_lossy() {
            Some(coordinate) => self.0[axis] = coordinate,
            None => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// The indices of one polygon's positions.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(Into::into).collect(),
            Property::ListUChar(list) => list.into_iter().map(Into::into).collect(),
            Property::ListShort(list) => list.into_iter().map(Into::into).collect(),
            Property::ListUShort(list) => list.into_iter().map(Into::into).collect(),
            Property::ListInt(list) => list.into_iter().map(Into::into).collect(),
            Property::ListUInt(list) => list.into_iter().map(Into::into).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Reads the bytes of a PLY file; `path` only names it in errors.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let bytes = without_mark(bytes);
    let mut reader = Reader::new(bytes);
    let header = Parser::<Vertex>::new()
        .read_header(&mut reader)
        .map_err(|error| fault(path, None, &error))?;
    check(&header, path)?;
    check_names(bytes, path)?;
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for element in header.elements.values() {
        // Every element has at least a byte or a line. Without this check a header of one line
        // could ask for any amount of memory.
        if element.properties.is_empty() || element.count > bytes.len() {
            let found = format!(
                "{} of {} properties in a file of {} bytes",
                element.count,
                element.properties.len(),
                bytes.len()
            );
            let message = format!("{found}; expected no more than the file has room for");
            return Err(element_of_header(path, &element.name, message));
        }
        match element.name.as_str() {
            "vertex" => vertices = elements::<Vertex>(&mut reader, element, &header, path)?,
            "face" => faces = elements::<Face>(&mut reader, element, &header, path)?,
            // Other elements must be read as well, because their length is not known in advance.
            _ => drop(elements::<Vertex>(&mut reader, element, &header, path)?),
        }
    }
    mesh(&vertices, &faces, path)
}

/// Rejects a version other than 1.0 and a list whose length has a fraction.
fn check(header: &Header, path: &Path) -> Result<(), Fault> {
    let version = header.version;
    if (version.major, version.minor) != (1, 0) {
        let message = format!("version {version}; expected 1.0");
        return Err(Fault::new(path, Place::Element("format".into()), message));
    }
    for element in header.elements.values() {
        for property in element.properties.values() {
            let PropertyType::List(length, _) = &property.data_type else { continue };
            if matches!(length, ScalarType::Float | ScalarType::Double) {
                let message = format!(
                    "the length of list {} is a {length:?}; expected an integer type",
                    property.name
                );
                return Err(element_of_header(path, &element.name, message));
            }
        }
    }
    Ok(())
}

/// Rejects an element, or a property of an element, that the header declares twice. The parser
/// keeps the last declaration and would read all bytes after it at wrong places.
fn check_names(bytes: &[u8], path: &Path) -> Result<(), Fault> {
    let mut elements = HashSet::new();
    let mut properties = HashSet::new();
    let mut element = String::new();
    for line in bytes.split(|byte| matches!(byte, b'\n' | b'\r')) {
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let is_new = match words[..] {
            ["end_header"] => break,
            ["element", name, ..] => {
                name.clone_into(&mut element);
                properties.clear();
                elements.insert(element.clone())
            }
            ["property", .., name] => properties.insert(name.to_owned()),
            _ => true,
        };
        if !is_new {
            let found = format!("`{}` repeats a name", beginning(&line));
            let message = format!("{found}; expected each name once");
            return Err(element_of_header(path, &element, message));
        }
    }
    Ok(())
}

fn element_of_header(path: &Path, element: &str, message: String) -> Fault {
    Fault::new(path, Place::Element(format!("element {element}")), message)
}

fn elements<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
    path: &Path,
) -> Result<Vec<E>, Fault> {
    Parser::<E>::new()
        .read_payload_for_element(reader, element, header)
        .map_err(|error| fault(path, Some((element, header)), &error))
}

/// Converts the parser's error: with its line if the file has lines, otherwise with its element.
fn fault(path: &Path, within: Option<(&ElementDef, &Header)>, error: &ParseError) -> Fault {
    let place = match (within, error.line()) {
        (Some((element, header)), _) if header.encoding != Encoding::Ascii => {
            Place::Element(format!("element {}", element.name))
        }
        (_, Some(line)) => Place::Line(line),
        _ => Place::File,
    };
    let full = error.to_string();
    // The place already names the line.
    let message =
        error.line().and_then(|line| full.strip_prefix(&format!("Line {line}: "))).unwrap_or(&full);
    // The parser's words for a line that it does not know are those of its grammar.
    let unknown =
        message.split_once("String: ").and_then(|(_, rest)| rest.split_once("\n\tError: "));
    match unknown {
        Some((line, _)) => {
            let message = format!("`{}`; expected a line of a PLY header", beginning(line));
            Fault::new(path, place, message)
        }
        None => Fault::new(path, place, message),
    }
}

fn beginning(line: &str) -> String {
    // Some of the parser's errors quote the line with its end.
    line.trim_matches('\'').trim_end().chars().take(60).flat_map(char::escape_debug).collect()
}

fn element_fault(path: &Path, element: &str, number: usize, message: String) -> Fault {
    Fault::new(path, Place::Element(format!("{element} {number}, counted from 0")), message)
}

fn mesh(vertices: &[Vertex], faces: &[Face], path: &Path) -> Result<Mesh, Fault> {
    if let Some((number, Vertex(found))) = vertices
        .iter()
        .enumerate()
        .find(|(_, Vertex(position))| position.iter().any(|x| !x.is_finite()))
    {
        let message = format!("position {found:?}; expected finite x, y and z");
        return Err(element_fault(path, "vertex", number, message));
    }
    // Unused vertices are reported, because they often show that an export went wrong.
    let mut used = vec![false; vertices.len()];
    let mut triangles = Vec::new();
    let mut short_faces = 0;
    for (number, Face(indices)) in faces.iter().enumerate() {
        let mut corners = Vec::with_capacity(indices.len());
        for &index in indices {
            let Some(Vertex(position)) =
                usize::try_from(index).ok().and_then(|index| vertices.get(index))
            else {
                let message = format!("vertex {index}; expected 0 to below {}", vertices.len());
                return Err(element_fault(path, "face", number, message));
            };
            corners.push(Vec3::from(*position));
        }
        let [first, others @ ..] = &corners[..] else {
            short_faces += 1;
            continue;
        };
        if others.len() < 2 {
            short_faces += 1;
            continue;
        }
        // The loop above has checked every index.
        for &index in indices {
            used[index as usize] = true;
        }
        for pair in others.windows(2) {
            triangles.push(Triangle([*first, pair[0], pair[1]]));
        }
    }
    if triangles.is_empty() || triangles.len() > MOST_TRIANGLES {
        let found = format!("{} vertices and {} triangles", vertices.len(), triangles.len());
        return Err(Fault::new(
            path,
            Place::File,
            format!("{found}; expected 1 to {MOST_TRIANGLES} triangles"),
        ));
    }
    let unused_vertices = used.iter().filter(|used| !**used).count();
    Ok(Mesh { unused_vertices, short_faces, ..Mesh::new(triangles) })
}
