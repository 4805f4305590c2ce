//! `bvh bake`: searches for the best tree of a scene within a budget, and writes it to a file.

mod effort;
mod found;
pub mod parts;
mod plan;
mod search;
mod watch;

use crate::Error;
use crate::answer::Answer;
use crate::arguments::named;
use crate::interrupt::{hold, is_interrupted};
use bvh_core::cost::Objective;
use bvh_core::export::Target;
use bvh_core::{Aabb, Frame};
use bvh_scenes::files::Reserved;
use bvh_scenes::{Precision, Scene};
use bvh_search::{Choice, Frames, Method, Reason, shortcuts};
use clap::Args;
use effort::Effort;
use plan::Prepared;
use std::path::PathBuf;
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
    let prepared = plan::prepare(args, answer)?;
    hold();
    let frame = frame(args, &prepared, &watch, answer);
    let Prepared { out, scene, start, plan } = prepared;
    let scene = scene.in_frame(frame);
    if args.explain {
        explain(&scene, answer)?;
    }
    // Reserving the file first reports a full disk before the search and not after it.
    let reserved = Reserved::new(&out, plan.most_bytes(&scene), args.out.is_none())?;
    let found = plan.search(&scene, start.as_ref(), watch, answer)?;
    found.save(&out, reserved, answer)?;
    found.next(args, &out, answer);
    Ok(())
}

/// Returns the frame of the tree to start from, or the best one, and says why it is the best.
fn frame(args: &BakeArgs, of: &Prepared, watch: &Watch, answer: &mut Answer) -> Option<Frame> {
    let Prepared { scene, start, plan, .. } = of;
    if let Some(start) = start {
        return start.tree.frame;
    }
    let is_ours = matches!(args.method, Method::Best(_)) && args.tracer.is_none();
    let frames = if is_ours { args.frame.unwrap_or_default() } else { Frames::File };
    let budget = plan.budget(scene.boxes.len());
    let choice = Choice::of_shapes(&scene.primitives, frames, budget, watch)?;
    if frames == Frames::Auto && !is_interrupted() {
        watch.bar.suspend(|| answer.say(&Reason::Frame(choice).to_string()));
    }
    if args.explain && choice.agreeing > 0.0 {
        let percent = 100.0 * choice.agreeing;
        let line = format!("frame: {percent:.0} % of the triangles, by size, share their axes");
        answer.line("explanation", line);
    }
    choice.frame
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
