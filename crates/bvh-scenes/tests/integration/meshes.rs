//! Mesh files of every format give the same triangles.

use crate::samples::{
    INDEXED, NODE, buffer, error, gltf_json, read, samples, square, stl_text, with,
};
use bvh_scenes::Scene;
use bvh_scenes::files::ReadError;
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{Format, MeshError, load};
use std::path::Path;

#[test]
fn every_format_gives_the_same_triangles_under_any_file_name() {
    for (name, format, bytes) in samples() {
        for name in [name, "scene.obj", "scene.stl", "scene"] {
            if format == Format::Obj && name == "scene.stl" {
                continue; // OBJ has no signature.
            }
            assert_eq!(Format::of(&bytes, Path::new(name)), format);
            assert_eq!(read(&bytes, name).unwrap(), Mesh::new(square(), vec![]), "{name}");
        }
    }
}

#[test]
fn text_formats_may_begin_with_a_byte_order_mark() {
    for (name, _, bytes) in samples() {
        if ["square.obj", "text.ply", "text.stl", "square.gltf"].contains(&name) {
            let marked = [b"\xef\xbb\xbf", &bytes[..]].concat();
            for name in [name, "scene"] {
                assert_eq!(read(&marked, name).unwrap(), Mesh::new(square(), vec![]), "{name}");
            }
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
    assert!(matches!(read(b" \r\n", "a.ply"), Err(MeshError::Empty(_))));
}

#[test]
fn buffers_are_files_in_the_folder_of_the_file_that_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, gltf_json("my%20buffer.bin", NODE, INDEXED)).unwrap();
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
    let remote = error(gltf_json("http://example.org/a.bin", NODE, INDEXED), "a.gltf");
    assert!(remote.contains("a file in this folder"), "{remote}");
}

#[test]
fn text_stl_is_a_sequence_of_words_of_any_case_on_any_lines() {
    let text = String::from_utf8(stl_text()).unwrap();
    let (first, rest) = text.split_once('\n').unwrap();
    let (facets, _) = rest.rsplit_once("endsolid").unwrap();
    let facets = facets.replace("endsolid\r\nsolid\r\n", "");
    let one_line = facets.replace("\r\n", " ");
    let in_capitals = facets.to_uppercase();
    for facets in [facets.as_str(), &in_capitals, &one_line, &one_line.replace("loop ", "loop\n")] {
        let file = format!("{first}\n{facets}\nendsolid a square");
        assert_eq!(read(file.as_bytes(), "a.stl").unwrap(), Mesh::new(square(), vec![]));
    }
}
