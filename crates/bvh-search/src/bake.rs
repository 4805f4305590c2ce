//! [`Bake`]: the one way from objects to the best tree and its file, for the command line, C and
//! Python alike.

use crate::parallel;
use crate::run::built_unless_cancelled;
use crate::{Budget, Kept, Observer, Outcome, Problem, Search, SearchError, Splits};
use crate::{best, optimize, solve_or_keep};
use best::Horizon;
use bvh_build::{Builder, Watch, muller_fellner};
use bvh_config::OutOfRange;
use bvh_core::cost::{Measure, Objective};
use bvh_core::file::{self, FileError, Origin};
use bvh_core::{
    Aabb, Bvh, Clip, DensityError, Frame, Primitives, RayDensity, validate, validate_references,
};
use core::sync::atomic::AtomicBool;

/// The largest average number of references to an object.
const MOST_REFERENCES: f64 = 16.0;

/// A search for the best tree of a scene.
///
/// The same objects, rays, references, seed and budget of work give the same tree and the same
/// [file](Self::write) on every machine, for any number of threads, from the command line, C and
/// Python alike. Within the same work, no tree costs more than the greedy one, nor than the result
/// of [reinsertion](crate::reinsertion) where the budget is long; the search of an observer with a
/// clock keeps such a tree itself.
///
/// ```
/// use bvh_search::{Bake, Budget, prelude::*};
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// let budget = Budget { max_work: Some(100_000), ..Budget::UNLIMITED };
/// let baked = Bake { seed: 7, budget, ..Bake::new(&boxes) }.search(None, &())?;
/// validate(&baked.outcome.tree, &boxes)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct Bake<'a> {
    /// One box per object, [in the frame](bvh_core::InFrame::boxes) if there is one.
    pub boxes: &'a [Aabb],
    /// The frame that the boxes lie in, and the trees will; `None` for the file's axes. Only
    /// triangles have frames. [`Choice`](crate::Choice) finds a good one.
    pub frame: Option<&'a Frame>,
    /// The objects, if their shape is known. Other objects are not divided.
    pub shapes: Option<&'a Primitives>,
    /// The density of the rays that the tree is for; random lines if `None`.
    pub rays: Option<&'a RayDensity>,
    /// The cost to minimise. `None` is the cost of the [layout](Objective::Layout) for rays,
    /// because it saves more of their tests than the sum of visits does, and otherwise the internal
    /// area.
    pub objective: Option<Objective>,
    /// The largest average number of references to an object, from 1 for whole objects to 16.
    pub references: f64,
    /// The tree that spatial splits divide the objects into, if the caller has it.
    pub divided: Option<&'a Bvh>,
    /// The tree that the search continues from, in the same frame; the outcome never costs more.
    /// `None` builds one.
    pub start: Option<&'a Bvh>,
    /// The name of another method than [`best`], and the method. It divides no objects and
    /// continues from no tree.
    pub method: Option<(&'a str, &'a (dyn Search + Sync))>,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The limits of the search besides its observer.
    pub budget: Budget,
}

/// The result of a [`Bake`].
#[derive(Clone, Debug)]
pub struct Baked {
    /// The result of the search.
    pub outcome: Outcome,
    /// The cost of the greedy tree by the same objective, if there was one.
    pub greedy_cost: Option<f64>,
    /// The cost of the [start](Bake::start) by the same objective.
    pub start_cost: Option<f64>,
    /// Whether the search divided objects among leaves.
    pub division: Division,
}

/// Whether a search divides objects among leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Division {
    /// The objects are whole, or the search ended before it knew.
    No,
    /// No spatial split saves anything, so that the search for whole objects finds the same tree.
    Useless,
    /// Leaves may hold parts of objects, and the cost includes leaves.
    Allowed,
}

/// The reason why there is no tree.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// The search failed.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// The rays are invalid.
    #[error("rays: {0}")]
    Rays(#[from] DensityError),
}

/// Asks an observer without a clock to cancel, and tells it nothing, because what it hears of belongs
/// to another search. One with a clock would make results depend on the machine.
pub(crate) struct Untimed<'a>(pub &'a dyn Observer);

impl Observer for Untimed<'_> {
    fn cancelled(&self) -> bool {
        self.0.progress().is_none() && self.0.cancelled()
    }
}

impl<'a> Bake<'a> {
    /// Returns a search with the defaults: whole objects, random lines, seed 1, no limit.
    pub fn new(boxes: &'a [Aabb]) -> Self {
        Self {
            boxes,
            frame: None,
            shapes: None,
            rays: None,
            objective: None,
            references: 1.0,
            divided: None,
            start: None,
            method: None,
            seed: 1,
            budget: Budget::UNLIMITED,
        }
    }

    /// Returns the cost that the search minimises.
    pub fn objective(&self) -> Objective {
        let default = if self.rays.is_some() { Objective::Layout } else { Objective::default() };
        self.objective.unwrap_or(default)
    }

    /// Rejects a number of [references](Self::references) that is out of range.
    pub fn check_references(references: f64) -> Result<(), OutOfRange> {
        match (1.0..=MOST_REFERENCES).contains(&references) {
            true => Ok(()),
            false => Err(OutOfRange::new("references", references, "1 to 16")),
        }
    }

    /// Returns the number of [references](Self::references) per object that permits so many in all.
    pub fn references_of(references: usize, objects: usize) -> f64 {
        // Half a reference more keeps the product with the number of objects from being rounded
        // down.
        ((references as f64 + 0.5) / objects.max(1) as f64).max(1.0)
    }

    /// Builds the greedy tree, with which gains are compared. `None` if the observer cancels first.
    pub fn greedy(&self, observer: &dyn Observer) -> Result<Option<Bvh>, SearchError> {
        let config = muller_fellner::Config::default();
        let build = |watch: &Watch| config.build_watched(self.boxes, None, watch);
        let built = built_unless_cancelled(observer, build)?;
        Ok(built.map(|tree| Bvh { frame: self.frame.copied(), ..tree }))
    }

    /// Searches until the budget is spent or the observer cancels. A budget of no work gives the
    /// greedy tree, or the [start](Self::start).
    ///
    /// Takes the `greedy` tree if the caller has it, and frees its memory as soon as there is a
    /// better tree. Otherwise builds it for a budget of work, in which its time does not count.
    pub fn search(
        &self,
        greedy: Option<Bvh>,
        observer: &dyn Observer,
    ) -> Result<Baked, SearchError> {
        // A start may have more references.
        if self.start.is_none() || !(MOST_REFERENCES..=f64::MAX).contains(&self.references) {
            Self::check_references(self.references)?;
        }
        let is_timed = observer.progress().is_some();
        let builds = !is_timed && self.budget != Budget::UNLIMITED && self.start.is_none();
        let greedy = match greedy {
            None if builds => self.greedy(observer)?,
            greedy => greedy,
        };
        // Without work there is nothing to search for, and the first tree is the answer.
        let is_over = AtomicBool::new(true);
        let observer = if self.budget.max_work == Some(0) { &is_over } else { observer };
        let parts = self.parts();
        let mut splits = self.splits(parts.as_deref());
        // A division may take all the time of a search that has no tree yet. Such a search divides
        // later itself.
        let is_later = self.starts_divided() || is_timed && greedy.is_none();
        let divided = match self.divided {
            None if !is_later => self.division(observer)?,
            _ => None,
        };
        let mut division = Division::No;
        if let Some(allowed) = &mut splits {
            allowed.divided = allowed.divided.or(divided.as_ref());
            division = match allowed.divided {
                _ if is_later => Division::Allowed,
                Some(tree) if tree.prim_ids.len() > self.boxes.len() => Division::Allowed,
                Some(_) => Division::Useless,
                None => Division::No,
            };
        }
        let splits = splits.filter(|_| division == Division::Allowed);
        let problem = self.problem(splits);
        let greedy = greedy.map(|tree| Kept::new(tree, &problem));
        let greedy_cost = greedy.as_ref().map(|greedy| greedy.cost);
        let mut outcome = self.outcome(&problem, greedy, observer)?;
        outcome.tree.frame = self.frame.copied();
        let start_cost = self.start.map(|tree| problem.cost(tree));
        Ok(Baked { outcome, greedy_cost, start_cost, division })
    }

    fn outcome(
        &self,
        problem: &Problem,
        greedy: Option<Kept>,
        observer: &dyn Observer,
    ) -> Result<Outcome, SearchError> {
        let Self { seed, budget, .. } = *self;
        if let Some((_, method)) = self.method {
            return solve_or_keep(method, problem, greedy, seed, budget, observer);
        }
        // An early end of a long search leaves a tree that is behind reinsertion's.
        let reinserted = match budget.max_work {
            Some(work) if observer.progress().is_none() && !observer.cancelled() => {
                best::fallback(problem, work, &Untimed(observer))?
            }
            _ => None,
        };
        // The budget ends the search, so the method's own limit is lifted.
        let config = best::Config { horizon: Some(Horizon::Known), ..Default::default() };
        let outcome = match self.start {
            Some(start) => optimize(start, problem, &config, seed, budget, observer)?,
            None => solve_or_keep(&config, problem, greedy, seed, budget, observer)?,
        };
        Ok(best::unless_behind(outcome, reinserted))
    }

    /// Returns the cost of a tree over these objects by which a search with this division compares
    /// trees. O(nodes).
    pub fn cost(&self, tree: &Bvh, division: Division) -> f64 {
        let parts = self.parts();
        let splits = self.splits(parts.as_deref()).filter(|_| division == Division::Allowed);
        self.problem(splits).cost(tree)
    }

    fn problem<'p>(&'p self, splits: Option<Splits<'p>>) -> Problem<'p> {
        Problem {
            objective: self.objective(),
            splits,
            measure: self.rays.map(|density| density as &dyn Measure),
            ..Problem::new(self.boxes)
        }
    }

    fn parts(&self) -> Option<Box<dyn Clip + 'a>> {
        self.shapes?.parts_in(self.frame)
    }

    fn splits<'b>(&'b self, parts: Option<&'b (dyn Clip + 'a)>) -> Option<Splits<'b>> {
        let most = (self.references * self.boxes.len() as f64) as usize;
        let splits = Splits::at_most(most, self.boxes, parts?)?;
        let is_best = self.method.is_none();
        is_best.then_some(Splits { divided: self.divided, ..splits })
    }

    /// Divides the objects with spatial splits, or copies the caller's division, unless they stay
    /// whole anyway. `None` if the observer cancels first.
    pub(crate) fn division(&self, observer: &dyn Observer) -> Result<Option<Bvh>, SearchError> {
        best::divided(self.splits(self.parts().as_deref()), self.boxes, observer)
    }

    /// Returns whether the start divides objects, after which no search returns to whole ones.
    fn starts_divided(&self) -> bool {
        self.start.is_some_and(|tree| tree.prim_ids.len() > self.boxes.len())
    }

    /// Passes the sections of the [file](bvh_core::file) of a tree over these objects to `write`.
    /// `work` is the work of all searches that led to the tree.
    ///
    /// Rejects a tree that is not valid over the objects, and a tree in a frame over other objects
    /// than triangles. O(nodes + objects).
    pub fn write<T>(
        &self,
        tree: &Bvh,
        work: u64,
        write: impl FnOnce(&[&[u8]]) -> T,
    ) -> Result<T, FileError> {
        let parts = self.parts();
        if self.frame.is_some() && parts.is_none() {
            return Err(FileError::Frame);
        }
        let shapes = self.shapes.filter(|_| self.frame.is_some());
        let along_file = shapes.map(Primitives::boxes);
        let objective = self.objective();
        let mut cost = 0.0;
        let mut validated = Ok(());
        let mut visits = Vec::new();
        // Somebody may wait for the file of a large tree.
        parallel::call_both(
            &mut || cost = Problem { objective, ..Problem::new(self.boxes) }.cost(tree),
            &mut || {
                parallel::call_both(
                    &mut || {
                        validated = match &parts {
                            Some(parts) => validate_references(tree, self.boxes, &**parts),
                            None => validate(tree, self.boxes),
                        }
                    },
                    &mut || visits = self.visits(tree),
                );
            },
        );
        validated?;
        let name = self.name();
        let doubles = match self.shapes {
            Some(Primitives::Doubles(triangles)) => &triangles[..],
            _ => &[],
        };
        let (method, seed, visits) = (&name[..], self.seed, &visits[..]);
        let origin = Origin { method, seed, work, visits, objective, doubles };
        let boxes = along_file.as_deref().unwrap_or(self.boxes);
        let sections = file::sections(tree, boxes, cost, &origin, &parallel::call_both)?;
        Ok(write(&sections.each_ref().map(|section| &**section)))
    }

    /// The method and whether it is for rays, in words: the origin that the file names.
    pub fn name(&self) -> String {
        let name = self.method.map_or("best", |(name, _)| name);
        if self.rays.is_some() { format!("{name} for rays") } else { name.into() }
    }

    fn visits(&self, tree: &Bvh) -> Vec<f32> {
        const NODES_PER_TASK: usize = 1 << 16;
        let Some(density) = self.rays else { return Vec::new() };
        let root = tree.root_aabb().unwrap_or(Aabb::EMPTY);
        let chunks = tree.nodes.chunks(NODES_PER_TASK).collect();
        // One copy of whole chunks; an iterator over all of them would move number by number.
        parallel::map(chunks, |nodes| density.visits_of(&root, nodes)).concat()
    }
}
