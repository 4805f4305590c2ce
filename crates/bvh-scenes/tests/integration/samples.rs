//! Files of a square in every format.

use base64::Engine as _;
use bvh_core::Triangle;
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{Format, MeshError, parse};
use std::path::Path;

pub const CORNERS: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]];
pub const FACES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

pub fn square() -> Vec<Triangle> {
    Triangle::from_mesh(&CORNERS, &FACES).unwrap()
}

pub fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

pub fn ply_text() -> Vec<u8> {
    let mut text = "ply\nformat ascii 1.0\ncomment a square\n\
                    element vertex 4\nproperty float x\nproperty double y\nproperty float z\n\
                    property uchar red\n\
                    element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_string();
    for [x, y, z] in CORNERS {
        text += &format!("{x} {y} {z} 255\n");
    }
    (text + "4 0 1 2 3\n").into_bytes()
}

pub fn ply_binary(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\n\
         element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 2\nproperty list uchar uint vertex_index\nend_header\n"
    )
    .into_bytes();
    let word = |x: u32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
    bytes.extend(CORNERS.as_flattened().iter().flat_map(|x| word(x.to_bits())));
    for face in FACES {
        bytes.push(3);
        bytes.extend(face.into_iter().flat_map(word));
    }
    bytes
}

pub fn stl_text() -> Vec<u8> {
    let mut text = String::new();
    // A file may have several solids, and a solid may have no name.
    for (solid, triangle) in ["solid a square", "solid"].iter().zip(square()) {
        text += &format!("{solid}\r\n facet normal 0 0 1\r\n  outer loop\r\n");
        for corner in triangle.0 {
            text += &format!("   vertex {} {:e} {}\r\n", corner.x, corner.y, corner.z);
        }
        text += "  endloop\r\n endfacet\r\nendsolid\r\n";
    }
    text.into_bytes()
}

pub fn stl_binary() -> Vec<u8> {
    let mut bytes = b"solid of a program that knows no better".to_vec();
    bytes.resize(80, b' ');
    bytes.extend(2u32.to_le_bytes());
    for triangle in square() {
        bytes.extend(floats([0.0; 3]));
        bytes.extend(floats(triangle.0.iter().flat_map(|p| p.to_array())));
        bytes.extend([7, 7]);
    }
    bytes
}

/// A scene over a buffer of four positions and of the indices of two triangles, `u16`.
pub const GLTF: &str = r#"{"asset": {"version": "2.0"},
    "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
         "min": [0, 0, 0], "max": [1, 1, 1]},
        {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
    "bufferViews": [
        {"buffer": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
    "buffers": [{"byteLength": 60}]}"#;

/// Returns the JSON of the scene whose buffer is at this URI.
pub fn gltf_json(uri: &str) -> String {
    GLTF.replace(r#"{"byteLength": 60}"#, &format!(r#"{{"uri": "{uri}", "byteLength": 60}}"#))
}

pub fn buffer() -> Vec<u8> {
    let indices = FACES.as_flattened().iter().flat_map(|&index| (index as u16).to_le_bytes());
    floats(CORNERS.as_flattened().iter().copied()).into_iter().chain(indices).collect()
}

pub fn data_uri() -> String {
    format!(
        "data:application/octet-stream;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(buffer())
    )
}

pub fn gltf() -> Vec<u8> {
    gltf_json(&data_uri()).into_bytes()
}

pub fn glb() -> Vec<u8> {
    crate::glb::glb(GLTF.to_owned(), &buffer())
}

/// Returns files of a square in every format.
pub fn samples() -> [(&'static str, Format, Vec<u8>); 8] {
    let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0.5\nf 1 2 3 4\n".to_vec();
    [
        ("square.obj", Format::Obj, obj),
        ("text.ply", Format::Ply, ply_text()),
        ("little.ply", Format::Ply, ply_binary(false)),
        ("big.ply", Format::Ply, ply_binary(true)),
        ("text.stl", Format::Stl, stl_text()),
        ("binary.stl", Format::Stl, stl_binary()),
        ("square.gltf", Format::Gltf, gltf()),
        ("square.glb", Format::Gltf, glb()),
    ]
}

/// Reads the bytes of a file with this name.
pub fn read(bytes: impl AsRef<[u8]>, name: &str) -> Result<Mesh, MeshError> {
    parse(bytes.as_ref(), Path::new(name))
}

pub fn error(bytes: impl AsRef<[u8]>, name: &str) -> String {
    read(bytes, name).unwrap_err().to_string()
}

/// Replaces the first occurrence of a text.
pub fn with(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    replaced(bytes, from.as_bytes(), to.as_bytes(), 1)
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8], most: usize) -> Vec<u8> {
    let mut changed = Vec::new();
    let (mut rest, mut count) = (bytes, 0);
    while count < most
        && let Some(start) = rest.windows(from.len()).position(|window| window == from)
    {
        changed.extend([&rest[..start], to].concat());
        rest = &rest[start + from.len()..];
        count += 1;
    }
    assert!(count > 0, "no {}", from.escape_ascii());
    [&changed, rest].concat()
}

/// Returns the bytes of a text in which `\n`, `\r` and `\xe9` stand for bytes.
fn raw(text: &str) -> Vec<u8> {
    let mut words = text.split('\\');
    let mut bytes = words.next().unwrap().as_bytes().to_vec();
    for word in words {
        let (byte, length) = match word.as_bytes() {
            [b'n', ..] => (b'\n', 1),
            [b'r', ..] => (b'\r', 1),
            _ => (u8::from_str_radix(&word[1..3], 16).unwrap(), 3),
        };
        bytes.push(byte);
        bytes.extend_from_slice(&word.as_bytes()[length..]);
    }
    bytes
}

/// Reads a table with one line for each changed file: `from → to | remark` if it is read, or
/// `from → to ! words | words` if it is at fault. The first occurrence of `from` becomes `to`, or
/// every occurrence with `⇒`; several changes are joined by `&`. Returns the line, the bytes of the
/// file, whether it is at fault, and the words.
pub fn changes<'a>(
    file: &[u8],
    table: &'a str,
) -> impl Iterator<Item = (&'a str, Vec<u8>, bool, Vec<&'a str>)> {
    table.lines().filter(|line| !line.is_empty()).map(|line| {
        let fault = line.split_once(" !");
        let (changes, words) = fault.or_else(|| line.split_once(" |")).expect(line);
        let mut bytes = file.to_vec();
        for change in changes.split(" & ") {
            let most = if change.contains(" ⇒") { usize::MAX } else { 1 };
            let (from, to) = change.split_once([" →", " ⇒"][usize::from(most > 1)]).expect(line);
            bytes = replaced(&bytes, &raw(from), &raw(to.strip_prefix(' ').unwrap_or(to)), most);
        }
        (line, bytes, fault.is_some(), words.split(" |").map(str::trim).collect())
    })
}
