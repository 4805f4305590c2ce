//! Forged and cut files give a mesh or an error that names its place. The fuzz target `mesh` of
//! `bvh-stress` has any bytes.

use crate::samples::{error, glb, read, samples, stl_binary};
use bvh_scenes::load::orient;
use glam::DMat3;
use std::path::Path;

#[test]
fn malicious_files_are_rejected() {
    for length in [0, 1, u32::MAX - 3, u32::MAX] {
        let mut bytes = glb();
        bytes[12..16].copy_from_slice(&length.to_le_bytes());
        error(bytes, "a.glb");
    }
    for length in [13, glb().len() - 60, glb().len() - 1] {
        let message = error(&glb()[..length], "a.glb");
        let cut = format!("cut: {length} of {} bytes", glb().len());
        assert!(message.contains(&cut), "{message}");
    }
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    error(format!(r#"{{"asset": {deep}}}"#), "a.gltf");
    // The length of the list is 2³² − 1.
    let list = "ply\nformat binary_little_endian 1.0\nelement face 1\n\
                property list uint int vertex_indices\nend_header\n";
    error([list.as_bytes(), &[255; 8]].concat(), "a.ply");
    let mut stl = stl_binary();
    stl[80..84].copy_from_slice(&(u32::MAX - 1).to_le_bytes());
    assert!(error(&stl, "a.stl").contains("4294967294"));
}

#[test]
fn cut_files_give_a_mesh_or_an_error() {
    for (name, _, bytes) in samples() {
        for bytes in (0..bytes.len()).map(|length| &bytes[..length]) {
            let find = &mut |_: usize, _: &[_]| Some(DMat3::from_rotation_x(1.0));
            let _ = orient(bytes, Path::new(name), Path::new(name), find);
            if let Ok(mesh) = read(bytes, name) {
                assert!(!mesh.triangles.is_empty());
                assert!(mesh.triangles.iter().flat_map(|t| t.0).all(|corner| corner.is_finite()));
            }
        }
    }
}
