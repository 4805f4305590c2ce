//! Mesh files of every format give the same triangles.

use crate::samples::{error, gltf, ply_text, read, samples, square, with};
use bvh_core::{Corners, DTriangle};
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{Format, MeshError, load};
use bvh_scenes::{Precision, Scene};
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

/// Returns the files of a triangle at `x` in every format that can have it, and one of a triangle at 0
/// with a vertex at `x` that no face uses.
fn files_at(x: f64) -> [Vec<u8>; 6] {
    let obj = |x: f64| format!("v {x} 0 0\nv {} 1 0\nv {x} 0 1\nf 1 2 3\n", x + 1.0).into_bytes();
    let ply = |x: f64| {
        let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\n\
                      property double y\nproperty double z\nelement face 1\n\
                      property list int int vertex_index\nend_header\n";
        let corners = [x, 0.0, 0.0, x + 1.0, 1.0, 0.0, x, 0.0, 1.0].map(f64::to_le_bytes);
        let face = [3i32, 0, 1, 2].map(i32::to_le_bytes);
        [header.as_bytes(), corners.as_flattened(), face.as_flattened()].concat()
    };
    let stl = |x: f64| {
        let corners = format!("vertex {x} 0 0 vertex {} 1 0 vertex {x} 0 1", x + 1.0);
        format!("solid\nfacet outer loop {corners} endloop endfacet\nendsolid").into_bytes()
    };
    let gltf = |x: f64| {
        let node = format!("[{{\"mesh\": 0, \"translation\": [{x}, 0, 0]}}],");
        with(&gltf(), "[{\"mesh\": 0}],", &node)
    };
    let text_ply = |x: f64| with(&ply_text(), "0 0 0 255", &format!("{x} 0 0 255"));
    let unused = |x: f64| [&obj(0.0)[..], format!("v {x} 1e30 0\n").as_bytes()].concat();
    [obj(x), ply(x), stl(x), gltf(x), text_ply(x), unused(x)]
}

#[test]
fn what_coordinates_lose_is_named_where_it_is_much_of_the_mesh() {
    // Up to this size no triangle moves by a ten thousandth of the extent 1 or ½.
    for (x, is_lossy) in [(4_000_000.1, true), (4_000_000.25, false), (300.1, false), (0.1, false)]
    {
        for (number, file) in files_at(x).into_iter().enumerate() {
            let remark = read(file, "a").unwrap().remark().unwrap_or_default();
            let found = remark.contains("lose up to 1.0e-1 ");
            assert_eq!(found, is_lossy && number < 5, "{x}, {number}: {remark}");
            assert_eq!(found, remark.contains("single precision"), "{x}, {number}: {remark}");
        }
    }
}

#[test]
fn double_precision_keeps_the_numbers_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let name = path.to_str().unwrap();
    let double = |file: &[u8]| {
        std::fs::write(&path, file).unwrap();
        Scene::load_as(name, Precision::Double)
    };
    for x in [4_000_000.1, 0.1, 1e-40, 1.0 / 3.0] {
        for file in &files_at(x)[..5] {
            let scene = double(file).unwrap();
            assert_eq!(scene.doubles().unwrap()[0].0[0].to_array(), [x, 0.0, 0.0]);
            assert!(!scene.remark.is_some_and(|remark| remark.contains("lose")), "{x}");
            assert_eq!(scene.boxes, scene.primitives.boxes());
        }
    }
    for (words, x, single) in
        [("0.1 0 0 3", 0.1 / 3.0, 0.1f32 / 3.0), ("1 0 0 -7", -1.0 / 7.0, 1.0 / -7.0)]
    {
        let file = format!("v {words}\nv 0 1 0\nv 0 0 1\nf 1 2 3");
        let scene = double(file.as_bytes()).unwrap();
        assert_eq!(scene.doubles().unwrap()[0].0[0].x, x);
        assert_eq!(Scene::load(name).unwrap().triangles().unwrap()[0].0[0].x, single);
    }
    // The fan of this polygon covers it in f32, where it has no area, and not in f64.
    let arrow = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 1.0]].map(|[x, y]| [1e9 + x, y, 0.0]);
    let vertices = arrow.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    let scene = double((vertices + "f 1 2 3 4").as_bytes()).unwrap();
    let corners = [[0, 1, 3], [1, 2, 3]].map(|face| DTriangle::from(face.map(|i: usize| arrow[i])));
    assert_eq!(scene.doubles().unwrap(), corners);
    let far = double(b"v 1e37 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3").unwrap_err().to_string();
    assert!(far.contains("triangle 0") && far.contains("2^120"), "{far}");
}

#[test]
fn built_in_scenes_have_their_triangles_in_both_precisions_and_spheres_none() {
    let [single, double] = [Precision::Single, Precision::Double]
        .map(|precision| Scene::load_as("escher:50", precision).unwrap());
    let corners = single.triangles().unwrap().iter().map(|triangle| triangle.corners());
    assert!(double.doubles().unwrap().iter().map(|triangle| triangle.0).eq(corners));
    assert_eq!(double.boxes, double.primitives.boxes());
    let message = Scene::load_as("spheres75", Precision::Double).unwrap_err().to_string();
    assert!(message.contains("spheres; accepted: a scene of triangles"), "{message}");
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

#[test]
fn a_face_of_too_many_vertices_is_rejected() {
    let text = format!("v 0 0 0\nv 1 0 0\nf{}", " 1 2".repeat(1 << 15));
    assert_eq!(read(&text, "a.obj").unwrap().triangles.len(), (1 << 16) - 2);
    let message = error(text + " 1\n", "a.obj");
    assert!(message.starts_with("a.obj:3: face of more than 65536"), "{message}");
}

#[test]
fn triangles_without_area_are_counted_and_kept_at_every_scale() {
    for scale in ["1e-45", "1", "3e38"] {
        let points = format!("v 0 0 0\nv {scale} 0 0\nv -{scale} 0 0\nv 0 {scale} 0\n");
        let faces = "f 1 1 1\nf 1 2 2\nf 1\nf 1 2 3\nf 1 2 4\n";
        let read = read(format!("{points}{faces}"), "a.obj").unwrap();
        assert_eq!(read.triangles.len(), 4);
        let remark = "faces of fewer than three vertices skipped: 1; triangles without area: 3";
        assert_eq!(read.remark().unwrap(), remark, "scale {scale}");
    }
}
