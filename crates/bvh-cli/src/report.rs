//! `bvh report`: one page about a tree file, compared with the plain tree that a library builds.

use crate::Error;
use crate::answer::{Answer, gain, short, snake, whole};
use crate::arguments::{greedy, output_file, output_or_free, scene_of};
use crate::output::png;
use crate::rays::Rays;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective};
use bvh_core::file::Header;
use bvh_scenes::files::{Reserved, WriteError};
use bvh_scenes::rays::View;
use bvh_scenes::render::{Film, Options, framing, heat, render};
use bvh_scenes::trace::Accelerator;
use bvh_scenes::{Scene, tree_file};
use clap::Args;
use html_escape::encode_double_quoted_attribute as escaped;
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
    #[arg(short, long, value_name = "FILE.html")]
    pub out: Option<PathBuf>,
}

const STYLE: &str = include_str!("report.css");
const WIDTH: u32 = 640;
const HEIGHT: u32 = 400;

/// A number about a tree, with its name. Other commands have the same names for the same numbers.
type Fact = (&'static str, f64);
const AREA: &str = "Area";
const LAYOUT: &str = "Cost of the wide layout";
const TESTS: &str = "Tests per ray";

/// Measures the tree in a file and the greedy tree, draws both, and writes the page.
pub fn report(args: &ReportArgs, answer: &mut Answer) -> Result<(), Error> {
    let out = output_or_free(args.out.as_ref(), || args.file.with_extension("html"))?;
    output_file("--out", &out, "html")?;
    let scene = scene_of(&args.file, &args.scene)?;
    let (tree, header) = tree_file::load(&args.file, &scene)?;
    let greedy = greedy(&scene)?;
    let view = framing::automatic(&scene, f64::from(WIDTH) / f64::from(HEIGHT));
    let (facts, film) = measure(&tree, &scene, &view)?;
    let (facts_of_greedy, film_of_greedy) = measure(&greedy, &scene, &view)?;
    // The page begins with what the tree is for.
    let is_for_tests = header.has_visits || header.objective == Objective::Layout;
    let minimised = match is_for_tests {
        true if scene.has_triangles() => TESTS,
        true => LAYOUT,
        false => AREA,
    };
    let place = facts.iter().position(|(name, _)| *name == minimised).unwrap_or(0);
    let gain = gain(facts[place].1, facts_of_greedy[place].1);
    let minimised = minimised.to_lowercase();
    let title = format!("{}: {gain} {minimised} against a plain build", scene.name);
    answer.say(&format!("{}: {title}", out.display()));
    answer.record("file", out.display().to_string());
    for ((name, baked), (_, greedy)) in facts.iter().zip(&facts_of_greedy) {
        answer.record(&snake(name), json!({ "baked": baked, "greedy": greedy }));
    }
    let ranges = [&film, &film_of_greedy].map(range);
    // The same colour must mean the same number of tests in both.
    let top = ranges[0].top.max(ranges[1].top);
    let picture = |pixels: &[[u8; 3]], caption: &str| {
        let png = png(WIDTH, pixels).map_err(WriteError::of(&out, "encode the picture"))?;
        let data = STANDARD.encode(png);
        Ok::<_, Error>(format!(
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\">\
             <figcaption>{caption}</figcaption></figure>\n"
        ))
    };
    let mut pictures = picture(&film.pixels, "The scene.")?;
    for (film, range, tree) in [(&film, ranges[0], "baked"), (&film_of_greedy, ranges[1], "greedy")]
    {
        let median = number(range.median);
        let caption = format!("Tests of each pixel's rays in the {tree} tree: median {median}.");
        pictures += &picture(&heat::colours(film, top), &caption)?;
    }
    let page = page(&title, &header, &table(&facts, &facts_of_greedy), &pictures, top);
    Reserved::new(&out, 0, args.out.is_none())?.write(&[page.as_bytes()])?;
    Ok(())
}

fn measure(tree: &Bvh, scene: &Scene, view: &View) -> Result<(Vec<Fact>, Film), Error> {
    let options = Options {
        samples: 1,
        depth: 0,
        ground: false,
        ..Options::new(WIDTH, HEIGHT, view.clone())
    };
    let accelerator = Accelerator::of_tree(&scene.primitives, tree);
    let film = render(scene, &accelerator, &options, &|| ());
    let tests = (film.counts.boxes + film.counts.objects) as f64 / film.rays.max(1) as f64;
    let mut facts = vec![
        (AREA, cost::internal_area(tree)),
        (LAYOUT, Objective::Layout.cost(tree)),
        ("Tests per ray of the picture, in the binary tree", tests),
        ("Depth", tree.depth() as f64),
        ("Nodes", tree.nodes.len() as f64),
    ];
    if scene.has_triangles() {
        let tests = Rays::Default.expected_tests(tree, scene)?;
        facts.insert(2, (TESTS, tests));
    }
    Ok((facts, film))
}

/// Returns the distribution of tests over the pixels whose rays meet the box of the scene. All other
/// rays have one test, which would hide the median of a small scene.
fn range(film: &Film) -> heat::Range {
    heat::range(film.tests.iter().copied().filter(|&tests| tests > 1).collect())
}

fn page(title: &str, header: &Header, table: &str, pictures: &str, top: f64) -> String {
    let colours = heat::scale(17).into_iter().map(|[r, g, b]| format!(", rgb({r} {g} {b})"));
    let colours: String = colours.collect();
    let (title, method, seed) = (escaped(title), escaped(&header.method), header.seed);
    let [objects, references, work, top] =
        [whole(header.objects), whole(header.references), whole(header.work), number(top)];
    let version = env!("CARGO_PKG_VERSION");
    format!(
        r#"<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>{STYLE}</style></head>
<body>
<h1>{title}</h1>
<p>{objects} objects, {references} references; {method}, seed {seed}, {work} nodes visited by the
search.</p>
{table}
<p>The greedy tree is a plain build along the file's axes, as by Müller and Fellner. Less is better,
but depth and nodes are no costs. Area of inner nodes, and the cost of the wide layout by area, are in
the scene's units. Tests per ray are expected ones in the wide layout, of rays from anywhere. A tree
baked for the wide layout saves tests there, and not always in the binary tree.</p>
<h2>Rays</h2>
<div class="pictures">{pictures}</div>
<div class="scale" style="background: linear-gradient(to right{colours})"></div>
<p class="ends"><span>0 tests</span><span>{top} or more, in one pixel of 200</span></p>
<p>Medians are over the pixels whose rays meet the box of the scene.</p>
<footer><p>Written by bvh {version}.</p></footer>
</body></html>
"#
    )
}

fn table(baked: &[Fact], greedy: &[Fact]) -> String {
    let rows = baked.iter().zip(greedy).map(|((name, baked), (_, greedy))| {
        let difference = match *name {
            "Depth" | "Nodes" => String::new(),
            _ => gain(*baked, *greedy),
        };
        let [baked, greedy] = [*baked, *greedy].map(number);
        format!("<tr><td>{name}</td><td>{baked}</td><td>{greedy}</td><td>{difference}</td></tr>\n")
    });
    let rows: String = rows.collect();
    format!(
        "<table>\n<tr><th></th><th>baked</th><th>greedy</th><th>difference</th></tr>\n{rows}</table>"
    )
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 && value >= 0.0 { whole(value as u64) } else { short(value) }
}
