//! A search without its command line, its result, and the tree file.

use super::effort::Effort;
use super::found::{Found, Greedy, is_turned};
use super::watch::Watch;
use super::{BEST, BakeArgs};
use crate::Error;
use crate::answer::Answer;
use crate::arguments::{self, input_file, load_scene, output_file, output_or_free, precision_of};
use crate::interrupt::{INTERRUPTED, hold, is_interrupted};
use crate::rays::Rays;
use bvh_core::cost::{Objective, internal_area};
use bvh_core::export::Target;
use bvh_core::file::Header;
use bvh_core::{Bvh, Frame, Node, Triangle};
use bvh_scenes::tree_file;
use bvh_scenes::{Precision, Scene};
use bvh_search::{
    Bake, BakeError, Budget, Choice, Frames, MadeRays, Method, Observer, Open, Reason,
};
use std::path::{Path, PathBuf};
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
            let cost = tracer.cost(&tracer.fit(greedy));
            let time = Duration::from_secs_f64(Target::comparison_seconds(cost));
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
        Ok(Found {
            bake: self.bake(scene),
            effort: self.effort,
            scene,
            chosen,
            is_tried,
            baked,
            greedy,
            work,
            seconds,
        })
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

impl BakeArgs {
    /// Returns the file to write. Wrong paths are reported before the scene is loaded, which may take
    /// long.
    pub fn out(&self) -> Result<PathBuf, Error> {
        if let Some(from) = &self.from {
            input_file("--from", from)?;
        }
        let out = output_or_free(self.out.as_ref(), || {
            let scene = Path::new(&self.scene);
            let stem = scene.file_stem().unwrap_or(scene.as_os_str());
            // The colon of `escher:1000` is no part of a file's name everywhere.
            let stem = stem.to_string_lossy().replace(':', "-");
            PathBuf::from(stem + ".bvh")
        })?;
        output_file("--out", &out, "bvh")?;
        Ok(out)
    }

    /// Returns the numbers of the scene's triangles. Rejects f64 for tracers of f32.
    pub fn precision(&self) -> Result<Precision, Error> {
        let precision = match (self.precision, &self.from) {
            (None, Some(from)) => precision_of(from)?,
            (given, _) => given.unwrap_or_default(),
        };
        match self.tracer {
            Some(Target { name, .. }) if precision == Precision::Double => {
                let accepted = "--precision single";
                Err(Error::Usage(format!("--for {name} in double; accepted: {accepted}")))
            }
            _ => Ok(precision),
        }
    }

    /// Loads the scene. Rejects rays that it cannot be traced with.
    pub fn scene(&self, plan: &Plan) -> Result<Scene, Error> {
        let scene = load_scene(&self.scene, self.precision()?)?;
        plan.rays.as_ref().map_or(Ok(()), |rays| rays.check(&scene))?;
        Ok(scene)
    }

    /// Returns what the arguments leave open. The tracers of others have a cost of their own.
    pub fn open<'a>(&self, anywhere: MadeRays<'a>) -> Open<'a> {
        let is_ours = self.tracer.is_none();
        Open {
            budget: self.budget.is_none(),
            cost: is_ours && self.cost.is_none(),
            references: is_ours && self.references.is_none(),
            anywhere: is_ours.then_some(anywhere),
            ..Open::default()
        }
    }

    /// Loads the tree of `--from`, whose references the plan then permits, and whose cost and rays
    /// it takes over.
    pub fn start(
        &self,
        scene: &Scene,
        plan: &mut Plan,
        answer: &mut Answer,
    ) -> Result<Option<Start>, Error> {
        let Some(from) = &self.from else { return Ok(None) };
        let (start, header) = Start::load(from, scene)?;
        self.take_over(&header, plan, answer);
        let [objects, references] = [scene.boxes.len(), start.tree.prim_ids.len()];
        if references <= objects.max((plan.references * objects as f64) as usize) {
            return Ok(Some(start));
        }
        if self.references.is_some() || self.tracer.is_some() {
            // Rounded up, so that the message's number suffices.
            let least = (100 * references).div_ceil(objects) as f64 / 100.0;
            return Err(Error::Usage(format!(
                "--from {}: the tree has {references} references to {objects} objects; accepted: \
                 --references {least:.2} or more",
                from.display()
            )));
        }
        // No search makes all divided objects whole again.
        plan.references = Bake::references_of(references, objects);
        Ok(Some(start))
    }

    /// Continues what the bake of a tree minimised, where the arguments say nothing else.
    fn take_over(&self, header: &Header, plan: &mut Plan, answer: &mut Answer) {
        let own = header.objective;
        let is_open = self.tracer.is_none() && self.rays.is_none();
        // Trees of other programs may be for other costs.
        let is_ours = [Objective::InternalArea, Objective::Layout].contains(&own);
        if !(is_open && is_ours && self.cost.is_none_or(|cost| cost == own)) {
            return;
        }
        plan.objective = Some(own);
        if own == Objective::Layout && self.cost.is_none() {
            answer.line("choices", "cost: the wide layout's, as of the tree of --from".into());
        }
        if header.has_visits {
            plan.rays = Some(Rays::Default);
            let why = "rays: default, because the tree of --from is for rays; for others, --rays";
            answer.line("choices", why.into());
        }
    }

    /// Returns the scene in the frame of its bake, and says why it is the best one.
    pub fn turned(
        &self,
        plan: &Plan,
        scene: Scene,
        start: Option<&Start>,
        watch: &Watch,
        answer: &mut Answer,
    ) -> Scene {
        if let Some(Start { tree, .. }) = start {
            return scene.in_frame(tree.frame);
        }
        let is_free = matches!(plan.method, Method::Best(_)) && self.tracer.is_none();
        let frames = if is_free { self.frame.unwrap_or_default() } else { Frames::File };
        let budget = plan.budget(scene.boxes.len());
        let Some(choice) = Choice::of_shapes(&scene.primitives, frames, budget, watch) else {
            return scene;
        };
        if frames == Frames::Auto && !is_interrupted() {
            watch.bar.suspend(|| answer.say(&Reason::Frame(choice).to_string()));
        }
        if self.explain && choice.agreeing > 0.0 {
            let percent = 100.0 * choice.agreeing;
            let line = format!("frame: {percent:.0} % of the triangles, by size, share their axes");
            answer.line("explanation", line);
        }
        scene.in_frame(choice.frame)
    }

    /// Returns the search that the arguments specify. Rejects methods that would ignore other
    /// arguments.
    pub fn plan(&self) -> Result<Plan, Error> {
        let rays = self.rays.as_deref().map(Rays::read).transpose()?;
        let is_best = matches!(self.method, Method::Best(_));
        let default = self.tracer.filter(|_| is_best).map_or(1.0, |tracer| tracer.references);
        let references = self.references.unwrap_or(default);
        Bake::check_references(references).map_err(|error| Error::Usage(format!("--{error}")))?;
        let name = self.method.name();
        let ignored = match (&self.from, references > 1.0) {
            _ if is_best => None,
            (Some(_), _) => Some(format!("--method {name} cannot continue --from a tree")),
            (None, true) => Some(format!("--references {references} with --method {name}")),
            (None, false) => None,
        };
        if let Some(ignored) = ignored {
            return Err(Error::Usage(format!("{ignored}; accepted: {BEST}")));
        }
        Ok(Plan {
            method: self.method.clone(),
            effort: self.budget,
            seed: self.seed,
            objective: self.cost,
            references,
            rays,
            tracer: self.tracer,
        })
    }
}
