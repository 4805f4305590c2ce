//! Reads the triangles of a Wavefront OBJ file, or says in which line it is wrong.
//!
//! `tobj` parses the numbers, resolves relative indices and cuts polygons into triangle fans. It is given the `v` and
//! `f` statements only, as `Geometry` finds them, because `tobj` 4.0.5 reads a polyline `l 1 2 3` as a triangle, skips
//! the first vertex after a byte order mark, and refuses Latin-1 comments, comments at the end of a line, continued
//! lines, and files in which only some vertices have a colour. It names no line in its errors and accepts `nan`: when it
//! refuses a file, or a word is not plainly a finite number, `explain` reads the file again and names the line.
//!
//! Points, lines, curves, names, groups, materials (whose files are never opened), normals and texture coordinates are
//! ignored. Lines may end in LF, CRLF or CR, and a backslash at the end continues a statement on the next line.

mod error;
mod explain;
mod geometry;
mod statements;

pub use error::{ObjError, Place};

use bvh_core::Triangle;
use explain::explain;
use geometry::Geometry;
use glam::Vec3;
use std::path::Path;

/// The triangles of one OBJ file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// In world units with finite corners, in the order of the file across its objects and groups. A face of n ≥ 3
    /// vertices gives the n − 2 triangles of the fan around its first vertex: exact for convex faces, while the fan of
    /// a concave one can reach outside it.
    pub triangles: Vec<Triangle>,
    /// Vertices that are a corner of no triangle. They must be finite, and count for nothing else.
    pub unused_vertices: usize,
    /// Faces left out because they have fewer than three vertices.
    pub short_faces: usize,
    /// Triangles without area (collinear or repeated corners). They are kept in `triangles`.
    pub degenerate_triangles: usize,
    /// Lines that begin with no keyword of the format, and the first of them: its number from 1 and its first word.
    pub unknown: Option<(usize, usize, String)>,
}

impl Mesh {
    /// What the file contains besides plain triangles, as one sentence; none if nothing does.
    pub fn remark(&self) -> Option<String> {
        let counted = |count: usize, one: &str, many: &str| {
            (count > 0).then(|| if count == 1 { format!("1 {one}") } else { format!("{count} {many}") })
        };
        let unknown = self.unknown.as_ref().map(|(count, line, word)| {
            let lines = if *count == 1 {
                "line with an unknown keyword was"
            } else {
                "lines with unknown keywords were"
            };
            format!("{count} {lines} ignored (`{word}` in line {line})")
        });
        let parts = [
            counted(self.unused_vertices, "vertex is used by no face", "vertices are used by no face"),
            counted(
                self.short_faces,
                "face has fewer than three vertices and was left out",
                "faces have fewer than three vertices and were left out",
            ),
            counted(self.degenerate_triangles, "triangle has no area", "triangles have no area"),
            unknown,
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// Reads the OBJ file at `path`. O(bytes) in time; memory is a few hundred bytes per triangle besides the file.
///
/// # Errors
///
/// See [`ObjError`]; whatever the file's bytes are, the outcome is a mesh with at least one triangle or one of those
/// errors.
pub fn load(path: &Path) -> Result<Mesh, ObjError> {
    let failed = |source| ObjError::of_reading(path, source);
    let file = std::fs::metadata(path).map_err(failed)?;
    if !file.is_file() {
        return Err(ObjError::not_a_file(path, file.is_dir()));
    }
    parse(&std::fs::read(path).map_err(failed)?, path)
}

/// Reads the bytes of an OBJ file; `path` only names it in errors. O(bytes). Any bytes give a mesh or an error.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, ObjError> {
    let mut geometry = Geometry::new(bytes);
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let loaded = tobj::load_obj_buf(&mut geometry, &options, no_materials);
    if loaded.is_err() || geometry.doubtful {
        explain(bytes, path)?;
    }
    let (models, _) = loaded.map_err(|source| ObjError::Tobj { path: path.to_path_buf(), source })?;
    let mut triangles = Vec::new();
    let mut used = 0;
    for tobj::Model { mesh, .. } in models {
        // tobj keeps exactly the vertices that faces use, each once.
        let (corners, _) = mesh.positions.as_chunks::<3>();
        let (faces, _) = mesh.indices.as_chunks::<3>();
        let corner = |index: u32| Vec3::from_array(corners[index as usize]);
        triangles.extend(faces.iter().map(|face| Triangle(face.map(corner))));
        used += corners.len();
    }
    if triangles.is_empty() {
        return Err(ObjError::without_faces(path, bytes, geometry.vertices));
    }
    Ok(Mesh {
        unused_vertices: geometry.vertices - used,
        short_faces: geometry.short_faces,
        degenerate_triangles: triangles.iter().filter(|triangle| triangle.is_degenerate()).count(),
        unknown: geometry.unknown(),
        triangles,
    })
}
