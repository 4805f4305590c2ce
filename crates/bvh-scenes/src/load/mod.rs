//! Mesh files of every format. The bytes decide the format, and the name does where they do not.

mod ears;
mod gltf;
pub mod mesh;
mod obj;
mod orient;
mod other;
mod ply;
mod polygon;
mod stl;
mod text;

use crate::files::{ReadError, read};
pub use gltf::glb;
use mesh::{Fault, FromFile, Mesh};
pub use orient::{Find, Oriented, orient};
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
