//! OBJ files of arbitrary bytes.

use bvh_scenes::load::obj::parse;
use std::fmt::Write;
use std::path::Path;

/// Parses the bytes as a file. Checks that the mesh is finite and counted, and stays the same if it
/// is written and read again.
pub fn obj(bytes: &[u8]) {
    let path = Path::new("scene.obj");
    let mesh = match parse(bytes, path) {
        Ok(mesh) => mesh,
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("scene.obj") && message.len() < 300, "{message}");
            return;
        }
    };
    assert!(!mesh.triangles.is_empty() && mesh.degenerate_triangles <= mesh.triangles.len());
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
    assert_eq!(again.degenerate_triangles, mesh.degenerate_triangles);
}
