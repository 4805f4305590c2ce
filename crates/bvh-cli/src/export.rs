//! `bvh export`: writes a tree for the tracer of another library.

use crate::Error;
use crate::answer::{Answer, gain, whole};
use crate::arguments::{greedy, output_file, scene_of};
use bvh_core::cost::Objective;
use bvh_core::export::{Layout, Target};
use bvh_scenes::{files, tree_file};
use bvh_search::FramedExport;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;

/// Write a tree for the tracer of another library: with the leaves that cost least there, no deeper
/// than it accepts, and in its order; or a greedy tree, where its rays take fewer tests.
/// docs/INTEROP.md has the lines that load the file.
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
    #[arg(long, value_name = "FILE.bin|.json")]
    pub out: PathBuf,
    /// Accept a tree that divides triangles among leaves also for a tracer whose queries for all
    /// hits would find them more than once, because yours are for the nearest or any hit.
    #[arg(long)]
    pub divided: bool,
}

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
    if tree.frame.is_some() {
        return Err(Error::Usage(format!(
            "{}: {FramedExport} (--frame file)",
            args.file.display()
        )));
    }
    let [objects, references] = [scene.boxes.len(), tree.prim_ids.len()];
    if references > objects && target.references == 1.0 && !args.divided {
        return Err(Error::Usage(format!(
            "{}: the tree has {references} references to {objects} triangles, and a query of {} \
             for all hits would find the divided ones more than once; accepted: a tree of `bvh \
             bake {} --for {1}`, or --divided if your queries are for the nearest or any hit",
            args.file.display(),
            target.name,
            args.scene
        )));
    }
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
    if header.objective == Objective::Layout {
        answer.say(&format!(
            "the tree is for the wide layout; `bvh bake {} --for {}` searches for this tracer",
            args.scene, target.name
        ));
    }
    answer.record("nodes", nodes);
    answer.record("cost_per_ray", target.cost(&better.tree));
    answer.record("is_searched", better.is_searched());
    answer.record("gain_inside", better.gains[0]);
    answer.record("gain_outside", better.gains[1]);
    Ok(())
}
