//! The class `Tree`: found over arrays, improved, measured, saved, loaded, and handed out as nodes.

use crate::arrays::{boxes, refused, triangles};
use crate::search::searched;
use bvh_files::WriteError;
use bvh_files::tree_file::{self, TreeFileError};
use bvh_search::bvh_core::cost::{Objective, SahConstants};
use bvh_search::{Objects, OwnedTree};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::fmt::Display;
use std::io;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard, TryLockError};

/// A tree with its objects. `from_triangles`, `from_boxes` and `load` make one; `len` is the number of objects.
#[pyclass(frozen, module = "bvh_search")]
pub struct Tree {
    /// Nobody calls Python while it is locked: Python may let another thread run, which would wait for the lock and not let this one on.
    owned: RwLock<OwnedTree>,
    /// Locked by the thread that improves the tree.
    improving: Mutex<()>,
}

impl Tree {
    fn new(owned: OwnedTree) -> Self {
        Self { owned: RwLock::new(owned), improving: Mutex::new(()) }
    }

    /// The tree as it is now. After a panic it is as before: it is replaced whole.
    pub fn owned(&self) -> RwLockReadGuard<'_, OwnedTree> {
        self.owned
            .read()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Tree {
    /// The best tree over triangles, `(n, 3, 3)`, that is found in about so many seconds. With `references` above 1, up to 16,
    /// triangles may be divided among leaves, into so many parts each on average.
    #[staticmethod]
    #[pyo3(signature = (triangles, seconds = 1.0, *, references = 1.0))]
    fn from_triangles(triangles: &Bound<PyAny>, seconds: f64, references: f64) -> PyResult<Self> {
        if !(1.0..=16.0).contains(&references) {
            return Err(refused(format!("references is {references}; accepted: 1 to 16")));
        }
        found(triangles.py(), "triangles", self::triangles(triangles)?, references, seconds)
    }

    /// The best tree over boxes, `(n, 2, 3)` or `(n, 6)`, lower corners first, that is found in about so many seconds.
    #[staticmethod]
    #[pyo3(signature = (boxes, seconds = 1.0))]
    fn from_boxes(boxes: &Bound<PyAny>, seconds: f64) -> PyResult<Self> {
        found(boxes.py(), "boxes", self::boxes(boxes)?, 1.0, seconds)
    }

    /// The tree in a file, over the same triangles or boxes as it was saved for.
    #[staticmethod]
    #[pyo3(signature = (path, *, triangles = None, boxes = None))]
    fn load(
        path: PathBuf,
        triangles: Option<&Bound<PyAny>>,
        boxes: Option<&Bound<PyAny>>,
    ) -> PyResult<Self> {
        let objects = match (triangles, boxes) {
            (Some(triangles), None) => self::triangles(triangles)?,
            (None, Some(boxes)) => self::boxes(boxes)?,
            _ => {
                return Err(refused("a tree is over triangles or boxes; accepted: one of the two"));
            }
        };
        let bytes = tree_file::read(&path).map_err(unread)?;
        OwnedTree::load(objects, &bytes)
            .map(Self::new)
            .map_err(|error| at("path", error))
    }

    /// Writes the tree to a file. One that is there is replaced when the new one is complete: after a failure it is the old one.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let bytes = self.owned().save().map_err(refused)?;
        bvh_files::write(&path, &bytes).map_err(unwritten)
    }

    /// Improves the tree for about so many seconds. Ctrl-C ends it sooner, and the tree keeps what was gained. Until it returns other
    /// threads use the tree as it was, and a second `improve` of theirs is a `RuntimeError`.
    #[pyo3(signature = (seconds = 1.0))]
    fn improve(&self, py: Python, seconds: f64) -> PyResult<()> {
        let _improving = match self.improving.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return Err(PyRuntimeError::new_err(IMPROVING)),
        };
        let (improvement, raised) =
            searched(py, seconds, |observer| self.owned().improvement(observer))?;
        let improvement = improvement.map_err(refused)?;
        self.owned
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .apply(improvement);
        raised
    }

    /// The cost of the tree: `internal_area`, which is minimised, `goldsmith_salmon`, `sah` with both constants 1, or `layout`, that of
    /// a `Tracer`.
    #[pyo3(signature = (kind = "internal_area"))]
    fn cost(&self, kind: &str) -> PyResult<f64> {
        let objective = match kind {
            "internal_area" => Objective::InternalArea,
            "goldsmith_salmon" => Objective::GoldsmithSalmon,
            "sah" => Objective::Sah(SahConstants::default()),
            "layout" => Objective::Layout,
            _ => {
                let accepted = "internal_area, goldsmith_salmon, sah, layout";
                return Err(refused(format!("kind is {kind:?}; accepted: {accepted}")));
            }
        };
        Ok(self.owned().cost(objective))
    }

    /// The nodes, the root first, as an array with the fields `min`, `first`, `max` and `count`: `count` is 0 for an inner node, whose two
    /// children begin at `first`; else the node is a leaf, whose objects are `object_ids()[first:first + count]`.
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let words: Vec<u32> = bytemuck::cast_slice(&self.owned().tree().to_first_count()).to_vec();
        let point = "3f4";
        let number = "u4";
        let fields = [("min", point), ("first", number), ("max", point), ("count", number)];
        let kind = py
            .import("numpy")?
            .call_method1("dtype", (fields.to_vec(),))?;
        words
            .into_pyarray(py)
            .call_method1("view", (kind,))
    }

    /// The object ids that leaves name by position.
    fn object_ids<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        let ids = self.owned().tree().prim_ids.clone();
        ids.into_pyarray(py)
    }

    fn __len__(&self) -> usize {
        self.owned().objects()
    }

    fn __repr__(&self) -> String {
        let owned = self.owned();
        format!("<Tree of {} nodes over {} objects>", owned.tree().nodes.len(), owned.objects())
    }
}

/// The message of a second improvement.
const IMPROVING: &str =
    "another thread is improving this tree; accepted: `improve` when its call has returned";

fn found(
    py: Python,
    name: &str,
    objects: Objects,
    references: f64,
    seconds: f64,
) -> PyResult<Tree> {
    let (found, raised) =
        searched(py, seconds, |observer| OwnedTree::find(objects, references, observer))?;
    raised?;
    found
        .map(Tree::new)
        .map_err(|error| at(name, error))
}

/// What is wrong with an argument.
fn at(name: &str, error: impl Display) -> PyErr {
    refused(format!("{name}: {error}"))
}

/// What happened to a file that was to be read, as the `OSError` of its kind, or as the `ValueError` of what it holds.
fn unread(error: TreeFileError) -> PyErr {
    match error {
        TreeFileError::Invalid { source, .. } => at("path", source),
        TreeFileError::Read(error) => io::Error::new(error.kind(), error.to_string()).into(),
    }
}

/// What happened to a file that was to be written, as the `OSError` of its kind.
fn unwritten(error: WriteError) -> PyErr {
    io::Error::new(error.source.kind(), error.to_string()).into()
}
