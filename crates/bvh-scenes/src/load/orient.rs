//! Mesh files whose meshes stand along axes of their own, with the rotation back beside them.

use super::mesh::{Fault, Mesh};
use super::{Format, MeshError, gltf, obj, other};
use bvh_core::Triangle;
use glam::DMat3;
use std::path::Path;

/// Returns the rotation by which to turn the mesh with this number and these triangles, if any.
pub type Find<'a> = &'a mut dyn FnMut(usize, &[Triangle]) -> Option<DMat3>;

/// A mesh file with turned meshes.
#[derive(Clone, Debug, Default)]
pub struct Oriented {
    /// The new file: OBJ, or GLB of a glTF file.
    pub bytes: Vec<u8>,
    /// The turned meshes by their numbers in the file. An OBJ file is one mesh, number 0.
    pub turned: Vec<usize>,
    /// What the user should know, one clause each, such as why a mesh was left as it is.
    pub remarks: Vec<String>,
}

/// Turns the meshes of an OBJ or glTF file by the rotations that `find` returns, and gives the
/// inverse to their nodes, or to a comment in the first line of an OBJ file. The triangles, their
/// order, their places but for rounding the turned vertices once, and everything else stay. A mesh
/// that would lose something is left as it is.
///
/// `path` and `out` are the paths of the file and of the new one. Takes O(bytes) time and memory
/// besides `find`.
///
/// # Errors
///
/// The faults of [`parse`](super::parse); another format; a folder of `out` in which the files that
/// the file names are not; 4 GB of GLB.
pub fn orient(bytes: &[u8], path: &Path, out: &Path, find: Find) -> Result<Oriented, MeshError> {
    let oriented = other::check(bytes).and_then(|()| match Format::of(bytes, path) {
        Format::Gltf => gltf::orient(bytes, path, out, find),
        Format::Obj => obj::parse(bytes).and_then(|mesh: Mesh| {
            let rotation = find(0, &mesh.triangles);
            let new = rotation.map_or(Ok(bytes.to_vec()), |rotation| obj::turned(bytes, &rotation));
            let turned = rotation.iter().map(|_| 0).collect();
            Ok(Oriented { bytes: new?, turned, remarks: Vec::new() })
        }),
        other => {
            Err(Fault::of_file(format!("a file of the kind {other:?}; expected OBJ, glTF or GLB")))
        }
    });
    oriented.map_err(MeshError::of(path))
}
