//! The class `Tree`: trees over arrays, found, improved, measured, saved, loaded, and copied as
//! nodes.

use crate::arrays::{Faces, boxes, mesh_objects, moved_mesh, segments, triangles};
use crate::elements::invalid;
use crate::improver::Improver;
use crate::pickle::{self, State};
use crate::precision::Precision;
use crate::scalars::{self, named};
use crate::search::{self, Limits};
use crate::threads::detached;
use bvh_scenes::files::{self, WriteError};
use bvh_scenes::tree_file::{self, TreeFileError};
use bvh_search::bvh_core::cost::{Objective, SahConstants};
use bvh_search::bvh_core::export::Target;
use bvh_search::bvh_core::file::FileError;
use bvh_search::{Anywhere, BakeError, Frames, Objects, Options, OwnedTree, SearchError};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::fmt::Display;
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock, RwLockWriteGuard};

/// A tree with its objects. `from_mesh`, `from_triangles`, `from_boxes` and `load` create trees;
/// `len` is the number of objects.
///
/// Trees can be copied and pickled. A copy is like the tree in everything. A pickle keeps the tree,
/// its objects and its faces, but forgets the `rays`, the `seed` and the `references` of its
/// search, as a file does: `improve` then minimises the cost for random lines.
///
/// Searches have these arguments. They end after `seconds` or after `work` nodes created or
/// visited, and minimise the cost `internal_area`, for `rays` the cost of a `Tracer`. Without
/// either, a search chooses its work: up to a minute or so for large meshes, and longer for
/// millions of objects. It also chooses what else is not given, by the tests that rays from
/// anywhere need in a `Tracer`, so that `internal_area` may end higher than after a few `seconds`;
/// `reasons` says why. With `work` and without `seconds`, the same `seed` gives the same tree on
/// every machine, and the same file as `bvh bake`. `progress(seconds, cost)` is called about twenty
/// times per second with the elapsed time and the lowest cost so far, which is `None` until there
/// is a tree; if it raises an exception, the search ends. `rays` are recorded rays of the shape
/// `(m, 2, 3)`, from their origins to their hits: the tree is then for rays like these.
/// `references` above 1, up to 16, divides triangles among leaves, on average into that many parts
/// each; 1 keeps them whole. With `precision="double"` the triangles have `float64` coordinates,
/// each 0 or 2^-150 to 2^120 in size, and `Tracer` answers in `float64`.
///
/// >>> from bvh_search import Tree
/// >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
/// >>> square = Tree.from_mesh(corners, [[0, 1, 2], [0, 2, 3]], work=100)
/// >>> len(square)
/// 2
#[pyclass(frozen, module = "bvh_search")]
pub struct Tree {
    /// The tree. A thread must not call Python while it holds this lock: Python may switch to a
    /// second thread, which would wait for the lock and never switch back. Only a thread that holds
    /// the interpreter's lock locks this, and so does a thread that forks. No fork therefore copies
    /// a locked lock.
    owned: RwLock<Arc<OwnedTree>>,
    /// The triangles of a mesh.
    faces: Option<Arc<Faces>>,
    /// Whether a thread improves or moves the tree.
    improver: Improver,
}

impl Tree {
    fn new(owned: OwnedTree) -> Self {
        Self::shared(Arc::new(owned))
    }

    /// Returns a tree that shares its objects until one of the two changes.
    pub fn shared(owned: Arc<OwnedTree>) -> Self {
        Self { owned: RwLock::new(owned), faces: None, improver: Improver::nobody() }
    }

    /// Returns the current tree.
    pub fn owned(&self) -> Arc<OwnedTree> {
        // A poisoned lock still has a valid tree, because trees are replaced as a whole.
        self.owned.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns the tree to change or to replace.
    fn locked(&self, _holds_interpreter: Python) -> RwLockWriteGuard<'_, Arc<OwnedTree>> {
        self.owned.write().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Tree {
    /// Searches for the best tree over the triangles of a mesh: vertices, `(v, 3)`, and faces, `(n,
    /// 3)`, of three vertices each. `update` moves the vertices later. The boxes lie along other
    /// axes than the vertices' where that saves area, see `frame`; `frame="file"` keeps the axes.
    /// Without `seconds` and `work`, large meshes take up to a minute or longer, see `Tree`.
    ///
    /// >>> mesh = Tree.from_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], work=100)
    #[staticmethod]
    #[pyo3(signature = (vertices, faces, seconds = None, *, references = None, seed = 1, work = None, progress = None, rays = None, frame = "auto", precision = "single"))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn from_mesh(
        vertices: &Bound<PyAny>,
        faces: &Bound<PyAny>,
        #[pyo3(from_py_with = scalars::seconds)] seconds: Option<f64>,
        #[pyo3(from_py_with = scalars::references)] references: Option<f64>,
        #[pyo3(from_py_with = scalars::seed)] seed: u64,
        #[pyo3(from_py_with = scalars::work)] work: Option<u64>,
        progress: Option<Py<PyAny>>,
        rays: Option<&Bound<PyAny>>,
        frame: &str,
        precision: &str,
    ) -> PyResult<Self> {
        let (objects, faces) = mesh_objects(vertices, faces, Precision::read(precision)?)?;
        let limits = Limits { seconds, work, progress };
        let options = Options { references, seed, frame: frames(frame)?, ..Options::default() };
        let tree = found(vertices.py(), "vertices", objects, &options, rays, limits)?;
        Ok(Self { faces: Some(Arc::new(faces)), ..tree })
    }

    /// Searches for the best tree over triangles, `(n, 3, 3)`.
    ///
    /// >>> triangle = Tree.from_triangles([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], seconds=0.1)
    #[staticmethod]
    #[pyo3(signature = (triangles, seconds = None, *, references = None, seed = 1, work = None, progress = None, rays = None, frame = "auto", precision = "single"))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments")]
    fn from_triangles(
        triangles: &Bound<PyAny>,
        #[pyo3(from_py_with = scalars::seconds)] seconds: Option<f64>,
        #[pyo3(from_py_with = scalars::references)] references: Option<f64>,
        #[pyo3(from_py_with = scalars::seed)] seed: u64,
        #[pyo3(from_py_with = scalars::work)] work: Option<u64>,
        progress: Option<Py<PyAny>>,
        rays: Option<&Bound<PyAny>>,
        frame: &str,
        precision: &str,
    ) -> PyResult<Self> {
        let objects = self::triangles(triangles, Precision::read(precision)?)?;
        let limits = Limits { seconds, work, progress };
        let options = Options { references, seed, frame: frames(frame)?, ..Options::default() };
        found(triangles.py(), "triangles", objects, &options, rays, limits)
    }

    /// Searches for the best tree over boxes, `(n, 2, 3)` or `(n, 6)`, lower corners first.
    ///
    /// >>> two = Tree.from_boxes([[0, 0, 0, 1, 1, 1], [2, 0, 0, 3, 1, 1]], work=100)
    #[staticmethod]
    #[pyo3(signature = (boxes, seconds = None, *, seed = 1, work = None, progress = None, rays = None))]
    fn from_boxes(
        boxes: &Bound<PyAny>,
        #[pyo3(from_py_with = scalars::seconds)] seconds: Option<f64>,
        #[pyo3(from_py_with = scalars::seed)] seed: u64,
        #[pyo3(from_py_with = scalars::work)] work: Option<u64>,
        progress: Option<Py<PyAny>>,
        rays: Option<&Bound<PyAny>>,
    ) -> PyResult<Self> {
        let limits = Limits { seconds, work, progress };
        let options = Options { seed, ..Options::default() };
        found(boxes.py(), "boxes", self::boxes(boxes)?, &options, rays, limits)
    }

    /// Loads the tree in a file. The mesh, triangles or boxes must be the ones that it was saved for.
    /// With `vertices` and `faces`, `update` moves the vertices later. `precision` is that of the saved
    /// tree.
    ///
    /// >>> import tempfile
    /// >>> folder = tempfile.TemporaryDirectory()
    /// >>> triangle.save(folder.name + "/scene.bvh")
    /// >>> Tree.load(folder.name + "/scene.bvh", triangles=[[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    /// <Tree of 1 nodes over 1 objects>
    #[staticmethod]
    #[pyo3(signature = (path, *, triangles = None, boxes = None, vertices = None, faces = None, precision = "single"))]
    fn load(
        py: Python,
        path: PathBuf,
        triangles: Option<&Bound<PyAny>>,
        boxes: Option<&Bound<PyAny>>,
        vertices: Option<&Bound<PyAny>>,
        faces: Option<&Bound<PyAny>>,
        precision: &str,
    ) -> PyResult<Self> {
        let precision = Precision::read(precision)?;
        let mut corners = None;
        let objects = match (triangles, boxes, vertices, faces) {
            (Some(triangles), None, None, None) => self::triangles(triangles, precision)?,
            (None, Some(boxes), None, None) => self::boxes(boxes)?,
            (None, None, Some(vertices), Some(faces)) => {
                let (objects, faces) = mesh_objects(vertices, faces, precision)?;
                corners = Some(Arc::new(faces));
                objects
            }
            _ => {
                let accepted = "one of triangles, boxes, and vertices with faces";
                return Err(invalid(format!(
                    "a tree is over triangles or boxes; accepted: {accepted}"
                )));
            }
        };
        let bytes = tree_file::read(&path).map_err(read_error)?;
        let loaded = detached(py, || OwnedTree::load(objects, &bytes))?;
        let owned = loaded.map_err(|error| match error {
            FileError::Single => invalid_argument("path", format!("{error}, precision=\"single\"")),
            FileError::Double => invalid_argument("path", format!("{error}, precision=\"double\"")),
            _ => invalid_argument("path", error),
        })?;
        Ok(Self { faces: corners, ..Self::new(owned) })
    }

    /// Writes the tree to a file. An existing file is replaced when the new one is complete; a
    /// failure leaves the old one.
    ///
    /// >>> square.save(folder.name + "/square.bvh")
    fn save(&self, py: Python, path: PathBuf) -> PyResult<()> {
        let owned = self.owned();
        let bytes = detached(py, || owned.save())?.map_err(invalid)?;
        files::write(&path, &bytes).map_err(write_error)
    }

    /// Returns the file of `bvh export` for the tracer of another library, by its name there
    /// (docs/use/INTEROP.md). A query for all hits of three-mesh-bvh, of the crate bvh and of a reader of
    /// json finds a divided triangle more than once: `divided=True` says that yours are for the
    /// nearest or any hit. Otherwise such a tree is rejected.
    ///
    /// >>> import json
    /// >>> json.loads(square.export("json"))["nodes"]
    /// [[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0, 2]]
    #[pyo3(signature = (tracer, *, divided = false))]
    fn export<'py>(
        &self,
        py: Python<'py>,
        tracer: &str,
        divided: bool,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let target =
            Target::named(tracer).map_err(|unknown| invalid(format!("tracer is {unknown}")))?;
        let owned = self.owned();
        let bytes = detached(py, || owned.export(&target, divided))?.map_err(invalid)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Improves the tree for about `seconds`, by default 1, or for `work`. Ctrl-C ends the search early, and the tree keeps its
    /// gains. Until the call returns, other threads see the old tree, and a second `improve` raises
    /// a `RuntimeError`.
    ///
    /// >>> square.improve(work=1000)
    #[pyo3(signature = (seconds = None, *, work = None, progress = None))]
    fn improve(
        &self,
        py: Python,
        #[pyo3(from_py_with = scalars::seconds)] seconds: Option<f64>,
        #[pyo3(from_py_with = scalars::work)] work: Option<u64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let _improving = self.improver.begin()?;
        let owned = self.owned();
        let seconds = seconds.or(work.is_none().then_some(1.0));
        let limits = Limits { seconds, work, progress };
        let (improvement, raised) =
            search::run(py, limits, |budget, observer| owned.improvement(budget, observer))?;
        drop(owned);
        let improvement = improvement.map_err(invalid)?;
        // The gains are applied before a KeyboardInterrupt is raised.
        Arc::make_mut(&mut self.locked(py)).apply(improvement);
        raised
    }

    /// Moves the vertices, `(v, 3)`, of a tree from `from_mesh` or `load`, which are as many as
    /// before. The nodes remain and their boxes become tight, in milliseconds; `improve` may find
    /// better nodes. Tracers of the tree do not change.
    ///
    /// >>> mesh.update([[0, 0, 1], [1, 0, 1], [0, 1, 1]])
    fn update(&self, vertices: &Bound<PyAny>) -> PyResult<()> {
        let Some(faces) = &self.faces else {
            let accepted = "a tree of vertices and faces, from Tree.from_mesh or Tree.load";
            return Err(invalid(format!("the tree has no faces; accepted: {accepted}")));
        };
        let _improving = self.improver.begin()?;
        let owned = self.owned();
        let objects = moved_mesh(vertices, faces, Precision::of_tree(&owned))?;
        let py = vertices.py();
        // A copy is moved, because the tree must not be locked while another thread may fork.
        let moved = py
            .detach(|| owned.refitted(objects))
            .map_err(|error| invalid_argument("vertices", error))?;
        *self.locked(py) = Arc::new(moved);
        Ok(())
    }

    /// Returns a cost of the tree for random lines: `internal_area`, which searches with `seconds`
    /// or `work` and without `rays` minimise, `goldsmith_salmon`, `sah` with both constants 1, or
    /// `layout`, the cost of a `Tracer`, which compares trees of all searches.
    ///
    /// >>> square.cost("sah") > 0
    /// True
    #[pyo3(signature = (kind = "internal_area"))]
    fn cost(&self, kind: &str) -> PyResult<f64> {
        let objectives = [
            ("internal_area", Objective::InternalArea),
            ("goldsmith_salmon", Objective::GoldsmithSalmon),
            ("sah", Objective::Sah(SahConstants::default())),
            ("layout", Objective::Layout),
        ];
        Ok(self.owned().cost(named("kind", kind, objectives)?))
    }

    /// The numbers of the triangles' coordinates: `single`, `float32`, as those of all boxes, or
    /// `double`, `float64`.
    ///
    /// >>> square.precision
    /// 'single'
    #[getter]
    fn precision(&self) -> &'static str {
        match Precision::of_tree(&self.owned()) {
            Precision::Single => "single",
            Precision::Double => "double",
        }
    }

    /// What the search chose by itself, and why: one line each. A loaded tree has none.
    ///
    /// >>> square.reasons
    /// ["frame: the budget is too small to try others; kept are the file's axes"]
    #[getter]
    fn reasons(&self) -> Vec<String> {
        self.owned().reasons().iter().map(ToString::to_string).collect()
    }

    /// The frame of the boxes, a rotation and a centre: they contain `rotation @ (p - centre)` for
    /// the points p of their objects. `None` if they lie along the axes.
    ///
    /// >>> square.frame
    #[getter]
    fn frame(&self) -> Option<([[f64; 3]; 3], [f64; 3])> {
        let frame = self.owned().tree().frame?;
        Some((frame.rotation().transpose().to_cols_array_2d(), frame.centre().to_array()))
    }

    /// Returns the nodes, the root first, as an array with the fields `min`, `first`, `max` and
    /// `count`. An inner node has the `count` 0, and its two children begin at `first`. The objects
    /// of a leaf are `object_ids()[first:first + count]`. Boxes lie in the `frame`, if there is one.
    ///
    /// >>> square.nodes()["max"][0]
    /// array([1., 1., 0.], dtype=float32)
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        // numpy views the words as records, so that no field is converted.
        let words: Vec<u32> = bytemuck::cast_slice(&self.owned().tree().to_first_count()).to_vec();
        let point = "3f4";
        let number = "u4";
        let fields = [("min", point), ("first", number), ("max", point), ("count", number)];
        let kind = py.import("numpy")?.call_method1("dtype", (fields.to_vec(),))?;
        words.into_pyarray(py).call_method1("view", (kind,))
    }

    /// Returns the object ids, to which leaves refer by position.
    ///
    /// >>> sorted(square.object_ids().tolist())
    /// [0, 1]
    fn object_ids<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        let ids = self.owned().tree().prim_ids.clone();
        ids.into_pyarray(py)
    }

    fn __copy__(&self) -> Self {
        Self { faces: self.faces.clone(), ..Self::shared(self.owned()) }
    }

    /// Both trees share what neither can change.
    fn __deepcopy__(&self, _memo: &Bound<PyAny>) -> Self {
        self.__copy__()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, State<'py>)> {
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, pickle::state(py, &self.owned(), self.faces.as_deref())?))
    }

    #[staticmethod]
    fn _restore(
        py: Python,
        shape: &str,
        objects: &[u8],
        tree: &[u8],
        faces: Option<&[u8]>,
        vertices: usize,
    ) -> PyResult<Self> {
        let owned = pickle::tree(py, shape, objects, tree)?;
        let faces = faces.map(|faces| pickle::faces(&owned, faces, vertices)).transpose()?;
        Ok(Self { faces: faces.map(Arc::new), ..Self::new(owned) })
    }

    fn __len__(&self) -> usize {
        self.owned().objects()
    }

    fn __repr__(&self) -> String {
        let owned = self.owned();
        format!("<Tree of {} nodes over {} objects>", owned.tree().nodes.len(), owned.objects())
    }
}

fn frames(frame: &str) -> PyResult<Frames> {
    named("frame", frame, [("auto", Frames::Auto), ("file", Frames::File)])
}

/// Searches for a tree, whose objects are the argument called `name`.
fn found(
    py: Python,
    name: &str,
    objects: Objects,
    options: &Options,
    rays: Option<&Bound<PyAny>>,
    limits: Limits,
) -> PyResult<Tree> {
    let rays = &segments(rays)?;
    let (found, raised) = search::run(py, limits, |budget, observer| {
        let anywhere: Option<Anywhere> = Some(bvh_scenes::rays::anywhere);
        OwnedTree::find(objects, &Options { rays, budget, anywhere, ..*options }, observer)
    })?;
    raised?;
    found.map(Tree::new).map_err(|error| match error {
        BakeError::Rays(_) | BakeError::Search(SearchError::OutOfRange(_)) => invalid(error),
        BakeError::Search(_) => invalid_argument(name, error),
    })
}

fn invalid_argument(name: &str, error: impl Display) -> PyErr {
    invalid(format!("{name}: {error}"))
}

/// Converts a failure to read into an `OSError` of its kind, or into a `ValueError` about the
/// contents.
fn read_error(error: TreeFileError) -> PyErr {
    match error {
        TreeFileError::Invalid { source, .. } => invalid_argument("path", source),
        TreeFileError::Read(error) => io::Error::new(error.kind(), error.to_string()).into(),
    }
}

/// Converts a failure to write into an `OSError` of its kind.
fn write_error(error: WriteError) -> PyErr {
    io::Error::new(error.source.kind(), error.to_string()).into()
}
