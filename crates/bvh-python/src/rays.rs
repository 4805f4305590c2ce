//! Reads the arrays of rays and points, and which triangles count for each ray.

use crate::arrays::{Array, given, numbers};
use crate::elements::invalid;
use crate::precision::{Point, Precision, Real};
use crate::scalars::named;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{Orientation, Select};
use pyo3::prelude::*;

/// Reads points, `(m, 3)`.
pub fn points<N: Real>(argument: &Bound<PyAny>) -> PyResult<Vec<Point<N>>> {
    let points = Vectors::read("points", argument, "(m, 3)", |shape| matches!(shape, [_, 3]))?;
    let slice = points.slice()?;
    Ok((0..points.len()).map(|index| N::point(slice.at(index))).collect())
}

/// Reads vectors, `(m, 3)`, or a row for each of so many points, as they are in rays: `part` 0 is an
/// origin and 1 a direction.
pub fn vectors<N: Real, T>(
    name: &str,
    argument: &Bound<PyAny>,
    (rows, part): (Option<usize>, usize),
    made: impl Fn(DVec3) -> T,
) -> PyResult<Vec<T>> {
    let accepted = rows.map_or("(m, 3)".to_owned(), |rows| format!("({rows}, 3), as points"));
    let vectors = Vectors::read(
        name,
        argument,
        &accepted,
        |shape| matches!(*shape, [found, 3] if rows.is_none_or(|rows| rows == found)),
    )?;
    let slice = vectors.slice()?;
    let vector = |row| {
        let found = slice.at(row);
        let mut ends = [DVec3::ZERO, DVec3::X];
        ends[part] = found;
        let ray = N::ray(ends[0], ends[1], [0.0, 1.0]).map_err(|_| {
            let accepted = [N::ACCEPTED, N::DIRECTIONS][part];
            invalid(format!("{name} has {:?} in row {row}; accepted: {accepted}", found.to_array()))
        })?;
        Ok(made(N::ends(&ray)[part]))
    };
    (0..vectors.len()).map(vector).collect()
}

/// Points or directions in either precision, without a copy of the array.
pub enum Vectors<'py> {
    Single(Array<'py, f32>),
    Double(Array<'py, f64>),
}

impl<'py> Vectors<'py> {
    pub fn read(
        name: &str,
        argument: &Bound<'py, PyAny>,
        accepted: &str,
        accepts: impl Fn(&[usize]) -> bool,
    ) -> PyResult<Self> {
        let array = &given(name, argument, accepted)?;
        match Precision::of(array) {
            Precision::Single => numbers(name, array, accepted, accepts).map(Self::Single),
            Precision::Double => numbers(name, array, accepted, accepts).map(Self::Double),
        }
    }

    pub fn into_numpy(self) -> Bound<'py, PyAny> {
        match self {
            Self::Single(array) => array.into_numpy().into_any(),
            Self::Double(array) => array.into_numpy().into_any(),
        }
    }

    fn len(&self) -> usize {
        let shape = match self {
            Self::Single(array) => array.shape(),
            Self::Double(array) => array.shape(),
        };
        shape.iter().product::<usize>() / 3
    }

    fn slice(&self) -> PyResult<VectorSlice<'_>> {
        Ok(match self {
            Self::Single(array) => VectorSlice::Single(array.elements()?.as_chunks().0),
            Self::Double(array) => VectorSlice::Double(array.elements()?.as_chunks().0),
        })
    }
}

/// A vector for each index, or one for all.
#[derive(Clone, Copy)]
enum VectorSlice<'a> {
    Single(&'a [[f32; 3]]),
    Double(&'a [[f64; 3]]),
}

impl VectorSlice<'_> {
    #[inline(always)]
    fn at(self, index: usize) -> DVec3 {
        match self {
            Self::Single(vectors) => DVec3::from(at(vectors, index).map(f64::from)),
            Self::Double(vectors) => DVec3::from(*at(vectors, index)),
        }
    }
}

/// Returns an element; the first one is for all later ones that are missing.
#[inline(always)]
fn at<T>(elements: &[T], index: usize) -> &T {
    elements.get(index).unwrap_or(&elements[0])
}

/// The origins and the directions of rays: one for all rays, or one per ray.
pub struct Ends<'py> {
    origins: Vectors<'py>,
    directions: Vectors<'py>,
}

impl<'py> Ends<'py> {
    pub fn read(origins: &Bound<'py, PyAny>, directions: &Bound<'py, PyAny>) -> PyResult<Self> {
        let are_vectors = |shape: &[usize]| matches!(shape, [_, 3] | [3]);
        let origins = Vectors::read("origins", origins, "(m, 3) or (3,)", are_vectors)?;
        let accepted = match origins.len() {
            1 => "(m, 3) or (3,)".to_owned(),
            rays => format!("({rays}, 3), as origins, or (3,)"),
        };
        let directions = Vectors::read("directions", directions, &accepted, |shape| {
            are_vectors(shape) && (origins.len() == 1 || matches!(shape, [3] | [1, 3]))
                || shape == [origins.len(), 3]
        })?;
        Ok(Self { origins, directions })
    }

    /// Reads the other arguments of a call, and returns the rays for threads without Python. An
    /// `invalid` ray is an `error` or a `miss`.
    pub fn source(
        &self,
        [t_min, t_max]: [Option<&Bound<PyAny>>; 2],
        invalid: &str,
    ) -> PyResult<RaySource<'_>> {
        let Self { origins, directions } = self;
        let misses = named("invalid", invalid, [("error", false), ("miss", true)])?;
        let rays = if origins.len() == 1 { directions.len() } else { origins.len() };
        let accepted = format!("a number or ({rays},), as origins");
        let limit = |name, argument: Option<&Bound<PyAny>>, default| match argument {
            // An array without axes is one number for all rays.
            Some(argument) => numbers::<f64>(name, argument, &accepted, |shape| {
                shape.is_empty() || shape == [rays]
            })
            .and_then(|numbers| Ok(numbers.elements()?.to_vec())),
            None => Ok(vec![default]),
        };
        let limits = [limit("t_min", t_min, 0.0)?, limit("t_max", t_max, f64::INFINITY)?];
        let (origins, directions) = (origins.slice()?, directions.slice()?);
        Ok(RaySource { origins, directions, limits, rays, misses })
    }
}

/// Rays in arrays.
pub struct RaySource<'a> {
    origins: VectorSlice<'a>,
    directions: VectorSlice<'a>,
    /// Each for all rays, or one per ray.
    limits: [Vec<f64>; 2],
    pub rays: usize,
    /// Whether an invalid ray hits nothing, instead of being an error.
    misses: bool,
}

impl RaySource<'_> {
    /// Returns the batch of this number, of batches of so many rays, or the fault of an invalid ray.
    pub fn batch<N: Real>(&self, number: usize, size: usize) -> Result<Vec<N::Ray>, String> {
        let mut rays = Vec::with_capacity(size.min(self.rays));
        for index in (number * size..self.rays).take(size) {
            let origin = self.origins.at(index);
            let direction = self.directions.at(index);
            let limits = self.limits.each_ref().map(|limits| *at(limits, index));
            rays.push(match N::ray(origin, direction, limits) {
                Err(_) if self.misses => {
                    // An empty range hits nothing.
                    N::ray(DVec3::ZERO, DVec3::X, [1.0, 0.0])?
                }
                ray => ray.map_err(|fault| format!("ray {index}: {fault}"))?,
            });
        }
        Ok(rays)
    }
}

/// Which triangles count for each ray.
pub struct Selection {
    orientation: Orientation,
    /// The same number of ids for each ray, ray after ray.
    excluded: Vec<u32>,
    each: usize,
}

impl Selection {
    /// Reads the arguments `orientation` and `exclude` of a call with so many rays, to a tree over so
    /// many triangles.
    pub fn read(
        orientation: &str,
        exclude: Option<&Bound<PyAny>>,
        rays: usize,
        triangles: usize,
    ) -> PyResult<Self> {
        use Orientation::{Any, Entering, Exiting};
        let sides = [("any", Any), ("exiting", Exiting), ("entering", Entering)];
        let orientation = named("orientation", orientation, sides)?;
        let Some(exclude) = exclude else {
            return Ok(Self { orientation, excluded: vec![], each: 0 });
        };
        let accepted = format!("one index, ({rays},) or ({rays}, k), as origins");
        let ids = numbers::<i64>("exclude", exclude, &accepted, |shape| match *shape {
            [] => true,
            [found] | [found, _] => found == rays,
            _ => false,
        })?;
        let id = |&id: &i64| match id {
            // No triangle has this id.
            -1 => Ok(u32::MAX),
            0.. if (id as usize) < triangles => Ok(id as u32),
            _ => Err(invalid(format!(
                "exclude has {id}; accepted: indices below {triangles}, or -1"
            ))),
        };
        let mut excluded = ids.elements()?.iter().map(id).collect::<PyResult<Vec<_>>>()?;
        let each = if let [_, each] = *ids.shape() { each } else { 1 };
        if ids.shape().is_empty() {
            excluded = vec![excluded[0]; rays];
        }
        Ok(Self { orientation, excluded, each })
    }

    /// Returns what counts for the batch of this number, of batches of so many rays.
    pub fn batch(&self, number: usize, size: usize, rays: usize) -> Select<'_> {
        let exclude = &self.excluded[number * size * self.each..][..rays * self.each];
        Select { orientation: self.orientation, exclude }
    }
}
