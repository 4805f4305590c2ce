//! The class `Tracer`: triangles in the wide layout, which answer batches of rays on all threads.

use crate::arrays::{invalid, rays};
use crate::tree::Tree;
use bvh_search::prelude::*;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

/// The triangles of a tree in a layout for fast traversal. Later improvements of the tree do not
/// change the tracer.
#[pyclass(frozen, module = "bvh_search")]
pub struct Tracer {
    wide: WideBvh,
}

/// The number of rays that a thread traces at once.
const BATCH: usize = 4096;

#[pymethods]
impl Tracer {
    #[new]
    fn new(tree: &Tree) -> PyResult<Self> {
        let owned = tree.owned();
        let Some(triangles) = owned.triangles() else {
            return Err(invalid("tree is over boxes; accepted: a tree over triangles"));
        };
        Ok(Self { wide: WideBvh::new(owned.tree(), triangles).map_err(invalid)? })
    }

    /// Returns the distances of the nearest hits, in multiples of the directions' lengths, and the
    /// triangles' indices. A ray without a hit has infinity and −1.
    ///
    /// Origins and directions have the shape `(m, 3)`. `t_min` and `t_max`, by default 0 and
    /// infinity, are one number or have the shape `(m,)`. Set `coherent` if consecutive rays begin
    /// close to each other and have similar directions: it changes the speed and no answer.
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, coherent = false))]
    fn nearest<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        coherent: bool,
    ) -> PyResult<Nearest<'py>> {
        let py = origins.py();
        let rays = rays(origins, directions, t_min, t_max)?;
        let (t, object) = py.detach(|| {
            let mut hits = vec![Hit::MISS; rays.len()];
            let batches = rays
                .par_chunks(BATCH)
                .zip(hits.par_chunks_mut(BATCH));
            batches.for_each(|(rays, hits)| {
                self.wide
                    .nearest_hits(rays, hits, coherence(coherent))
            });
            // The cast turns the id of a miss, `u32::MAX`, into −1.
            let t: Vec<f32> = hits.iter().map(|hit| hit.t).collect();
            let object: Vec<i32> = hits.iter().map(|hit| hit.object as i32).collect();
            (t, object)
        });
        Ok((t.into_pyarray(py), object.into_pyarray(py)))
    }

    /// Returns whether each ray hits any triangle. Accepts the same arguments as `nearest`.
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, coherent = false))]
    fn any<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        coherent: bool,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let py = origins.py();
        let rays = rays(origins, directions, t_min, t_max)?;
        let hits = py.detach(|| {
            let mut hits = vec![false; rays.len()];
            let batches = rays
                .par_chunks(BATCH)
                .zip(hits.par_chunks_mut(BATCH));
            batches.for_each(|(rays, hits)| {
                self.wide
                    .any_hits(rays, hits, coherence(coherent))
            });
            hits
        });
        Ok(hits.into_pyarray(py))
    }
}

/// The distances and the indices of triangles.
type Nearest<'py> = (Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<i32>>);

fn coherence(coherent: bool) -> Coherence {
    if coherent { Coherence::Coherent } else { Coherence::Incoherent }
}
