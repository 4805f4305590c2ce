//! Converts and checks numpy arrays. Errors name the argument, the value found and the values
//! accepted.

use bvh_search::bvh_core::Primitives;
use bvh_search::{Objects, prelude::*};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;

/// Creates the error of an invalid argument.
pub fn invalid(message: impl Display) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// Converts anything that numpy accepts as an array to `float32` in row order, and checks its
/// shape.
fn floats<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
    accepts: impl Fn(&[usize]) -> bool,
) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    let py = argument.py();
    let options = PyDict::new(py);
    options.set_item("dtype", "float32")?;
    options.set_item("order", "C")?;
    let numpy = py.import("numpy")?;
    let no_array =
        |error: PyErr| invalid(format!("{name}: {}; accepted: {accepted}", error.value(py)));
    // `asanyarray` keeps masked arrays, whose masks the conversion below would drop silently.
    let given = numpy
        .call_method1("asanyarray", (argument,))
        .map_err(no_array)?;
    check_elements(name, &numpy, &given)?;
    let array = numpy
        .call_method("asarray", (given,), Some(&options))
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
    Err(invalid(format!("{name} has shape ({}); accepted: {accepted}", sizes.join(", "))))
}

/// Rejects elements that would silently lose their imaginary part, unit or mask in a conversion to
/// `float32`.
fn check_elements(name: &str, numpy: &Bound<PyModule>, array: &Bound<PyAny>) -> PyResult<()> {
    const REAL_NUMBERS: &str = "biuf";
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    if !REAL_NUMBERS.contains(&kind) {
        return Err(invalid(format!("{name} has dtype {}; accepted: real numbers", dtype.str()?)));
    }
    let masked_arrays = numpy.getattr("ma")?;
    let is_masked = masked_arrays.call_method1("is_masked", (array,))?;
    if is_masked.is_truthy()? {
        return Err(invalid(format!("{name} has masked elements; accepted: none")));
    }
    Ok(())
}

/// Reads triangles with three corners each.
pub fn triangles(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array = floats("triangles", argument, "(n, 3, 3)", |shape| matches!(shape, [_, 3, 3]))?;
    let triangles: &[Triangle] = bytemuck::cast_slice(array.as_slice()?);
    Ok(Objects::Shapes(Primitives::Triangles(triangles.to_vec())))
}

/// Reads boxes with a lower and an upper corner each.
pub fn boxes(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array = floats("boxes", argument, "(n, 2, 3) or (n, 6)", |shape| {
        matches!(shape, [_, 2, 3] | [_, 6])
    })?;
    let boxes: &[Aabb] = bytemuck::cast_slice(array.as_slice()?);
    Ok(Objects::Boxes(boxes.to_vec()))
}

/// Reads rays. `t_min` and `t_max` are one number for all rays or one number per ray.
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
    let limits = |name, argument: Option<&Bound<PyAny>>, default: f32| -> PyResult<Vec<f32>> {
        let Some(argument) = argument else { return Ok(vec![default; rays]) };
        let limit = floats(name, argument, &accepted, |shape| shape.is_empty() || shape == [rays])?;
        // An array without axes is one number for all rays.
        match limit.shape() {
            [] => Ok(vec![limit.as_slice()?[0]; rays]),
            _ => Ok(limit.as_slice()?.to_vec()),
        }
    };
    let t_min = limits("t_min", t_min, 0.0)?;
    let t_max = limits("t_max", t_max, f32::INFINITY)?;
    let (origins, _) = origins.as_slice()?.as_chunks::<3>();
    let (directions, _) = directions.as_slice()?.as_chunks::<3>();
    (0..rays)
        .map(|index| {
            Ray::new(origins[index], directions[index], t_min[index], t_max[index])
                .map_err(|error| invalid(format!("ray {index}: {error}")))
        })
        .collect()
}
