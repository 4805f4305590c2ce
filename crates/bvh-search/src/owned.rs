//! A tree that owns its objects, for callers that cannot lend them: the bindings to other
//! languages.

use crate::{Budget, Observer, Outcome, Problem, SearchError, Splits, best, optimize, solve};
use bvh_core::cost::Objective;
use bvh_core::file::{self, FileError, Origin};
use bvh_core::{Aabb, Bvh, Primitives, Triangle};

/// The objects of a tree.
#[derive(Clone, Debug)]
pub enum Objects {
    /// Objects known by their boxes only.
    Boxes(Vec<Aabb>),
    /// Objects of a known shape, which can be divided among leaves.
    Shapes(Primitives),
}

/// A better tree over the objects of an [`OwnedTree`], from [`OwnedTree::improvement`].
#[derive(Clone, Debug)]
pub struct Improvement(Outcome);

/// A tree found by [`best`](crate::best), with its objects.
#[derive(Clone, Debug)]
pub struct OwnedTree {
    tree: Bvh,
    boxes: Vec<Aabb>,
    shapes: Option<Primitives>,
    /// Maximum number of references to objects.
    most: usize,
    /// The work of all searches so far.
    work: u64,
}

impl OwnedTree {
    /// Searches until `observer` cancels, as a [`Deadline`](crate::Deadline) does. Shapes may be
    /// divided among leaves, into up to `references` parts each on average; boxes may not.
    pub fn find(
        objects: Objects,
        references: f64,
        observer: &dyn Observer,
    ) -> Result<Self, SearchError> {
        let mut owned = Self::bare(objects, references);
        let outcome =
            solve(&best::Config::default(), &owned.problem(), 1, Budget::UNLIMITED, observer)?;
        owned.take(outcome);
        Ok(owned)
    }

    /// Reads a tree over these objects from `bytes`. Later searches may use as many references as
    /// the tree has.
    pub fn load(objects: Objects, bytes: &[u8]) -> Result<Self, FileError> {
        let mut owned = Self::bare(objects, 1.0);
        let file = file::TreeFile::open(bytes)?.for_boxes(&owned.boxes)?;
        owned.tree = file.tree()?;
        owned.most = owned.tree.prim_ids.len();
        owned.work = file.header().work;
        Ok(owned)
    }

    /// Improves the tree until `observer` cancels the search; the cost never rises.
    pub fn improve(&mut self, observer: &dyn Observer) -> Result<(), SearchError> {
        let improvement = self.improvement(observer)?;
        self.apply(improvement);
        Ok(())
    }

    /// Searches as [`improve`](Self::improve) does without changing the tree, so that other threads
    /// can read it meanwhile. Pass the result to [`apply`](Self::apply).
    pub fn improvement(&self, observer: &dyn Observer) -> Result<Improvement, SearchError> {
        let config = best::Config::default();
        optimize(&self.tree, &self.problem(), &config, 1, Budget::UNLIMITED, observer)
            .map(Improvement)
    }

    /// Replaces the tree by an improvement of this very tree.
    pub fn apply(&mut self, improvement: Improvement) {
        self.take(improvement.0);
    }

    /// Returns the tree as a file, which [`load`](Self::load) and the program `bvh` read.
    pub fn save(&self) -> Result<Vec<u8>, FileError> {
        let origin = Origin { method: "best", seed: 1, work: self.work, ..Origin::default() };
        match &self.shapes {
            // The validation of divided objects needs their shapes.
            Some(shapes) => file::save_references(&self.tree, &self.boxes, shapes, &origin),
            None => file::save(&self.tree, &self.boxes, &origin),
        }
    }

    /// The cost of the tree by `objective`. O(nodes).
    pub fn cost(&self, objective: Objective) -> f64 {
        objective.cost(&self.tree)
    }

    /// The tree.
    pub fn tree(&self) -> &Bvh {
        &self.tree
    }

    /// The number of objects.
    pub fn objects(&self) -> usize {
        self.boxes.len()
    }

    /// The objects, if they are triangles.
    pub fn triangles(&self) -> Option<&[Triangle]> {
        match &self.shapes {
            Some(Primitives::Triangles(triangles)) => Some(triangles),
            _ => None,
        }
    }

    /// Builds the value without a tree.
    fn bare(objects: Objects, references: f64) -> Self {
        let (boxes, shapes) = match objects {
            Objects::Boxes(boxes) => (boxes, None),
            Objects::Shapes(shapes) => (shapes.boxes(), Some(shapes)),
        };
        let most = (references * boxes.len() as f64) as usize;
        Self { tree: Bvh::default(), boxes, shapes, most, work: 0 }
    }

    /// The problem that every search solves.
    fn problem(&self) -> Problem<'_> {
        let shapes = self.shapes.as_ref();
        let splits = shapes.and_then(|shapes| Splits::at_most(self.most, &self.boxes, shapes));
        Problem { splits, ..Problem::new(&self.boxes) }
    }

    fn take(&mut self, outcome: Outcome) {
        self.tree = outcome.tree;
        self.work = self.work.saturating_add(outcome.work);
    }
}
