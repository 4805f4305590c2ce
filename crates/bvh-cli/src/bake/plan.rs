//! A search without its command line, its result, and the tree file.

use super::effort::Effort;
use super::watch::Watch;
use crate::Error;
use crate::answer::Answer;
use crate::arguments;
use crate::interrupt::{INTERRUPTED, hold, is_interrupted};
use crate::rays::Rays;
use bvh_core::cost::{Objective, internal_area};
use bvh_core::export::Target;
use bvh_core::file::Header;
use bvh_core::{Bvh, Frame, Node, Triangle};
use bvh_scenes::Scene;
use bvh_scenes::files::Reserved;
use bvh_scenes::tree_file::{self, TreeFileError};
use bvh_search::{
    self, Bake, BakeError, Baked, Budget, Chosen, Division, MadeRays, Method, Observer, Open,
    Reason,
};
use glam::DMat3;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

/// What is left of a budget of time, over the time for the rays.
const SHARE: u32 = 4;

/// A search for the best tree of any scene.
#[derive(Clone, Debug)]
pub struct Plan {
    pub method: Method,
    /// The budget, unless the bake chooses it.
    pub effort: Option<Effort>,
    pub seed: u64,
    /// The cost, unless it is the default for the rays.
    pub objective: Option<Objective>,
    /// The largest number of references per object; 1 for whole objects.
    pub references: f64,
    /// The rays whose visits replace areas.
    pub rays: Option<Rays>,
    /// The tracer of another library.
    pub tracer: Option<Target>,
}

/// Returns the size in bytes of the largest file of a tree over a scene with at most so many
/// references per object.
pub fn most_bytes(scene: &Scene, references: f64) -> usize {
    // A tree with n leaves has fewer than 2n nodes; each node may have a number of visits.
    let reference = 2 * (size_of::<Node>() + size_of::<f32>()) + size_of::<u32>();
    Header::BYTES
        + size_of::<Frame>()
        + (references * scene.boxes.len() as f64) as usize * reference
}

/// The tree of an earlier bake of the scene, from which a search continues.
pub struct Start {
    pub tree: Bvh,
    /// The work of the earlier bake, in nodes built or visited.
    pub work: u64,
}

impl Start {
    /// Reads the tree of `--from` over the scene, and its header. Rejects a tree with nodes that no
    /// search moves.
    pub fn load(from: &Path, scene: &Scene) -> Result<(Self, Header), Error> {
        let (tree, header) = tree_file::load(from, scene)?;
        let is_wide = |node: &Node| !node.is_leaf() && node.children().len() != 2;
        if let Some(wide) = tree.nodes.iter().position(is_wide) {
            return Err(Error::Usage(format!(
                "--from {}: inner node {wide} has {} children; accepted: a tree of nodes with two",
                from.display(),
                tree.nodes[wide].children().len()
            )));
        }
        Ok((Self { tree, work: header.work }, header))
    }
}

impl Plan {
    /// Returns the limits of a search over so many objects besides its time.
    pub fn budget(&self, objects: usize) -> Budget {
        match self.effort {
            None => Budget::of_objects(objects),
            Some(effort) => Budget { max_work: effort.work(), ..Budget::UNLIMITED },
        }
    }

    /// Returns the same search with a fraction of the budget.
    pub fn share(&self, part: f64) -> Self {
        Self { effort: self.effort.map(|effort| effort.share(part)), ..self.clone() }
    }

    fn bake<'a>(&'a self, scene: &'a Scene) -> Bake<'a> {
        Bake {
            frame: scene.frame.as_ref(),
            shapes: Some(&scene.primitives),
            objective: self.objective,
            references: self.references,
            method: match &self.method {
                Method::Best(_) => None,
                method => Some((method.name(), method)),
            },
            seed: self.seed,
            budget: self.budget(scene.boxes.len()),
            ..Bake::new(&scene.boxes)
        }
    }

    /// Returns the tree that is compared with the best one for another tracer, if there is time for
    /// it, which the search then has less. A method that was asked for gives its own tree.
    fn rival<'a>(&self, scene: &'a Scene, greedy: &Bvh, watch: &mut Watch) -> Option<Rival<'a>> {
        let tracer = self.tracer.filter(|_| matches!(self.method, Method::Best(_)))?;
        let triangles = scene.triangles().ok()?;
        if let Some(left) = watch.left() {
            let time = Duration::from_secs_f64(tracer.comparison_seconds(greedy));
            if time > left / SHARE {
                return None;
            }
            watch.deadline = watch.deadline.sooner(time);
        }
        Some(Rival { tracer, greedy: greedy.clone(), triangles })
    }

    /// Makes the open choices, prints their reasons, and searches until the budget is spent, or the
    /// watch's time is over, or the user interrupts.
    pub fn search<'a>(
        &'a self,
        scene: &'a Scene,
        start: Option<&'a Start>,
        open: &Open,
        watch: Watch,
        answer: &mut Answer,
    ) -> Result<Found<'a>, Error> {
        hold();
        let failed = |error| Error::search(&scene.name, self.method.name())(error);
        let bake = Bake { start: start.map(|start| &start.tree), ..self.bake(scene) };
        // Without time, and after an interruption, the greedy tree is the answer.
        let greedy = bake.greedy(&()).map_err(failed)?;
        let rays = self.rays.as_ref();
        let step = OnceLock::new();
        let made = |tree: &_, seed, is_over: &dyn Fn() -> bool| {
            let rays = rays.unwrap_or(&Rays::Default);
            // By fewer rays than the start is for, the result could be worse for all.
            let left = watch.left().filter(|_| start.is_none());
            let within = |time| rays.step_within(scene, tree, time, is_over);
            let step = *step.get_or_init(|| left.map_or(1, |left| within(left / SHARE)));
            match rays.density(scene, tree, step, seed, is_over) {
                // So few may miss the scene.
                Err(_) if step > 1 => rays.density(scene, tree, 1, seed, is_over),
                made => made,
            }
        };
        let rays: Option<MadeRays> = if rays.is_some() { Some(&made) } else { None };
        let untimed: &dyn Observer = if open.budget { &watch } else { &INTERRUPTED };
        let open = Open { rays, ..*open };
        let traced = |source| Error::Tracing { scene: scene.name.clone(), source };
        let mut chosen = bake.choose(&open, greedy, untimed).map_err(|error| match error {
            BakeError::Search(error) => failed(error),
            BakeError::Rays(source) => traced(source),
        })?;
        // A file would no longer say that the tree is for rays.
        if start.is_some() && rays.is_some() && chosen.density.is_none() {
            let left = "nothing was written; the tree of --from is the best so far";
            return Err(Error::Interrupted(left.into()));
        }
        watch.bar.suspend(|| {
            if let Some(step @ 2..) = step.get() {
                let why = format!("rays: one in {step}, because more would take too much time");
                answer.line("choices", why);
            }
            let explain = |reason: &Reason| answer.line("choices", reason.to_string());
            chosen.reasons.iter().for_each(explain);
        });
        let greedy = chosen.greedy.take();
        let plain = match &greedy {
            Some(_) if is_turned(scene) && !is_interrupted() => Some(arguments::greedy(scene)?),
            _ => None,
        };
        let area = plain.as_ref().or(greedy.as_ref()).map(internal_area);
        let tests = match &plain {
            Some(plain) => {
                chosen.tests_along(&open, self.seed, plain, &is_interrupted).map_err(traced)?
            }
            None => greedy.as_ref().map(|tree| chosen.tests_per_ray(tree)),
        };
        let tests = tests.filter(|_| scene.has_triangles());
        drop(plain);
        let tried = chosen.tried.take();
        let is_tried = tried.is_some();
        let settled = chosen.bake(&bake);
        let mut watch = watch.within(settled.budget.max_work);
        let rival = greedy.as_ref().filter(|_| start.is_none());
        let rival = rival.and_then(|greedy| self.rival(scene, greedy, &mut watch));
        let baked = match tried {
            Some(tried) => Ok(tried),
            None => settled.search(greedy, &watch),
        };
        watch.bar.finish_and_clear();
        let mut baked = baked.map_err(failed)?;
        if let Some(rival) = rival.filter(|rival| rival.is_better(&baked.outcome.tree)) {
            let name = rival.tracer.name;
            let why =
                format!("greedy, because rays take fewer tests in {name} than in the best tree");
            answer.line("choices", format!("tree: {why}"));
            baked.outcome.cost = baked.greedy_cost.unwrap_or(baked.outcome.cost);
            baked.outcome.tree = rival.greedy;
        }
        let seconds = watch.deadline.elapsed().as_secs_f64();
        // The work of all bakes that led to this tree, one after the other.
        let work = start.map_or(0, |start| start.work).saturating_add(baked.outcome.work);
        let greedy = Greedy { area, tests };
        Ok(Found { plan: self, scene, chosen, is_tried, baked, greedy, work, seconds })
    }
}

/// The tree that a tracer traces if its rays take fewer tests there than in a searched tree.
struct Rival<'a> {
    tracer: Target,
    greedy: Bvh,
    triangles: &'a [Triangle],
}

impl Rival<'_> {
    fn is_better(&self, tree: &Bvh) -> bool {
        !self.tracer.fit_better(tree, &self.greedy, self.triangles).is_searched()
    }
}

/// Returns whether the boxes lie along other axes than the file's.
pub fn is_turned(scene: &Scene) -> bool {
    scene.frame.is_some_and(|frame| frame.rotation() != DMat3::IDENTITY)
}

/// What the greedy tree along the file's axes costs, if there was one.
pub struct Greedy {
    /// The total area of inner nodes, which the documentation compares.
    pub area: Option<f64>,
    /// The tests per ray in the wide layout.
    pub tests: Option<f64>,
}

/// The result of a search, with what its file and its summary need.
pub struct Found<'a> {
    pub plan: &'a Plan,
    pub scene: &'a Scene,
    pub chosen: Chosen,
    /// Whether the tree is a trial that the user interrupted.
    is_tried: bool,
    pub baked: Baked,
    pub greedy: Greedy,
    work: u64,
    /// The time since the command began.
    pub seconds: f64,
}

impl Found<'_> {
    /// The search with all its choices.
    pub fn settled(&self) -> Bake<'_> {
        self.chosen.bake(&self.plan.bake(self.scene))
    }

    /// Writes the file of the tree. Returns its number of bytes.
    pub fn save(&self, path: &Path, reserved: Reserved) -> Result<usize, Error> {
        let written = self.settled().write(&self.baked.outcome.tree, self.work, |sections| {
            reserved.write(sections)?;
            Ok(sections.iter().map(|section| section.len()).sum())
        });
        written.map_err(TreeFileError::of(path))?
    }

    /// Returns whether the file at the path has a tree over the scene that is no worse than the one
    /// of this interrupted search.
    pub fn is_behind(&self, path: &Path) -> bool {
        let Ok((old, _)) = tree_file::load(path, self.scene) else { return false };
        let Baked { outcome, greedy_cost, division, .. } = &self.baked;
        let [old, new] = [&old, &outcome.tree].map(|tree| match self.is_tried {
            true => self.chosen.tests_per_ray(tree),
            false => self.settled().cost(tree, *division),
        });
        // The old tree may be for another cost, by which a greedy tree would be behind.
        old <= new || *greedy_cost == Some(outcome.cost)
    }

    /// Names the cost that the search minimised, unless it is the total area of inner nodes.
    pub fn unit(&self) -> Option<&'static str> {
        match (self.chosen.objective, self.chosen.density.is_some()) {
            (Objective::Layout, true) => Some("cost of the wide layout for rays"),
            (Objective::Layout, false) => Some("cost of the wide layout"),
            (_, true) => Some("visits of rays"),
            (_, false) if self.baked.division == Division::Allowed => Some("area of all nodes"),
            (_, false) => None,
        }
    }
}
