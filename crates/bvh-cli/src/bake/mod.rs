//! `bvh bake`: searches for the best tree of a scene within a budget, and writes it to a file.

mod effort;
pub mod parts;
mod plan;
mod watch;

use crate::Error;
use crate::answer::{Answer, frame_facts, gain, saved, whole};
use crate::arguments::{
    input_file, load_scene, named, output_file, output_or_free, precision_of, quoted,
};
use crate::interrupt::{hold, is_interrupted};
use crate::rays::Rays;
use bvh_core::Aabb;
use bvh_core::cost::{Objective, internal_area};
use bvh_core::export::Target;
use bvh_core::file::Header;
use bvh_scenes::files::Reserved;
use bvh_scenes::{Precision, Scene};
use bvh_search::{
    Bake, Choice, Division, Frames, MadeRays, Method, Open, Outcome, Reason, StopReason, shortcuts,
};
use clap::Args;
use effort::Effort;
use plan::{Found, Plan, Start, is_turned};
use std::path::{Path, PathBuf};
use std::time::Duration;
use watch::Watch;

/// Search for the best tree of a scene within a budget, and save it.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  bvh bake scene.glb                    choose everything, and end when more hardly pays
  bvh bake scene.glb --budget 1m        search for a minute
  bvh bake scene.glb --rays frame.npy   for the rays of a frame
  bvh bake scene.glb --for obvhs        for `bvh export scene.bvh scene.glb --for obvhs`")]
pub struct BakeArgs {
    /// Name of a scene, or path of a mesh file.
    pub scene: String,
    /// How long to take: a time (`10s`, `1m 30s`), loading included, or work (`50Mwork`: 50 million
    /// nodes visited), which gives the same bytes on every machine. `0s` and `0work` give the greedy tree, or the
    /// one of --from. Without it, the bake ends when more work would hardly pay; it also chooses
    /// --rays, --cost and --references where they are not given, and prints the reasons.
    #[arg(long, value_name = "TIME|WORK")]
    pub budget: Option<Effort>,
    /// The file to write. It replaces an existing file when it is complete. Without it, a new file
    /// with the scene's name, in this folder.
    #[arg(short, long, value_name = "FILE.bvh")]
    pub out: Option<PathBuf>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Minimise the cost of rays instead of area: `default` for rays that need no camera, a TOML
    /// file that describes the rays of a renderer, or a file of recorded segments: six numbers
    /// each, from the origin to the hit, as lines of CSV, as an array of numpy, (n, 6) or (n, 2, 3),
    /// or as little-endian `f32`.
    #[arg(long, value_name = "default|FILE.toml|.csv|.npy|.bin")]
    pub rays: Option<String>,
    /// The cost to minimise: `area`, the internal area, which suits every tracer; or `layout`, the
    /// tests of nodes and of blocks of triangles in this project's wide layout. With --budget, the
    /// default is `layout` with --rays, and `area` otherwise; with --from, that of the tree.
    #[arg(long, value_name = "area|layout")]
    #[arg(value_parser = named([("area", Objective::InternalArea), ("layout", Objective::Layout)]))]
    pub cost: Option<Objective>,
    /// Divide objects among leaves where it pays, up to N references per object, 1 to 16. The cost
    /// then includes the leaves. With --budget, the default is 1; with --from, as many as the tree
    /// has.
    #[arg(long, value_name = "N")]
    pub references: Option<f64>,
    /// The axes of the boxes: `auto` turns them where that saves area, as it does around a building
    /// that stands obliquely in its file; `file` keeps the file's, as --for, --parts and other
    /// methods than best do. Without it, with --from, those of the tree.
    #[arg(long, value_name = "auto|file", conflicts_with = "from")]
    #[arg(value_parser = named([("auto", Frames::Auto), ("file", Frames::File)]))]
    pub frame: Option<Frames>,
    /// The numbers of the triangles: `single`, to which the coordinates of the file are rounded, or
    /// `double`, as they are in the file. With --from, the default is that of the tree.
    #[arg(long, value_name = "single|double")]
    #[arg(value_parser = named([("single", Precision::Single), ("double", Precision::Double)]))]
    pub precision: Option<Precision>,
    /// Search for the tracer of another library, for `bvh export`: by default with `--cost area`,
    /// and with as many references as pay there. Where rays take fewer tests in the greedy tree, as in
    /// some smooth meshes, that one is kept.
    #[arg(long = "for", value_name = "TRACER", conflicts_with_all = ["rays", "parts"])]
    #[arg(value_parser = named(Target::ALL.map(|target| (target.name, target))))]
    pub tracer: Option<Target>,
    /// The method, with its default parameters.
    #[arg(long, value_name = "NAME", default_value = BEST)]
    #[arg(value_parser = named(Method::all().into_iter().map(|method| (method.name(), method))))]
    pub method: Method,
    /// Continue from the tree of an earlier bake of the same scene; the result never costs more.
    /// Without --rays, a tree for rays is continued for the default ones.
    #[arg(long, value_name = "FILE.bvh")]
    pub from: Option<PathBuf>,
    /// Cut the scene by space into N parts, bake each into `FILE.parts` beside FILE.bvh, and join their
    /// trees under a greedy top. Finished parts are not baked again.
    #[arg(long, value_name = "N", requires = "budget", help_heading = ADVANCED)]
    #[arg(conflicts_with_all = ["rays", "from", "explain"])]
    #[arg(value_parser = clap::value_parser!(u32).range(2..=65_536))]
    pub parts: Option<u32>,
    /// With --parts, list the parts, one a line: identifier, estimated work, description.
    #[arg(long, requires = "parts", conflicts_with = "part", help_heading = ADVANCED)]
    pub list: bool,
    /// With --parts, bake only the part with this identifier.
    #[arg(long, value_name = "ID", requires = "parts", help_heading = ADVANCED)]
    pub part: Option<String>,
    /// First list the steps that the scene does not need and that are skipped, with reasons.
    #[arg(long)]
    pub explain: bool,
}

const ADVANCED: &str = "Advanced";

/// The method that can continue from a given tree and divide objects.
const BEST: &str = "best";

/// Searches until the budget is spent or the user interrupts, writes the best tree, and prints its
/// cost. An interrupted bake writes the file as well, unless the file has a better tree of the scene,
/// and returns [`Error::Interrupted`].
pub fn bake(args: &BakeArgs, answer: &mut Answer) -> Result<(), Error> {
    // A budget of time is the whole wait.
    let watch = Watch::new(args.budget);
    // Wrong paths are reported before the scene is loaded, which may take long.
    if let Some(from) = &args.from {
        input_file("--from", from)?;
    }
    let out = args.out()?;
    output_file("--out", &out, "bvh")?;
    let mut plan = args.plan()?;
    let scene = load_scene(&args.scene, args.precision()?)?;
    if let Some(rays) = &plan.rays {
        rays.check(&scene)?;
    }
    let start = args.start(&scene, &mut plan, answer)?;
    let start = start.as_ref();
    hold();
    let scene = args.turned(&plan, scene, start, &watch, answer);
    if args.explain {
        explain(&scene, answer)?;
    }
    let anywhere = |tree: &_, seed, is_over: &dyn Fn() -> bool| {
        Rays::Default.density(&scene, tree, 1, seed, is_over)
    };
    let open = args.open(&anywhere);
    // Reserving the file first reports a full disk before the search and not after it.
    let chosen = if open.references { Open::REFERENCES } else { 1.0 };
    let bytes = plan::most_bytes(&scene, plan.references.max(chosen));
    let reserved = Reserved::new(&out, bytes, args.out.is_none())?;
    let found = plan.search(&scene, start, &open, watch, answer)?;
    save(&found, &out, reserved, answer)?;
    next(args, &found, &out, answer);
    Ok(())
}

fn explain(scene: &Scene, answer: &mut Answer) -> Result<(), Error> {
    let skipped = shortcuts::of(&scene.boxes).map_err(Error::search(&scene.name, "--explain"))?;
    let size = Aabb::union_of(&scene.boxes).extent().as_vec3();
    let objects = scene.boxes.len();
    answer.line("explanation", format!("{}: {objects} objects within {size}", scene.name));
    for (_, why) in skipped {
        answer.line("explanation", format!("skipped: {why}"));
    }
    Ok(())
}

fn save(found: &Found, out: &Path, reserved: Reserved, answer: &mut Answer) -> Result<(), Error> {
    if is_interrupted() && found.is_behind(out) {
        return Err(Error::Interrupted(format!(
            "{0} keeps its tree, which is better than the one so far; {1}",
            out.display(),
            continues(out)
        )));
    }
    let bytes = found.save(out, reserved)?;
    summarise(found, answer);
    answer.say(&format!("{}: {} bytes", out.display(), whole(bytes)));
    answer.record("file", out.display().to_string());
    answer.record("bytes", bytes);
    if is_interrupted() {
        let (tree, out, next) = (so_far(found), out.display(), continues(out));
        return Err(Error::Interrupted(format!("{out} has {tree}; {next}")));
    }
    Ok(())
}

/// Says what an interrupted search has found.
fn so_far(found: &Found) -> String {
    let cost = found.baked.outcome.cost;
    match found.baked.greedy_cost {
        Some(base) if cost < base => {
            let (gain, unit) = (gain(cost, base), found.unit().unwrap_or("area of inner nodes"));
            format!("the best tree so far, {gain} {unit} against the greedy tree")
        }
        Some(_) => "the greedy tree, because nothing better was found yet".into(),
        None => "the best tree so far".into(),
    }
}

/// Says how to go on after an interruption. The file takes the default name of the next bake.
fn continues(out: &Path) -> String {
    let out = quoted(&out.to_string_lossy());
    format!("`--from {out} --out {out}` continues, `--out {out}` begins again")
}

fn summarise(found: &Found, answer: &mut Answer) {
    let Found { plan, scene, chosen, baked, greedy, seconds, .. } = found;
    let Outcome { tree, cost, evaluations: moves, work, stop, .. } = &baked.outcome;
    let method = found.settled().name();
    let objects = scene.boxes.len();
    let references = tree.prim_ids.len();
    answer.say(&format!(
        "{} ({}), {} objects, {method}, seed {}",
        scene.name,
        scene.kind,
        whole(objects),
        plan.seed
    ));
    answer.record("scene", scene.name.as_str());
    answer.record("method", method);
    answer.record("objects", objects);
    answer.record("references", references);
    answer.record("frame", frame_facts(tree.frame.as_ref()));
    answer.record("seed", plan.seed);
    let area = internal_area(tree);
    answer.record("area", area);
    if let Some(base) = greedy.area {
        let mut gains = format!("{} area of inner nodes", gain(area, base));
        if let Some(base) = greedy.tests {
            let tests = chosen.tests_per_ray(tree);
            gains = format!("{} tests of rays, {gains}", gain(tests, base));
            answer.record("tests_saved", saved(tests, base));
        }
        answer.say(&format!("{gains}, against a greedy SAH sweep's tree"));
        answer.record("greedy_area", base);
        answer.record("saved", saved(area, base));
    }
    // The cost in the file is that for random lines and whole objects.
    answer.record("cost", chosen.objective.cost(tree));
    answer.record("minimised_cost", *cost);
    // The gain in area is no measure of a search for another cost.
    if let (Some(base), Some(unit)) = (baked.greedy_cost, found.unit()) {
        let gain = gain(*cost, base);
        // A cost for rays is known along the axes of its density.
        let (axes, key) = match is_turned(scene) {
            true => (" along the same axes", "minimised_cost_of_greedy_along_the_same_axes"),
            false => ("", "minimised_cost_of_greedy"),
        };
        answer.say(&format!("{unit}, which was minimised, {gain} against the greedy tree{axes}"));
        answer.record(key, base);
    }
    if let Some(before) = baked.start_cost {
        answer.say(&format!("{} cost against the tree it started from", gain(*cost, before)));
        answer.record("minimised_cost_of_start", before);
    }
    if references > objects {
        answer.say(&format!("{} references to {} objects", whole(references), whole(objects)));
    } else if baked.division == Division::Useless {
        answer.say("no object is divided, because no spatial split saves anything");
    } else if plan.references > 1.0 {
        answer.say("no object is divided, because no division paid within the budget");
    }
    // A method that plans its time completes its plan just before the time is over, and then could
    // have used more.
    let limit = if let Some(Effort::Time(limit)) = plan.effort { limit } else { Duration::MAX };
    let why = match stop {
        StopReason::Completed if *seconds < 0.5 * limit.as_secs_f64() => {
            ", and the method has completed"
        }
        StopReason::Optimal => ", and no tree is better",
        _ => "",
    };
    answer.say(&format!(
        "{} moves, {} nodes visited, {seconds:.1} s in all{why}",
        whole(*moves),
        whole(*work)
    ));
    answer.record("moves", *moves);
    answer.record("work", *work);
    answer.record("seconds", *seconds);
}

fn next(args: &BakeArgs, found: &Found, out: &Path, answer: &Answer) {
    let [out, scene] = [&out.to_string_lossy(), &args.scene[..]].map(quoted);
    let tracer = args.tracer.map_or("TRACER", |target| target.name);
    let mut commands = format!("`bvh report {out} {scene}`");
    if found.scene.has_triangles() {
        commands = format!("`bvh bench {out} {scene}`, {commands}");
    }
    if found.scene.frame.is_none() && found.scene.triangles().is_ok() {
        commands += &format!(", `bvh export {out} {scene} --for {tracer} --out FILE`");
    }
    answer.say(&format!("next: {commands}"));
}

impl BakeArgs {
    fn out(&self) -> Result<PathBuf, Error> {
        output_or_free(self.out.as_ref(), || {
            let scene = Path::new(&self.scene);
            let stem = scene.file_stem().unwrap_or(scene.as_os_str());
            // The colon of `escher:1000` is no part of a file's name everywhere.
            let stem = stem.to_string_lossy().replace(':', "-");
            PathBuf::from(stem + ".bvh")
        })
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

    /// Returns what the arguments leave open. The tracers of others have a cost of their own.
    fn open<'a>(&self, anywhere: MadeRays<'a>) -> Open<'a> {
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
    fn start(
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
    fn turned(
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
    fn plan(&self) -> Result<Plan, Error> {
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
