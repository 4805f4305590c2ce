//! Extensions, missing parts and references of glTF files that are accepted or rejected.

use crate::glb::glb;
use crate::samples::{INDEXED, NODE, buffer, error, gltf_json, square};
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{OutsideFiles, load, load_with, parse};
use std::fs;
use std::path::Path;

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

fn read(json: String) -> Mesh {
    parse(&glb_of(json), Path::new("a.glb")).unwrap()
}

/// Creates a folder with `scene.gltf`, whose buffer is the file of this name.
fn folder(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.gltf"), gltf_json(name, NODE, INDEXED)).unwrap();
    folder
}

#[test]
fn a_file_may_require_only_extensions_that_change_no_mesh() {
    let required = |names: &str| json(&format!(r#""extensionsRequired": [{names}], "#));
    for known in
        ["", r#""KHR_materials_unlit", "KHR_texture_basisu""#, r#""EXT_mesh_gpu_instancing""#]
    {
        assert_eq!(read(required(known)), mesh(), "{known}");
    }
    for unknown in ["EVIL_no_such", "EXT_meshopt_compression", "KHR_draco_mesh_compression"] {
        let names = format!(r#""KHR_materials_unlit", "{unknown}""#);
        let message = error(glb_of(required(&names)), "a.glb");
        let expected = format!("a.glb: extensionsRequired: `{unknown}`; expected");
        assert!(message.contains(&expected), "{message}");
    }
    // The format lets a reader ignore extensions that are used but not required.
    let used = read(json(r#""extensionsUsed": ["EVIL_no_such", "KHR_materials_ior"], "#));
    assert_eq!(used.triangles, square());
    assert_eq!(used.remarks, ["the extension EVIL_no_such was ignored"]);
}

#[test]
fn a_buffer_without_uri_is_the_binary_chunk_only_if_it_is_the_first() {
    let of_buffer = |number: usize| {
        let json = json("").replace(r#""buffer": 0"#, &format!(r#""buffer": {number}"#));
        json.replace(r#"{"byteLength": 60}"#, r#"{"byteLength": 60}, {"byteLength": 60}"#)
    };
    assert_eq!(read(of_buffer(0)), mesh());
    for (number, words) in [(1, "buffers[1]: no URI"), (2, "no buffers[2]")] {
        let message = error(glb_of(of_buffer(number)), "a.glb");
        assert!(message.contains(words), "{message}");
    }
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
            assert_eq!(read(text), mesh(), "{extras}");
        }
    }
}

#[test]
fn a_buffer_that_no_mesh_needs_may_be_invalid() {
    for unused in [
        r#"{"uri": "no_such_file.bin", "byteLength": 60}"#,
        r#"{"uri": "../../outside.bin", "byteLength": 60}"#,
        r#"{"uri": "data:nonsense", "byteLength": 60}"#,
        r#"{"byteLength": 60}"#,
    ] {
        let more = format!(r#"{{"byteLength": 60}}, {unused}"#);
        assert_eq!(read(json("").replace(r#"{"byteLength": 60}"#, &more)), mesh(), "{unused}");
    }
}

#[test]
fn a_buffer_outside_the_folder_of_the_scene_is_rejected_unless_it_is_allowed() {
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

/// Asserts that the folder's scene is rejected, and that it is read with permission.
fn assert_outside(folder: &Path) {
    let path = folder.join("scene.gltf");
    let message = load(&path).unwrap_err().to_string();
    for part in ["buffers[0]", "outside the scene's folder", "--outside-files"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    assert_eq!(load_with(&path, OutsideFiles::Allowed).unwrap(), mesh());
}

#[test]
fn files_in_the_folder_of_the_scene_and_below_are_read() {
    for name in ["my%20buffer.bin", "a/b.bin", "./a/../b.bin", "..bin"] {
        let folder = folder(name);
        fs::create_dir(folder.path().join("a")).unwrap();
        let file = folder.path().join(name.replace("%20", " "));
        fs::write(file, buffer()).unwrap();
        assert_eq!(load(&folder.path().join("scene.gltf")).unwrap(), mesh(), "{name}");
    }
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
    assert_eq!(read(json(r#""extras": {"mesh": 4294967296}, "#)), mesh());
}

#[test]
fn a_glb_file_shorter_than_its_header_says_is_rejected_as_a_part() {
    let whole = glb_of(json(""));
    for length in [13, whole.len() - 60, whole.len() - 1] {
        let message = error(&whole[..length], "a.glb");
        assert!(message.contains("expected a GLB file, and whole"), "{message}");
    }
}

#[test]
fn a_file_that_promises_too_many_triangles_is_rejected_before_its_buffers_are_read() {
    let folder = folder("missing.bin");
    let path = folder.path().join("scene.gltf");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace(r#""count": 6,"#, r#""count": 300000003,"#)).unwrap();
    let message = load(&path).unwrap_err().to_string();
    assert!(message.contains("nodes[0]: more than 100000000 triangles"), "{message}");
}
