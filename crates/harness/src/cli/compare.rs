//! `harness compare`: compares a tree with the best known one of its scene and, on request,
//! archives a better one.

use super::terminal::{input_folder, print_line};
use crate::Error;
use crate::run::{archive, reference};
use bvh_core::cost;
use bvh_scenes::{Scene, tree_file};
use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use std::path::{Path, PathBuf};

/// Compare the tree in a file with the best known one of a scene.
///
/// Any program may have written the file; its cost and validity are computed again.
#[derive(Args, Clone, Debug)]
pub struct CompareArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The scene it is for, by name or path of a mesh file.
    pub scene: String,
    /// Let a glTF file name buffers outside its own folder. Its author then chooses which files are
    /// read.
    #[arg(long)]
    pub outside_files: bool,
    /// Folder with the best known costs, by default `results` if it exists.
    #[arg(long, value_name = "DIR")]
    pub results: Option<PathBuf>,
    /// If the tree is the best known, keep it in the archive in the results folder, with the
    /// command that made it.
    #[arg(long, value_name = "COMMAND", value_parser = NonEmptyStringValueParser::new())]
    pub keep: Option<String>,
}

/// Prints the costs of the tree and of the best known one, a binary tree with one object per leaf.
pub fn compare(args: &CompareArgs) -> Result<(), Error> {
    let file = &args.file;
    let results = args.results.as_deref().unwrap_or(Path::new("results"));
    // The default folder may be missing: a tree can be costed outside a checkout.
    if args.results.is_some() {
        input_folder("--results", results)?;
    }
    if args.keep.is_some() {
        input_folder("--keep", results)?;
    }
    let scene = Scene::load_with(&args.scene, args.outside_files.into())?;
    // Any program may have written the file, so its cost is computed here and not read from it.
    let (tree, _) = tree_file::load(file, &scene)?;
    let area = cost::internal_area(&tree);
    print_line(&format!("internal area: {area}"));
    print_line(&best_known(results, &scene, area)?);
    if let Some(command) = &args.keep {
        let path = archive::keep(results, &scene, file, command)?;
        print_line(&format!("kept in: {}", path.display()));
    }
    Ok(())
}

/// Returns the best known cost of the scene, its method, and the ratio of `area` to it.
fn best_known(results: &Path, scene: &Scene, area: f64) -> Result<String, Error> {
    let Some(best) = reference::best_known(results, scene)? else {
        return Ok("best known internal area: none of this very scene".into());
    };
    Ok(format!(
        "best known internal area: {}\nfound by: {}\ninternal area over the best known: {}",
        best.cost,
        best.method,
        area / best.cost
    ))
}
