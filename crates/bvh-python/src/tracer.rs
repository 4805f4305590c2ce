//! The class `Tracer`: triangles in the wide layout, asked for hits by batches of rays on all threads.

use crate::arrays::{rays, refused};
use crate::tree::Tree;
use bvh_search::prelude::*;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

/// The triangles of a tree, laid out for speed. It needs the tree no longer, and does not follow its changes.
#[pyclass(frozen, module = "bvh_search")]
pub struct Tracer {
    wide: WideBvh,
}

/// Rays that a thread takes at once.
const BATCH: usize = 4096;

#[pymethods]
impl Tracer {
    #[new]
    fn new(tree: &Tree) -> PyResult<Self> {
        let refusal = || refused("tree is over boxes; accepted: a tree over triangles");
        let owned = tree.owned();
        let triangles = owned.triangles().ok_or_else(refusal)?;
        Ok(Self { wide: WideBvh::new(owned.tree(), triangles).map_err(refused)? })
    }

    /// The distances of the nearest hits, in multiples of the directions' lengths, and the triangles' indices; infinity and −1 for a
    /// ray that meets nothing. Origins and directions are `(m, 3)`; `t_min` and `t_max`, by default 0 and infinity, are one number or
    /// `(m,)`. `coherent` says that consecutive
    /// rays begin close to each other and run the same way, which makes them faster and changes no answer.
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
            // The number of no object becomes −1.
            hits.iter()
                .map(|hit| (hit.t, hit.object as i32))
                .unzip::<_, _, Vec<_>, Vec<_>>()
        });
        Ok((t.into_pyarray(py), object.into_pyarray(py)))
    }

    /// Whether each ray meets any triangle. The arguments are those of `nearest`.
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

/// Distances, and indices of triangles.
type Nearest<'py> = (Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<i32>>);

fn coherence(coherent: bool) -> Coherence {
    if coherent { Coherence::Coherent } else { Coherence::Incoherent }
}
