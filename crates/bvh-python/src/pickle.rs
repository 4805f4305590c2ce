//! The bytes in the pickle of a tree. A pickle may be forged, so every part is checked.

use crate::arrays::Faces;
use crate::elements::invalid;
use crate::precision::Real;
use crate::threads::detached;
use bvh_search::bvh_core::DTriangle;
use bvh_search::{Objects, OwnedTree};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The arguments that restore a tree: the kind of objects, the objects, the file, the faces and the
/// number of vertices.
pub type State<'py> =
    (&'static str, Bound<'py, PyBytes>, Bound<'py, PyBytes>, Option<Bound<'py, PyBytes>>, usize);

pub fn state<'py>(
    py: Python<'py>,
    owned: &OwnedTree,
    faces: Option<&Faces>,
) -> PyResult<State<'py>> {
    let bytes = |numbers: &[u8]| PyBytes::new(py, numbers);
    let tree = detached(py, || owned.save())?.map_err(invalid)?;
    let (shape, objects) = match (owned.triangles(), owned.doubles()) {
        (Some(triangles), _) => ("triangles", bytes(bytemuck::cast_slice(triangles))),
        (_, Some(doubles)) => ("doubles", bytes(bytemuck::cast_slice(doubles))),
        _ => ("boxes", bytes(bytemuck::cast_slice(owned.boxes()))),
    };
    let vertices = faces.map_or(0, |faces| faces.vertices);
    let faces = faces.map(|faces| bytes(bytemuck::cast_slice(&faces.corners)));
    Ok((shape, objects, bytes(&tree), faces, vertices))
}

pub fn tree(py: Python, shape: &str, objects: &[u8], tree: &[u8]) -> PyResult<OwnedTree> {
    let objects = match shape {
        "triangles" => Objects::Shapes(f32::shapes(numbers("objects", objects)?)),
        "doubles" => {
            let triangles: Vec<DTriangle> = numbers("objects", objects)?;
            DTriangle::check(&triangles).map_err(|error| invalid(format!("objects: {error}")))?;
            Objects::Shapes(f64::shapes(triangles))
        }
        "boxes" => Objects::Boxes(numbers("objects", objects)?),
        _ => {
            return Err(invalid(format!(
                "shape is {shape:?}; accepted: triangles, doubles, boxes"
            )));
        }
    };
    let loaded = detached(py, || OwnedTree::load(objects, tree))?;
    loaded.map_err(|error| invalid(format!("tree: {error}")))
}

/// Restores the faces of a mesh, whose triangles are the objects of the tree.
pub fn faces(owned: &OwnedTree, faces: &[u8], vertices: usize) -> PyResult<Faces> {
    let corners: Vec<[u32; 3]> = numbers("faces", faces)?;
    let is_mesh = owned.triangles().is_some() || owned.doubles().is_some();
    let accepted = if is_mesh { owned.objects() } else { 0 };
    let found = corners.len();
    if found != accepted {
        return Err(invalid(format!("faces has {found} faces; accepted: {accepted}, as objects")));
    }
    Ok(Faces { corners, vertices })
}

/// Reads numbers of a pickle, whose bytes may begin anywhere.
fn numbers<T: bytemuck::AnyBitPattern>(name: &str, bytes: &[u8]) -> PyResult<Vec<T>> {
    if !bytes.len().is_multiple_of(size_of::<T>()) {
        let (found, accepted) = (bytes.len(), size_of::<T>());
        return Err(invalid(format!(
            "{name} has {found} bytes; accepted: multiples of {accepted}"
        )));
    }
    Ok(bytes.chunks(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
}
