//! `harness bake`: the best tree for a scene that a budget buys, kept in a file.

use crate::Error;
use crate::cli::arguments::{Jobs, TREE, input_file, output_file};
use crate::cli::bake_rays::Rays;
use crate::cli::effort::Effort;
use crate::cli::explain;
use crate::cli::interrupt::{self, Interrupted};
use crate::cli::output::{print_error, print_line};
use crate::files::{self, Reserved, load_tree};
use crate::scenes::Scene;
use bvh_build::{Builder, muller_fellner};
use bvh_core::Bvh;
use bvh_core::cost::{Measure, Objective};
use bvh_core::file::{self, Header, Origin};
use bvh_search::best::{self, Horizon};
use bvh_search::{
    Budget, Deadline, Event, Method, Observer, Outcome, Problem, Splits, StopReason, optimize, solve,
};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

/// Search for the best tree of a scene within a budget, and save it.
#[derive(Args, Clone, Debug)]
pub struct BakeArgs {
    /// Name of a scene, or path of a mesh file.
    pub scene: String,
    /// How long to search: a time (`10s`, `1m 30s`), or work (`50Mwork`: 50 million nodes visited), which gives the
    /// same bytes everywhere.
    #[arg(long, value_name = "TIME|WORK")]
    pub budget: Effort,
    /// The file to write; an old one is replaced when the new one is complete. With --instances a new or empty folder.
    #[arg(long, value_name = "FILE.bvh|DIR")]
    pub out: PathBuf,
    /// Bake a tree for every mesh of a glTF file, each once, and one over the places where its nodes put them.
    #[arg(long, conflicts_with_all = ["rays", "from", "explain"])]
    pub instances: bool,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Search for the least cost of rays instead of area: `default`, rays that need no camera, or a file that describes those
    /// of a renderer.
    #[arg(long, value_name = "default|FILE.toml")]
    pub rays: Option<String>,
    /// What the search minimises: `area`, the internal area, which suits every tracer; or `layout`, the nodes and blocks of triangles
    /// that are tested in this project's own wide layout. Default: `layout` with --rays, else `area`.
    #[arg(long, value_name = "area|layout", value_enum)]
    pub cost: Option<BakeCost>,
    /// Let objects be divided among leaves where that pays, up to so many references per object, 1 to 16. Leaves count in the cost
    /// then.
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    pub references: f64,
    /// The method, with its default parameters.
    #[arg(long, value_name = "NAME", default_value = BEST)]
    pub method: String,
    /// Go on from the tree of an earlier bake of the same scene; the result is never worse.
    #[arg(long, value_name = "FILE.bvh")]
    pub from: Option<PathBuf>,
    /// Limits the threads.
    #[command(flatten)]
    pub jobs: Jobs,
    /// Say first what the scene does not need and is left out, and why.
    #[arg(long)]
    pub explain: bool,
}

/// What a bake minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BakeCost {
    /// The internal area.
    Area,
    /// The cost of the wide layout.
    Layout,
}

impl BakeArgs {
    /// What is minimised. Rays save more tests by the cost of the layout, and without a camera hardly any by area:
    /// `results/ray_objective`.
    fn cost(&self) -> BakeCost {
        let suits = if self.rays.is_some() { BakeCost::Layout } else { BakeCost::Area };
        self.cost.unwrap_or(suits)
    }
}

/// The method that goes on from a given tree.
const BEST: &str = "best";

/// Searches until the budget is spent or `interrupted` becomes true, writes the best tree found, and prints what it
/// costs. If it is interrupted, it writes the file all the same and returns [`Error::Stopped`].
pub fn bake(args: &BakeArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    if let Some(from) = &args.from {
        input_file("--from", from)?;
    }
    output_file("--out", &args.out, &TREE)?;
    let rays = args.rays.as_deref().map(Rays::read).transpose()?;
    args.jobs.apply()?;
    let scene = Scene::load(&args.scene)?;
    scene.remark.iter().for_each(|remark| print_error(remark));
    if args.explain {
        print_line(&explain::scene(&scene)?);
    }
    let method = method(args)?;
    check_references(args, &method)?;
    let start = args.from.as_deref().map(|path| start(path, &scene)).transpose()?;
    let reserved = Reserved::new(&args.out, most_bytes(most_references(args, &scene)))?;
    let baked = search(args, &method, &scene, args.budget, rays.as_ref(), start.as_ref(), interrupted)?;
    reserved.write(&baked.bytes)?;
    if interrupted.load(Relaxed) {
        return Err(Error::Stopped { path: args.out.clone(), cost: baked.outcome.cost });
    }
    print_line(&format!("{}{} bytes", summary(args, &scene, &baked), baked.bytes.len()));
    Ok(())
}

/// What a search found.
pub(super) struct Baked {
    pub outcome: Outcome,
    /// Of the tree file.
    pub bytes: Vec<u8>,
    /// The cost of the greedy tree.
    pub base: f64,
    /// The cost of the tree that it went on from.
    before: Option<f64>,
    seconds: f64,
    /// What the cost is.
    unit: &'static str,
}

/// Searches until the budget is spent or `interrupted` becomes true.
pub(super) fn search(
    args: &BakeArgs,
    method: &Method,
    scene: &Scene,
    effort: Effort,
    rays: Option<&Rays>,
    start: Option<&(Bvh, Header)>,
    interrupted: &AtomicBool,
) -> Result<Baked, Error> {
    let greedy = muller_fellner::Config::default().build(&scene.boxes);
    let greedy = greedy.map_err(Error::search(&scene.name, &args.method))?;
    let deadline = effort.deadline();
    interrupt::hold();
    let splits = splits(args, scene, start.map(|(tree, _)| tree))?;
    let density = rays.map(|rays| rays.density(scene, &greedy, args.seed)).transpose()?;
    let objective = match args.cost() {
        BakeCost::Area => Objective::InternalArea,
        BakeCost::Layout => Objective::Layout,
    };
    let problem = Problem {
        objective,
        splits,
        measure: density.as_ref().map(|density| density as &dyn Measure),
        ..Problem::new(&scene.boxes)
    };
    let base = problem.cost(&greedy);
    let watch = Watch::new(effort, deadline, base, interrupted);
    let budget = match effort {
        Effort::Time(_) => Budget::UNLIMITED,
        Effort::Work(work) => Budget { max_work: Some(work), ..Budget::UNLIMITED },
    };
    let fallback = match (effort, method) {
        (Effort::Work(work), Method::Best(_)) => best::fallback(&problem, work, &Interrupted(interrupted)),
        _ => Ok(None),
    };
    let outcome = match (start, method) {
        (Some((tree, _)), Method::Best(config)) => optimize(tree, &problem, config, args.seed, budget, &watch),
        _ => solve(method, &problem, args.seed, budget, &watch),
    };
    watch.bar.finish_and_clear();
    let outcome = outcome.and_then(|found| Ok(best::unless_behind(found, fallback?)));
    let outcome = outcome.map_err(Error::search(&scene.name, &args.method))?;
    let seconds = watch.deadline.elapsed().as_secs_f64();

    let spent = start.map_or(0, |(_, header)| header.work);
    let work = spent.saturating_add(outcome.work);
    let name = recorded(args);
    let visits = density.as_ref().map_or_else(Vec::new, |density| density.visits(&outcome.tree));
    let origin = Origin { method: &name, seed: args.seed, work, visits: &visits, objective };
    let bytes = file::save_references(&outcome.tree, &scene.boxes, &scene.primitives, &origin)
        .map_err(|source| Error::TreeFile { path: args.out.clone(), source })?;
    let before = start.map(|(tree, _)| problem.cost(tree));
    Ok(Baked { outcome, bytes, base, before, seconds, unit: unit(args, splits.is_some()) })
}

/// The most references to a scene's objects that leaves may have.
fn most_references(args: &BakeArgs, scene: &Scene) -> usize {
    (args.references * scene.boxes.len() as f64) as usize
}

/// The leave to divide objects that the scene needs, or the tree `from` which the search goes on: without one, the search is that for
/// whole objects and gives the same tree.
fn splits<'a>(args: &BakeArgs, scene: &'a Scene, from: Option<&Bvh>) -> Result<Option<Splits<'a>>, Error> {
    let asked = Splits::at_most(most_references(args, scene), &scene.boxes, &scene.primitives);
    let divided = from.is_some_and(|tree| tree.prim_ids.len() > scene.boxes.len());
    let Some(splits) = asked.filter(|_| !divided) else { return Ok(asked) };
    let needed = splits.if_they_pay(&scene.boxes).map_err(Error::search(&scene.name, "--references"))?;
    if args.explain && needed.is_none() {
        print_line("  left out: divided objects: no spatial split of a top-down division saves anything");
    }
    Ok(needed)
}

/// What the file says of the method: its name, and the rays if there are any.
fn recorded(args: &BakeArgs) -> String {
    const MOST_BYTES: usize = 64;
    let Some(rays) = &args.rays else { return args.method.clone() };
    let file = Path::new(rays).file_name().map_or(rays.clone(), |name| name.to_string_lossy().into_owned());
    let mut name = format!("{} for rays of {file}", args.method).replace('\0', "");
    while name.len() > MOST_BYTES {
        name.pop();
    }
    name
}

/// What the cost is.
fn unit(args: &BakeArgs, leaves_count: bool) -> &'static str {
    match (args.cost(), &args.rays) {
        (BakeCost::Layout, Some(_)) => "cost of the wide layout for rays, times root area,",
        (BakeCost::Layout, None) => "cost of the wide layout, times root area,",
        (BakeCost::Area, Some(_)) => "visits of rays times root area",
        (BakeCost::Area, None) if leaves_count => "area of all nodes",
        (BakeCost::Area, None) => "internal area",
    }
}

/// The method that was named. Refuses one that cannot start from a tree if a tree is given.
pub(super) fn method(args: &BakeArgs) -> Result<Method, Error> {
    let found = Method::all().into_iter().find(|method| method.name() == args.method);
    match found {
        None => {
            let accepted = Method::NAMES.join(", ");
            Err(Error::Usage(format!("--method {}: no such method; accepted: {accepted}", args.method)))
        }
        Some(Method::Best(config)) => {
            // The budget ends the search; the limit of the method itself does not count.
            Ok(Method::Best(best::Config { horizon: Some(Horizon::Known), ..config }))
        }
        Some(_) if args.from.is_some() => {
            Err(Error::Usage(format!("--method {} cannot go on --from a tree; accepted: {BEST}", args.method)))
        }
        Some(method) => Ok(method),
    }
}

/// Refuses numbers of references that are out of range, and methods that would take no notice of them.
pub(super) fn check_references(args: &BakeArgs, method: &Method) -> Result<(), Error> {
    let refused = |found: String, accepted: &str| {
        Err(Error::Usage(format!("--references {found}; accepted: {accepted}")))
    };
    if !(1.0..=16.0).contains(&args.references) {
        return refused(args.references.to_string(), "1 to 16");
    }
    if args.references > 1.0 && !matches!(method, Method::Best(_)) {
        return refused(format!("{} with --method {}", args.references, args.method), BEST);
    }
    Ok(())
}

/// The tree to start from, and its header.
fn start(path: &Path, scene: &Scene) -> Result<(Bvh, Header), Error> {
    let tree = load_tree(path, scene)?;
    let header = files::open_tree(path, &files::read(path)?)?.header().clone();
    Ok((tree, header))
}

/// The size of the largest tree file over `objects` objects, in bytes.
fn most_bytes(objects: usize) -> usize {
    Header::BYTES + objects * (2 * (size_of::<bvh_core::Node>() + size_of::<f32>()) + size_of::<u32>())
}

fn summary(args: &BakeArgs, scene: &Scene, baked: &Baked) -> String {
    let &Baked { ref outcome, base, before, seconds, unit, .. } = baked;
    let mut lines = vec![
        format!(
            "{} ({}), {} objects, {}, seed {}",
            scene.name,
            scene.kind,
            scene.boxes.len(),
            args.method,
            args.seed
        ),
        format!("{unit} {}, {} Müller–Fellner's {base}", outcome.cost, gain(outcome.cost, base)),
    ];
    if let Some(before) = before {
        lines.push(format!("{} the tree it went on from, {before}", gain(outcome.cost, before)));
    }
    if args.references > 1.0 {
        let (references, objects) = (outcome.tree.prim_ids.len(), scene.boxes.len());
        lines.push(if references > objects {
            format!(
                "{references} references to {objects} objects, where no more than {} were allowed",
                args.references
            )
        } else {
            "no object is divided, because that does not pay here".into()
        });
    }
    // Of a method that plans with the clock, the plan is done when the time is over.
    let in_time = matches!(args.budget, Effort::Time(limit) if seconds >= 0.5 * limit.as_secs_f64());
    let why = match outcome.stop {
        StopReason::Completed if in_time => "",
        StopReason::Completed => ", and nothing more that this method does",
        StopReason::Optimal => ", and no tree is better",
        _ => "",
    };
    lines.push(format!("{} moves, {} nodes visited, {seconds:.1} s{why}", outcome.evaluations, outcome.work));
    lines.push(format!("{}: ", args.out.display()));
    lines.join("\n")
}

/// By how much `cost` is below or above `base`, in words.
pub(super) fn gain(cost: f64, base: f64) -> String {
    let percent = if base > 0.0 { 100.0 * (1.0 - cost / base) } else { 0.0 };
    if percent >= 0.0 { format!("{percent:.2} % below") } else { format!("{:.2} % above", -percent) }
}

/// Watches a bake: ends it with its budget of time or when it is interrupted, and shows its progress.
struct Watch<'a> {
    bar: ProgressBar,
    deadline: Deadline,
    effort: Effort,
    /// The cost that gains are relative to.
    base: f64,
    last: Mutex<Option<Event>>,
    /// Moves and work so far, which events are far behind while it is hot.
    moves: AtomicU64,
    work: AtomicU64,
    /// When the bar was last brought up to date, in milliseconds since the beginning.
    shown: AtomicU64,
    interrupted: &'a AtomicBool,
}

impl<'a> Watch<'a> {
    fn new(effort: Effort, deadline: Deadline, base: f64, interrupted: &'a AtomicBool) -> Self {
        // In thousandths of the budget; hidden unless standard error is a terminal.
        let bar = ProgressBar::new(1000);
        let style = ProgressStyle::with_template("{bar:10} {wide_msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let [moves, work, shown] = [0, 0, 0].map(AtomicU64::new);
        Self { bar, deadline, effort, base, last: Mutex::default(), moves, work, shown, interrupted }
    }

    /// Shows incumbent, gain, rate and time left, ten times a second.
    fn show(&self) {
        const REFRESH_MILLISECONDS: u64 = 100;
        if self.bar.is_hidden() {
            return;
        }
        let elapsed = self.deadline.elapsed();
        let (now, before) = (elapsed.as_millis() as u64, self.shown.load(Relaxed));
        let due = now >= before + REFRESH_MILLISECONDS;
        if !due || self.shown.compare_exchange(before, now, Relaxed, Relaxed).is_err() {
            return;
        }
        let Some(event) = *self.last.lock().unwrap_or_else(PoisonError::into_inner) else { return };
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let done = match self.effort {
            Effort::Time(_) => self.deadline.fraction(),
            Effort::Work(work) => self.work.load(Relaxed) as f64 / work.max(1) as f64,
        };
        self.bar.set_position((1000.0 * done.min(1.0)) as u64);
        self.bar.set_message(format!(
            "{:.6e}, {} MF, {:.2} M moves/s, {:.0} s left",
            event.incumbent,
            gain(event.incumbent, self.base),
            self.moves.load(Relaxed) as f64 / seconds / 1e6,
            (seconds / done.max(1e-9) - seconds).max(0.0)
        ));
    }
}

impl Observer for Watch<'_> {
    fn event(&self, event: &Event) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(*event);
    }

    fn counted(&self, evaluations: u64, work: u64) {
        self.moves.store(evaluations, Relaxed);
        self.work.store(work, Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.show();
        self.interrupted.load(Relaxed) || matches!(self.effort, Effort::Time(_)) && self.deadline.has_passed()
    }

    fn progress(&self) -> Option<f64> {
        matches!(self.effort, Effort::Time(_)).then(|| self.deadline.fraction())
    }
}
