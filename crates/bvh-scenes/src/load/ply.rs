//! Triangles from PLY files, of text or binary, as `ply-rs-bw` reads them.

use super::mesh::{Fault, MOST_TRIANGLES, Mesh, Place};
use bvh_core::Triangle;
use glam::Vec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult,
};
use std::path::Path;

/// A position; NaN where the file has none.
struct Vertex([f32; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f32::NAN; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"]
            .iter()
            .position(|axis| *axis == name)
        else {
            return PropertyAccessResult::Ignored;
        };
        match property.to_f32_lossy() {
            Some(coordinate) => self.0[axis] = coordinate,
            None => return PropertyAccessResult::UnsupportedType,
        }
        PropertyAccessResult::Set
    }
}

/// The positions' indices of one polygon.
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

/// An element that is neither.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// Reads the bytes of a PLY file; `path` only names it in errors.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Other>::new()
        .read_header(&mut reader)
        .map_err(|error| told(path, None, &error))?;
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for element in header.elements.values() {
        let place = || Place::Element(format!("element {}", element.name));
        // Every element has a byte or a line at least; without this a header of a line could ask for endless memory.
        if element.properties.is_empty() || element.count > bytes.len() {
            let found = format!(
                "{} of {} properties in a file of {} bytes",
                element.count,
                element.properties.len(),
                bytes.len()
            );
            return Err(Fault::new(
                path,
                place(),
                format!("{found}; expected no more than it has room for"),
            ));
        }
        match element.name.as_str() {
            "vertex" => vertices = elements::<Vertex>(&mut reader, element, &header, path)?,
            "face" => faces = elements::<Face>(&mut reader, element, &header, path)?,
            _ => drop(elements::<Other>(&mut reader, element, &header, path)?),
        }
    }
    mesh(&vertices, &faces, path)
}

/// All elements of one kind.
fn elements<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
    path: &Path,
) -> Result<Vec<E>, Fault> {
    let told = |error| told(path, Some((element, header)), &error);
    Parser::<E>::new()
        .read_payload_for_element(reader, element, header)
        .map_err(told)
}

/// The library's error: with its line where there are lines, else with its element.
fn told(path: &Path, within: Option<(&ElementDef, &Header)>, error: &ParseError) -> Fault {
    let place = match (within, error.line()) {
        (Some((element, header)), _) if header.encoding != Encoding::Ascii => {
            Place::Element(format!("element {}", element.name))
        }
        (_, Some(line)) => Place::Line(line),
        _ => Place::File,
    };
    let message = error.to_string();
    let message = error
        .line()
        .and_then(|line| message.strip_prefix(&format!("Line {line}: ")))
        .unwrap_or(&message);
    Fault::new(path, place, message)
}

/// The fans of all faces.
fn mesh(vertices: &[Vertex], faces: &[Face], path: &Path) -> Result<Mesh, Fault> {
    let fault = |element, number: usize, message| {
        Err(Fault::new(
            path,
            Place::Element(format!("{element} {number}, counted from 0")),
            message,
        ))
    };
    if let Some((number, Vertex(found))) = vertices
        .iter()
        .enumerate()
        .find(|(_, Vertex(position))| position.iter().any(|x| !x.is_finite()))
    {
        return fault("vertex", number, format!("position {found:?}; expected finite x, y and z"));
    }
    let mut used = vec![false; vertices.len()];
    let mut triangles = Vec::new();
    let mut short_faces = 0;
    for (number, Face(indices)) in faces.iter().enumerate() {
        let mut corners = Vec::with_capacity(indices.len());
        for &index in indices {
            let Some(Vertex(position)) = usize::try_from(index)
                .ok()
                .and_then(|index| vertices.get(index))
            else {
                return fault(
                    "face",
                    number,
                    format!("vertex {index}; expected 0 to below {}", vertices.len()),
                );
            };
            corners.push(Vec3::from(*position));
        }
        let [first, rest @ ..] = &corners[..] else {
            short_faces += 1;
            continue;
        };
        short_faces += usize::from(rest.len() < 2);
        if rest.len() >= 2 {
            indices
                .iter()
                .for_each(|&index| used[index as usize] = true);
        }
        triangles.extend(
            rest.windows(2)
                .map(|pair| Triangle([*first, pair[0], pair[1]])),
        );
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
