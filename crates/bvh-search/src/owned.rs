//! A tree that owns its objects, for callers that cannot lend them: the bindings to other
//! languages.

use crate::bake::Untimed;
use crate::{
    Bake, BakeError, Baked, Budget, Choice, Division, Frames, MadeDensity, Observer, Open, Reason,
    SearchError, parallel, ray_density,
};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::export::{ExportError, Target};
use bvh_core::file::{FileError, TreeFile};
use bvh_core::{
    Aabb, Bvh, DTriangle, Frame, InvalidBox, InvalidBvh, Primitives, RayDensity, Segment, Triangle,
    WideBvh, check_boxes,
};

/// The objects of a tree.
#[derive(Clone, Debug)]
pub enum Objects {
    /// Objects known by their boxes only.
    Boxes(Vec<Aabb>),
    /// Objects of a known shape, which can be divided among leaves.
    Shapes(Primitives),
}

/// The choices of a search for an [`OwnedTree`]. Without a limit of work or of time, a bake
/// [chooses](Bake::choose) its work and all that is not given.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// The average number of parts into which shapes may be divided among leaves; 1 keeps them
    /// whole, as `None` does within a limit.
    pub references: Option<f64>,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The limits of the search besides its observer.
    pub budget: Budget,
    /// The rays that the tree is for, as in [`RayDensity`]; if empty, random lines, or rays from
    /// anywhere if they are chosen.
    pub rays: &'a [Segment],
    /// Makes rays from anywhere in a scene, for a bake that chooses.
    pub anywhere: Option<Anywhere>,
    /// Whether triangles choose the frame of their boxes.
    pub frame: Frames,
}

/// Makes the [rays](Open::anywhere) of a seed from anywhere in a scene of these shapes.
pub type Anywhere = fn(&Primitives, &Bvh, u64, &dyn Fn() -> bool) -> MadeDensity;

impl Default for Options<'_> {
    fn default() -> Self {
        let (budget, frame) = (Budget::UNLIMITED, Frames::Auto);
        Self { references: None, seed: 1, budget, rays: &[], anywhere: None, frame }
    }
}

/// The tree of a [`Bake`], with its objects.
///
/// ```
/// use bvh_search::{Objects, Options, OwnedTree, bvh_core::Primitives, prelude::*};
/// let at = |x: f32| [[x, 0.0, 0.0], [x + 1.5, 1.0, 0.0], [x, 1.0, 2.0]];
/// let shapes = Primitives::Triangles((0..50u8).map(|x| at(x.into()).into()).collect());
/// let budget = Budget { max_work: Some(100_000), ..Budget::UNLIMITED };
/// let options = Options { budget, ..Options::default() };
/// let tree = OwnedTree::find(Objects::Shapes(shapes.clone()), &options, &())?;
/// let loaded = OwnedTree::load(Objects::Shapes(shapes), &tree.save()?)?;
/// assert_eq!(loaded.tree(), tree.tree());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct OwnedTree {
    tree: Bvh,
    boxes: Vec<Aabb>,
    shapes: Option<Primitives>,
    /// The largest average number of references to an object.
    references: f64,
    /// The cost that searches minimise; `None` is the default of a [`Bake`].
    objective: Option<Objective>,
    /// The work of all searches so far.
    work: u64,
    seed: u64,
    /// The density of the rays that the tree is for.
    density: Option<RayDensity>,
    reasons: Vec<Reason>,
}

impl OwnedTree {
    /// Searches until the options' budget is spent, or the one that the bake chooses, or until
    /// `observer` cancels, as a [`Deadline`](crate::Deadline) does.
    pub fn find(
        objects: Objects,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self, BakeError> {
        let Options { references, seed, rays, anywhere, frame, .. } = *options;
        let is_open = options.budget == Budget::UNLIMITED && observer.progress().is_none();
        let count = match &objects {
            Objects::Boxes(boxes) => boxes.len(),
            Objects::Shapes(shapes) => shapes.count(),
        };
        let budget = if is_open { Budget::of_objects(count) } else { options.budget };
        let choice = match &objects {
            Objects::Boxes(_) => None,
            Objects::Shapes(shapes) => Choice::of_shapes(shapes, frame, budget, observer),
        };
        let mut owned = Self::bare(objects, choice.and_then(|choice| choice.frame));
        (owned.references, owned.seed) = (references.unwrap_or(1.0), seed);
        if frame == Frames::Auto && !Untimed(observer).cancelled() {
            owned.reasons.extend(choice.map(Reason::Frame));
        }
        let shapes = owned.shapes.as_ref();
        let recorded =
            |tree: &Bvh, _, is_over: &dyn Fn() -> bool| ray_density(tree, shapes, rays, is_over);
        let made = |tree: &Bvh, seed, is_over: &dyn Fn() -> bool| match (anywhere, shapes) {
            (Some(anywhere), Some(shapes)) => anywhere(shapes, tree, seed, is_over),
            _ => Ok(None),
        };
        let open = Open {
            budget: is_open,
            cost: true,
            references: references.is_none(),
            rays: if rays.is_empty() { None } else { Some(&recorded) },
            anywhere: if anywhere.is_some() { Some(&made) } else { None },
        };
        let bake = Bake { budget, start: None, ..owned.bake() };
        let mut chosen = bake.choose(&open, None, observer)?;
        let greedy = chosen.greedy.take();
        let settled = chosen.bake(&bake);
        let references = settled.references;
        let baked = settled.search(greedy, observer)?;
        owned.references = references;
        owned.objective = Some(chosen.objective);
        owned.density = chosen.density;
        owned.reasons.extend(chosen.reasons);
        owned.apply(baked);
        Ok(owned)
    }

    /// Returns the tree over the same objects at other places: every box becomes tight again, and
    /// the nodes remain. Other threads may still use this one. The growth of a [cost](Self::cost)
    /// tells when a search is worth its time. O(n).
    ///
    /// # Errors
    /// Returns the first object that has no valid box.
    ///
    /// # Panics
    /// Panics if the number of objects differs.
    pub fn refitted(&self, objects: Objects) -> Result<Self, InvalidBox> {
        let (boxes, shapes) = boxes_of(objects, self.tree.frame.as_ref());
        assert_eq!(boxes.len(), self.boxes.len(), "the same number of objects");
        check_boxes(&boxes)?;
        let mut tree = self.tree.clone();
        tree.refit(&boxes);
        Ok(Self {
            tree,
            boxes,
            shapes,
            reasons: self.reasons.clone(),
            density: self.density.clone(),
            ..*self
        })
    }

    /// Returns the layout of the tree that traces rays, for the rays of its search if there are
    /// any; `None` for objects that are not triangles in f32.
    pub fn layout(&self) -> Option<Result<WideBvh, InvalidBvh>> {
        let triangles = self.triangles()?;
        Some(match &self.density {
            Some(density) => WideBvh::for_rays(&self.tree, triangles, &density.visits(&self.tree)),
            None => WideBvh::new(&self.tree, triangles),
        })
    }

    /// Reads a tree over these objects from `bytes`. Later searches have the seed of the file, and
    /// may use as many references as the tree has.
    ///
    /// Rejects the trees of other objects, and forged trees whose boxes do not contain their
    /// objects, as [`TreeFile::tree_over`] does.
    pub fn load(objects: Objects, bytes: &[u8]) -> Result<Self, FileError> {
        let mut owned = Self::bare(objects, None);
        let file = TreeFile::open(bytes)?.for_objects(&owned.boxes, owned.shapes.as_ref())?;
        owned.tree = file.tree_over(&owned.boxes, owned.shapes.as_ref(), &parallel::call_both)?;
        if let Some(frame) = owned.tree.frame {
            let shapes = owned.shapes.as_ref().ok_or(FileError::Frame)?;
            owned.boxes = shapes.boxes_in(Some(&frame));
        }
        owned.references = Bake::references_of(owned.tree.prim_ids.len(), owned.boxes.len());
        // A bake minimises no other costs.
        owned.objective = Some(file.header().objective).filter(|cost| *cost == Objective::Layout);
        owned.work = file.header().work;
        owned.seed = file.header().seed;
        Ok(owned)
    }

    /// Searches for a better tree until the budget is spent or `observer` cancels, without changing
    /// this one, so that other threads can read it meanwhile. The cost never rises. Pass the result
    /// to [`apply`](Self::apply).
    pub fn improvement(
        &self,
        budget: Budget,
        observer: &dyn Observer,
    ) -> Result<Baked, SearchError> {
        Bake { budget, ..self.bake() }.search(None, observer)
    }

    /// Replaces the tree by an [improvement](Self::improvement) of this very tree.
    pub fn apply(&mut self, improvement: Baked) {
        let Baked { outcome, division, .. } = improvement;
        self.tree = outcome.tree;
        self.work = self.work.saturating_add(outcome.work);
        // Later searches need not look again.
        if division == Division::Useless {
            self.references = 1.0;
        }
    }

    /// Returns the tree as a [file](Target::bytes) for another tracer; of triangles, the greedy tree
    /// if it is [better](Target::fit_better) there. Rejects trees that the tracer would trace
    /// [wrongly](Target::check); `divided` says that all queries are for the nearest or any hit.
    pub fn export(&self, target: &Target, divided: bool) -> Result<Vec<u8>, ExportError> {
        target.check(&self.tree, self.boxes.len(), divided)?;
        let fitted = match (self.triangles(), muller_fellner::Config::default().build(&self.boxes))
        {
            (Some(triangles), Ok(greedy)) => target.fit_better(&self.tree, &greedy, triangles).tree,
            _ => target.fit(&self.tree),
        };
        Ok(target.bytes(&fitted, &self.boxes))
    }

    /// Returns the tree as a file, which [`load`](Self::load) and the program `bvh` read.
    pub fn save(&self) -> Result<Vec<u8>, FileError> {
        self.bake().write(&self.tree, self.work, |sections| sections.concat())
    }

    /// The cost of the tree by `objective`. O(nodes).
    pub fn cost(&self, objective: Objective) -> f64 {
        objective.cost(&self.tree)
    }

    /// What the bake chose by itself, and why.
    pub fn reasons(&self) -> &[Reason] {
        &self.reasons
    }

    /// The tree.
    pub fn tree(&self) -> &Bvh {
        &self.tree
    }

    /// The number of objects.
    pub fn objects(&self) -> usize {
        self.boxes.len()
    }

    /// The boxes of the objects, in the tree's frame if it has one.
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// The objects, if they are triangles in f32.
    pub fn triangles(&self) -> Option<&[Triangle]> {
        match &self.shapes {
            Some(Primitives::Triangles(triangles)) => Some(triangles),
            _ => None,
        }
    }

    /// The objects, if they are triangles in f64.
    pub fn doubles(&self) -> Option<&[DTriangle]> {
        match &self.shapes {
            Some(Primitives::Doubles(triangles)) => Some(triangles),
            _ => None,
        }
    }

    fn bare(objects: Objects, frame: Option<Frame>) -> Self {
        let (boxes, shapes) = boxes_of(objects, frame.as_ref());
        let tree = Bvh { frame, ..Bvh::default() };
        Self {
            tree,
            boxes,
            shapes,
            references: 1.0,
            objective: None,
            work: 0,
            seed: 1,
            density: None,
            reasons: Vec::new(),
        }
    }

    fn bake(&self) -> Bake<'_> {
        Bake {
            frame: self.tree.frame.as_ref(),
            shapes: self.shapes.as_ref(),
            rays: self.density.as_ref(),
            objective: self.objective,
            references: self.references,
            start: Some(&self.tree),
            seed: self.seed,
            ..Bake::new(&self.boxes)
        }
    }
}

fn boxes_of(objects: Objects, frame: Option<&Frame>) -> (Vec<Aabb>, Option<Primitives>) {
    match objects {
        Objects::Boxes(boxes) => (boxes, None),
        Objects::Shapes(shapes) => {
            let boxes = shapes.boxes_in(frame);
            (boxes, Some(shapes))
        }
    }
}
