//! The class `Tree`: found over arrays, improved, measured, saved, loaded, and handed out as nodes.

use crate::arrays::{boxes, refused, triangles};
use crate::search::searched;
use bvh_search::bvh_core::cost::{Objective, SahConstants};
use bvh_search::{Objects, OwnedTree};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A tree with its objects. `from_triangles`, `from_boxes` and `load` make one; `len` is the number of objects.
#[pyclass(module = "bvh_search")]
pub struct Tree {
    pub owned: OwnedTree,
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
    fn load(path: PathBuf, triangles: Option<&Bound<PyAny>>, boxes: Option<&Bound<PyAny>>) -> PyResult<Self> {
        let objects = match (triangles, boxes) {
            (Some(triangles), None) => self::triangles(triangles)?,
            (None, Some(boxes)) => self::boxes(boxes)?,
            _ => return Err(refused("a tree is over triangles or boxes; accepted: one of the two")),
        };
        let bytes = std::fs::read(&path).map_err(|error| file(&path, error))?;
        let owned = OwnedTree::load(objects, &bytes).map_err(|error| at("path", error))?;
        Ok(Self { owned })
    }

    /// Writes the tree to a file, which is replaced if it is there.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let bytes = self.owned.save().map_err(refused)?;
        std::fs::write(&path, bytes).map_err(|error| file(&path, error))
    }

    /// Improves the tree for about so many seconds. Ctrl-C ends it sooner, and the tree keeps what was gained. Until then no
    /// other thread can use the tree.
    #[pyo3(signature = (seconds = 1.0))]
    fn improve(&mut self, py: Python, seconds: f64) -> PyResult<()> {
        let (improved, raised) = searched(py, seconds, |observer| self.owned.improve(observer))?;
        improved.map_err(refused)?;
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
        Ok(self.owned.cost(objective))
    }

    /// The nodes, the root first, as an array with the fields `min`, `first`, `max` and `count`: `count` is 0 for an inner node, whose two
    /// children begin at `first`; else the node is a leaf, whose objects are `object_ids()[first:first + count]`.
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let words: Vec<u32> = bytemuck::cast_slice(&self.owned.tree().to_first_count()).to_vec();
        let (point, number) = ("3f4", "u4");
        let fields = [("min", point), ("first", number), ("max", point), ("count", number)];
        let kind = py.import("numpy")?.call_method1("dtype", (fields.to_vec(),))?;
        words.into_pyarray(py).call_method1("view", (kind,))
    }

    /// The object ids that leaves name by position.
    fn object_ids<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.owned.tree().prim_ids.clone().into_pyarray(py)
    }

    fn __len__(&self) -> usize {
        self.owned.objects()
    }

    fn __repr__(&self) -> String {
        let (nodes, objects) = (self.owned.tree().nodes.len(), self.owned.objects());
        format!("<Tree of {nodes} nodes over {objects} objects>")
    }
}

fn found(py: Python, name: &str, objects: Objects, references: f64, seconds: f64) -> PyResult<Tree> {
    let (found, raised) = searched(py, seconds, |observer| OwnedTree::find(objects, references, observer))?;
    raised?;
    Ok(Tree { owned: found.map_err(|error| at(name, error))? })
}

/// What is wrong with an argument.
fn at(name: &str, error: impl Display) -> PyErr {
    refused(format!("{name}: {error}"))
}

/// What happened to a file, as the `OSError` of its kind.
fn file(path: &Path, error: std::io::Error) -> PyErr {
    std::io::Error::new(error.kind(), format!("{}: {error}", path.display())).into()
}
