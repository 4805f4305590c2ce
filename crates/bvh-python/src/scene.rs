//! The functions that check the arrays of the class `RaycastingScene`.

use crate::arrays::{MeshNames, floats, mesh};
use numpy::{IntoPyArray, PyArray3, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;

/// The arguments of `RaycastingScene.add_triangles`.
const NAMES: MeshNames = MeshNames { vertices: "vertex_positions", faces: "triangle_indices" };

/// Returns the corners, `(n, 3, 3)`, of the triangles of a mesh, with the checks of
/// `Tree.from_mesh`.
#[pyfunction]
pub fn corners<'py>(
    vertex_positions: &Bound<'py, PyAny>,
    triangle_indices: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let (triangles, faces) = mesh(NAMES, vertex_positions, triangle_indices)?;
    let numbers: Vec<f32> = bytemuck::cast_slice(&triangles).to_vec();
    numbers.into_pyarray(vertex_positions.py()).reshape([faces.len(), 3, 3])
}

/// Converts the argument called `name` to `float32` and checks that its last axis has this length.
#[pyfunction]
pub fn rows<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    length: usize,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let accepted = format!("(..., {length})");
    let array = floats(name, argument, &accepted, |shape| shape.last() == Some(&length))?;
    Ok(array.into_numpy())
}
