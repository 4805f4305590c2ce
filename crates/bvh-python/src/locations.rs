//! The function `locations`: hit points in double precision.

use crate::arrays::numbers;
use crate::threads::Query;
use bvh_search::bvh_core::glam::DVec3;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

/// The number of hits that a thread locates at once.
const PART: usize = 1024;

/// Returns the points, in `float64`, where rays cross triangles: the indices of triangles and rays
/// are from `Tracer.all`. `triangles` has the shape `(n, 3, 3)`. Each point is in the box of its
/// triangle.
#[pyfunction]
pub fn locations<'py>(
    triangles: &Bound<'py, PyAny>,
    origins: &Bound<'py, PyAny>,
    directions: &Bound<'py, PyAny>,
    triangle: &Bound<'py, PyAny>,
    ray: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let py = triangles.py();
    let corners =
        numbers::<f64>("triangles", triangles, "(n, 3, 3)", |shape| matches!(shape, [_, 3, 3]))?;
    let vectors = |name, argument| {
        numbers::<f64>(name, argument, "(m, 3)", |shape: &[usize]| matches!(shape, [_, 3]))
    };
    let origins = vectors("origins", origins)?;
    let directions = vectors("directions", directions)?;
    let triangle = numbers::<i64>("triangle", triangle, "(h,)", |shape| shape.len() == 1)?;
    let ray = numbers::<i64>("ray", ray, "(h,)", |shape| shape == triangle.shape())?;
    let (corners, _) = corners.elements()?.as_chunks::<3>();
    let (triangles, _) = corners.as_chunks::<3>();
    let (origins, _) = origins.elements()?.as_chunks::<3>();
    let (directions, _) = directions.elements()?.as_chunks::<3>();
    let hits = (triangle.elements()?, ray.elements()?);
    let count = hits.0.len();
    let points = Query::ask(py, None, count.div_ceil(PART), |query| {
        let mut points = vec![0.0; 3 * count];
        let parts =
            (points.par_chunks_mut(3 * PART), hits.0.par_chunks(PART), hits.1.par_chunks(PART));
        query.answer(parts.into_par_iter(), |_, (points, triangle, ray)| {
            for ((point, &triangle), &ray) in
                points.as_chunks_mut().0.iter_mut().zip(triangle).zip(ray)
            {
                let missing = || "locations: accepted: hits of these rays and triangles";
                let corners =
                    triangles.get(triangle as usize).ok_or_else(missing)?.map(DVec3::from);
                let origin = DVec3::from(*origins.get(ray as usize).ok_or_else(missing)?);
                let direction = DVec3::from(*directions.get(ray as usize).ok_or_else(missing)?);
                *point = location(corners, origin, direction).to_array();
            }
            Ok(())
        })?;
        Ok(points)
    })?;
    points.into_pyarray(py).reshape([count, 3])
}

/// Returns the point where a ray crosses the triangle that it is known to hit.
fn location([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let mut distance = normal.dot(a - origin) / normal.dot(direction);
    // Next to a plane that is nearly parallel, rounding moves the quotient out of the triangle.
    let lower = a.min(b).min(c);
    let upper = a.max(b).max(c);
    for axis in (0..3).filter(|&axis| direction[axis] != 0.0) {
        let [p, q] = [lower, upper].map(|corner| (corner[axis] - origin[axis]) / direction[axis]);
        distance = distance.max(p.min(q)).min(p.max(q));
    }
    (origin + direction * distance).clamp(lower, upper)
}
