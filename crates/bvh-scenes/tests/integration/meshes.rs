//! Mesh files of every format give the same triangles.

use crate::samples::{error, read, samples, square};
use bvh_scenes::Scene;
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{Format, MeshError, load};
use std::path::Path;

#[test]
fn every_format_gives_the_same_triangles_under_any_file_name() {
    for (name, format, bytes) in samples() {
        // Text may begin with a byte order mark.
        let marked = [b"\xef\xbb\xbf", &bytes[..]].concat();
        let is_text = ["square.obj", "text.ply", "text.stl", "square.gltf"].contains(&name);
        for name in [name, "scene.obj", "scene.stl", "scene"] {
            if format == Format::Obj && name == "scene.stl" {
                continue; // OBJ has no signature.
            }
            for bytes in [&bytes, &marked].into_iter().take(1 + usize::from(is_text)) {
                assert_eq!(Format::of(bytes, Path::new(name)), format);
                assert_eq!(read(bytes, name).unwrap(), Mesh::new(square(), vec![]), "{name}");
            }
        }
    }
}

#[test]
fn the_path_of_a_mesh_file_names_a_scene_and_a_missing_file_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _, bytes) in samples() {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let scene = Scene::load(path.to_str().unwrap()).unwrap();
        assert_eq!(scene.triangles().unwrap(), square());
        assert!(name.starts_with(&scene.name), "{name}");
    }
    let path = folder.path().join("line.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n").unwrap();
    let remark = Scene::load(path.to_str().unwrap()).unwrap().remark.unwrap();
    assert!(remark.ends_with("skipped: 1"), "{remark}");
    for missing in ["none.ply", "none.obj", "folder/none"] {
        let message = Scene::load(missing).unwrap_err().to_string();
        assert!(message.contains(&format!("{missing}: no such file")), "{message}");
    }
    assert!(matches!(load(folder.path()), Err(MeshError::Read(_))));
    assert!(error(b" \r\n", "a.ply").starts_with("a.ply: empty; expected an OBJ, PLY"));
}
