//! A tree that owns what it is over, for callers who can lend nothing: the bindings to other languages.

use crate::{Budget, Observer, Outcome, Problem, SearchError, Splits, best, optimize, solve};
use bvh_core::cost::Objective;
use bvh_core::file::{self, FileError, Origin};
use bvh_core::{Aabb, Bvh, Primitives, Triangle};

/// What a tree is over.
#[derive(Clone, Debug)]
pub enum Objects {
    /// Objects of which only the boxes are known.
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
    /// How many references to objects the tree may have.
    most: usize,
    /// The work of all searches so far.
    work: u64,
}

impl OwnedTree {
    /// The tree that is found until `observer` cancels the search, as a [`Deadline`](crate::Deadline) does. Shapes may be divided
    /// among leaves, into up to `references` parts each on average; boxes may not.
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

    /// The tree over these objects that `bytes` hold. As many references as it has stay allowed.
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

    /// Searches as [`improve`](Self::improve) does and leaves the tree as it is, so that others can read it meanwhile. The result is
    /// for [`apply`](Self::apply).
    pub fn improvement(&self, observer: &dyn Observer) -> Result<Improvement, SearchError> {
        let config = best::Config::default();
        optimize(&self.tree, &self.problem(), &config, 1, Budget::UNLIMITED, observer)
            .map(Improvement)
    }

    /// Puts an improvement of this very tree in its place.
    pub fn apply(&mut self, improvement: Improvement) {
        self.take(improvement.0);
    }

    /// The tree as a file, which [`load`](Self::load) and the harness read.
    pub fn save(&self) -> Result<Vec<u8>, FileError> {
        let origin = Origin { method: "best", seed: 1, work: self.work, ..Origin::default() };
        match &self.shapes {
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

    /// The objects, without a tree.
    fn bare(objects: Objects, references: f64) -> Self {
        let (boxes, shapes) = match objects {
            Objects::Boxes(boxes) => (boxes, None),
            Objects::Shapes(shapes) => (shapes.boxes(), Some(shapes)),
        };
        let most = (references * boxes.len() as f64) as usize;
        Self { tree: Bvh::default(), boxes, shapes, most, work: 0 }
    }

    /// What is searched for, now and later.
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
