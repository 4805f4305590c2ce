//! The function `locations`: hit points in double precision.

use crate::arrays::{doubles, floats, integers, invalid};
use bvh_search::bvh_core::glam::DVec3;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

/// Returns the points, in `float64`, where rays cross the planes of triangles: `t`, the indices of
/// triangles and the indices of rays are from `Tracer.all`. `triangles` has the shape `(n, 3, 3)`.
#[pyfunction]
pub fn locations<'py>(
    triangles: &Bound<'py, PyAny>,
    origins: &Bound<'py, PyAny>,
    directions: &Bound<'py, PyAny>,
    t: &Bound<'py, PyAny>,
    triangle: &Bound<'py, PyAny>,
    ray: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let py = triangles.py();
    let corners = doubles("triangles", triangles, "(n, 3, 3)", |shape| matches!(shape, [_, 3, 3]))?;
    let vectors = |name, argument| {
        doubles(name, argument, "(m, 3)", |shape: &[usize]| matches!(shape, [_, 3]))
    };
    let origins = vectors("origins", origins)?;
    let directions = vectors("directions", directions)?;
    let t = floats("t", t, "(h,)", |shape| shape.len() == 1)?;
    let triangle = integers("triangle", triangle, "(h,)", |shape| shape == t.shape())?;
    let ray = integers("ray", ray, "(h,)", |shape| shape == t.shape())?;
    let (corners, _) = corners.elements()?.as_chunks::<9>();
    let (origins, _) = origins.elements()?.as_chunks::<3>();
    let (directions, _) = directions.elements()?.as_chunks::<3>();
    let (t, triangle, ray) = (t.elements()?, triangle.elements()?, ray.elements()?);
    let mut points = Vec::with_capacity(3 * t.len());
    for ((&t, &triangle), &ray) in t.iter().zip(triangle).zip(ray) {
        let missing = || invalid("locations: accepted: hits of these rays and triangles");
        let &[ax, ay, az, bx, by, bz, cx, cy, cz] =
            corners.get(triangle as usize).ok_or_else(missing)?;
        let a = DVec3::new(ax, ay, az);
        let normal = (DVec3::new(bx, by, bz) - a).cross(DVec3::new(cx, cy, cz) - a);
        let origin = DVec3::from(*origins.get(ray as usize).ok_or_else(missing)?);
        let direction = DVec3::from(*directions.get(ray as usize).ok_or_else(missing)?);
        let exact = normal.dot(a - origin) / normal.dot(direction);
        // Next to a plane that is nearly parallel, the distance in f32 is as good.
        let rounded = f64::from(t);
        let is_close = (exact - rounded).abs() <= 1e-4 * rounded.abs().max(1e-3);
        let distance = if is_close { exact } else { rounded };
        points.extend((origin + direction * distance).to_array());
    }
    points.into_pyarray(py).reshape([t.len(), 3])
}
