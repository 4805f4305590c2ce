//! `bvh export`: writes a tree for the tracer of another library.

use crate::Error;
use crate::answer::{Answer, gain, whole};
use crate::arguments::{greedy, named, output_file, quoted, scene_of};
use bvh_core::cost::Objective;
use bvh_core::export::{ExportError, Layout, Target};
use bvh_scenes::{files, tree_file};
use clap::Args;
use std::path::PathBuf;

/// Write a tree for the tracer of another library: with the leaves that cost least there, no deeper
/// than it accepts, and in its order; or a greedy tree, where its rays take fewer tests.
/// The file has a header of 32 bytes, the nodes in the library's layout, and the triangles' ids.
#[derive(Args, Clone, Debug)]
pub struct ExportArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file.
    pub scene: String,
    /// The tracer.
    #[arg(long = "for", value_name = "TRACER")]
    #[arg(value_parser = named(Target::ALL.map(|target| (target.name, target))))]
    pub tracer: Target,
    /// The file to write, replaced when it is complete; `.json` for json.
    #[arg(short, long, value_name = "FILE.bin|.json")]
    pub out: PathBuf,
    /// Accept a tree that divides triangles among leaves also for a tracer whose queries for all
    /// hits would find them more than once, because yours are for the nearest or any hit.
    #[arg(long)]
    pub divided: bool,
}

/// The least and the largest speed of the trees of `bake --for` over the fastest of a tracer's own
/// trees: of seven scenes, all its layouts, and rays from a camera and incoherent ones. From
/// `results/interop/timing_tracers.csv`.
const MEASURED: [(&str, [f64; 2]); 5] = [
    ("three-mesh-bvh", [1.00, 1.75]),
    ("tinybvh", [0.96, 1.26]),
    ("obvhs", [0.90, 1.28]),
    ("bvh", [1.02, 1.95]),
    ("madmann91-bvh", [1.04, 1.47]),
];

/// Writes the better of the tree and a greedy one for the tracer, and prints how they compare.
pub fn export(args: &ExportArgs, answer: &mut Answer) -> Result<(), Error> {
    let target = args.tracer;
    let extension = if target.layout == Layout::Json { "json" } else { "bin" };
    output_file("--out", &args.out, extension)?;
    let scene = scene_of(&args.file, &args.scene)?;
    // Only triangles in f32 can be traced there.
    let triangles = scene.triangles().map_err(|fault| Error::Usage(fault.to_string()))?;
    let (tree, header) = tree_file::load(&args.file, &scene)?;
    let bake_for = format!("`bvh bake {} --for {}`", quoted(&args.scene), target.name);
    let objects = scene.boxes.len();
    target.check(&tree, objects, args.divided).map_err(|error| {
        let flags = match error {
            ExportError::Framed => "--frame file",
            ExportError::Divided { .. } => "--divided",
        };
        Error::Usage(format!("{}: {error} ({bake_for}, {flags})", args.file.display()))
    })?;
    let better = target.fit_better(&tree, &greedy(&scene)?, triangles);
    files::write(&args.out, &target.bytes(&better.tree, &scene.boxes))?;
    let which = match better.is_searched() {
        true => "this tree",
        false => "a greedy tree instead, which takes fewer tests",
    };
    let [inside, outside] = better.gains.map(|times| gain(1.0, times));
    let nodes = better.tree.nodes.len();
    answer.say(&format!(
        "{}: {} nodes of {which}; {inside} tests of rays from inside the scene against a greedy \
         tree, {outside} of rays from outside",
        args.out.display(),
        whole(nodes)
    ));
    if let Some((tracer, [least, most])) = MEASURED.iter().find(|(name, _)| *name == target.name) {
        answer.say(&format!(
            "other scenes, traced in {tracer}: {least:.2} to {most:.2} times the speed of the fastest \
             of its own trees"
        ));
    }
    if better.gains[1] < 1.0 {
        answer.say("warning: rays from a camera outside the scene lose here");
    }
    // A search for the tracer minimises its area, and may divide triangles.
    let is_whole = target.references > 1.0 && tree.prim_ids.len() == objects;
    let is_for_tracer = header.objective == Objective::InternalArea && !is_whole;
    if !is_for_tracer || !better.is_searched() {
        answer.say(&format!("a tree that is searched for this tracer may gain more: {bake_for}"));
    }
    answer.record("file", args.out.display().to_string());
    answer.record("nodes", nodes);
    answer.record("cost_per_ray", target.cost(&better.tree));
    answer.record("is_greedy", !better.is_searched());
    answer.record("is_searched_for_tracer", is_for_tracer && better.is_searched());
    answer.record("gain_inside", better.gains[0]);
    answer.record("gain_outside", better.gains[1]);
    Ok(())
}
