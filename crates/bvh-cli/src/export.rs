//! `bvh export`: writes a tree for the tracer of another library.

use crate::Error;
use crate::answer::{Answer, gain, whole};
use crate::arguments::{greedy, output_file, scene_of};
use bvh_core::cost::Objective;
use bvh_core::export::{ExportError, Layout, Target};
use bvh_scenes::{files, tree_file};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;

/// Write a tree for the tracer of another library: with the leaves that cost least there, no deeper
/// than it accepts, and in its order; or a greedy tree, where its rays take fewer tests.
/// docs/use/INTEROP.md has the lines that load the file.
#[derive(Args, Clone, Debug)]
pub struct ExportArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file.
    pub scene: String,
    /// The tracer.
    #[arg(long = "for", value_name = "TRACER", value_parser = tracers())]
    pub tracer: Target,
    /// The file to write, replaced when it is complete; `.json` for json.
    #[arg(short, long, value_name = "FILE.bin|.json")]
    pub out: PathBuf,
    /// Accept a tree that divides triangles among leaves also for a tracer whose queries for all
    /// hits would find them more than once, because yours are for the nearest or any hit.
    #[arg(long)]
    pub divided: bool,
}

/// The least and the largest speed, of seven scenes, of the trees of `bake --for` over the fastest of
/// a tracer's own trees: of rays from a camera, and of incoherent ones. From
/// `results/interop/timing_tracers.csv`, by layout.
const MEASURED: [(&str, [f64; 2], [f64; 2]); 10] = [
    ("three-mesh-bvh", [1.00, 1.74], [1.01, 1.75]),
    ("tinybvh", [1.02, 1.11], [1.03, 1.23]),
    ("tinybvh BVH4_CPU", [1.00, 1.11], [1.03, 1.13]),
    ("tinybvh BVH8_CPU", [0.98, 1.04], [0.97, 1.16]),
    ("tinybvh BVH_GPU", [1.01, 1.12], [1.01, 1.25]),
    ("tinybvh CWBVH", [0.96, 1.26], [1.00, 1.23]),
    ("obvhs", [1.01, 1.25], [1.05, 1.28]),
    ("obvhs CwBvh", [0.90, 1.14], [0.94, 1.03]),
    ("bvh", [1.09, 1.69], [1.02, 1.95]),
    ("madmann91-bvh", [1.04, 1.22], [1.06, 1.47]),
];

/// Parses the names of the targets.
pub fn tracers() -> impl TypedValueParser<Value = Target> {
    PossibleValuesParser::new(Target::ALL.map(|target| target.name))
        .try_map(|name| Target::named(&name))
}

/// Writes the better of the tree and a greedy one for the tracer, and prints how they compare.
pub fn export(args: &ExportArgs, answer: &mut Answer) -> Result<(), Error> {
    let target = args.tracer;
    let extension = if target.layout == Layout::Json { "json" } else { "bin" };
    output_file("--out", &args.out, extension)?;
    let scene = scene_of(&args.file, &args.scene)?;
    // Only triangles in f32 can be traced there.
    let triangles = scene.triangles().map_err(|fault| Error::Usage(fault.to_string()))?;
    let (tree, header) = tree_file::load(&args.file, &scene)?;
    let bake_for = format!("`bvh bake {} --for {}`", args.scene, target.name);
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
    for (layout, camera, incoherent) in MEASURED {
        if layout.split(' ').next() == Some(target.name) {
            let [[a, b], [c, d]] = [camera, incoherent];
            answer.say(&format!(
                "measured in {layout} over the fastest of its own trees, on seven scenes: {a:.2} to \
                 {b:.2} times the speed for rays from a camera, {c:.2} to {d:.2} for others"
            ));
        }
    }
    if better.gains[1] < 1.0 {
        answer.say("warning: rays from a camera outside the scene lose here");
    }
    // A search for the tracer minimises its area, and may divide triangles.
    let is_whole = target.references > 1.0 && tree.prim_ids.len() == objects;
    if header.objective != Objective::InternalArea || is_whole || !better.is_searched() {
        answer.say(&format!(
            "the tree was not searched for this tracer, which often gives more: {bake_for}"
        ));
    }
    answer.record("nodes", nodes);
    answer.record("cost_per_ray", target.cost(&better.tree));
    answer.record("is_searched", better.is_searched());
    answer.record("gain_inside", better.gains[0]);
    answer.record("gain_outside", better.gains[1]);
    Ok(())
}
