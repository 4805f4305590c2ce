//! Arguments: numpy arrays of the right shape, or an error that names the argument, what was found and what is accepted.

use bvh_search::bvh_core::Primitives;
use bvh_search::{Objects, prelude::*};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;

/// An argument that is not accepted.
pub fn refused(message: impl Display) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// Whatever numpy makes an array of, as `float32` in rows, if its shape is accepted.
fn floats<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
    accepts: impl Fn(&[usize]) -> bool,
) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    let py = argument.py();
    let how = PyDict::new(py);
    how.set_item("dtype", "float32")?;
    how.set_item("order", "C")?;
    let numpy = py.import("numpy")?;
    let no_array =
        |error: PyErr| refused(format!("{name}: {}; accepted: {accepted}", error.value(py)));
    let given = numpy
        .call_method1("asanyarray", (argument,))
        .map_err(no_array)?;
    check_elements(name, &numpy, &given)?;
    let array = numpy
        .call_method("asarray", (given,), Some(&how))
        .map_err(no_array)?;
    let array: PyReadonlyArrayDyn<f32> = array.extract()?;
    if accepts(array.shape()) {
        return Ok(array);
    }
    let sizes: Vec<String> = array
        .shape()
        .iter()
        .map(usize::to_string)
        .collect();
    Err(refused(format!("{name} has shape ({}); accepted: {accepted}", sizes.join(", "))))
}

/// Refuses elements of which a conversion to `float32` would drop something without a word: imaginary parts, units, masks.
fn check_elements(name: &str, numpy: &Bound<PyModule>, array: &Bound<PyAny>) -> PyResult<()> {
    const REAL_NUMBERS: &str = "biuf";
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    if !REAL_NUMBERS.contains(&kind) {
        return Err(refused(format!("{name} has dtype {}; accepted: real numbers", dtype.str()?)));
    }
    if numpy
        .getattr("ma")?
        .call_method1("is_masked", (array,))?
        .is_truthy()?
    {
        return Err(refused(format!("{name} has masked elements; accepted: none")));
    }
    Ok(())
}

/// Triangles, three corners each.
pub fn triangles(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array = floats("triangles", argument, "(n, 3, 3)", |shape| matches!(shape, [_, 3, 3]))?;
    let triangles: &[Triangle] = bytemuck::cast_slice(array.as_slice()?);
    Ok(Objects::Shapes(Primitives::Triangles(triangles.to_vec())))
}

/// Boxes, lower and upper corner.
pub fn boxes(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array = floats("boxes", argument, "(n, 2, 3) or (n, 6)", |shape| {
        matches!(shape, [_, 2, 3] | [_, 6])
    })?;
    let boxes: &[Aabb] = bytemuck::cast_slice(array.as_slice()?);
    Ok(Objects::Boxes(boxes.to_vec()))
}

/// Rays from `origins` in `directions` over the ranges from `t_min` to `t_max`, each one number for all or one per ray.
pub fn rays(
    origins: &Bound<PyAny>,
    directions: &Bound<PyAny>,
    t_min: Option<&Bound<PyAny>>,
    t_max: Option<&Bound<PyAny>>,
) -> PyResult<Vec<Ray>> {
    let origins = floats("origins", origins, "(m, 3)", |shape| matches!(shape, [_, 3]))?;
    let rays = origins.shape()[0];
    let accepted = format!("({rays}, 3), as origins");
    let directions = floats("directions", directions, &accepted, |shape| shape == [rays, 3])?;
    let accepted = format!("a number or ({rays},), as origins");
    let range = |name, argument: Option<&Bound<PyAny>>, default: f32| -> PyResult<Vec<f32>> {
        let Some(argument) = argument else { return Ok(vec![default]) };
        let range = floats(name, argument, &accepted, |shape| shape.is_empty() || shape == [rays])?;
        Ok(range.as_slice()?.to_vec())
    };
    let t_min = range("t_min", t_min, 0.0)?;
    let t_max = range("t_max", t_max, f32::INFINITY)?;
    let of = |range: &[f32], index: usize| if range.len() == 1 { range[0] } else { range[index] };
    let origins = origins.as_slice()?;
    let directions = directions.as_slice()?;
    let points = |values: &[f32], index: usize| -> [f32; 3] { values.as_chunks().0[index] };
    let ray = |index: usize| {
        let origin = points(origins, index);
        let direction = points(directions, index);
        Ray::new(origin, direction, of(&t_min, index), of(&t_max, index))
            .map_err(|error| refused(format!("ray {index}: {error}")))
    };
    (0..rays).map(ray).collect()
}
