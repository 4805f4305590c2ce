//! Mesh files of arbitrary bytes, in every format.

use bvh_scenes::load::{orient, parse};
use glam::DMat3;
use std::fmt::Write;
use std::path::Path;

/// Turns the bytes as a file, which may be an error, and parses them. Checks that the mesh is finite,
/// and that it stays the same if it is written and read again.
pub fn mesh(bytes: &[u8]) {
    let path = Path::new("scene.obj");
    let _ = orient(bytes, path, path, &mut |_, _| Some(DMat3::from_rotation_x(1.0)));
    let mesh = match parse(bytes, path) {
        Ok(mesh) => mesh,
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("scene.obj"), "{message}");
            assert!(message.chars().count() < 450, "{message}");
            assert!(!message.chars().any(char::is_control), "{message}");
            return;
        }
    };
    assert!(!mesh.triangles.is_empty());
    // Forged files may repeat a mesh many times.
    if mesh.triangles.len() > 1000 {
        return;
    }
    let mut text = String::new();
    for triangle in &mesh.triangles {
        for corner in triangle.0 {
            assert!(corner.is_finite());
            let _ = writeln!(text, "v {:e} {} {}", corner.x, corner.y, corner.z);
        }
        text += "f -3 -2 -1\n";
    }
    let again = parse(text.as_bytes(), path).unwrap();
    assert_eq!(again.triangles, mesh.triangles);
}
