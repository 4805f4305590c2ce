//! The class `Tracer`: triangles in the wide layout, which answer batches of rays and points on all
//! threads.

use crate::answers::{Call, Hint, Reals};
use crate::arrays::numbers;
use crate::arrays::{Column, Rows};
use crate::elements::invalid;
use crate::precision::Real;
use crate::rays::{Ends, Selection, points};
use crate::scalars::named;
use crate::sky::Views;
use crate::threads::detached;
use crate::tree::Tree;
use bvh_search::OwnedTree;
use bvh_search::bvh_core::DWideBvh;
use bvh_search::prelude::*;
use pyo3::prelude::*;
use std::sync::{Arc, OnceLock};

/// The triangles of a tree in a layout for fast traversal. Later improvements and updates of the
/// tree do not change the tracer.
///
/// Rays have `origins` and `directions` of the shape `(m, 3)`; one of the shape `(3,)` or `(1, 3)` is
/// for all rays. `t_min` and `t_max`, by default 0 and infinity, are one number or have the shape
/// `(m,)`. Distances are in multiples of the directions' lengths. `coherent` tells whether consecutive
/// rays begin close to each other and have similar directions; by default a look at the rays decides.
/// It changes the speed and no answer. An invalid ray, with a direction that is zero or a number that
/// is not finite, raises a `ValueError`; with `invalid="miss"` it hits nothing.
///
/// The tracer of a tree with `precision="double"` answers in `float64`, exactly, however far the
/// triangles and the rays are from the origin. Coordinates are up to 2^120 in size, and
/// count as 0 below 2^-150. In other tracers, rays and points are
/// rounded to `float32`, and `t_min` and `t_max` inwards.
///
/// `nearest` and `any` choose which triangles count: those with the `orientation` `"exiting"`, which the ray meets along their normal as where it leaves a solid,
/// `"entering"`, against it, or `"any"`, and none of the indices `exclude`. That is one index,
/// an array `(m,)` or `(m, k)` of some for each ray; -1 excludes nothing. Of a side, each crossing of
/// the surface counts once: a ray that touches a corner enters as often as it leaves.
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
    layout: Layout,
    source: Arc<OwnedTree>,
    /// Made when it is first needed.
    solid: OnceLock<Solid>,
}

enum Layout {
    Single(Box<WideBvh>),
    Double(Box<DWideBvh>),
}

/// Answers by a [`Call`], which is generic over the numbers `N` of the tree.
macro_rules! call {
    ($tracer:ident, $py:expr, $progress:expr, $call:ident, $number:ident => $answer:expr) => {
        match &$tracer.layout {
            Layout::Single(layout) => {
                type $number = f32;
                let triangles = f32::triangles(&$tracer.source).unwrap_or(&[]);
                let $call = Call::<$number> { py: $py, progress: $progress, layout, triangles };
                $answer
            }
            Layout::Double(layout) => {
                type $number = f64;
                let triangles = f64::triangles(&$tracer.source).unwrap_or(&[]);
                let $call = Call::<$number> { py: $py, progress: $progress, layout, triangles };
                $answer
            }
        }
    };
}

#[pymethods]
impl Tracer {
    #[new]
    fn new(tree: &Tree) -> PyResult<Self> {
        let source = tree.owned();
        let layout = match (f32::layout(&source), f64::layout(&source)) {
            (Some(layout), _) => Layout::Single(layout.map_err(invalid)?.into()),
            (_, Some(layout)) => Layout::Double(layout.map_err(invalid)?.into()),
            _ => return Err(invalid("tree is over boxes; accepted: a tree over triangles")),
        };
        Ok(Self { layout, source, solid: OnceLock::new() })
    }

    /// Returns the distances of the nearest hits and the triangles' indices. A ray without a hit
    /// has infinity and −1.
    ///
    /// >>> tracer.nearest([[0.25, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
    /// (array([ 3., inf], dtype=float32), array([ 1, -1], dtype=int32))
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, orientation = "any", exclude = None, coherent = None, invalid = "error", progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn nearest<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        orientation: &str,
        exclude: Option<&Bound<'py, PyAny>>,
        coherent: Option<bool>,
        invalid: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Reals<'py>, Column<'py, i32>)> {
        let ends = Ends::read(origins, directions)?;
        let source = &ends.source([t_min, t_max], invalid)?;
        let select = Selection::read(orientation, exclude, source.rays, self.source.objects())?;
        let hint = self.hint(coherent);
        call!(self, origins.py(), progress, call, N => call.nearest(source, &select, hint))
    }

    /// Returns whether each ray hits any triangle.
    ///
    /// >>> tracer.any([[0.25, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
    /// array([ True, False])
    #[pyo3(signature = (origins, directions, t_min = None, t_max = None, *, orientation = "any", exclude = None, coherent = None, invalid = "error", progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn any<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        orientation: &str,
        exclude: Option<&Bound<'py, PyAny>>,
        coherent: Option<bool>,
        invalid: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Column<'py, bool>> {
        let ends = Ends::read(origins, directions)?;
        let source = &ends.source([t_min, t_max], invalid)?;
        let select = Selection::read(orientation, exclude, source.rays, self.source.objects())?;
        let hint = self.hint(coherent);
        call!(self, origins.py(), progress, call, N => call.any(source, &select, hint))
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
    ) -> PyResult<(Reals<'py>, Column<'py, i32>, Column<'py, i64>)> {
        let ends = Ends::read(origins, directions)?;
        let source = &ends.source([t_min, t_max], invalid)?;
        call!(self, origins.py(), progress, call, N => call.all(source))
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
        let ends = Ends::read(origins, directions)?;
        let source = &ends.source([t_min, t_max], invalid)?;
        call!(self, origins.py(), progress, call, N => call.counts(source))
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
    /// triangles, at a hundred times the cost, and near an open terrain, where it is nearly one half
    /// everywhere, at the cost of most triangles. `by="parity"` counts the crossings along one
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
        let (rule, solid) = (rule(by)?, self.solid(points.py())?);
        call!(self, points.py(), progress, call, N => {
            call.of_points(&self::points::<N>(points)?, |layout, points, inside| {
                solid.contains(layout, points, rule, inside);
            })
        })
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
        call!(self, points.py(), progress, call, N => call.closest(&self::points::<N>(points)?))
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
        let (rule, solid) = (rule(by)?, self.solid(points.py())?);
        call!(self, points.py(), progress, call, N => {
            call.of_points(&self::points::<N>(points)?, |layout, points, distances| {
                solid.signed_distances(layout, points, rule, distances);
            })
        })
    }

    /// Returns which of the `directions`, `(m, 3)`, are free from each of the `points`, `(n, 3)`: an
    /// array `(n, m)` that is true where `any` finds no hit from `t_min` to `t_max`. With `weights`,
    /// `(m,)` or `(m, k)`, returns instead their sums over each point's free directions, `(n,)` or
    /// `(n, k)`, in `float64`: hours of sun, energies, view factors, in memory for these sums alone.
    ///
    /// With `normals`, `(n, 3)` and of any length, only directions d above the surface, n · d > 0,
    /// count as free; `cosine=True` multiplies weights by the cosine of the angle between the two.
    /// Surfaces stop directions at 0, so points on a surface need a `t_min`, or a place a
    /// little above it.
    ///
    /// >>> below = [[0.5, 0.5, -1]]
    /// >>> tracer.visible(below, [[0, 0, 1], [0, 1, 0]])
    /// array([[False,  True]])
    /// >>> tracer.visible(below, [[0, 0, 1], [0, 1, 0], [1, 0, 0]], [4, 2, 1])
    /// array([3.])
    #[pyo3(signature = (points, directions, weights = None, *, normals = None, cosine = false, t_min = None, t_max = None, progress = None))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn visible<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        weights: Option<&Bound<'py, PyAny>>,
        normals: Option<&Bound<'py, PyAny>>,
        cosine: bool,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        call!(self, points.py(), progress, call, N => {
            let optional = [weights, normals, t_min, t_max];
            let views = Views::<N>::read([points, directions], optional, cosine)?;
            match weights {
                Some(_) => call.visible(&views, |point, row, to| views.sums(point, row, to)),
                None => call.visible::<bool>(&views, |_, row, to| {
                    for (number, to) in to.iter_mut().enumerate() {
                        *to = row[number / 64] >> (number % 64) & 1 != 0;
                    }
                }),
            }
        })
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
    ) -> PyResult<(Column<'py, f64>, Column<'py, f64>, Reals<'py>)> {
        let ends = Ends::read(origins, directions)?;
        let source = &ends.source([None, None], "miss")?;
        let accepted = format!("({},), as origins", source.rays);
        let indices =
            numbers::<i64>("triangle", triangle, &accepted, |shape| shape == [source.rays])?;
        let indices = indices.elements()?;
        let triangles = self.source.objects();
        if !indices.iter().all(|index| (-1..triangles as i64).contains(index)) {
            let message = format!("triangle: accepted: an index below {triangles} per ray, or -1");
            return Err(invalid(message));
        }
        call!(self, origins.py(), None, call, N => call.surfaces(source, indices))
    }

    fn __len__(&self) -> usize {
        self.source.objects()
    }

    fn __repr__(&self) -> String {
        format!("<Tracer of {} triangles>", self.source.objects())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyAny>, (Tree,)) {
        (py.get_type::<Self>().into_any(), (Tree::shared(self.source.clone()),))
    }
}

impl Tracer {
    fn solid(&self, py: Python) -> PyResult<&Solid> {
        if let Some(solid) = self.solid.get() {
            return Ok(solid);
        }
        let tree = self.source.tree();
        let solid = detached(py, || match f64::triangles(&self.source) {
            Some(triangles) => Solid::new(tree, triangles),
            None => Solid::new(tree, f32::triangles(&self.source).unwrap_or(&[])),
        })?;
        // Only a thread that holds the interpreter's lock comes here, and so does a thread that
        // forks: no fork copies a locked lock. Another thread may have been faster.
        Ok(self.solid.get_or_init(|| solid))
    }

    fn hint(&self, coherent: Option<bool>) -> Hint {
        let size = self.source.tree().root_aabb().map_or(0.0, |aabb| aabb.extent().length());
        Hint { coherent, size }
    }
}

fn rule(by: &str) -> PyResult<InsideRule> {
    use InsideRule::{Auto, Parity, Winding};
    named("by", by, [("auto", Auto), ("parity", Parity), ("winding", Winding)])
}
