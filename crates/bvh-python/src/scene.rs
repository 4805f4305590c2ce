//! The functions that check the arrays of the class `RaycastingScene`.

use crate::arrays::{MeshNames, Vectors, mesh, numbers};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

/// The arguments of `RaycastingScene.add_triangles`.
const NAMES: MeshNames = MeshNames { vertices: "vertex_positions", faces: "triangle_indices" };

/// Returns the corners, `(n, 3, 3)` in `float64`, of the triangles of a mesh, with the checks of
/// `Tree.from_mesh`.
#[pyfunction]
pub fn corners<'py>(
    vertex_positions: &Bound<'py, PyAny>,
    triangle_indices: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (_, faces) = mesh(NAMES, vertex_positions, triangle_indices)?;
    let vertices =
        numbers::<f64>(NAMES.vertices, vertex_positions, "(v, 3)", |shape| shape.len() == 2)?;
    let (vertices, _) = vertices.elements()?.as_chunks::<3>();
    let numbers: Vec<f64> =
        faces.as_flattened().iter().flat_map(|&vertex| vertices[vertex as usize]).collect();
    numbers.into_pyarray(vertex_positions.py()).reshape([faces.len(), 3, 3])
}

/// Converts the argument called `name` to `float32` or `float64` and checks that its last axis has
/// this length.
#[pyfunction]
pub fn rows<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let accepted = format!("(..., {length})");
    let array = Vectors::read(name, argument, &accepted, |shape| shape.last() == Some(&length))?;
    Ok(array.into_numpy())
}
