//! `bvh report`: one page about a tree file, compared with the plain tree that a library builds.

mod page;

use crate::Error;
use crate::arguments::{Jobs, output_file, output_or_free, reserve};
use crate::output::print_line;
use crate::rays::Rays;
use crate::scene_files::SceneFiles;
use bvh_build::{Builder, muller_fellner};
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective};
use bvh_scenes::render::{Film, Options, heat, image, render};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_scenes::{Scene, tree_file};
use clap::Args;
use page::{Heat, Page, Row};
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

/// Write a page about a tree file: costs by level and tests of rays as heat, each compared with the
/// greedy tree of the same scene.
#[derive(Args, Clone, Debug)]
pub struct ReportArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file.
    pub scene: String,
    /// The page, an HTML file without scripts that refers to no other file. The default is the name
    /// of the tree file with the extension html, which must be free.
    #[arg(long, value_name = "FILE.html")]
    pub out: Option<PathBuf>,
    /// Permits files outside the scene's folder.
    #[command(flatten)]
    pub files: SceneFiles,
    /// Limits the threads.
    #[command(flatten)]
    pub jobs: Jobs,
}

/// One of the two trees on the page.
struct Measured {
    tree: Bvh,
    /// The expected tests of a ray in the wide layout, for triangles.
    tests: Option<f64>,
    film: Film,
}

/// Measures the tree in a file and the greedy tree, draws both, and writes the page.
pub fn report(args: &ReportArgs) -> Result<(), Error> {
    let out = output_or_free("--out", args.out.as_ref(), || args.file.with_extension("html"))?;
    output_file("--out", &out, "html")?;
    args.jobs.apply()?;
    let scene = args.files.load(&args.scene)?;
    let (tree, header) = tree_file::load(&args.file, &scene)?;
    let greedy = muller_fellner::Config::default()
        .build(&scene.boxes)
        .map_err(Error::search(&scene.name, "muller_fellner"))?;
    let baked = measure(tree, &scene)?;
    let greedy = measure(greedy, &scene)?;
    let title = format!("{} by {}", scene.name, header.method);
    let page = Page {
        title: &title,
        origin: format!(
            "{} objects, {} references; seed {}, {} nodes visited by the search.",
            header.objects, header.references, header.seed, header.work
        ),
        rows: rows(&baked, &greedy),
        scene: png(&out, &baked.film, &baked.film.pixels)?,
        heat: heat_maps(&out, &baked.film, &greedy.film)?,
        levels: [area_by_level(&baked.tree), area_by_level(&greedy.tree)],
    };
    reserve(&out, args.out.is_some(), 0)?.write(&[page.html().as_bytes()])?;
    print_line(&format!("{}: {title}", out.display()));
    Ok(())
}

fn measure(tree: Bvh, scene: &Scene) -> Result<Measured, Error> {
    let tests = match scene.triangles() {
        Ok(_) => Some(Rays::Default.expected_tests(&tree, scene)?),
        Err(_) => None,
    };
    let options = Options {
        width: 640,
        height: 400,
        samples: 1,
        depth: 0,
        ground: false,
        ..Options::default()
    };
    let accelerator = Accelerator::new(&scene.primitives, Structure::Tree(Cow::Borrowed(&tree)));
    let film = render(scene, &accelerator, &options, &|| ());
    Ok(Measured { tree, tests, film })
}

fn rows(baked: &Measured, greedy: &Measured) -> Vec<Row> {
    let over_root = |of: &Measured, cost| Some(cost::over_root_area(&of.tree, cost));
    let facts = |of: &Measured| {
        let counts = of.film.counts;
        [
            ("Internal area over root area", over_root(of, cost::internal_area(&of.tree))),
            ("Cost of the wide layout by area", over_root(of, Objective::Layout.cost(&of.tree))),
            ("Expected tests of a ray from anywhere", of.tests),
            (
                "Tests per ray of the picture, in the binary tree",
                Some((counts.boxes + counts.objects) as f64 / of.film.rays.max(1) as f64),
            ),
            ("Depth", Some(of.tree.depth() as f64)),
            ("Nodes", Some(of.tree.nodes.len() as f64)),
        ]
    };
    facts(baked)
        .into_iter()
        .zip(facts(greedy))
        .filter_map(|((name, baked), (_, greedy))| {
            Some(Row { name, baked: baked?, greedy: greedy? })
        })
        .collect()
}

/// Returns the sum of the inner nodes' areas at each depth over the root's area: the expected
/// number of them that a random line visits.
fn area_by_level(tree: &Bvh) -> Vec<f64> {
    // The areas of a scene without area are all 0.
    let unit = tree.root_aabb().map_or(0.0, |root| root.half_area()).max(f64::MIN_POSITIVE);
    let mut levels = Vec::new();
    let mut row: Vec<usize> = (0..tree.nodes.len().min(1)).collect();
    while !row.is_empty() {
        let inner = row.iter().map(|&index| &tree.nodes[index]).filter(|node| !node.is_leaf());
        levels.push(inner.clone().map(|node| node.aabb.half_area() / unit).sum());
        row = inner.flat_map(|node| node.children()).collect();
    }
    levels
}

fn heat_maps(out: &Path, baked: &Film, greedy: &Film) -> Result<[Heat; 2], Error> {
    let [ours, theirs] = [baked, greedy].map(|film| heat::range(film, 1));
    // The same colour must mean the same number of tests in both.
    let top = ours.top.max(theirs.top);
    Ok([
        heat_map(out, baked, heat::Range { top, ..ours })?,
        heat_map(out, greedy, heat::Range { top, ..theirs })?,
    ])
}

fn heat_map(out: &Path, film: &Film, range: heat::Range) -> Result<Heat, Error> {
    let pixels = heat::map(film, 1, &range)
        .map_err(io::Error::other)
        .map_err(Error::io(out, "encode the picture"))?;
    Ok(Heat { png: png(out, film, &pixels)?, median: range.median, most: range.max })
}

fn png(out: &Path, film: &Film, pixels: &[[u8; 3]]) -> Result<Vec<u8>, Error> {
    image::png(film.width, pixels)
        .map_err(io::Error::other)
        .map_err(Error::io(out, "encode the picture"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_areas_of_all_levels_add_up_to_the_cost() {
        let scene = Scene::load("escher:300").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let levels = area_by_level(&tree);
        let sum: f64 = levels.iter().sum();
        let expected = cost::over_root_area(&tree, cost::internal_area(&tree));
        assert!((sum - expected).abs() < 1e-12 * expected, "{sum} {expected}");
        assert_eq!((levels[0], levels.len()), (1.0, tree.depth() + 1));
    }
}
