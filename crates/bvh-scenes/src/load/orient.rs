//! Mesh files whose meshes stand along axes of their own, with the rotation back beside them.

use super::mesh::Fault;
use super::text::{line, words};
use super::{Format, MeshError, gltf, obj};
use bvh_core::Triangle;
use glam::{DMat3, DVec3};
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
    let oriented = match Format::of(bytes, path) {
        Format::Gltf => gltf::orient(bytes, path, out, find),
        Format::Obj => obj::parse(bytes).and_then(|mesh| match find(0, &mesh.triangles) {
            Some(rotation) => Ok(Oriented {
                bytes: turned(bytes, &rotation)?,
                turned: vec![0],
                remarks: Vec::new(),
            }),
            None => Ok(Oriented { bytes: bytes.to_vec(), ..Oriented::default() }),
        }),
        other => {
            Err(Fault::of_file(format!("a file of the kind {other:?}; expected OBJ, glTF or GLB")))
        }
    };
    oriented.map_err(MeshError::of(path))
}

/// Turns the vertices and the normals of an OBJ file, in double precision, which other programs may
/// read.
fn turned(bytes: &[u8], rotation: &DMat3) -> Result<Vec<u8>, Fault> {
    let rows = rotation.to_cols_array().map(|number| number.to_string()).join(" ");
    let mut turned = format!("# scene = matrix * vertex, matrix by rows: {rows}\n").into_bytes();
    let mut rest = super::without_mark(bytes);
    let mut number = 0;
    loop {
        let start = rest;
        let Some(code) = line(&mut rest) else { return Ok(turned) };
        number += 1;
        let whole = &start[..start.len() - rest.len()];
        let mut words = words(code);
        let keyword = words.next().unwrap_or_default();
        let is_vector = matches!(keyword, b"v" | b"V" | b"vn" | b"VN");
        let triple: Vec<&[u8]> = words.take(if is_vector { 3 } else { 0 }).collect();
        let numbers = triple.iter().map_while(|word| str::from_utf8(word).ok()?.parse().ok());
        match numbers.filter(|x: &f64| x.is_finite()).collect::<Vec<f64>>()[..] {
            [x, y, z] => {
                let [x, y, z] = (*rotation * DVec3::new(x, y, z)).to_array();
                let end = triple[2].as_ptr_range().end.addr() - whole.as_ptr().addr();
                turned
                    .extend([keyword, format!(" {x} {y} {z}").as_bytes(), &whole[end..]].concat());
            }
            _ if is_vector && code.ends_with(b"\\") => {
                return Err(Fault::in_line(number, "a vertex on two lines; expected it on one"));
            }
            // What is no number is used by no face.
            _ => turned.extend(whole),
        }
    }
}
