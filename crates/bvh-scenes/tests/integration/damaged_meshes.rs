//! Any bytes give a mesh or an error that names its place.

use crate::samples::{
    INDEXED, NODE, changes, error, glb, gltf, ply_binary, ply_text, samples, stl_binary, stl_text,
    with,
};
use bvh_scenes::load::parse;
use proptest::prelude::*;
use std::path::Path;
use std::time::{Duration, Instant};

const PLY: &str = r"
1 1 0.5 → 1 nan 0.5 | face 0 | vertex 2 at [1, NaN, 0.5]
1 1 0.5 → 1 1e99 0.5 | face 0 | vertex 2 at [1, inf, 0.5]
1 1 0.5 → 1 one 0.5 | a.ply:14: vertex 2 | y: `one`
1 1 0.5 → 1 1 | a.ply:14: vertex 2 | red: its line ends
1 1 0.5 → 1 1 0.5 7 | a.ply:14: | `255` after its last
4 0 1 2 3 → 4 0 1 2 4 | face 0 | vertex 4 | below 4
4 0 1 2 3 → 4 0 1 2 -1 | face 0 | vertex -1
4 0 1 2 3 → -4 0 1 2 3 | face 0 | list of length -4
4 0 1 2 3 → 4 0 1 2 3.0 | a.ply:16: face 0 | `3.0`
4 0 1 2 3 → 2 0 1 | 4 vertices and 0 triangles
property float x → property float u | element vertex has other properties; expected x, y and z
element vertex 4 → element vertex 4000000000 | a.ply:16: vertex 4, counted from 0
format ascii → format octal | a.ply:2: format `octal`; expected ascii, binary_little
ply\n → p\x00ly\n | a.ply:1: `p\x00ly`; expected ply
format ascii 1.0 → format ascii 2.0 | a.ply:2: version 2.0; expected 1.0
format ascii 1.0 → comment | no format; expected a line
list uchar int → list float int | a.ply:10: a length of type float; expected an integer type
list uchar int → list uchar double | a.ply:10: indices of type double; expected an integer type
list uchar int → int | `vertex_indices`; expected a list
property float x → property f x | a.ply:5: type `f`
end_header → end | a.ply:11: `end`; expected format, comment
element face 1 → element vertex 1 | a.ply:9: element `vertex` repeats a name
property float z → property float x | a.ply:7: property `x` repeats a name
";

const STL: &str = r"
vertex 1 0e0 0\r → vertex 1 0 0 4\r | a.stl:5: `4`; expected a keyword
vertex 1 0e0 0\r → vertex 1 0 inf\r | a.stl:5: | `1 0 inf` | three finite
vertex 1 0e0 0\r → vertex 1 0\r | a.stl:5: | `1 0`
   vertex 1 0e0 0\r\n → \r\n | a.stl:7: | 2 vertices
endfacet\r\nendsolid\r\nsolid\r → vertecks\r | a.stl:8: | `vertecks`
";

const GLTF: &str = r#"
"mesh": 0 → "mesh": 7 | a.gltf: nodes[0]: no meshes[7]
"count": 6 → "count": 7 | meshes[0].primitives[0] at nodes[0] | accessors[1]: bufferViews[1] | 7 items
"byteOffset": 48 → "byteOffset": 46 | index | below 4
"version": "2.0" → "version": "1.0" | a.gltf: asset: version `1.0`; expected 2.0
"2.0" → "2.1", "minVersion": "2.1" | a.gltf: asset: version `2.1`; expected 2.0
"indices": 1 → "indices": 1, "mode": 99 | meshes[0].primitives[0] at nodes[0] | mode 99; expected 0 to 6
5126 → 5125 | accessors[0]: VEC3 of unsigned int; expected VEC3 of float or byte
"byteLength": 60 → "byteLength": 61 | buffers[0]: 60 bytes; expected 61
"#;

/// Asserts that the file is rejected in one short line with each of these words.
fn assert_refused(bytes: impl AsRef<[u8]>, name: &str, words: &[&str]) {
    let message = error(bytes, name);
    assert!(words.iter().all(|words| message.contains(words)), "{words:?}: {message}");
    assert!(message.len() < 400 && !message.contains('\n'), "{message}");
}

#[test]
fn a_fault_is_named_with_its_line_or_element_and_what_would_be_accepted() {
    let json = gltf(NODE, INDEXED);
    for (name, file, table) in
        [("a.ply", ply_text(), PLY), ("a.stl", stl_text(), STL), ("a.gltf", json.clone(), GLTF)]
    {
        changes(&file, table).for_each(|(_, bytes, words)| assert_refused(bytes, name, &words));
    }
    let face = format!("element {} 9000", "face".repeat(1000));
    let long = with(&ply_text(), "element face 1", &face);
    assert_refused(long, "a.ply", &["a.ply:16: facefaceface", "…"]);
    let cut = &["a.ply: vertex 1, counted from 0: z: the file ends"];
    assert_refused(&ply_binary(false)[..190], "a.ply", cut);
    let mut nan = stl_binary();
    nan[84 + 50 + 20..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_refused(nan, "a.stl", &["a.stl: facet 1", "NaN"]);
    assert_refused(&stl_binary()[..150], "a.stl", &["room for 1 facets; expected the 2"]);
    assert_refused(&json[..200], "a.gltf", &["a.gltf: ", "EOF"]);
}

#[test]
fn malicious_files_are_rejected() {
    for cycle in [
        r#"{"children": [1]}, {"children": [0], "mesh": 0}"#,
        r#"{"children": [0], "mesh": 0}"#,
        r#"{"children": [1, 1]}, {"mesh": 0}"#,
    ] {
        let message = error(gltf(cycle, INDEXED), "a.gltf");
        assert!(message.contains("expected a tree of nodes"), "{cycle}: {message}");
    }
    let json = gltf(NODE, INDEXED);
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
    assert!(error(&stl, "a.stl").contains("4294967294"));
    // The time follows from the bytes of the file, not from the facets that it promises.
    let start = Instant::now();
    for _ in 0..20 {
        error(&stl, "a.stl");
    }
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
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
