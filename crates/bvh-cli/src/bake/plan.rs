//! A bake without its command line: the search, its result, and the tree file.

use super::effort::Effort;
use super::starts::{Division, greedy};
use super::watch::{Interrupted, Watch};
use crate::Error;
use crate::interrupt;
use crate::rays::Rays;
use bvh_core::cost::{CallBoth, Measure, Objective};
use bvh_core::file::{self, FileError, Header, Origin};
use bvh_core::{Aabb, Bvh, Node, RayDensity, Triangle, validate_references};
use bvh_scenes::files::Reserved;
use bvh_scenes::tree_file::TreeFileError;
use bvh_scenes::{Scene, is_allocatable};
use bvh_search::{
    Budget, Deadline, Kept, Method, Outcome, Problem, SearchError, StopReason, best, optimize,
    solve_or_keep,
};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// A search for the best tree of any scene.
#[derive(Clone)]
pub struct Plan {
    /// The method, with its parameters.
    pub method: Method,
    /// The budget of the search.
    pub effort: Effort,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The cost that the search minimises.
    pub objective: Objective,
    /// The largest number of references per object; 1 for whole objects.
    pub references: f64,
    /// The rays whose visits replace areas.
    pub rays: Option<Rays>,
    /// The name of the method that the tree file records.
    pub name: String,
}

/// Returns the size in bytes of the largest file of a tree over a scene with at most so many
/// references per object.
pub fn most_bytes(scene: &Scene, references: f64) -> usize {
    // A tree with n leaves has fewer than 2n nodes; each node may have a number of visits.
    let reference = 2 * (size_of::<Node>() + size_of::<f32>()) + size_of::<u32>();
    Header::BYTES + (references * scene.boxes.len() as f64) as usize * reference
}

/// The most bytes per object that a bake has allocated at once, the scene included, of which `best`
/// with two threads needs most: the greatest `bytes_per_object` of `results/scale`, as a test checks.
const BYTES_PER_OBJECT: usize = 326;
/// The bytes per object of each copy of the tree but the first.
const BYTES_PER_COPY: usize = 256;
/// The most bytes per permitted reference that a bake with divided objects has allocated at once,
/// which the division needs: five million triangles with 1.2 references each.
const BYTES_PER_REFERENCE: usize = 550;
/// The bytes per object of a loaded scene.
pub const BYTES_PER_LOADED: usize = size_of::<Triangle>() + size_of::<Aabb>();

/// Rejects a scene with so many objects if the process cannot have the memory of a bake with at
/// most so many `references` per object, of which a loaded scene has `per_loaded` bytes per object.
/// An allocation that fails in the middle of the work would end the program without a result.
pub fn check_memory(
    scene: &str,
    objects: usize,
    references: f64,
    per_loaded: usize,
) -> Result<(), Error> {
    let per_object = if references > 1.0 {
        (references * BYTES_PER_REFERENCE as f64) as usize
    } else {
        let copies = best::copies(objects as u64, rayon::current_num_threads());
        BYTES_PER_OBJECT + (copies as usize - 1) * BYTES_PER_COPY
    };
    let bytes = objects.saturating_mul(per_object);
    if is_allocatable(objects.saturating_mul(per_object - per_loaded)) {
        return Ok(());
    }
    Err(Error::Memory { scene: scene.to_owned(), objects, bytes })
}

/// The tree of an earlier bake, from which a search continues.
pub struct Start {
    /// The tree, over the same scene.
    pub tree: Bvh,
    /// The work of the earlier bake, in nodes built or visited.
    pub work: u64,
}

/// The results of a decision that the bake needs too, and would otherwise make again.
#[derive(Default)]
pub struct Prepared<'a> {
    /// The greedy tree.
    pub greedy: Option<Bvh>,
    /// The density of the plan's rays.
    pub density: Option<RayDensity>,
    /// The decision whether the plan's references pay.
    pub division: Option<Division<'a>>,
}

impl Plan {
    /// Returns the largest number of references to a scene's objects.
    fn most_references(&self, scene: &Scene) -> usize {
        (self.references * scene.boxes.len() as f64) as usize
    }

    /// Begins a bake with the `prepared` results, and returns the bake with the greedy tree. The
    /// time of the bake starts after the greedy tree is built.
    pub fn begin<'a>(
        &'a self,
        scene: &'a Scene,
        start: Option<&'a Start>,
        prepared: Prepared<'a>,
        interrupted: &AtomicBool,
    ) -> Result<(Bake<'a>, Bvh), Error> {
        let greedy = match prepared.greedy {
            Some(tree) => tree,
            None => greedy(self.method.name(), scene, interrupted)?,
        };
        let deadline = self.effort.deadline();
        // There is a tree now, which Ctrl-C must save instead of ending the program.
        interrupt::hold();
        let from = start.map(|start| &start.tree);
        let is_timed = matches!(self.effort, Effort::Time(_));
        let is_over = || interrupted.load(Relaxed) || is_timed && deadline.has_passed();
        let division = match prepared.division {
            Some(division) => division,
            None => Division::decide(self.most_references(scene), scene, from, &is_over)?,
        };
        let density = match (prepared.density, &self.rays) {
            (None, Some(rays)) => rays.density(scene, &greedy, self.seed, interrupted)?,
            (density, _) => density,
        };
        Ok((Bake { plan: self, scene, start, deadline, division, density }, greedy))
    }
}

/// A bake that has begun.
pub struct Bake<'a> {
    /// The search.
    pub plan: &'a Plan,
    /// The scene.
    pub scene: &'a Scene,
    start: Option<&'a Start>,
    deadline: Deadline,
    division: Division<'a>,
    density: Option<RayDensity>,
}

impl Bake<'_> {
    /// Returns whether the search keeps objects whole because no split saves anything.
    pub fn is_whole(&self) -> bool {
        matches!(self.division, Division::Useless)
    }

    /// Searches until the budget is spent or `interrupted` becomes true.
    ///
    /// Takes the greedy tree, whose memory is free as soon as there is a better one.
    pub fn search(&self, greedy: Bvh, interrupted: &AtomicBool) -> Result<Baked, Error> {
        // An interrupted bake has no time for costs by rays, which take a second in large scenes.
        if interrupted.load(Relaxed) {
            let tree = self.start.map_or(greedy, |start| start.tree.clone());
            return Ok(Baked { tree, work: 0, figures: None });
        }
        let problem = Problem {
            objective: self.plan.objective,
            splits: self.division.splits(),
            measure: self.density.as_ref().map(|density| density as &dyn Measure),
            ..Problem::new(&self.scene.boxes)
        };
        let base_elsewhere = self.density.is_some().then(|| self.plan.objective.cost(&greedy));
        // Gains are relative to the greedy tree, by the cost that the search minimises.
        let greedy = Kept::new(greedy, &problem);
        let base = greedy.cost;
        let watch = Watch::new(self.plan.effort, self.deadline, base, interrupted);
        let outcome = self.outcome(&problem, greedy, &watch, interrupted);
        watch.bar.finish_and_clear();
        let outcome = outcome.map_err(Error::search(&self.scene.name, self.plan.method.name()))?;
        let Outcome { tree, cost, evaluations: moves, work, stop, .. } = outcome;
        let seconds = self.deadline.elapsed().as_secs_f64();
        let before = self
            .start
            .filter(|_| !interrupted.load(Relaxed))
            .map(|start| problem.cost(&start.tree));
        let figures = Figures { cost, base, base_elsewhere, before, moves, stop, seconds };
        Ok(Baked { tree, work, figures: Some(figures) })
    }

    fn outcome(
        &self,
        problem: &Problem,
        greedy: Kept,
        watch: &Watch,
        interrupted: &AtomicBool,
    ) -> Result<Outcome, SearchError> {
        let Plan { method, effort, seed, .. } = self.plan;
        let budget = match *effort {
            Effort::Time(_) => Budget::UNLIMITED,
            Effort::Work(work) => Budget { max_work: Some(work), ..Budget::UNLIMITED },
        };
        // With little work `best` may end above a tree that it builds on its way; that tree is
        // kept.
        let fallback = match (*effort, method) {
            (Effort::Work(work), Method::Best(_)) if !interrupted.load(Relaxed) => {
                // With the greedy tree, no other is built after an interruption.
                let problem = Problem { known: Some(&greedy.tree), ..*problem };
                best::fallback(&problem, work, &Interrupted(interrupted))?
            }
            _ => None,
        };
        let found = match (self.start, method) {
            (Some(start), Method::Best(config)) => {
                let problem = Problem { known: Some(&greedy.tree), ..*problem };
                optimize(&start.tree, &problem, config, *seed, budget, watch)?
            }
            _ => solve_or_keep(method, problem, Some(greedy), *seed, budget, watch)?,
        };
        Ok(best::unless_behind(found, fallback))
    }

    /// Writes the file of a search's tree. Returns its number of bytes and the cost in its header.
    pub fn save(
        &self,
        baked: &Baked,
        path: &Path,
        reserved: Reserved,
    ) -> Result<(usize, f64), Error> {
        let Baked { tree, work, figures } = baked;
        let Scene { boxes, primitives, .. } = self.scene;
        // Somebody may wait for the file of a large tree after Ctrl-C.
        let (cost, (validated, visits)) = rayon::join(
            || self.cost_for_lines(tree, figures.as_ref()),
            || rayon::join(|| validate_references(tree, boxes, primitives), || self.visits(tree)),
        );
        validated.map_err(FileError::from).map_err(TreeFileError::of(path))?;
        // The work of all bakes that led to this tree, one after the other.
        let spent = self.start.map_or(0, |start| start.work);
        let origin = Origin {
            method: &self.plan.name,
            seed: self.plan.seed,
            work: spent.saturating_add(*work),
            visits: &visits,
            objective: self.plan.objective,
        };
        let both: CallBoth = &|first, second| _ = rayon::join(first, second);
        let sections =
            file::sections(tree, boxes, cost, &origin, both).map_err(TreeFileError::of(path))?;
        let sections = sections.each_ref().map(|section| &**section);
        reserved.write(&sections)?;
        let bytes = sections.iter().map(|section| section.len()).sum();
        Ok((bytes, cost))
    }

    /// Returns the cost of a tree for random lines, whichever rays the search was for.
    fn cost_for_lines(&self, tree: &Bvh, figures: Option<&Figures>) -> f64 {
        let objective = self.plan.objective;
        match figures {
            // Half a second in large scenes; other costs take a hundredth.
            Some(figures) if self.density.is_none() && objective == Objective::Layout => {
                figures.cost
            }
            _ => {
                let for_lines = Problem { objective, ..Problem::new(&self.scene.boxes) };
                for_lines.cost(tree)
            }
        }
    }

    /// Returns the visits of all nodes; none if the search was not for rays.
    fn visits(&self, tree: &Bvh) -> Vec<f32> {
        const NODES_PER_TASK: usize = 1 << 16;
        let Some(density) = &self.density else { return Vec::new() };
        let root = tree.root_aabb().unwrap_or(Aabb::EMPTY);
        let visits: Vec<Vec<f32>> = tree
            .nodes
            .par_chunks(NODES_PER_TASK)
            .map(|nodes| density.visits_of(&root, nodes))
            .collect();
        // One copy of whole chunks; an iterator over all of them would move number by number.
        visits.concat()
    }

    /// Names the cost that the search minimises.
    pub fn unit(&self) -> &'static str {
        match (self.plan.objective, &self.density) {
            (Objective::Layout, Some(_)) => "cost of the wide layout for rays, times root area,",
            (Objective::Layout, None) => "cost of the wide layout, times root area,",
            (_, Some(_)) => "visits of rays times root area",
            (_, None) if self.division.splits().is_some() => "area of all nodes",
            (_, None) => "internal area",
        }
    }
}

/// The result of a search.
pub struct Baked {
    /// The best tree.
    pub tree: Bvh,
    /// The nodes built or visited.
    pub work: u64,
    /// The course of the search; `None` if it was interrupted before it began.
    pub figures: Option<Figures>,
}

/// The costs of a search, and its course.
pub struct Figures {
    /// The cost of the best tree.
    pub cost: f64,
    /// The cost of the greedy tree.
    pub base: f64,
    /// The cost of the greedy tree for random lines, if the search was for other rays.
    pub base_elsewhere: Option<f64>,
    /// The cost of the tree that the search continued from.
    pub before: Option<f64>,
    /// The number of moves tried.
    pub moves: u64,
    /// The reason why the search ended.
    pub stop: StopReason,
    /// The time since the bake began.
    pub seconds: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_that_a_bake_asks_for_is_the_most_that_one_was_measured_to_take() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../results/scale/timing_scale.csv");
        let mut reader = csv::Reader::from_path(path).unwrap();
        let headers = reader.headers().unwrap().clone();
        let column = |name: &str| headers.iter().position(|header| header == name).unwrap();
        let phase = column("phase");
        let bytes = column("bytes_per_object");
        let mut most = 0.0f64;
        for row in reader.records() {
            let row = row.unwrap();
            if row[phase].starts_with("bake") {
                most = most.max(row[bytes].parse().unwrap());
            }
        }
        assert_eq!(BYTES_PER_OBJECT, most.ceil() as usize);
    }
}
