//! The triangles of glTF files, and the files to which they may refer.

use crate::glb::glb;
use crate::samples::{buffer, error, gltf, gltf_json, read, square};
use bvh_core::Triangle;
use bvh_scenes::load::load;
use bvh_scenes::load::mesh::Mesh;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Files by what differs from a node with a mesh of one triangle, in groups that share more. `views`
/// are numbers after their type, `node`, `mesh` and `accessor` are the first of their lists, and all
/// else is as in the format. Then follow the triangles, nine numbers each, and the remark, or words
/// of the fault.
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

/// Returns the bytes of numbers after the name of their type.
fn view(text: &str) -> Vec<u8> {
    let (kind, numbers) = text.split_once(' ').unwrap();
    let bytes = |word: &str| -> Vec<u8> {
        match kind {
            "i8" => word.parse::<i8>().unwrap().to_le_bytes().into(),
            "u8" => word.parse::<u8>().unwrap().to_le_bytes().into(),
            "i16" => word.parse::<i16>().unwrap().to_le_bytes().into(),
            "u16" => word.parse::<u16>().unwrap().to_le_bytes().into(),
            _ => word.parse::<f32>().unwrap().to_le_bytes().into(),
        }
    };
    numbers.split(' ').flat_map(bytes).collect()
}

pub fn file(case: &Value) -> Vec<u8> {
    let mut binary = Vec::new();
    let mut views = Vec::new();
    for text in case["views"].as_array().unwrap() {
        let bytes = view(text.as_str().unwrap());
        let (start, length) = (binary.len(), bytes.len());
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
        merge(&mut view, &json!({ "byteStride": case["stride"] }));
        views.push(view);
        binary.extend(bytes);
        binary.resize(binary.len().next_multiple_of(4), 0);
    }
    let mut document = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": binary.len() }],
        "bufferViews": views,
    });
    merge(&mut document, case);
    for (list, first) in [("accessors", "accessor"), ("nodes", "node"), ("meshes", "mesh")] {
        let further = case[list].as_array().into_iter().flatten();
        document[list] = [&case[first]].into_iter().chain(further).cloned().collect();
    }
    glb(document.to_string(), &binary)
}

/// Returns the whole of all cases.
pub fn cases() -> Vec<Value> {
    let default = json!({
        "views": ["f32 0 0 0 1 0 0 0 1 0"],
        "accessor": { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
        "mesh": { "primitives": [{ "attributes": { "POSITION": 0 } }] },
        "node": { "mesh": 0 },
        "triangles": [[0, 0, 0, 1, 0, 0, 0, 1, 0]], "remark": "",
    });
    let groups: Vec<Value> = serde_json::from_str(CASES).unwrap();
    let mut cases = Vec::new();
    for mut group in groups {
        let patches = group["cases"].take();
        for patch in patches.as_array().unwrap() {
            let mut case = default.clone();
            merge(&mut case, &group);
            merge(&mut case, patch);
            cases.push(case);
        }
    }
    cases
}

#[test]
fn everything_that_moves_or_repeats_a_vertex_is_read_or_named() {
    for case in cases() {
        let bytes = file(&case);
        let name = case["name"].as_str().unwrap();
        if let Some(words) = case["fault"].as_str() {
            let message = error(&bytes, "a.glb");
            assert!(message.contains(words), "{name}: {message}");
            continue;
        }
        let mesh = read(&bytes, "a.glb").unwrap_or_else(|error| panic!("{name}: {error}"));
        let expected: Vec<[f32; 9]> = serde_json::from_value(case["triangles"].clone()).unwrap();
        let expected: Vec<Triangle> = expected.into_iter().map(Triangle::from).collect();
        assert_eq!(mesh.triangles, expected, "{name}");
        assert_eq!(mesh.remark().unwrap_or_default(), case["remark"], "{name}");
    }
}

/// Creates a folder with `scene.gltf`, whose buffer is the file of this name.
fn folder(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.gltf"), gltf_json(name)).unwrap();
    folder
}

#[test]
fn extras_of_any_kind_are_ignored_in_any_place() {
    let text = String::from_utf8(gltf()).unwrap();
    // Attributes contain names of accessors and nothing else.
    let places = text.match_indices('{').map(|(place, _)| place);
    let places: Vec<usize> =
        places.filter(|&place| !text[place..].starts_with(r#"{"POSITION"#)).collect();
    for extras in [r#""a text""#, "5", "-1.5e300", "true", "null", "[1, {}]", r#"{"a": [null]}"#] {
        for &place in &places {
            let mut text = text.clone();
            text.insert_str(place + 1, &format!(r#""extras": {extras}, "#));
            let mesh = read(text, "a.gltf").unwrap();
            assert_eq!(mesh, Mesh::new(square(), vec![]), "{extras}");
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
        // A name that leads out and back is rejected as well.
        "a/../b.bin".to_owned(),
    ] {
        let folder = folder(&name);
        fs::create_dir(folder.path().join("a")).unwrap();
        assert_outside(folder.path());
    }
    // The message must not reveal whether the file exists.
    let scene_folder = folder("../no_such_file");
    let message = load(&scene_folder.path().join("scene.gltf")).unwrap_err().to_string();
    assert!(message.contains("`../no_such_file` may be outside"), "{message}");
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
    for name in ["my%20buffer.bin", "a/b.bin", "./a/./b.bin", "..bin"] {
        let folder = folder(name);
        fs::create_dir(folder.path().join("a")).unwrap();
        let file = folder.path().join(name.replace("%20", " "));
        fs::write(&file, buffer()).unwrap();
        let read = || load(&folder.path().join("scene.gltf"));
        assert_eq!(read().unwrap(), Mesh::new(square(), vec![]), "{name}");
        fs::write(&file, &buffer()[..50]).unwrap();
        let short = read().unwrap_err().to_string();
        assert!(short.contains("buffers[0]: 50 bytes; expected 60"), "{short}");
        fs::remove_file(file).unwrap();
        let missing = read().unwrap_err().to_string();
        let words = ["buffers[0]", "bin: no such file"];
        assert!(words.iter().all(|words| missing.contains(words)), "{missing}");
    }
    let remote = error(gltf_json("http://example.org/a.bin"), "a.gltf");
    assert!(remote.contains("a file in this folder"), "{remote}");
}
