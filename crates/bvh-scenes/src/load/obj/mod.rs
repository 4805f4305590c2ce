//! Reads the triangles of a Wavefront OBJ file, or reports the first invalid line.
//!
//! `tobj` parses the numbers, resolves relative indices and splits polygons into triangle fans. It
//! receives only the `v` and `f` statements that `Geometry` finds, because `tobj` 4.0.5 reads a
//! polyline `l 1 2 3` as a triangle, skips the first vertex after a byte order mark, and rejects
//! Latin-1 comments, comments at the end of a line, continued lines, and files in which only some
//! vertices have a colour. Its errors name no line, and it accepts `nan`. The module `check`
//! therefore checks every number before `tobj` receives it.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and
//! texture coordinates are ignored. Lines may end in LF, CRLF or CR, and a backslash at the end
//! continues a statement on the next line.

mod check;
mod error;
mod geometry;
mod statements;

pub use error::{ObjError, Place};

use super::mesh::Mesh;
use bvh_core::Triangle;
use geometry::Geometry;
use glam::Vec3;
use std::path::Path;

/// Reads the bytes of an OBJ file; `path` only names it in errors. Any bytes give a mesh or an
/// error. O(bytes).
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, ObjError> {
    let mut geometry = Geometry::new(bytes, path);
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // No statement names a material, so that `tobj` asks for no material file.
    let loaded =
        tobj::load_obj_buf(&mut geometry, &options, |_| Err(tobj::LoadError::OpenFileFailed));
    // A fault of the file comes first, because it names a line and the error of `tobj` does not.
    geometry.finish()?;
    let (models, _) =
        loaded.map_err(|source| ObjError::Tobj { path: path.to_path_buf(), source })?;
    let mut triangles = Vec::new();
    let mut used = 0;
    for tobj::Model { mesh, .. } in models {
        // `tobj` keeps exactly the vertices that faces use, each once.
        let (corners, _) = mesh.positions.as_chunks::<3>();
        let (faces, _) = mesh.indices.as_chunks::<3>();
        for face in faces {
            let face_corners = face.map(|index| Vec3::from_array(corners[index as usize]));
            triangles.push(Triangle(face_corners));
        }
        used += corners.len();
    }
    if triangles.is_empty() {
        return Err(ObjError::NoFaces { path: path.to_path_buf(), vertices: geometry.vertices });
    }
    Ok(Mesh {
        unused_vertices: geometry.vertices - used,
        short_faces: geometry.short_faces,
        unknown: geometry.unknown(),
        ..Mesh::new(triangles)
    })
}
