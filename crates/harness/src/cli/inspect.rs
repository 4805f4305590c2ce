//! `harness inspect`: what a tree file is, what its tree costs, and what it looks like.

use crate::cli::arguments::{NODES, output_file};
use crate::cli::output::{print_error, print_line};
use crate::scenes::Scene;
use crate::{Error, files, run::rows};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_core::file::{FileError, Header, TreeFile};
use bvh_core::{Bvh, NodeKind, validate};
use clap::Args;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Say what a tree file holds: its origin, costs, depth, arity, validity.
#[derive(Args, Clone, Debug)]
pub struct InspectArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The scene it is for, by name or path of a mesh file: checks the tree against its objects, compares it with
    /// Müller–Fellner's, and measures the end-point overlap.
    pub scene: Option<String>,
    /// Write the nodes to a CSV file, one row each, in full precision.
    #[arg(long, value_name = "NODES.csv")]
    pub nodes: Option<PathBuf>,
}

/// One row of the nodes' CSV file.
#[derive(Serialize)]
struct NodeRow {
    node: usize,
    /// Empty for the root.
    parent: Option<usize>,
    kind: &'static str,
    first: u32,
    count: u32,
    min_x: f32,
    min_y: f32,
    min_z: f32,
    max_x: f32,
    max_y: f32,
    max_z: f32,
}

/// Lines of `what: value`.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn add(&mut self, what: &str, value: impl std::fmt::Display) {
        self.0 += &format!("{what}: {value}\n");
    }
}

/// Inspects a file, and prints a line per fact, `what: value`. Refuses a file that is damaged, or for another scene than
/// the one named.
pub fn inspect(args: &InspectArgs) -> Result<(), Error> {
    if let Some(nodes) = &args.nodes {
        output_file("--nodes", nodes, &NODES)?;
    }
    let bytes = files::read(&args.file)?;
    let file = files::open_tree(&args.file, &bytes)?;
    let scene = args.scene.as_deref().map(Scene::load).transpose()?;
    scene.iter().filter_map(|scene| scene.remark.as_ref()).for_each(|remark| print_error(remark));
    let mut lines = Lines::default();
    describe(file.header(), bytes.len(), &mut lines);
    let refused = |source| Error::TreeFile { path: args.file.clone(), source };
    let tree = file.tree().map_err(refused)?;
    measure(&tree, &mut lines);
    if let Some(path) = &args.nodes {
        write_nodes(&tree, path)?;
    }
    match &scene {
        Some(scene) => against(&tree, file, scene, &mut lines).map_err(refused)?,
        None => lines.add("valid", "as a tree; with a scene its objects are checked too"),
    }
    print_line(&lines.0);
    Ok(())
}

/// The facts in the header.
fn describe(header: &Header, bytes: usize, lines: &mut Lines) {
    let objective = match header.objective {
        Objective::InternalArea => "internal area".into(),
        Objective::GoldsmithSalmon => "Goldsmith–Salmon".into(),
        Objective::Sah(constants) => {
            let (traversal, intersection) = (constants.traversal(), constants.intersection());
            format!("surface area heuristic, traversal {traversal}, intersection {intersection}")
        }
    };
    lines.add("version", Header::VERSION);
    lines.add("bytes", bytes);
    lines.add("method", &header.method);
    lines.add("seed", header.seed);
    lines.add("work", header.work);
    lines.add("objective", objective);
    lines.add("cost when saved", header.cost);
    lines.add("checksum of the scene", format_args!("{:08x}", header.scene));
    lines.add("objects", header.objects);
    lines.add("nodes", header.nodes);
}

/// The facts that follow from the tree alone.
fn measure(tree: &Bvh, lines: &mut Lines) {
    let area = cost::internal_area(tree);
    lines.add("inner nodes", tree.inner_count());
    lines.add("leaves", tree.nodes.len() - tree.inner_count());
    lines.add("depth", tree.depth());
    lines.add("internal area", area);
    lines.add("internal area over root area", cost::over_root_area(tree, area));
    lines.add("Goldsmith–Salmon cost", cost::goldsmith_salmon(tree));
    lines.add("surface area heuristic", cost::sah(tree, &SahConstants::default()));
    let (mut arities, mut leaves) = (BTreeMap::new(), BTreeMap::new());
    for node in &tree.nodes {
        let (histogram, count) = match node.kind() {
            NodeKind::Inner { count, .. } => (&mut arities, count),
            NodeKind::Leaf { count, .. } => (&mut leaves, count),
        };
        *histogram.entry(count).or_insert(0usize) += 1;
    }
    lines.add("inner nodes by children", histogram(&arities));
    lines.add("leaves by objects", histogram(&leaves));
}

/// `2 × 100, 3 × 7`: sizes and how many have them.
fn histogram(counts: &BTreeMap<u32, usize>) -> String {
    let bins: Vec<String> = counts.iter().map(|(size, count)| format!("{size} × {count}")).collect();
    if bins.is_empty() { "none".into() } else { bins.join(", ") }
}

/// The facts that only the scene can tell.
fn against(tree: &Bvh, file: TreeFile, scene: &Scene, lines: &mut Lines) -> Result<(), FileError> {
    file.for_boxes(&scene.boxes)?;
    validate(tree, &scene.boxes)?;
    lines.add("scene", &scene.name);
    lines.add("valid", "yes, over this scene's objects");
    // Boxes that the file's checksum has accepted are finite: a valid tree lies around them.
    if let Ok(greedy) = muller_fellner::Config::default().build(&scene.boxes) {
        let base = cost::internal_area(&greedy);
        if base > 0.0 {
            lines.add("internal area over Müller–Fellner's", cost::internal_area(tree) / base);
        }
    }
    match scene.triangles() {
        Ok(triangles) => {
            let overlap = cost::end_point_overlap(tree, triangles, &SahConstants::default());
            lines.add("end-point overlap", overlap);
        }
        Err(_) => lines.add("end-point overlap", "of triangles only"),
    }
    Ok(())
}

fn write_nodes(tree: &Bvh, path: &Path) -> Result<(), Error> {
    let mut parents = vec![None; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        parents[node.children()].fill(Some(index));
    }
    let row = |(node, parent): (usize, Option<usize>)| {
        let of = &tree.nodes[node];
        let (kind, first, count) = match of.kind() {
            NodeKind::Inner { first, count } => ("inner", first, count),
            NodeKind::Leaf { first, count } => ("leaf", first, count),
        };
        let ([min_x, min_y, min_z], [max_x, max_y, max_z]) = (of.aabb.min.to_array(), of.aabb.max.to_array());
        NodeRow { node, parent, kind, first, count, min_x, min_y, min_z, max_x, max_y, max_z }
    };
    let rows: Vec<NodeRow> = parents.into_iter().enumerate().map(row).collect();
    files::write(path, &rows::to_bytes(&rows, path)?)
}
