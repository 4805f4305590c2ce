//! Extensions, missing parts and references of glTF files that are accepted or rejected.

use crate::glb::glb;
use bvh_core::Triangle;
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{OutsideFiles, load, load_with, parse};
use std::fs;
use std::path::Path;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn corner_bytes() -> Vec<u8> {
    CORNERS.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn triangle() -> Mesh {
    Mesh::new(Triangle::from_mesh(&CORNERS, &[[0, 1, 2]]).unwrap(), vec![])
}

/// Returns a scene of one triangle in `buffers[0]`, with additional top-level keys.
fn json(buffers: &str, more: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{buffers}]{more}}}"#
    )
}

/// The buffer in the binary chunk of a GLB file.
const CHUNK: &str = r#"{"byteLength": 36}"#;

/// Creates a folder with `scene.gltf`, whose buffer is the file of this name.
fn folder(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = json(&format!(r#"{{"uri": "{name}", "byteLength": 36}}"#), "");
    fs::write(folder.path().join("scene.gltf"), text).unwrap();
    folder
}

#[test]
fn a_file_may_require_only_extensions_that_change_no_triangle() {
    let required = |names: &str| {
        glb(json(CHUNK, &format!(r#", "extensionsRequired": [{names}]"#)), &corner_bytes())
    };
    let path = Path::new("a.glb");
    for known in
        ["", r#""KHR_materials_unlit", "KHR_texture_basisu""#, r#""EXT_mesh_gpu_instancing""#]
    {
        assert_eq!(parse(&required(known), path).unwrap(), triangle(), "{known}");
    }
    for unknown in ["EVIL_no_such", "EXT_meshopt_compression", "KHR_draco_mesh_compression"] {
        let message = parse(&required(&format!(r#""KHR_materials_unlit", "{unknown}""#)), path)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains(&format!("a.glb: extensionsRequired: `{unknown}`; expected")),
            "{message}"
        );
    }
    // The format lets a reader ignore extensions that are used but not required.
    let used = json(CHUNK, r#", "extensionsUsed": ["EVIL_no_such", "KHR_materials_ior"]"#);
    let mesh = parse(&glb(used, &corner_bytes()), path).unwrap();
    assert_eq!(mesh.triangles, triangle().triangles);
    assert_eq!(mesh.remarks, ["the extension EVIL_no_such was ignored"]);
}

#[test]
fn a_buffer_without_uri_is_the_binary_chunk_only_if_it_is_the_first() {
    let bytes = |buffer: usize| {
        let views = format!(r#""buffer": {buffer}, "#);
        let json = json(&format!("{CHUNK}, {CHUNK}"), "").replace(r#""buffer": 0, "#, &views);
        glb(json, &corner_bytes())
    };
    assert_eq!(parse(&bytes(0), Path::new("a.glb")).unwrap(), triangle());
    let message = parse(&bytes(1), Path::new("a.glb")).unwrap_err().to_string();
    assert!(message.contains("buffers[1]: no URI"), "{message}");
    let message = parse(&bytes(2), Path::new("a.glb")).unwrap_err().to_string();
    assert!(message.contains("no buffers[2]"), "{message}");
}

#[test]
fn extras_of_any_kind_are_ignored_in_any_place() {
    let text = json(CHUNK, "");
    // Attributes contain names of accessors and nothing else.
    let places = text.match_indices('{').map(|(place, _)| place);
    let places: Vec<usize> =
        places.filter(|&place| !text[place..].starts_with(r#"{"POSITION"#)).collect();
    for extras in [r#""a text""#, "5", "-1.5e300", "true", "null", "[1, {}]", r#"{"a": [null]}"#] {
        for &place in &places {
            let mut text = text.clone();
            text.insert_str(place + 1, &format!(r#""extras": {extras}, "#));
            assert_eq!(
                parse(&glb(text, &corner_bytes()), Path::new("a.glb")).unwrap(),
                triangle(),
                "{extras}"
            );
        }
    }
}

#[test]
fn a_buffer_that_no_mesh_needs_may_be_invalid() {
    for unused in [
        r#"{"uri": "no_such_file.bin", "byteLength": 36}"#,
        r#"{"uri": "../../outside.bin", "byteLength": 36}"#,
        r#"{"uri": "data:nonsense", "byteLength": 36}"#,
        r#"{"byteLength": 36}"#,
    ] {
        let bytes = glb(json(&format!("{CHUNK}, {unused}"), ""), &corner_bytes());
        assert_eq!(parse(&bytes, Path::new("a.glb")).unwrap(), triangle(), "{unused}");
    }
}

#[test]
fn a_buffer_outside_the_folder_of_the_scene_is_rejected_unless_it_is_allowed() {
    let outside = tempfile::tempdir().unwrap();
    let file = outside.path().join("outside.bin");
    fs::write(&file, corner_bytes()).unwrap();
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
    assert_eq!(load_with(&path, OutsideFiles::Allowed).unwrap(), triangle());
}

#[test]
fn files_in_the_folder_of_the_scene_and_below_are_read() {
    for name in ["my%20buffer.bin", "a/b.bin", "./a/../b.bin", "..bin"] {
        let folder = folder(name);
        fs::create_dir(folder.path().join("a")).unwrap();
        let file = folder.path().join(name.replace("%20", " "));
        fs::write(file, corner_bytes()).unwrap();
        assert_eq!(load(&folder.path().join("scene.gltf")).unwrap(), triangle(), "{name}");
    }
}

#[test]
fn an_index_of_33_bits_is_not_taken_for_its_lower_32() {
    let whole = json(CHUNK, r#", "scene": 0"#);
    let wrapped = |number: u64| (number + (1 << 32)).to_string();
    for (key, number) in [
        ("POSITION", 0),
        ("buffer", 0),
        ("bufferView", 0),
        ("componentType", 5126),
        ("mesh", 0),
        ("scene", 0),
    ] {
        let old = format!(r#""{key}": {number}"#);
        let new = format!(r#""{key}": {}"#, wrapped(number));
        assert_eq!(whole.matches(&old).count(), 1, "{key}");
        let damaged = glb(whole.replace(&old, &new), &corner_bytes());
        let message = parse(&damaged, Path::new("a.glb")).unwrap_err().to_string();
        assert!(message.contains(&wrapped(number)), "{message}");
    }
    let damaged = whole.replace(r#"{"nodes": [0]}"#, r#"{"nodes": [4294967296]}"#);
    assert!(parse(&glb(damaged, &corner_bytes()), Path::new("a.glb")).is_err());
    // Numbers that are no reference may be as large as they like.
    let large = r#", "scene": 0, "extras": {"mesh": 4294967296}"#;
    assert!(parse(&glb(json(CHUNK, large), &corner_bytes()), Path::new("a.glb")).is_ok());
}

#[test]
fn a_glb_file_shorter_than_its_header_says_is_rejected_as_a_part() {
    let whole = glb(json(CHUNK, ""), &corner_bytes());
    for length in [13, whole.len() - 36, whole.len() - 1] {
        let message = parse(&whole[..length], Path::new("a.glb")).unwrap_err().to_string();
        assert!(message.contains("expected a GLB file, and whole"), "{message}");
    }
}

#[test]
fn a_file_that_promises_too_many_triangles_is_rejected_before_its_buffers_are_read() {
    let folder = folder("missing.bin");
    let path = folder.path().join("scene.gltf");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace(r#""count": 3,"#, r#""count": 300000003,"#)).unwrap();
    let message = load(&path).unwrap_err().to_string();
    assert!(message.contains("nodes[0]: more than 100000000 triangles"), "{message}");
}
