//! The triangles of glTF files, and the files to which they may refer.

use crate::glb::glb;
use crate::samples::{INDEXED, NODE, buffer, error, gltf_json, read, square};
use bvh_core::Triangle;
use bvh_scenes::load::load;
use bvh_scenes::load::mesh::Mesh;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Files by what differs from a node with a mesh of one triangle, in groups that share more. `views`
/// are numbers after their type, `accessors` are a view, a type, a count and a shape, `node`, `mesh`
/// and `accessor` are the first of their lists, and all else is as in the format. Then follow the
/// triangles, nine numbers each, and the remark, or words of the fault.
const CASES: &str = include_str!("gltf_cases.json");

/// Changes a value as RFC 7396 says: objects key by key, everything else as a whole.
fn merge(value: &mut Value, patch: &Value) {
    let Value::Object(patch) = patch else { return *value = patch.clone() };
    if !value.is_object() {
        *value = json!({});
    }
    for (key, patch) in patch {
        match patch {
            Value::Null => drop(value.as_object_mut().unwrap().remove(key)),
            patch => merge(&mut value[key], patch),
        }
    }
}

/// Returns the bytes of a number.
type Bytes = fn(&str) -> Vec<u8>;

/// The types of numbers: the name here and the number in the format.
const TYPES: [(&str, u32, Bytes); 5] = [
    ("i8", 5120, |word| word.parse::<i8>().unwrap().to_le_bytes().into()),
    ("u8", 5121, |word| word.parse::<u8>().unwrap().to_le_bytes().into()),
    ("i16", 5122, |word| word.parse::<i16>().unwrap().to_le_bytes().into()),
    ("u16", 5123, |word| word.parse::<u16>().unwrap().to_le_bytes().into()),
    ("f32", 5126, |word| word.parse::<f32>().unwrap().to_le_bytes().into()),
];

fn view(text: &str) -> Vec<u8> {
    let mut words = text.split(' ');
    let kind = words.next().unwrap();
    let bytes = TYPES.iter().find(|(name, ..)| *name == kind).unwrap().2;
    words.flat_map(bytes).collect()
}

fn accessor(text: &Value) -> Value {
    let words: Vec<&str> = text.as_str().unwrap().split(' ').collect();
    let component = TYPES.iter().find(|(name, ..)| *name == words[1]).unwrap().1;
    let count: usize = words[2].parse().unwrap();
    let mut accessor = json!({ "componentType": component, "count": count, "type": words[3] });
    accessor["normalized"] = (words.len() > 4).into();
    if let Ok(view) = words[0].parse::<usize>() {
        accessor["bufferView"] = view.into();
    }
    accessor
}

fn file(case: &Value) -> Vec<u8> {
    let list = |name: &str| case[name].as_array().cloned().unwrap_or_default();
    let first = |name: &str| case.get(name).cloned();
    let mut binary = Vec::new();
    let mut views = Vec::new();
    for text in list("views") {
        let bytes = view(text.as_str().unwrap());
        let (start, length) = (binary.len(), bytes.len());
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
        merge(&mut view, &json!({ "byteStride": case["stride"] }));
        views.push(view);
        binary.extend(bytes);
        binary.resize(binary.len().next_multiple_of(4), 0);
    }
    let accessors = first("accessor").map_or_else(
        || list("accessors").iter().map(accessor).collect(),
        |accessor| vec![accessor],
    );
    let nodes: Vec<Value> = first("node").into_iter().chain(list("nodes")).collect();
    let mut document = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": binary.len() }],
        "bufferViews": views,
    });
    merge(&mut document, case);
    merge(&mut document, &json!({ "accessors": accessors, "nodes": nodes }));
    document["meshes"] = first("mesh").into_iter().collect();
    glb(document.to_string(), &binary)
}

#[track_caller]
fn assert_near(found: &[Triangle], expected: &[Triangle], name: &str) {
    let pairs = found.iter().zip(expected).flat_map(|(a, b)| a.0.into_iter().zip(b.0));
    let is_near = pairs.into_iter().all(|(a, b)| a.distance(b) < 1e-6);
    assert!(found.len() == expected.len() && is_near, "{name}: {found:?}, not {expected:?}");
}

#[test]
fn everything_that_moves_or_repeats_a_vertex_is_read_or_named() {
    let default = json!({
        "views": ["f32 0 0 0 1 0 0 0 1 0"], "accessors": ["0 f32 3 VEC3"], "node": { "mesh": 0 },
        "mesh": { "primitives": [{ "attributes": { "POSITION": 0 } }] },
        "triangles": [[0, 0, 0, 1, 0, 0, 0, 1, 0]], "remark": "",
    });
    let groups: Vec<Value> = serde_json::from_str(CASES).unwrap();
    for mut group in groups {
        let cases = group["cases"].take();
        for patch in cases.as_array().unwrap() {
            let mut case = default.clone();
            merge(&mut case, &group);
            merge(&mut case, patch);
            let bytes = file(&case);
            let name = case["name"].as_str().unwrap();
            if let Some(words) = case["fault"].as_str() {
                let message = error(&bytes, "a.glb");
                assert!(message.contains(words), "{name}: {message}");
                continue;
            }
            let mesh = read(&bytes, "a.glb").unwrap_or_else(|error| panic!("{name}: {error}"));
            let expected: Vec<[f32; 9]> =
                serde_json::from_value(case["triangles"].clone()).unwrap();
            let expected: Vec<Triangle> = expected.into_iter().map(Triangle::from).collect();
            assert_near(&mesh.triangles, &expected, name);
            assert_eq!(mesh.remark().unwrap_or_default(), case["remark"], "{name}");
        }
    }
}

fn mesh() -> Mesh {
    Mesh::new(square(), vec![])
}

/// Returns the JSON of the square in the binary chunk, with further keys at the top.
fn json(more: &str) -> String {
    gltf_json("", NODE, INDEXED).replacen('{', &format!("{{{more}"), 1)
}

fn glb_of(json: String) -> Vec<u8> {
    glb(json, &buffer())
}

fn read_glb(json: String) -> Mesh {
    read(glb_of(json), "a.glb").unwrap()
}

/// Creates a folder with `scene.gltf`, whose buffer is the file of this name.
fn folder(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.gltf"), gltf_json(name, NODE, INDEXED)).unwrap();
    folder
}

#[test]
fn extras_of_any_kind_are_ignored_in_any_place() {
    let text = json("");
    // Attributes contain names of accessors and nothing else.
    let places = text.match_indices('{').map(|(place, _)| place);
    let places: Vec<usize> =
        places.filter(|&place| !text[place..].starts_with(r#"{"POSITION"#)).collect();
    for extras in [r#""a text""#, "5", "-1.5e300", "true", "null", "[1, {}]", r#"{"a": [null]}"#] {
        for &place in &places {
            let mut text = text.clone();
            text.insert_str(place + 1, &format!(r#""extras": {extras}, "#));
            assert_eq!(read_glb(text), mesh(), "{extras}");
        }
    }
}

#[test]
fn a_buffer_outside_the_folder_of_the_scene_is_rejected() {
    let outside = tempfile::tempdir().unwrap();
    let file = outside.path().join("outside.bin");
    fs::write(&file, buffer()).unwrap();
    let absolute = file.to_str().unwrap();
    let folder_name = outside.path().file_name().unwrap().to_str().unwrap();
    for name in [
        absolute.to_owned(),
        format!("../{folder_name}/outside.bin"),
        format!("%2e%2e/{folder_name}/outside.bin"),
        format!("%2e%2e%2f{folder_name}%2Foutside.bin"),
        format!("./a/../../{folder_name}/outside.bin"),
    ] {
        let folder = folder(&name);
        fs::create_dir(folder.path().join("a")).unwrap();
        assert_outside(folder.path());
    }
    // The message must not reveal whether the file exists.
    let scene_folder = folder("../no_such_file");
    let message = load(&scene_folder.path().join("scene.gltf")).unwrap_err().to_string();
    assert!(message.contains("`../no_such_file` is outside"), "{message}");
    #[cfg(unix)]
    {
        let folder = folder("link.bin");
        std::os::unix::fs::symlink(&file, folder.path().join("link.bin")).unwrap();
        assert_outside(folder.path());
    }
}

fn assert_outside(folder: &Path) {
    let path = folder.join("scene.gltf");
    let message = load(&path).unwrap_err().to_string();
    for part in ["buffers[0]", "outside the scene's folder; accepted: a file in this folder"] {
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn files_in_the_folder_of_the_scene_and_below_are_read() {
    for name in ["my%20buffer.bin", "a/b.bin", "./a/../b.bin", "..bin"] {
        let folder = folder(name);
        fs::create_dir(folder.path().join("a")).unwrap();
        let file = folder.path().join(name.replace("%20", " "));
        fs::write(&file, buffer()).unwrap();
        let read = || load(&folder.path().join("scene.gltf"));
        assert_eq!(read().unwrap(), mesh(), "{name}");
        fs::write(&file, &buffer()[..50]).unwrap();
        let short = read().unwrap_err().to_string();
        assert!(short.contains("buffers[0]: 50 bytes; expected 60"), "{short}");
        fs::remove_file(file).unwrap();
        let missing = read().unwrap_err().to_string();
        let words = ["buffers[0]", "bin: no such file"];
        assert!(words.iter().all(|words| missing.contains(words)), "{missing}");
    }
    let remote = error(gltf_json("http://example.org/a.bin", NODE, INDEXED), "a.gltf");
    assert!(remote.contains("a file in this folder"), "{remote}");
}

#[test]
fn an_index_of_33_bits_is_not_taken_for_its_lower_32() {
    let whole = json("");
    for key in ["POSITION", "indices", "buffer", "bufferView", "componentType", "mesh", "scene"] {
        let (before, number) = whole.split_once(&format!(r#""{key}": "#)).unwrap();
        let digits = number.find(|c: char| !c.is_ascii_digit()).unwrap();
        let wrapped = (number[..digits].parse::<u64>().unwrap() + (1 << 32)).to_string();
        let damaged = format!(r#"{before}"{key}": {wrapped}{}"#, &number[digits..]);
        let message = error(glb_of(damaged), "a.glb");
        assert!(message.contains(&wrapped), "{message}");
    }
    error(glb_of(whole.replace(r#""nodes": [0]"#, r#""nodes": [4294967296]"#)), "a.glb");
    // Numbers that are no reference may be as large as they like.
    assert_eq!(read_glb(json(r#""extras": {"mesh": 4294967296}, "#)), mesh());
}

#[test]
fn a_glb_file_shorter_than_its_header_says_is_rejected_as_a_part() {
    let whole = glb_of(json(""));
    for length in [13, whole.len() - 60, whole.len() - 1] {
        let message = error(&whole[..length], "a.glb");
        assert!(message.contains("expected a GLB file, and whole"), "{message}");
    }
}
