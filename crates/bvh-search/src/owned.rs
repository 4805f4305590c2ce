//! A tree that owns its objects, for callers that cannot lend them: the bindings to other
//! languages.

use crate::rays::{FindError, ray_density};
use crate::{Budget, Observer, Outcome, Problem, SearchError, Splits, best, optimize, solve};
use bvh_core::cost::{Measure, Objective};
use bvh_core::file::{self, FileError, Origin};
use bvh_core::{Aabb, Bvh, InvalidBvh, Primitives, RayDensity, Segment, Triangle, WideBvh};

/// The objects of a tree.
#[derive(Clone, Debug)]
pub enum Objects {
    /// Objects known by their boxes only.
    Boxes(Vec<Aabb>),
    /// Objects of a known shape, which can be divided among leaves.
    Shapes(Primitives),
}

/// The choices of a search for an [`OwnedTree`].
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The average number of parts into which shapes may be divided among leaves; 1 keeps them
    /// whole.
    pub references: f64,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The limits of the search besides its observer.
    pub budget: Budget,
    /// The rays that the tree is for, as in [`ray_density`]; random lines if empty.
    pub rays: &'a [Segment],
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { references: 1.0, seed: 1, budget: Budget::UNLIMITED, rays: &[] }
    }
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
    seed: u64,
    /// The density of the rays that the tree is for.
    density: Option<RayDensity>,
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
        owned.search(Budget::UNLIMITED, observer)?;
        Ok(owned)
    }

    /// Searches as [`find`](Self::find) does, with these options.
    pub fn find_with(
        objects: Objects,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self, FindError> {
        let mut owned = Self::bare(objects, options.references);
        owned.seed = options.seed;
        if !options.rays.is_empty() {
            owned.density = Some(ray_density(&owned.boxes, owned.shapes.as_ref(), options.rays)?);
        }
        owned.search(options.budget, observer)?;
        Ok(owned)
    }

    fn search(&mut self, budget: Budget, observer: &dyn Observer) -> Result<(), SearchError> {
        let config = best::Config::default();
        let outcome = solve(&config, &self.problem(), self.seed, budget, observer)?;
        self.take(outcome);
        Ok(())
    }

    /// Moves the tree to the same objects at other places: every box becomes tight again, and the
    /// nodes remain. The growth of a [cost](Self::cost) tells when a search is worth its time.
    /// O(n).
    ///
    /// # Errors
    /// Returns the first object that has no valid box; the tree is then unchanged.
    ///
    /// # Panics
    /// Panics if the number of objects differs.
    pub fn refit(&mut self, objects: Objects) -> Result<(), bvh_core::InvalidBox> {
        let (boxes, shapes) = self.moved(objects)?;
        self.tree.refit(&boxes);
        self.boxes = boxes;
        self.shapes = shapes;
        Ok(())
    }

    /// Returns a copy of the tree, moved as by [`refit`](Self::refit), for callers whose threads
    /// still use this one. O(n).
    ///
    /// # Errors
    /// Returns the first object that has no valid box.
    ///
    /// # Panics
    /// Panics if the number of objects differs.
    pub fn refitted(&self, objects: Objects) -> Result<Self, bvh_core::InvalidBox> {
        let (boxes, shapes) = self.moved(objects)?;
        let mut tree = self.tree.clone();
        tree.refit(&boxes);
        let density = self.density.clone();
        let Self { most, work, seed, .. } = *self;
        Ok(Self { tree, boxes, shapes, most, work, seed, density })
    }

    /// Returns the boxes and shapes of the objects at other places.
    fn moved(
        &self,
        objects: Objects,
    ) -> Result<(Vec<Aabb>, Option<Primitives>), bvh_core::InvalidBox> {
        let (boxes, shapes) = boxes_of(objects);
        assert_eq!(boxes.len(), self.boxes.len(), "the same number of objects");
        bvh_core::check_boxes(&boxes)?;
        Ok((boxes, shapes))
    }

    /// Returns the layout of the tree that traces rays, for the rays of its search if there are
    /// any; `None` for objects that are not triangles.
    pub fn layout(&self) -> Option<Result<WideBvh, InvalidBvh>> {
        let triangles = self.triangles()?;
        Some(match &self.density {
            Some(density) => WideBvh::for_rays(&self.tree, triangles, &density.visits(&self.tree)),
            None => WideBvh::new(&self.tree, triangles),
        })
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
        self.improvement_within(Budget::UNLIMITED, observer)
    }

    /// Searches as [`improvement`](Self::improvement) does, within a budget.
    pub fn improvement_within(
        &self,
        budget: Budget,
        observer: &dyn Observer,
    ) -> Result<Improvement, SearchError> {
        let config = best::Config::default();
        optimize(&self.tree, &self.problem(), &config, self.seed, budget, observer).map(Improvement)
    }

    /// Replaces the tree by an improvement of this very tree.
    pub fn apply(&mut self, improvement: Improvement) {
        self.take(improvement.0);
    }

    /// Returns the tree as a file, which [`load`](Self::load) and the program `bvh` read.
    pub fn save(&self) -> Result<Vec<u8>, FileError> {
        let origin =
            Origin { method: "best", seed: self.seed, work: self.work, ..Origin::default() };
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

    /// The boxes of the objects.
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
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
        let (boxes, shapes) = boxes_of(objects);
        let most = (references * boxes.len() as f64) as usize;
        Self { tree: Bvh::default(), boxes, shapes, most, work: 0, seed: 1, density: None }
    }

    /// The problem that every search solves.
    fn problem(&self) -> Problem<'_> {
        let shapes = self.shapes.as_ref();
        let splits = shapes.and_then(|shapes| Splits::at_most(self.most, &self.boxes, shapes));
        let mut problem = Problem { splits, ..Problem::new(&self.boxes) };
        if let Some(density) = &self.density {
            // The cost of the layout saves more tests of rays than the sum of visits does.
            problem.objective = Objective::Layout;
            problem.measure = Some(density as &dyn Measure);
        }
        problem
    }

    fn take(&mut self, outcome: Outcome) {
        self.tree = outcome.tree;
        self.work = self.work.saturating_add(outcome.work);
    }
}

/// Returns the boxes of objects, and their shapes if they have any.
fn boxes_of(objects: Objects) -> (Vec<Aabb>, Option<Primitives>) {
    match objects {
        Objects::Boxes(boxes) => (boxes, None),
        Objects::Shapes(shapes) => (shapes.boxes(), Some(shapes)),
    }
}
