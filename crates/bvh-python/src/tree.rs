//! The class `Tree`: trees over arrays, found, improved, measured, saved, loaded, and copied as
//! nodes.

use crate::arrays::{boxes, invalid, triangles};
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

/// A tree with its objects. `from_triangles`, `from_boxes` and `load` create trees; `len` is the
/// number of objects.
#[pyclass(frozen, module = "bvh_search")]
pub struct Tree {
    /// The tree. A thread must not call Python while it holds this lock: Python may switch to a
    /// second thread, which would wait for the lock and never switch back.
    owned: RwLock<OwnedTree>,
    /// The lock of the thread that improves the tree.
    improving: Mutex<()>,
}

impl Tree {
    fn new(owned: OwnedTree) -> Self {
        Self { owned: RwLock::new(owned), improving: Mutex::new(()) }
    }

    /// Returns the current tree.
    pub fn owned(&self) -> RwLockReadGuard<'_, OwnedTree> {
        // A poisoned lock still has a valid tree, because trees are replaced as a whole.
        self.owned
            .read()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Tree {
    /// Searches for the best tree over triangles, `(n, 3, 3)`, for about `seconds`. With
    /// `references` above 1, up to 16, triangles may be divided among leaves, on average into that
    /// many parts each.
    #[staticmethod]
    #[pyo3(signature = (triangles, seconds = 1.0, *, references = 1.0))]
    fn from_triangles(triangles: &Bound<PyAny>, seconds: f64, references: f64) -> PyResult<Self> {
        if !(1.0..=16.0).contains(&references) {
            return Err(invalid(format!("references is {references}; accepted: 1 to 16")));
        }
        found(triangles.py(), "triangles", self::triangles(triangles)?, references, seconds)
    }

    /// Searches for the best tree over boxes, `(n, 2, 3)` or `(n, 6)`, lower corners first, for
    /// about `seconds`.
    #[staticmethod]
    #[pyo3(signature = (boxes, seconds = 1.0))]
    fn from_boxes(boxes: &Bound<PyAny>, seconds: f64) -> PyResult<Self> {
        found(boxes.py(), "boxes", self::boxes(boxes)?, 1.0, seconds)
    }

    /// Loads the tree in a file. The triangles or boxes must be the ones that it was saved for.
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
                return Err(invalid("a tree is over triangles or boxes; accepted: one of the two"));
            }
        };
        let bytes = tree_file::read(&path).map_err(read_error)?;
        OwnedTree::load(objects, &bytes)
            .map(Self::new)
            .map_err(|error| invalid_argument("path", error))
    }

    /// Writes the tree to a file. An existing file is replaced when the new one is complete; a
    /// failure leaves the old one.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let bytes = self.owned().save().map_err(invalid)?;
        bvh_files::write(&path, &bytes).map_err(write_error)
    }

    /// Improves the tree for about `seconds`. Ctrl-C ends the search early, and the tree keeps its
    /// gains. Until the call returns, other threads see the old tree, and a second `improve` raises
    /// a `RuntimeError`.
    #[pyo3(signature = (seconds = 1.0))]
    fn improve(&self, py: Python, seconds: f64) -> PyResult<()> {
        // Waiting for the lock here would block the interpreter and with it the other thread.
        let _improving = match self.improving.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return Err(PyRuntimeError::new_err(IMPROVING)),
        };
        let (improvement, raised) =
            searched(py, seconds, |observer| self.owned().improvement(observer))?;
        let improvement = improvement.map_err(invalid)?;
        // The gains are applied before a KeyboardInterrupt is raised.
        self.owned
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .apply(improvement);
        raised
    }

    /// Returns a cost of the tree: `internal_area`, which searches minimise, `goldsmith_salmon`,
    /// `sah` with both constants 1, or `layout`, the cost of a `Tracer`.
    #[pyo3(signature = (kind = "internal_area"))]
    fn cost(&self, kind: &str) -> PyResult<f64> {
        let objective = match kind {
            "internal_area" => Objective::InternalArea,
            "goldsmith_salmon" => Objective::GoldsmithSalmon,
            "sah" => Objective::Sah(SahConstants::default()),
            "layout" => Objective::Layout,
            _ => {
                let accepted = "internal_area, goldsmith_salmon, sah, layout";
                return Err(invalid(format!("kind is {kind:?}; accepted: {accepted}")));
            }
        };
        Ok(self.owned().cost(objective))
    }

    /// Returns the nodes, the root first, as an array with the fields `min`, `first`, `max` and
    /// `count`. An inner node has the `count` 0, and its two children begin at `first`. The objects
    /// of a leaf are `object_ids()[first:first + count]`.
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        // numpy views the words as records, so that no field is converted.
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

    /// Returns the object ids, to which leaves refer by position.
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

/// The message about a second improvement at the same time.
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
        .map_err(|error| invalid_argument(name, error))
}

/// Creates the error of an argument with this name.
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
