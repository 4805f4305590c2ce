//! Reads the triangles of a Wavefront OBJ file, or reports the first invalid line.
//!
//! `tobj` parses the numbers and resolves relative indices. It receives only the `v` and `f`
//! statements that `Geometry` finds, because `tobj` 4.0.5 reads a polyline `l 1 2 3` as a triangle,
//! skips the first vertex after a byte order mark, and rejects Latin-1 comments, comments at the end
//! of a line, continued lines, and files in which only some vertices have a colour. Its errors name
//! no line, and it accepts `nan`. `Geometry` therefore checks every number before `tobj` receives
//! it. `tobj` splits every polygon into a fan, so that `Polygons` splits them instead.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and
//! texture coordinates are ignored. Lines may end in LF, CRLF or CR, and a backslash at the end
//! continues a statement on the next line.

mod geometry;
mod statements;

use super::mesh::{Fault, Mesh, Place, unused};
use super::polygon::{Polygons, open};
use geometry::Geometry;
use glam::Vec3;
use std::path::Path;

/// Reads the bytes of an OBJ file; `path` only names it in errors. Any bytes give a mesh or an
/// error. O(bytes), and more for faces that are not convex.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let at = |line: usize, message| Fault::new(path, Place::Line(line), message);
    let geometry = Geometry::of(bytes).map_err(|(line, message)| at(line, message))?;
    let options =
        tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // No statement names a material, so that `tobj` asks for no material file.
    let no_material = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let loaded = tobj::load_obj_buf(&mut &geometry.text[..], &options, no_material);
    let (models, _) = loaded.map_err(|error| {
        Fault::new(path, Place::File, format!("{error}; expected a Wavefront OBJ file"))
    })?;
    let mut polygons = Polygons::default();
    let mut lines = geometry.lines.iter();
    let mut corners = Vec::new();
    let mut used = 0;
    for tobj::Model { mesh, .. } in models {
        // `tobj` keeps exactly the vertices that faces use, each once, and names no lengths of
        // faces if all are triangles.
        let (positions, _) = mesh.positions.as_chunks::<3>();
        let mut indices = &mesh.indices[..];
        let mut arities = mesh.face_arities.iter();
        while !indices.is_empty() {
            let (face, rest) = indices.split_at(arities.next().map_or(3, |&arity| arity as usize));
            corners.clear();
            corners.extend(open(face).iter().map(|&index| Vec3::from(positions[index as usize])));
            let line = lines.next().copied().unwrap_or_default();
            polygons.add(&corners).map_err(|message| at(line, format!("face of {message}")))?;
            indices = rest;
        }
        used += positions.len();
    }
    if polygons.triangles.is_empty() {
        let found = format!("{} vertices and no face of three or more", geometry.vertices);
        let message = format!("{found}; expected a Wavefront OBJ file with at least one such face");
        return Err(Fault::new(path, Place::File, message));
    }
    polygons.short += geometry.short_faces;
    let unused = unused(geometry.vertices - used);
    let remarks = unused.into_iter().chain(polygons.remarks()).chain(geometry.unknown);
    let remarks = remarks.collect();
    Ok(Mesh::new(polygons.triangles, remarks))
}
