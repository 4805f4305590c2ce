//! `bvh report`: one page about a tree file, compared with the plain tree that a library builds.

mod levels;
mod page;

use crate::Error;
use crate::arguments::{FileKind, Jobs, output_file, output_or_free, reserve};
use crate::output::print_line;
use crate::rays::Rays;
use crate::scene_files::SceneFiles;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{self, Objective};
use bvh_core::{Bvh, validate_references};
use bvh_scenes::Scene;
use bvh_scenes::render::{Film, Options, heat, image, render};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_scenes::tree_file::{self, TreeFileError};
use clap::Args;
use levels::Level;
use page::{Heat, Page, Row};
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Write a page about a tree file: costs by level, overlap, tests of rays as heat, each compared
/// with the greedy tree of the same scene.
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

/// The kind of pages.
const PAGE: FileKind =
    FileKind { name: "an HTML page", beginning: b"<!DOCTYPE html>", extension: "html" };
/// The width and the height of the pictures, in pixels.
const PICTURE: (u32, u32) = (640, 400);

/// One of the two trees on the page.
struct Measured {
    tree: Bvh,
    levels: Vec<Level>,
    /// The expected tests of a ray in the wide layout, for triangles.
    tests: Option<f64>,
    film: Film,
}

/// Measures the tree in a file and the greedy tree, draws both, and writes the page.
pub fn report(args: &ReportArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    let out = output_or_free("--out", args.out.as_ref(), || args.file.with_extension("html"))?;
    output_file("--out", &out, &PAGE)?;
    args.jobs.apply()?;
    let scene = args.files.load(&args.scene)?;
    let (tree, header) = tree_file::load(&args.file, &scene)?;
    validate_references(&tree, &scene.boxes, &scene.primitives)
        .map_err(|fault| TreeFileError::of(&args.file)(fault.into()))?;
    let greedy = muller_fellner::Config::default()
        .build(&scene.boxes)
        .map_err(Error::search(&scene.name, "muller_fellner"))?;
    let baked = measure(tree, &scene, interrupted)?;
    let greedy = measure(greedy, &scene, interrupted)?;
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
        levels: [&baked.levels, &greedy.levels],
    };
    reserve(&out, args.out.is_some(), 0)?.write(&[page.html().as_bytes()])?;
    print_line(&format!("{}: {title}", out.display()));
    Ok(())
}

/// Measures a tree, and draws the scene with it.
fn measure(tree: Bvh, scene: &Scene, interrupted: &AtomicBool) -> Result<Measured, Error> {
    let tests = match scene.triangles() {
        Ok(_) => Some(Rays::Default.expected_tests(&tree, scene, interrupted)?),
        Err(_) => None,
    };
    let (width, height) = PICTURE;
    let options =
        Options { width, height, samples: 1, depth: 0, view: None, lights: None, ground: false };
    let accelerator = Accelerator::new(&scene.primitives, Structure::Tree(Cow::Borrowed(&tree)));
    let film = render(scene, &accelerator, &options, &|| !interrupted.load(Relaxed))
        .ok_or(Error::Abandoned)?;
    let levels = levels::of(&tree);
    Ok(Measured { tree, levels, tests, film })
}

/// Computes a number from a tree, if it has this number.
type Fact = fn(&Measured) -> Option<f64>;

/// Compares the two trees, one fact each.
fn rows(baked: &Measured, greedy: &Measured) -> Vec<Row> {
    let facts: [(&'static str, Fact); 7] = [
        ("Internal area over root area", |of| {
            Some(cost::over_root_area(&of.tree, cost::internal_area(&of.tree)))
        }),
        ("Cost of the wide layout by area", |of| {
            let cost = Objective::Layout.cost(&of.tree);
            Some(cost::over_root_area(&of.tree, cost))
        }),
        ("Expected tests of a ray from anywhere", |of| of.tests),
        ("Tests per ray of the picture, in the binary tree", |of| {
            let counts = of.film.counts;
            Some((counts.boxes + counts.objects) as f64 / of.film.rays.max(1) as f64)
        }),
        ("Shared area of siblings over root area", |of| {
            Some(of.levels.iter().map(|level| level.overlap).sum())
        }),
        ("Depth", |of| Some(of.tree.depth() as f64)),
        ("Nodes", |of| Some(of.tree.nodes.len() as f64)),
    ];
    facts
        .into_iter()
        .filter_map(|(name, fact)| Some(Row { name, baked: fact(baked)?, greedy: fact(greedy)? }))
        .collect()
}

/// Returns the heat maps of both trees under one scale.
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

/// Returns a PNG file as wide as the film.
fn png(out: &Path, film: &Film, pixels: &[[u8; 3]]) -> Result<Vec<u8>, Error> {
    image::png(film.width, pixels)
        .map_err(io::Error::other)
        .map_err(Error::io(out, "encode the picture"))
}
