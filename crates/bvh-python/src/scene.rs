//! The functions that check the arrays of the class `RaycastingScene`.

use crate::arrays::{MeshNames, given, mesh};
use crate::precision::{Precision, with_precision};
use crate::rays::Vectors;
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;

/// The arguments of `RaycastingScene.add_triangles`.
const NAMES: MeshNames = MeshNames { vertices: "vertex_positions", faces: "triangle_indices" };

/// Returns the corners, `(n, 3, 3)`, of the triangles of a mesh, with the checks of
/// `Tree.from_mesh`: in `float32` if the vertices are, and otherwise in `float64`.
#[pyfunction]
pub fn corners<'py>(
    vertex_positions: &Bound<'py, PyAny>,
    triangle_indices: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let vertices = given(NAMES.vertices, vertex_positions, "(v, 3)")?;
    with_precision!(Precision::of(&vertices), N => {
        let (triangles, _) = mesh::<N>(NAMES, &vertices, triangle_indices)?;
        let numbers: Vec<N> = bytemuck::cast_slice(&triangles).to_vec();
        let corners = numbers.into_pyarray(vertex_positions.py());
        Ok(corners.reshape([triangles.len(), 3, 3])?.into_any())
    })
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
