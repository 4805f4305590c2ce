//! The class `Tracer`: triangles in the wide layout, which answer batches of rays and points on all
//! threads.

use crate::arrays::{Place, RayArrays, invalid, numbers, point, points};
use crate::threads::{Query, detached};
use crate::tree::Tree;
use bvh_search::OwnedTree;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::prelude::*;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// One number per ray, hit or point.
type Column<'py, T> = Bound<'py, PyArray1<T>>;
/// One point or direction per ray or point.
type Rows<'py, T> = Bound<'py, PyArray2<T>>;

/// The triangles of a tree in a layout for fast traversal. Later improvements and updates of the
/// tree do not change the tracer.
///
/// Rays have `origins` and `directions` of the shape `(m, 3)`; one of the shape `(3,)` or `(1, 3)` is
/// for all rays. `t_min` and `t_max`, by default 0
/// and infinity, are one number or have the shape `(m,)`; those in `float64` are rounded inwards.
/// Distances are in multiples of the directions' lengths. `coherent` tells whether consecutive rays
/// begin close to each other and have similar directions; by default a look at the rays decides. It
/// changes the speed and no answer. An invalid ray, with a direction that is zero or a number that
/// is not finite, raises a `ValueError`; with `invalid="miss"` it hits nothing.
///
/// Trees have `float32` coordinates. For coordinates that need `float64`, move the triangles by
/// `-center` before they are rounded, and pass `center`: rays, points and answers are then in the
/// coordinates of the world, and only what is left after their move is rounded. A ray that begins
/// outside the tree's box, far away or at a point that `float32` does not have, is first advanced to
/// it in `float64`.
///
/// Ctrl-C ends every call. `progress(seconds, fraction)` is called about twenty times per second with
/// the elapsed time and the part of the rays or points that is answered, and at the end with 1; if it
/// raises an exception, the call ends.
///
/// >>> import numpy as np
/// >>> from bvh_search import Tracer, Tree
/// >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
/// >>> square = Tree.from_mesh(corners, [[0, 1, 2], [0, 2, 3]])
/// >>> tracer = Tracer(square)
#[pyclass(frozen, module = "bvh_search")]
pub struct Tracer {
    wide: WideBvh,
    source: Arc<OwnedTree>,
    place: Option<Place>,
    /// Made when it is first needed.
    solid: OnceLock<Solid>,
}

/// The number of rays that a thread traces at once.
const BATCH: usize = 1024;
/// The number of rays or points that a thread answers at once where one may take long.
const FEW: usize = 128;

#[pymethods]
impl Tracer {
    #[new]
    #[pyo3(signature = (tree, *, center = None))]
    fn new(tree: &Tree, center: Option<&Bound<PyAny>>) -> PyResult<Self> {
        let source = tree.owned();
        let center = center.map(|center| point("center", center)).transpose()?;
        let Some(wide) = source.layout() else {
            return Err(invalid("tree is over boxes; accepted: a tree over triangles"));
        };
        let place = center.map(|center| Place::new(center, source.bounds()));
        Ok(Self { wide: wide.map_err(invalid)?, source, place, solid: OnceLock::new() })
    }

    /// Returns the distances of the nearest hits and the triangles' indices. A ray without a hit
    /// has infinity and −1.
    ///
    /// >>> tracer.nearest([[0.25, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
    /// (array([ 3., inf], dtype=float32), array([ 1, -1], dtype=int32))
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, coherent = None, invalid = "error", progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn nearest<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        coherent: Option<bool>,
        invalid: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Column<'py, f32>, Column<'py, i32>)> {
        let py = origins.py();
        let arrays = RayArrays::read(origins, directions, t_min, t_max, invalid)?;
        let source = arrays.source(self.place)?;
        let (t, objects) = Query::ask(py, progress, source.rays.div_ceil(BATCH), |query| {
            let mut t = vec![0.0; source.rays];
            let mut objects = vec![0; source.rays];
            let parts = t.par_chunks_mut(BATCH).zip(objects.par_chunks_mut(BATCH));
            query.answer(parts, |batch, (t, objects)| {
                let batch = source.batch(batch, BATCH)?;
                let mut hits = [Hit::MISS; BATCH];
                let hits = &mut hits[..batch.rays.len()];
                let coherence = self.coherence(coherent, &batch.rays);
                self.wide.nearest_hits(&batch.rays, hits, coherence);
                for (ray, ((hit, t), object)) in hits.iter().zip(t).zip(objects).enumerate() {
                    *t = batch.distance(ray, hit.t);
                    // The cast turns the id of a miss, `u32::MAX`, into −1.
                    *object = hit.object as i32;
                }
                Ok(())
            })?;
            Ok((t, objects))
        })?;
        Ok((t.into_pyarray(py), objects.into_pyarray(py)))
    }

    /// Returns whether each ray hits any triangle.
    ///
    /// >>> tracer.any([[0.25, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
    /// array([ True, False])
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, coherent = None, invalid = "error", progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn any<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        coherent: Option<bool>,
        invalid: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Column<'py, bool>> {
        let py = origins.py();
        let arrays = RayArrays::read(origins, directions, t_min, t_max, invalid)?;
        let source = arrays.source(self.place)?;
        let hits = answers(py, progress, source.rays, BATCH, |batch, hits| {
            let rays = source.batch(batch, BATCH)?.rays;
            self.wide.any_hits(&rays, hits, self.coherence(coherent, &rays));
            Ok(())
        })?;
        Ok(hits.into_pyarray(py))
    }

    /// Returns all hits, ray after ray and the nearest first: distances, triangles, and the indices
    /// of the rays. Each crossing of the surface counts once, although triangles share edges and
    /// corners, so the number of hits of a line with a closed mesh is even.
    ///
    /// >>> tracer.all([[0.5, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
    /// (array([3.], dtype=float32), array([0], dtype=int32), array([0]))
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, invalid = "error", progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn all<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        invalid: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Column<'py, f32>, Column<'py, i32>, Column<'py, i64>)> {
        let py = origins.py();
        let arrays = RayArrays::read(origins, directions, t_min, t_max, invalid)?;
        let source = arrays.source(self.place)?;
        let parts = source.rays.div_ceil(FEW);
        let (t, objects, numbers) = Query::ask(py, progress, parts, |query| {
            let mut found = vec![(Vec::new(), Vec::new()); parts];
            query.answer(found.par_iter_mut(), |batch, (hits, counts)| {
                let batch = source.batch(batch, FEW)?;
                *counts = vec![0; batch.rays.len()];
                self.wide.all_hits_of(&batch.rays, hits, counts);
                let mut own = hits.iter_mut();
                for (ray, &count) in counts.iter().enumerate() {
                    for hit in own.by_ref().take(count as usize) {
                        hit.t = batch.distance(ray, hit.t);
                    }
                }
                Ok(())
            })?;
            let hits = found.iter().map(|(hits, _)| hits.len()).sum();
            let mut t = Vec::with_capacity(hits);
            let mut objects = Vec::with_capacity(hits);
            let mut numbers = Vec::with_capacity(hits);
            let mut number = 0;
            for (hits, counts) in found {
                query.go_on()?;
                t.extend(hits.iter().map(|hit| hit.t));
                objects.extend(hits.iter().map(|hit| hit.object as i32));
                for count in counts {
                    numbers.extend((0..count).map(|_| number));
                    number += 1;
                }
            }
            Ok((t, objects, numbers))
        })?;
        Ok((t.into_pyarray(py), objects.into_pyarray(py), numbers.into_pyarray(py)))
    }

    /// Returns the number of hits of each ray, as `all` counts them.
    ///
    /// >>> tracer.counts([[0.5, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
    /// array([1, 0], dtype=uint32)
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, invalid = "error", progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn counts<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        invalid: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Column<'py, u32>> {
        let py = origins.py();
        let arrays = RayArrays::read(origins, directions, t_min, t_max, invalid)?;
        let source = arrays.source(self.place)?;
        let counts = answers(py, progress, source.rays, FEW, |batch, counts| {
            self.wide.all_hits_of(&source.batch(batch, FEW)?.rays, &mut Vec::new(), counts);
            Ok(())
        })?;
        Ok(counts.into_pyarray(py))
    }

    /// Whether the mesh has no holes: every edge runs as often in one direction as in the other, or
    /// belongs to two triangles. Positions count, not indices. Computed once.
    ///
    /// >>> tracer.watertight
    /// False
    #[getter]
    fn watertight(&self, py: Python) -> PyResult<bool> {
        Ok(self.solid(py)?.is_watertight())
    }

    /// Returns whether each point, `(m, 3)`, is inside the mesh. A point on the surface may count as
    /// either.
    ///
    /// `by="winding"` counts how often the triangles wind round the point: right for meshes that
    /// have holes or overlap themselves, if the corners of all triangles run in the same direction.
    /// It is exact for watertight meshes, and otherwise the generalised winding number of all
    /// triangles, at a hundred times the cost. `by="parity"` counts the crossings along one
    /// direction: right for watertight meshes that do not overlap themselves, in whatever direction
    /// their corners run. `by="auto"` is parity for watertight meshes with corners in both
    /// directions, and otherwise winding.
    ///
    /// >>> tracer.contains([[0.5, 0.5, 1]])
    /// array([False])
    #[pyo3(signature = (points, *, by = "auto", progress = None))]
    fn contains<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        by: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Column<'py, bool>> {
        let py = points.py();
        let rule = rule(by)?;
        let points = self::points(points, self.place.as_ref())?;
        let solid = self.solid(py)?;
        let inside = answers(py, progress, points.len(), FEW, |part, inside| {
            solid.contains(&self.wide, &points[part * FEW..][..inside.len()], rule, inside);
            Ok(())
        })?;
        Ok(inside.into_pyarray(py))
    }

    /// Returns the closest points of the triangles to each point, `(m, 3)`, in `float64`, with the
    /// triangles' indices and the distances. Among triangles at the same distance the lowest index
    /// wins. A point that is not finite has NaN, −1 and infinity. Triangles without area do not
    /// count.
    ///
    /// >>> tracer.closest([[0.5, 0.25, 2]])
    /// (array([[0.5 , 0.25, 0.  ]]), array([0], dtype=int32), array([2.]))
    #[pyo3(signature = (points, *, progress = None))]
    fn closest<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Rows<'py, f64>, Column<'py, i32>, Column<'py, f64>)> {
        let py = points.py();
        let points = self::points(points, self.place.as_ref())?;
        let center = self.place.map_or(DVec3::ZERO, |place| place.center);
        let answer = |query: &Query| {
            let mut positions = vec![0.0; 3 * points.len()];
            let mut objects = vec![0; points.len()];
            let mut distances = vec![0.0; points.len()];
            let parts = (
                positions.par_chunks_mut(3 * FEW),
                objects.par_chunks_mut(FEW),
                distances.par_chunks_mut(FEW),
                points.par_chunks(FEW),
            );
            query.answer(parts.into_par_iter(), |_, (positions, objects, distances, points)| {
                let mut closest = [None; FEW];
                let closest = &mut closest[..points.len()];
                self.wide.closest_points(points, closest);
                let positions = positions.as_chunks_mut().0;
                for (((closest, position), object), distance) in
                    closest.iter().zip(positions).zip(objects).zip(distances)
                {
                    *position = closest.map_or(DVec3::NAN, |at| at.point + center).to_array();
                    *object = closest.map_or(-1, |at| at.object as i32);
                    *distance = closest.map_or(f64::INFINITY, |at| at.distance);
                }
                Ok(())
            })?;
            Ok((positions, objects, distances))
        };
        let (positions, objects, distances) =
            Query::ask(py, progress, points.len().div_ceil(FEW), answer)?;
        let positions = positions.into_pyarray(py).reshape([points.len(), 3])?;
        Ok((positions, objects.into_pyarray(py), distances.into_pyarray(py)))
    }

    /// Returns the distance of each point, `(m, 3)`, from the triangles, negative for points that
    /// the mesh contains. `by` is as for `contains`.
    ///
    /// >>> tracer.signed_distance([[0.5, 0.25, 2]])
    /// array([2.])
    #[pyo3(signature = (points, *, by = "auto", progress = None))]
    fn signed_distance<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        by: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Column<'py, f64>> {
        let py = points.py();
        let rule = rule(by)?;
        let points = self::points(points, self.place.as_ref())?;
        let solid = self.solid(py)?;
        let distances = answers(py, progress, points.len(), FEW, |part, distances| {
            let points = &points[part * FEW..][..distances.len()];
            solid.signed_distances(&self.wide, points, rule, distances);
            Ok(())
        })?;
        Ok(distances.into_pyarray(py))
    }

    /// Returns the weights `u` and `v` of the second and third corner at hits, and the unit normals
    /// of the triangles, on the side from which their corners run counterclockwise. `triangle` has
    /// one index per ray; where it is −1 all numbers are 0.
    ///
    /// >>> tracer.surface([[0.5, 0.25, 3]], [[0, 0, -1]], [0])
    /// (array([0.25]), array([0.25]), array([[0., 0., 1.]], dtype=float32))
    fn surface<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        triangle: &Bound<'py, PyAny>,
    ) -> PyResult<(Column<'py, f64>, Column<'py, f64>, Rows<'py, f32>)> {
        let py = origins.py();
        let arrays = RayArrays::read(origins, directions, None, None, "miss")?;
        let source = arrays.source(self.place)?;
        let accepted = format!("({},), as origins", source.rays);
        let indices =
            numbers::<i64>("triangle", triangle, &accepted, |shape| shape == [source.rays])?;
        let indices = indices.elements()?;
        let triangles = self.source.triangles().unwrap_or(&[]);
        let is_index = |&index: &i64| (-1..triangles.len() as i64).contains(&index);
        if !indices.iter().all(is_index) {
            let message =
                format!("triangle: accepted: an index below {} per ray, or -1", triangles.len());
            return Err(invalid(message));
        }
        let (u, v, normals) = Query::ask(py, None, source.rays.div_ceil(BATCH), |query| {
            let mut u = vec![0.0; source.rays];
            let mut v = vec![0.0; source.rays];
            let mut normals = vec![0.0; 3 * source.rays];
            let parts = (
                u.par_chunks_mut(BATCH),
                v.par_chunks_mut(BATCH),
                normals.par_chunks_mut(3 * BATCH),
                indices.par_chunks(BATCH),
            );
            query.answer(parts.into_par_iter(), |batch, (u, v, normals, indices)| {
                let rays = source.batch(batch, BATCH)?.rays;
                let normals = normals.as_chunks_mut().0;
                for ((((ray, &index), u), v), normal) in
                    rays.iter().zip(indices).zip(u).zip(v).zip(normals)
                {
                    if let Some(triangle) = triangles.get(index as usize) {
                        [_, *u, *v] = triangle.barycentrics(ray).unwrap_or_default();
                        *normal = triangle.normal().unwrap_or_default().to_array();
                    }
                }
                Ok(())
            })?;
            Ok((u, v, normals))
        })?;
        let normals = normals.into_pyarray(py).reshape([source.rays, 3])?;
        Ok((u.into_pyarray(py), v.into_pyarray(py), normals))
    }

    fn __len__(&self) -> usize {
        self.source.objects()
    }

    fn __repr__(&self) -> String {
        let triangles = self.source.objects();
        match self.place {
            Some(place) => format!("<Tracer of {triangles} triangles at {}>", place.center),
            None => format!("<Tracer of {triangles} triangles>"),
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, State)> {
        let restore = py.get_type::<Self>().getattr("_restore")?;
        let center = self.place.map(|place| place.center.to_array());
        Ok((restore, (Tree::shared(self.source.clone()), center)))
    }

    #[staticmethod]
    #[pyo3(signature = (tree, center))]
    fn _restore(tree: &Tree, center: Option<&Bound<PyAny>>) -> PyResult<Self> {
        Self::new(tree, center)
    }
}

type State = (Tree, Option<[f64; 3]>);

impl Tracer {
    fn solid(&self, py: Python) -> PyResult<&Solid> {
        if let Some(solid) = self.solid.get() {
            return Ok(solid);
        }
        let triangles = self.source.triangles().unwrap_or(&[]);
        let solid = detached(py, || Solid::new(self.source.tree(), triangles))?;
        // Only a thread that holds the interpreter's lock comes here, and so does a thread that
        // forks: no fork copies a locked lock. Another thread may have been faster.
        Ok(self.solid.get_or_init(|| solid))
    }

    /// Returns the hint for a batch that the caller gave, or else the one that suits the rays.
    fn coherence(&self, coherent: Option<bool>, rays: &[Ray]) -> Coherence {
        /// The least cosine of the angle between similar directions.
        const SIMILAR: f32 = 0.97;
        /// The largest distance of close origins, in diagonals of the scene.
        const CLOSE: f64 = 0.05;
        let is_coherent = coherent.unwrap_or_else(|| {
            let size = self.source.tree().root_aabb().map_or(0.0, |aabb| aabb.extent().length());
            let pairs = rays.windows(2).step_by(16);
            let similar = pairs.clone().filter(|pair| {
                let [a, b] = [pair[0].direction(), pair[1].direction()];
                a.dot(b) >= SIMILAR * a.length() * b.length()
                    && f64::from(pair[0].origin().distance(pair[1].origin())) <= CLOSE * size
            });
            4 * similar.count() >= 3 * pairs.len().max(1)
        });
        if is_coherent { Coherence::Coherent } else { Coherence::Incoherent }
    }
}

fn rule(by: &str) -> PyResult<InsideRule> {
    match by {
        "auto" => Ok(InsideRule::Auto),
        "parity" => Ok(InsideRule::Parity),
        "winding" => Ok(InsideRule::Winding),
        _ => Err(invalid(format!("by is {by:?}; accepted: auto, parity, winding"))),
    }
}

/// Returns one answer per ray or point; `answer` writes the answers of a part of them, by its number.
fn answers<T: Clone + Default + Send + Sync>(
    py: Python,
    progress: Option<Py<PyAny>>,
    count: usize,
    part: usize,
    answer: impl Fn(usize, &mut [T]) -> Result<(), String> + Sync,
) -> PyResult<Vec<T>> {
    Query::ask(py, progress, count.div_ceil(part), |query| {
        let mut answers = vec![T::default(); count];
        query.answer(answers.par_chunks_mut(part), &answer)?;
        Ok(answers)
    })
}
