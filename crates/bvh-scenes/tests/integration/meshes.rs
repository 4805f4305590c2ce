//! Mesh files of every format give the same triangles, and any bytes give a mesh or an error that
//! names its place.

use base64::Engine as _;
use bvh_core::Triangle;
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{Format, MeshError, load, parse};
use bvh_scenes::{ReadError, Scene};
use glam::Vec3;
use proptest::prelude::*;
use std::path::Path;

const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]];
const FACES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn square() -> Vec<Triangle> {
    Triangle::from_mesh(&CORNERS, &FACES).unwrap()
}

fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect()
}

fn ply_text() -> Vec<u8> {
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

fn ply_binary(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\n\
         element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 2\nproperty list uchar uint vertex_index\nend_header\n"
    )
    .into_bytes();
    let word = |x: u32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
    bytes.extend(
        CORNERS
            .as_flattened()
            .iter()
            .flat_map(|x| word(x.to_bits())),
    );
    for face in FACES {
        bytes.push(3);
        bytes.extend(face.into_iter().flat_map(word));
    }
    bytes
}

fn stl_text() -> Vec<u8> {
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

fn stl_binary() -> Vec<u8> {
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

/// Returns the JSON of a scene over a buffer of four positions and of the indices of two triangles,
/// `u16`.
fn gltf_json(uri: &str, nodes: &str, primitive: &str) -> String {
    let uri = if uri.is_empty() { String::new() } else { format!(r#""uri": "{uri}", "#) };
    format!(
        r#"{{"asset": {{"version": "2.0"}},
        "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}{primitive}}}]}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
              "min": [0, 0, 0], "max": [1, 1, 1]}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}],
        "bufferViews": [
            {{"buffer": 0, "byteLength": 48}},
            {{"buffer": 0, "byteOffset": 48, "byteLength": 12}}],
        "buffers": [{{{uri}"byteLength": 60}}]}}"#
    )
}

const INDEXED: &str = r#", "indices": 1"#;

fn buffer() -> Vec<u8> {
    let indices = FACES
        .as_flattened()
        .iter()
        .flat_map(|&index| (index as u16).to_le_bytes());
    floats(CORNERS.as_flattened().iter().copied())
        .into_iter()
        .chain(indices)
        .collect()
}

fn data_uri() -> String {
    format!(
        "data:application/octet-stream;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(buffer())
    )
}

fn gltf(nodes: &str, primitive: &str) -> Vec<u8> {
    gltf_json(&data_uri(), nodes, primitive).into_bytes()
}

fn glb() -> Vec<u8> {
    crate::glb::glb(gltf_json("", r#"{"mesh": 0}"#, INDEXED), &buffer())
}

/// Returns files of a square in every format.
fn samples() -> [(&'static str, Format, Vec<u8>); 8] {
    let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0.5\nf 1 2 3 4\n".to_vec();
    [
        ("square.obj", Format::Obj, obj),
        ("text.ply", Format::Ply, ply_text()),
        ("little.ply", Format::Ply, ply_binary(false)),
        ("big.ply", Format::Ply, ply_binary(true)),
        ("text.stl", Format::Stl, stl_text()),
        ("binary.stl", Format::Stl, stl_binary()),
        ("square.gltf", Format::Gltf, gltf(r#"{"mesh": 0}"#, INDEXED)),
        ("square.glb", Format::Gltf, glb()),
    ]
}

fn error(bytes: impl AsRef<[u8]>, name: &str) -> String {
    parse(bytes.as_ref(), Path::new(name))
        .unwrap_err()
        .to_string()
}

/// Replaces the first occurrence of a text.
fn with(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let start = bytes
        .windows(from.len())
        .position(|window| window == from.as_bytes())
        .expect(from);
    [&bytes[..start], to.as_bytes(), &bytes[start + from.len()..]].concat()
}

#[test]
fn every_format_gives_the_same_triangles_under_any_file_name() {
    for (name, format, bytes) in samples() {
        for name in [name, "scene.obj", "scene.stl", "scene"] {
            if format == Format::Obj && name == "scene.stl" {
                continue; // OBJ has no signature.
            }
            assert_eq!(Format::of(&bytes, Path::new(name)), format);
            assert_eq!(parse(&bytes, Path::new(name)).unwrap(), Mesh::new(square()), "{name}");
        }
    }
}

#[test]
fn text_formats_may_begin_with_a_byte_order_mark() {
    for (name, _, bytes) in samples() {
        if ["square.obj", "text.stl", "square.gltf"].contains(&name) {
            let marked = [b"\xef\xbb\xbf", &bytes[..]].concat();
            assert_eq!(parse(&marked, Path::new(name)).unwrap(), Mesh::new(square()), "{name}");
        }
    }
    let wrong =
        [b"\xef\xbb\xbf", &with(&stl_text(), "vertex 1 0e0 0\r", "vertex 1 0\r")[..]].concat();
    assert!(error(wrong, "a.stl").starts_with("a.stl:5: "));
}

#[test]
fn the_path_of_a_mesh_file_names_a_scene_and_a_missing_file_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _, bytes) in samples() {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let scene = Scene::load(path.to_str().unwrap()).unwrap();
        assert_eq!(
            (scene.triangles().unwrap(), name.starts_with(&scene.name)),
            (&square()[..], true)
        );
    }
    for missing in ["none.ply", "none.obj", "folder/none"] {
        let message = Scene::load(missing).unwrap_err().to_string();
        assert!(message.contains(&format!("{missing}: no such file")), "{message}");
    }
    assert!(matches!(load(folder.path()), Err(MeshError::Read(ReadError::Folder { .. }))));
    #[cfg(unix)]
    assert!(matches!(
        load(Path::new("/dev/zero")),
        Err(MeshError::Read(ReadError::NotRegular { .. }))
    ));
    assert!(matches!(parse(b" \r\n", Path::new("a.ply")), Err(MeshError::Empty(_))));
}

#[test]
fn nodes_move_their_meshes_and_their_children() {
    let nodes = r#"{"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [2, 2, 2]},
        {"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]}"#;
    let mesh = parse(&gltf(nodes, INDEXED), Path::new("a.gltf")).unwrap();
    let mut expected = Vec::new();
    for triangle in square() {
        expected.push(Triangle(triangle.0.map(|p| p * 2.0 + Vec3::X * 10.0)));
    }
    for triangle in square() {
        expected.push(Triangle(
            triangle
                .0
                .map(|p| Vec3::new(10.0 - p.y, p.x, p.z + 5.0)),
        ));
    }
    assert_eq!(mesh.triangles, expected);
}

#[test]
fn strips_fans_and_lists_without_indices_are_triangles_and_lines_are_not() {
    for (mode, triangles) in
        [(5, &[[0, 1, 2], [1, 3, 2]][..]), (6, &[[0, 1, 2], [0, 2, 3]]), (4, &[[0, 1, 2]])]
    {
        let file = gltf(r#"{"mesh": 0}"#, &format!(r#", "mode": {mode}"#));
        let mesh = parse(&file, Path::new("a.gltf")).unwrap();
        assert_eq!(mesh.triangles, Triangle::from_mesh(&CORNERS, triangles).unwrap(), "{mode}");
    }
    let lines = gltf(r#"{"mesh": 0}"#, r#", "mode": 1"#);
    assert!(error(lines, "a.gltf").contains("no triangle"));
}

#[test]
fn buffers_are_files_in_the_folder_of_the_file_that_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, gltf_json("my%20buffer.bin", r#"{"mesh": 0}"#, INDEXED)).unwrap();
    let missing = load(&path).unwrap_err().to_string();
    assert!(
        missing.contains("buffers[0]") && missing.contains("my buffer.bin: no such file"),
        "{missing}"
    );
    std::fs::write(folder.path().join("my buffer.bin"), buffer()).unwrap();
    assert_eq!(load(&path).unwrap().triangles, square());
    std::fs::write(folder.path().join("my buffer.bin"), &buffer()[..50]).unwrap();
    let short = load(&path).unwrap_err().to_string();
    assert!(short.contains("buffers[0]: 50 bytes; expected 60"), "{short}");
    let remote = error(gltf_json("http://example.org/a.bin", r#"{"mesh": 0}"#, INDEXED), "a.gltf");
    assert!(remote.contains("a file in this folder"), "{remote}");
}

#[test]
fn a_fault_is_named_with_its_line_or_element_and_what_would_be_accepted() {
    let ply = ply_text();
    let stl = stl_text();
    let node = r#"{"mesh": 0}"#;
    let json = String::from_utf8(gltf(node, INDEXED)).unwrap();
    let change = |from: &str, to: &str| with(json.as_bytes(), from, to);
    let mut nan = stl_binary();
    nan[84 + 50 + 20..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let cases: [(Vec<u8>, &str, &[&str]); 22] = [
        (with(&ply, "1 1 0.5", "1 nan 0.5"), "a.ply", &["a.ply:14: ", "nan"]),
        (with(&ply, "1 1 0.5", "1 1e99 0.5"), "a.ply", &["vertex 2", "inf"]),
        (with(&ply, "1 1 0.5", "1 one 0.5"), "a.ply", &["a.ply:14: ", "one"]),
        (with(&ply, "4 0 1 2 3", "4 0 1 2 4"), "a.ply", &["face 0", "vertex 4", "below 4"]),
        (with(&ply, "4 0 1 2 3", "4 0 1 2 -1"), "a.ply", &["face 0", "vertex -1"]),
        (with(&ply, "4 0 1 2 3", "2 0 1"), "a.ply", &["4 vertices and 0 triangles"]),
        (with(&ply, "property float x", "property float u"), "a.ply", &["vertex 0", "NaN"]),
        (
            with(&ply, "element vertex 4", "element vertex 4000000000"),
            "a.ply",
            &["element vertex", "room for"],
        ),
        (with(&ply, "format ascii", "format octal"), "a.ply", &["a.ply:2: "]),
        (ply_binary(false)[..190].to_vec(), "a.ply", &["a.ply: element vertex"]),
        (
            with(&stl, "vertex 1 0e0 0\r", "vertex 1 0 inf\r"),
            "a.stl",
            &["a.stl:5: ", "`1 0 inf`", "three finite"],
        ),
        (with(&stl, "vertex 1 0e0 0\r", "vertex 1 0\r"), "a.stl", &["a.stl:5: ", "`1 0`"]),
        (with(&stl, "   vertex 1 0e0 0\r\n", ""), "a.stl", &["a.stl:6: ", "2 vertices"]),
        (
            with(&stl, "endfacet\r\nendsolid\r\nsolid\r", "vertecks\r"),
            "a.stl",
            &["a.stl:8: ", "`vertecks`"],
        ),
        (nan, "a.stl", &["a.stl: facet 1", "NaN"]),
        (stl_binary()[..150].to_vec(), "a.stl", &["1 whole facets", "expected the 2", "cut"]),
        (change(r#""mesh": 0"#, r#""mesh": 7"#), "a.gltf", &["a.gltf: nodes[0]: no meshes[7]"]),
        (
            change(r#""count": 6"#, r#""count": 7"#),
            "a.gltf",
            &["meshes[0].primitives[0] at nodes[0]", "accessors[1]", "7 items"],
        ),
        (change(r#""byteOffset": 48"#, r#""byteOffset": 46"#), "a.gltf", &["index", "below 4"]),
        (change("5126", "5123"), "a.gltf", &["accessors[0]", "F32"]),
        (
            change(r#""byteLength": 60"#, r#""byteLength": 61"#),
            "a.gltf",
            &["buffers[0]: 60 bytes; expected 61"],
        ),
        (json.as_bytes()[..200].to_vec(), "a.gltf", &["a.gltf: ", "EOF"]),
    ];
    for (bytes, name, parts) in cases {
        let message = error(bytes, name);
        for part in parts {
            assert!(message.contains(part), "{part}: {message}");
        }
        assert!(message.len() < 400 && !message.contains('\n'), "{message}");
    }
}

#[test]
fn malicious_files_are_rejected() {
    let node = r#"{"mesh": 0}"#;
    for cycle in [
        r#"{"children": [1]}, {"children": [0], "mesh": 0}"#,
        r#"{"children": [0], "mesh": 0}"#,
        r#"{"children": [1, 1]}, {"mesh": 0}"#,
    ] {
        assert!(error(gltf(cycle, INDEXED), "a.gltf").contains("reached twice"), "{cycle}");
    }
    let json = gltf(node, INDEXED);
    let beyond = "18446744073709551615";
    for (from, to) in [
        (r#""byteOffset": 48"#, format!(r#""byteOffset": {beyond}"#)),
        (r#""count": 4"#, format!(r#""count": {beyond}"#)),
        (
            r#""buffer": 0, "byteLength": 48"#,
            r#""buffer": 0, "byteStride": 4, "byteLength": 48"#.to_string(),
        ),
        (r#""byteLength": 60"#, format!(r#""byteLength": {beyond}"#)),
    ] {
        error(with(&json, from, &to), "a.gltf");
    }
    for length in [0, 1, u32::MAX - 3, u32::MAX] {
        let mut bytes = glb();
        bytes[12..16].copy_from_slice(&length.to_le_bytes());
        error(bytes, "a.glb");
    }
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    error(format!(r#"{{"asset": {deep}}}"#), "a.gltf");
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 90000000000\nend_header\n";
    assert!(error(header, "a.ply").contains("room for"));
    // The length of the list is 2³² − 1.
    let list = "ply\nformat binary_little_endian 1.0\nelement face 1\n\
                property list uint int vertex_indices\nend_header\n";
    error([list.as_bytes(), &[255; 8]].concat(), "a.ply");
    let mut stl = stl_binary();
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(error(stl, "a.stl").contains("4294967295"));
}

#[test]
fn cut_files_give_a_mesh_or_an_error() {
    for (name, _, bytes) in samples() {
        for length in 0..bytes.len() {
            check(&bytes[..length], name);
        }
    }
}

/// Asserts that the bytes give an error, or a mesh with triangles that are all finite.
fn check(bytes: &[u8], name: &str) {
    if let Ok(mesh) = parse(bytes, Path::new(name)) {
        assert!(!mesh.triangles.is_empty());
        assert!(
            mesh.triangles
                .iter()
                .flat_map(|t| t.0)
                .all(|corner| corner.is_finite())
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn damaged_files_give_a_mesh_or_an_error(
        which in 0usize..8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
        digits in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 0..5),
    ) {
        let (name, _, original) = samples()[which].clone();
        let mut bytes = original.clone();
        for (place, byte) in changes {
            bytes[place.index(original.len())] = byte;
        }
        check(&bytes, name);
        // Wrong digits leave a file well formed, so that deeper checks see its numbers.
        let mut bytes = original;
        let numbers: Vec<usize> =
            (0..bytes.len()).filter(|&index| bytes[index].is_ascii_digit()).collect();
        for (place, digit) in digits.iter().filter(|_| !numbers.is_empty()) {
            bytes[numbers[place.index(numbers.len())]] = *digit;
        }
        check(&bytes, name);
    }
}
