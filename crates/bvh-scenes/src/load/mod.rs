//! Mesh files of every format. The bytes decide the format, and the name does where they do not.

mod ears;
mod gltf;
pub mod mesh;
mod obj;
mod other;
mod ply;
mod polygon;
mod stl;
mod text;

use crate::files::{ReadError, read};
use bvh_core::Triangle;
use glam::DMat3;
pub use gltf::glb;
use mesh::{Fault, FromFile, Mesh};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The reason why a file gave no triangles.
#[derive(Debug, Error)]
pub enum MeshError {
    /// The file does not exist or cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file is invalid.
    #[error("{}{fault}", .path.display())]
    Fault {
        /// The file's path as the caller gave it.
        path: PathBuf,
        /// The place and the reason.
        fault: Fault,
    },
}

impl MeshError {
    /// Returns a function for `map_err` that names the file.
    fn of(path: &Path) -> impl FnOnce(Fault) -> Self {
        move |fault| Self::Fault { path: path.to_path_buf(), fault }
    }
}

/// The formats of meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// Polygon File Format, text or binary.
    Ply,
    /// Stereolithography, text or binary.
    Stl,
    /// glTF 2.0, as JSON or as one binary file (GLB).
    Gltf,
}

impl Format {
    /// Returns the format of a file with these bytes at this path. OBJ has no signature, so every
    /// file without another format's signature or extension counts as OBJ.
    pub fn of(bytes: &[u8], path: &Path) -> Self {
        let unmarked = without_mark(bytes);
        let text = unmarked.trim_ascii_start();
        if bytes.starts_with(b"glTF") || text.starts_with(b"{") {
            return Self::Gltf;
        }
        if let [word @ .., after] = &unmarked[..unmarked.len().min(4)]
            && word.eq_ignore_ascii_case(b"ply")
            && after.is_ascii_whitespace()
        {
            return Self::Ply;
        }
        if stl::is_binary(bytes) || stl::is_text(unmarked) {
            return Self::Stl;
        }
        let extension =
            path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("ply") => Self::Ply,
            Some("stl") => Self::Stl,
            Some("gltf" | "glb") => Self::Gltf,
            _ => Self::Obj,
        }
    }
}

fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Reads the mesh file at `path`. Any bytes give a mesh with at least one triangle or an error.
/// A glTF file may refer to files in its folder and below. Takes O(bytes) time, and a few hundred
/// bytes of memory per triangle besides the file.
pub fn load(path: &Path) -> Result<Mesh, MeshError> {
    load_as(path)
}

/// Reads the mesh file at `path` as triangles in f32 or f64.
pub(crate) fn load_as<T: FromFile>(path: &Path) -> Result<Mesh<T>, MeshError> {
    parse_as(&read(path)?, path)
}

/// Reads the bytes of a mesh file as [`load`] does. `path` names the file in errors, and a glTF
/// file's references are relative to its folder.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, MeshError> {
    parse_as(bytes, path)
}

fn parse_as<T: FromFile>(bytes: &[u8], path: &Path) -> Result<Mesh<T>, MeshError> {
    let parsed = other::check(bytes).and_then(|()| match Format::of(bytes, path) {
        Format::Obj => obj::parse(bytes),
        Format::Ply => ply::parse(bytes),
        Format::Stl => stl::parse(bytes),
        Format::Gltf => gltf::parse(bytes, path),
    });
    parsed.map_err(MeshError::of(path))
}

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
/// The faults of [`parse`]; another format; a folder of `out` in which the files that
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
