//! Any bytes give a mesh or an error that names its place.

use crate::samples::{
    INDEXED, error, glb, gltf, ply_binary, ply_text, samples, stl_binary, stl_text, with,
};
use bvh_scenes::load::parse;
use proptest::prelude::*;
use std::path::Path;

#[test]
fn a_fault_is_named_with_its_line_or_element_and_what_would_be_accepted() {
    let ply = ply_text();
    let stl = stl_text();
    let node = r#"{"mesh": 0}"#;
    let json = String::from_utf8(gltf(node, INDEXED)).unwrap();
    let change = |from: &str, to: &str| with(json.as_bytes(), from, to);
    let mut nan = stl_binary();
    nan[84 + 50 + 20..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let cases: Vec<(Vec<u8>, &str, &[&str])> = vec![
        (with(&ply, "1 1 0.5", "1 nan 0.5"), "a.ply", &["face 0", "vertex 2 at [1, NaN, 0.5]"]),
        (with(&ply, "1 1 0.5", "1 1e99 0.5"), "a.ply", &["face 0", "vertex 2 at [1, inf, 0.5]"]),
        (with(&ply, "1 1 0.5", "1 one 0.5"), "a.ply", &["a.ply:14: vertex 2", "y: `one`"]),
        (with(&ply, "1 1 0.5", "1 1"), "a.ply", &["a.ply:14: vertex 2", "red: its line ends"]),
        (with(&ply, "1 1 0.5", "1 1 0.5 7"), "a.ply", &["a.ply:14: ", "`255` after its last"]),
        (with(&ply, "4 0 1 2 3", "4 0 1 2 4"), "a.ply", &["face 0", "vertex 4", "below 4"]),
        (with(&ply, "4 0 1 2 3", "4 0 1 2 -1"), "a.ply", &["face 0", "vertex -1"]),
        (with(&ply, "4 0 1 2 3", "-4 0 1 2 3"), "a.ply", &["face 0", "list of length -4"]),
        (with(&ply, "4 0 1 2 3", "4 0 1 2 3.0"), "a.ply", &["a.ply:16: face 0", "`3.0`"]),
        (with(&ply, "4 0 1 2 3", "2 0 1"), "a.ply", &["4 vertices and 0 triangles"]),
        (
            with(&ply, "property float x", "property float u"),
            "a.ply",
            &["element vertex has other properties; expected x, y and z"],
        ),
        (
            with(&ply, "element vertex 4", "element vertex 4000000000"),
            "a.ply",
            &["a.ply:16: vertex 4, counted from 0"],
        ),
        (
            with(&ply, "format ascii", "format octal"),
            "a.ply",
            &["a.ply:2: format `octal`; expected ascii, binary_little"],
        ),
        (with(&ply, "ply\n", "p\0ly\n"), "a.ply", &[r"a.ply:1: `p\x00ly`; expected ply"]),
        (
            with(&ply, "format ascii 1.0", "format ascii 2.0"),
            "a.ply",
            &["a.ply:2: version 2.0; expected 1.0"],
        ),
        (with(&ply, "format ascii 1.0\n", ""), "a.ply", &["no format; expected a line"]),
        (
            with(&ply, "list uchar int", "list float int"),
            "a.ply",
            &["a.ply:10: a length of type float; expected an integer type"],
        ),
        (
            with(&ply, "list uchar int", "list uchar double"),
            "a.ply",
            &["a.ply:10: indices of type double; expected an integer type"],
        ),
        (with(&ply, "list uchar int", "int"), "a.ply", &["`vertex_indices`; expected a list"]),
        (with(&ply, "property float x", "property f x"), "a.ply", &["a.ply:5: type `f`"]),
        (with(&ply, "end_header", "end"), "a.ply", &["a.ply:11: `end`; expected format, comment"]),
        (
            with(&ply, "element face 1", "element vertex 1"),
            "a.ply",
            &["a.ply:9: element `vertex` repeats a name"],
        ),
        (
            with(&ply, "element face 1", &format!("element {} 9000", "face".repeat(1000))),
            "a.ply",
            &["a.ply:16: facefaceface", "…"],
        ),
        (
            with(&stl, "vertex 1 0e0 0\r", "vertex 1 0 0 4\r"),
            "a.stl",
            &["a.stl:5: `4`; expected a keyword"],
        ),
        (
            with(&ply, "property float z", "property float x"),
            "a.ply",
            &["a.ply:7: property `x` repeats a name"],
        ),
        (
            ply_binary(false)[..190].to_vec(),
            "a.ply",
            &["a.ply: vertex 1, counted from 0: z: the file ends"],
        ),
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
        (stl_binary()[..150].to_vec(), "a.stl", &["room for 1 facets; expected the 2"]),
        (change(r#""mesh": 0"#, r#""mesh": 7"#), "a.gltf", &["a.gltf: nodes[0]: no meshes[7]"]),
        (
            change(r#""count": 6"#, r#""count": 7"#),
            "a.gltf",
            &["meshes[0].primitives[0] at nodes[0]", "accessors[1]: bufferViews[1]", "7 items"],
        ),
        (change(r#""byteOffset": 48"#, r#""byteOffset": 46"#), "a.gltf", &["index", "below 4"]),
        (
            change(r#""version": "2.0""#, r#""version": "1.0""#),
            "a.gltf",
            &["a.gltf: asset: version `1.0`; expected 2.0"],
        ),
        (
            change(r#""version": "2.0""#, r#""version": "2.1", "minVersion": "2.1""#),
            "a.gltf",
            &["a.gltf: asset: version `2.1`; expected 2.0"],
        ),
        (
            change(r#""indices": 1"#, r#""indices": 1, "mode": 99"#),
            "a.gltf",
            &["meshes[0].primitives[0] at nodes[0]", "mode 99; expected 0 to 6"],
        ),
        (
            change("5126", "5125"),
            "a.gltf",
            &["accessors[0]: VEC3 of unsigned int; expected VEC3 of float or byte"],
        ),
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
        let message = error(gltf(cycle, INDEXED), "a.gltf");
        assert!(message.contains("expected a tree of nodes"), "{cycle}: {message}");
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
    assert!(error(header, "a.ply").contains("element vertex has other properties"));
    // The length of the list is 2³² − 1.
    let list = "ply\nformat binary_little_endian 1.0\nelement face 1\n\
                property list uint int vertex_indices\nend_header\n";
    error([list.as_bytes(), &[255; 8]].concat(), "a.ply");
    let mut stl = stl_binary();
    stl[80..84].copy_from_slice(&(u32::MAX - 1).to_le_bytes());
    assert!(error(stl, "a.stl").contains("4294967294"));
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
        assert!(mesh.triangles.iter().flat_map(|t| t.0).all(|corner| corner.is_finite()));
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
