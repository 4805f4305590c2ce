//! `bvh export`: writes a tree for the tracer of another library.

use crate::Error;
use crate::answer::{Answer, Form, gain, short, whole};
use crate::arguments::{output_file, reserve};
use crate::scene_files::SceneFiles;
use bvh_build::{Builder, muller_fellner};
use bvh_core::export::Target;
use bvh_scenes::tree_file;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;

/// Write a tree for the tracer of another library: with the leaves that cost least there, no deeper
/// than it accepts, and in its order. docs/INTEROP.md has the lines that load the file.
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
    /// The file to write, replaced when it is complete.
    #[arg(long, value_name = "FILE.bin")]
    pub out: PathBuf,
    /// Permits files outside the scene's folder.
    #[command(flatten)]
    pub files: SceneFiles,
    /// The form of the costs.
    #[command(flatten)]
    pub form: Form,
}

/// Parses the names of the targets.
fn tracers() -> impl TypedValueParser<Value = Target> {
    PossibleValuesParser::new(Target::ALL.map(|target| target.name)).try_map(|name| {
        Target::ALL.into_iter().find(|target| target.name == name).ok_or("no tracer")
    })
}

/// Writes the file, and prints the cost of the tree there beside that of a greedy tree.
pub fn export(args: &ExportArgs) -> Result<(), Error> {
    output_file("--out", &args.out, "bin")?;
    let target = args.tracer;
    let scene = args.files.load(&args.scene)?;
    let (tree, _) = tree_file::load(&args.file, &scene)?;
    let fitted = target.fit(&tree);
    let bytes = target.bytes(&fitted, &scene.boxes);
    reserve(&args.out, true, bytes.len())?.write(&[&bytes])?;
    // The loaded tree is over the same boxes, so that these can be built over, too.
    let greedy = muller_fellner::Config::default().build(&scene.boxes).unwrap_or(tree);
    let cost = target.cost(&fitted);
    let base = target.cost(&target.fit(&greedy));
    let nodes = fitted.nodes.len();
    let mut answer = Answer::new(args.form);
    answer.say(&format!(
        "{}: {} nodes, cost of a ray {}, {} a greedy tree's {}",
        args.out.display(),
        whole(nodes),
        short(cost),
        gain(cost, base),
        short(base),
    ));
    answer.record("nodes", nodes);
    answer.record("cost of a ray", cost);
    answer.record("cost of a ray in a greedy tree", base);
    answer.end();
    Ok(())
}
