//! `bvh report`: one page about a tree file, compared with the plain tree that a library builds.

mod page;

use crate::Error;
use crate::answer::{Answer, Form, whole};
use crate::arguments::{Jobs, load_scene, output_file, output_or_free};
use crate::rays::Rays;
use bvh_build::{Builder, muller_fellner};
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective};
use bvh_scenes::files::{Reserved, WriteError};
use bvh_scenes::rays::View;
use bvh_scenes::render::{Film, Options, framing, heat, image, render};
use bvh_scenes::trace::Accelerator;
use bvh_scenes::{Scene, tree_file};
use clap::Args;
use page::{Page, Row};
use serde_json::json;
use std::path::PathBuf;

/// Write a page about a tree file: its costs and the tests of rays as heat, each compared with the
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
    #[command(flatten)]
    pub jobs: Jobs,
    #[command(flatten)]
    pub form: Form,
}

struct Measured {
    tree: Bvh,
    /// The expected tests of a ray in the wide layout, for triangles.
    tests: Option<f64>,
    film: Film,
}

const WIDTH: u32 = 640;
const HEIGHT: u32 = 400;

/// Measures the tree in a file and the greedy tree, draws both, and writes the page.
pub fn report(args: &ReportArgs) -> Result<(), Error> {
    let out = output_or_free(args.out.as_ref(), || args.file.with_extension("html"))?;
    output_file("--out", &out, "html")?;
    args.jobs.apply()?;
    let scene = load_scene(&args.scene)?;
    let (tree, header) = tree_file::load(&args.file, &scene)?;
    let greedy = muller_fellner::Config::default()
        .build(&scene.boxes)
        .map_err(Error::search(&scene.name, "muller_fellner"))?;
    let view = framing::automatic(&scene, f64::from(WIDTH) / f64::from(HEIGHT));
    let baked = measure(tree, &scene, &view)?;
    let greedy = measure(greedy, &scene, &view)?;
    let rows = rows(&baked, &greedy);
    let title = title(&scene.name, &rows[0]);
    let mut answer = Answer::new(args.form);
    answer.say(&format!("{}: {title}", out.display()));
    answer.record("file", out.display().to_string());
    for Row { name, baked, greedy, .. } in &rows {
        answer.record(name, json!({ "baked": baked, "greedy": greedy }));
    }
    let ranges = [&baked, &greedy].map(Measured::range);
    // The same colour must mean the same number of tests in both.
    let top = ranges[0].top.max(ranges[1].top);
    let png = |pixels: &[[u8; 3]]| {
        image::png(WIDTH, pixels).map_err(WriteError::of(&out, "encode the picture"))
    };
    let page = Page {
        title: &title,
        origin: format!(
            "{} objects, {} references; {}, seed {}, {} nodes visited by the search.",
            whole(header.objects),
            whole(header.references),
            header.method,
            header.seed,
            whole(header.work)
        ),
        rows,
        scene: png(&baked.film.pixels)?,
        heat: [png(&heat::colours(&baked.film, top))?, png(&heat::colours(&greedy.film, top))?],
        medians: ranges.map(|range| range.median),
        top,
    };
    Reserved::new(&out, 0, args.out.is_none())?.write(&[page.html().as_bytes()])?;
    answer.end();
    Ok(())
}

/// Says what the tree is worth: its gain in the first row of the table.
fn title(scene: &str, row: &Row) -> String {
    let percent = if row.greedy > 0.0 { 100.0 * (1.0 - row.baked / row.greedy) } else { 0.0 };
    match percent.round() {
        0.0 => format!("{scene}: as cheap as a plain build"),
        gain if gain > 0.0 => format!("{scene}: {gain:.0} % cheaper than a plain build"),
        loss => format!("{scene}: {:.0} % dearer than a plain build", -loss),
    }
}

impl Measured {
    /// Returns the distribution of tests over the pixels whose rays meet the box of the scene. All
    /// other rays have one test, which would hide the median of a small scene.
    fn range(&self) -> heat::Range {
        let tests = self.film.tests.iter().copied().filter(|&tests| tests > 1).collect();
        heat::range(tests)
    }
}

fn measure(tree: Bvh, scene: &Scene, view: &View) -> Result<Measured, Error> {
    let tests = match scene.triangles() {
        Ok(_) => Some(Rays::Default.expected_tests(&tree, scene)?),
        Err(_) => None,
    };
    let options = Options {
        samples: 1,
        depth: 0,
        ground: false,
        ..Options::new(WIDTH, HEIGHT, view.clone())
    };
    let accelerator = Accelerator::of_tree(&scene.primitives, &tree);
    let film = render(scene, &accelerator, &options, &|| ());
    Ok(Measured { tree, tests, film })
}

fn rows(baked: &Measured, greedy: &Measured) -> Vec<Row> {
    let over_root = |of: &Measured, cost| Some(cost::over_root_area(&of.tree, cost));
    let facts = |of: &Measured| {
        let counts = of.film.counts;
        let area = over_root(of, cost::internal_area(&of.tree));
        let layout = over_root(of, Objective::Layout.cost(&of.tree));
        let tests = (counts.boxes + counts.objects) as f64 / of.film.rays.max(1) as f64;
        [
            ("Total area of inner nodes over the root's", true, area),
            ("Cost of the wide layout by area", true, layout),
            ("Expected tests of a ray from anywhere", true, of.tests),
            ("Tests per ray of the picture, in the binary tree", true, Some(tests)),
            ("Depth", false, Some(of.tree.depth() as f64)),
            ("Nodes", false, Some(of.tree.nodes.len() as f64)),
        ]
    };
    facts(baked)
        .into_iter()
        .zip(facts(greedy))
        .filter_map(|((name, is_cost, baked), (.., greedy))| {
            Some(Row { name, baked: baked?, greedy: greedy?, is_cost })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_says_what_the_tree_is_worth() {
        for (baked, title_of) in [
            (0.8, "20 % cheaper than a plain build"),
            (1.034, "3 % dearer than a plain build"),
            (1.001, "as cheap as a plain build"),
        ] {
            let row = Row { name: "", baked, greedy: 1.0, is_cost: true };
            assert_eq!(title("escher", &row), format!("escher: {title_of}"));
        }
    }
}
