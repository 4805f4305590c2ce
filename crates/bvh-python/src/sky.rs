//! Skies: built-in ones as arrays, and points that look at any.

use crate::arrays::{Column, Rows, numbers};
use crate::elements::invalid;
use crate::precision::{Point, Real};
use crate::rays::vectors;
use crate::scalars::count;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{Sky, View};
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use std::num::NonZeroU32;

/// Returns directions of the sky above the plane of x (east) and y (north), unit vectors `(m, 3)`,
/// and their weights, `(m,)`: the solid angle of each over π. With `cosine=True`,
/// `Tracer.visible` then returns sky view factors: of a free horizontal surface 1, to 0.6 % with 145
/// patches.
///
/// `patches` are the middles of the 145 patches of Tregenza, the default, or of the 577, 1297 and so
/// on, 144 k² + 1, into which Reinhart divides them, in rows from the horizon to the zenith, from
/// north over east. `uniform` directions have the same solid angle each.
///
/// >>> from bvh_search import sky
/// >>> directions, weights = sky(patches=145)
/// >>> directions[0].round(3), float(weights.sum().round(9))
/// (array([0.   , 0.995, 0.105]), 2.0)
#[pyfunction]
#[pyo3(signature = (patches = None, *, uniform = None))]
pub fn sky<'py>(
    py: Python<'py>,
    patches: Option<&Bound<'py, PyAny>>,
    uniform: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Rows<'py, f64>, Column<'py, f64>)> {
    let sky = match (patches, uniform) {
        (Some(_), Some(_)) => return Err(invalid("patches and uniform; accepted: one of them")),
        (None, Some(uniform)) => Sky::uniform(count("uniform", uniform)?),
        (patches, None) => {
            let patches = patches.map_or(Ok(145), |patches| count("patches", patches))?;
            let division = NonZeroU32::new((patches / 144).isqrt());
            let Some(division) = division.filter(|d| 144 * d.get().pow(2) + 1 == patches) else {
                let accepted = "145, 577, 1297 and so on, 144 k^2 + 1";
                return Err(invalid(format!("patches is {patches}; accepted: {accepted}")));
            };
            Sky::patches(division)
        }
    };
    let directions: Vec<f64> = sky.directions().iter().flat_map(DVec3::to_array).collect();
    let directions = directions.into_pyarray(py).reshape([sky.directions().len(), 3])?;
    Ok((directions, sky.weights().to_vec().into_pyarray(py)))
}

/// Points, the sky at which they look, and how its weights count.
pub struct Views<N: Real> {
    points: Vec<Point<N>>,
    normals: Option<Vec<Point<N>>>,
    cosine: bool,
    pub sky: Sky,
    /// That of the answers, the points first.
    pub shape: Vec<usize>,
}

impl<N: Real> Views<N> {
    /// Reads the arguments of `Tracer.visible`.
    pub fn read(
        [points, directions]: [&Bound<PyAny>; 2],
        [weights, normals, t_min, t_max]: [Option<&Bound<PyAny>>; 4],
        cosine: bool,
    ) -> PyResult<Self> {
        let points = vectors::<N, _>("points", points, (None, 0), N::point)?;
        let directions = vectors::<N, _>("directions", directions, (None, 1), |found| found)?;
        let rows = (Some(points.len()), 0);
        let normals = normals.map(|normals| vectors::<N, _>("normals", normals, rows, N::point));
        let normals = normals.transpose()?;
        if cosine && (normals.is_none() || weights.is_none()) {
            return Err(invalid("cosine is True; accepted: with weights and normals"));
        }
        let limit = |name: &str, argument: Option<&Bound<PyAny>>, default: f64| match argument {
            Some(argument) => {
                Ok(numbers::<f64>(name, argument, "a number", <[_]>::is_empty)?.elements()?[0])
            }
            None => PyResult::Ok(default),
        };
        let limits = [limit("t_min", t_min, 0.0)?, limit("t_max", t_max, f64::INFINITY)?];
        let count = directions.len();
        let mut sky = Sky::new(directions, N::range(limits)).map_err(invalid)?;
        let mut shape = vec![points.len(), count];
        if let Some(weights) = weights {
            let accepted = format!("({count},) or ({count}, k), as directions");
            let weights = numbers::<f64>("weights", weights, &accepted, |shape| {
                shape.first() == Some(&count) && matches!(shape, [_] | [_, 1..=usize::MAX])
            })?;
            sky = sky.with_weights(weights.elements()?.to_vec()).map_err(invalid)?;
            shape.splice(1.., weights.shape()[1..].iter().copied());
        }
        Ok(Self { points, normals, cosine, sky, shape })
    }

    pub fn view(&self) -> View<'_, Point<N>> {
        View { points: &self.points, normals: self.normals.as_deref() }
    }

    /// Writes the sums of the weights of the free directions in a point's row.
    pub fn sums(&self, point: usize, row: &[u64], sums: &mut [f64]) {
        let normals = self.normals.as_ref().filter(|_| self.cosine);
        let normal = normals.map(|normals| normals[point].into());
        for (sum, found) in sums.iter_mut().zip(self.sky.sums(row, normal)) {
            *sum = found;
        }
    }
}
