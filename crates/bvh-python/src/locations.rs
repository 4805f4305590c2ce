//! The function `locations`: hit points in double precision.

use crate::arrays::invalid;
use bvh_search::bvh_core::glam::DVec3;
use numpy::{IntoPyArray, Ix2, Ix3, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1};
use pyo3::prelude::*;

/// Returns the points, in `float64`, where rays cross the planes of triangles: `t`, the indices of
/// triangles and the indices of rays are from `Tracer.all`. `triangles` has the shape `(n, 3, 3)`.
#[pyfunction]
pub fn locations<'py>(
    triangles: PyReadonlyArray<'py, f64, Ix3>,
    origins: PyReadonlyArray<'py, f64, Ix2>,
    directions: PyReadonlyArray<'py, f64, Ix2>,
    t: PyReadonlyArray1<'py, f32>,
    triangle: PyReadonlyArray1<'py, i32>,
    ray: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let py = triangles.py();
    let (corners, _) = triangles.as_slice()?.as_chunks::<9>();
    let (origins, _) = origins.as_slice()?.as_chunks::<3>();
    let (directions, _) = directions.as_slice()?.as_chunks::<3>();
    let triangle = triangle.as_slice()?;
    let ray = ray.as_slice()?;
    let t = t.as_slice()?;
    let mut points = Vec::with_capacity(3 * t.len());
    for ((&t, &triangle), &ray) in t.iter().zip(triangle).zip(ray) {
        let missing = || invalid("locations: accepted: hits of these rays and triangles");
        let &[ax, ay, az, bx, by, bz, cx, cy, cz] = corners
            .get(triangle as usize)
            .ok_or_else(missing)?;
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
