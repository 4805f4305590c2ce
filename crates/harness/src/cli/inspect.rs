//! `harness inspect` and `verify`: what a tree file is, what its tree costs, and what it looks like.

use crate::cli::arguments::{NODES, input_folder, output_file};
use crate::cli::output::{print_error, print_line};
use crate::run::columns::Columns;
use crate::run::{archive, reference, rows};
use crate::scenes::Scene;
use crate::{Error, files};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_core::file::{FileError, Header, TreeFile};
use bvh_core::{Bvh, NodeKind, validate_references};
use clap::Args;
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
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
    /// Print the facts as JSON, under the same names.
    #[arg(long)]
    pub json: bool,
}

/// One row of `FILE.csv` of `harness inspect --nodes FILE.csv`: a node of a tree.
#[derive(Serialize, JsonSchema)]
struct NodeRow {
    /// Its number, 0 for the root.
    node: usize,
    /// Empty for the root.
    parent: Option<usize>,
    /// `inner` or `leaf`.
    kind: &'static str,
    /// Of an inner node the first child, of a leaf its first place in the list of objects.
    first: u32,
    /// Number of children, or of objects.
    count: u32,
    /// Lower corner of its box, in world units.
    min_x: f32,
    /// Likewise.
    min_y: f32,
    /// Likewise.
    min_z: f32,
    /// Upper corner.
    max_x: f32,
    /// Likewise.
    max_y: f32,
    /// Likewise.
    max_z: f32,
}

/// The columns of the nodes' file.
pub fn columns() -> Columns {
    Columns::of::<NodeRow>()
}

/// Facts by name, in the order in which they are printed: as a text, and as JSON.
#[derive(Default)]
struct Facts(Vec<(String, String, serde_json::Value)>);

impl Facts {
    fn add(&mut self, what: &str, value: impl Display + Serialize) {
        self.0.push((what.into(), value.to_string(), json!(value)));
    }
}

impl Display for Facts {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|(what, text, _)| writeln!(f, "{what}: {text}"))
    }
}

impl Serialize for Facts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(what, _, value)| (what, value)))
    }
}

/// Inspects a file, and prints a line per fact, `what: value`, or JSON. Refuses a file that is damaged, or for another scene than
/// the one named.
pub fn inspect(args: &InspectArgs) -> Result<(), Error> {
    if let Some(nodes) = &args.nodes {
        output_file("--nodes", nodes, &NODES)?;
    }
    let scene = args.scene.as_deref().map(Scene::load).transpose()?;
    let (tree, facts) = examine(&args.file, scene.as_ref())?;
    if let Some(path) = &args.nodes {
        write_nodes(&tree, path)?;
    }
    print(&facts, args.json);
    Ok(())
}

/// Prove that a tree file, whoever made it, holds a tree for a scene, and compare its cost with the best known.
#[derive(Args, Clone, Debug)]
pub struct VerifyArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The scene it is for, by name or path of an OBJ file.
    pub scene: String,
    /// Folder with the best known costs, by default `results`, if it is there.
    #[arg(long, value_name = "DIR")]
    pub results: Option<PathBuf>,
    /// If the tree is the best known, keep it in the archive among the results, with the command that made it.
    #[arg(long, value_name = "COMMAND", value_parser = clap::builder::NonEmptyStringValueParser::new())]
    pub keep: Option<String>,
    /// Print the facts as JSON, under the same names.
    #[arg(long)]
    pub json: bool,
}

/// As [`inspect`], and says what the best known tree costs, which is a binary one with one object per leaf.
pub fn verify(args: &VerifyArgs) -> Result<(), Error> {
    args.results.iter().try_for_each(|folder| input_folder("--results", folder))?;
    let results = args.results.as_deref().unwrap_or(Path::new("results"));
    args.keep.iter().try_for_each(|_| input_folder("--keep", results))?;
    let scene = Scene::load(&args.scene)?;
    let (tree, mut facts) = examine(&args.file, Some(&scene))?;
    match reference::best_known(results, &scene)? {
        Some(best) => {
            facts.add("best known internal area", best.cost);
            facts.add("found by", best.method);
            facts.add("internal area over the best known", cost::internal_area(&tree) / best.cost);
        }
        None => facts.add("best known internal area", "none of this very scene"),
    }
    if let Some(command) = &args.keep {
        facts.add("kept in", archive::keep(results, &scene, &args.file, command)?.display().to_string());
    }
    print(&facts, args.json);
    Ok(())
}

fn print(facts: &Facts, as_json: bool) {
    print_line(&if as_json { format!("{:#}", json!(facts)) } else { facts.to_string() });
}

/// The tree in a file and the facts about it.
fn examine(path: &Path, scene: Option<&Scene>) -> Result<(Bvh, Facts), Error> {
    let bytes = files::read(path)?;
    let file = files::open_tree(path, &bytes)?;
    scene.iter().filter_map(|scene| scene.remark.as_ref()).for_each(|remark| print_error(remark));
    let mut facts = Facts::default();
    describe(file.header(), &bytes, &mut facts);
    let refused = |source| Error::TreeFile { path: path.to_owned(), source };
    let tree = file.tree().map_err(refused)?;
    measure(&tree, &mut facts);
    match scene {
        Some(scene) => against(&tree, file, scene, &mut facts).map_err(refused)?,
        None => facts.add("valid", "as a tree; with a scene its objects are checked too"),
    }
    Ok((tree, facts))
}

/// The facts in the header.
fn describe(header: &Header, bytes: &[u8], facts: &mut Facts) {
    let objective = match header.objective {
        Objective::InternalArea => "internal area".to_owned(),
        Objective::GoldsmithSalmon => "Goldsmith–Salmon".to_owned(),
        Objective::Layout => "cost of the wide layout, by area".to_owned(),
        Objective::Sah(constants) => {
            let (traversal, intersection) = (constants.traversal(), constants.intersection());
            format!("surface area heuristic, traversal {traversal}, intersection {intersection}")
        }
    };
    // The magic comes first, then the version.
    let version = bytes[Header::MAGIC.len()..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
    facts.add("version", version);
    facts.add("bytes", bytes.len());
    facts.add("method", &header.method);
    facts.add("seed", header.seed);
    facts.add("work", header.work);
    facts.add("objective", objective);
    facts.add("cost when saved", header.cost);
    facts.add("checksum of the scene", format!("{:08x}", header.scene));
    facts.add("objects", header.objects);
    facts.add("references", header.references);
    facts.add("nodes", header.nodes);
}

/// The facts that follow from the tree alone.
fn measure(tree: &Bvh, facts: &mut Facts) {
    let area = cost::internal_area(tree);
    facts.add("inner nodes", tree.inner_count());
    facts.add("leaves", tree.nodes.len() - tree.inner_count());
    facts.add("depth", tree.depth());
    facts.add("internal area", area);
    facts.add("internal area over root area", cost::over_root_area(tree, area));
    facts.add("Goldsmith–Salmon cost", cost::goldsmith_salmon(tree));
    facts.add("surface area heuristic", cost::sah(tree, &SahConstants::default()));
    let (mut arities, mut leaves) = (BTreeMap::new(), BTreeMap::new());
    for node in &tree.nodes {
        let (histogram, count) = match node.kind() {
            NodeKind::Inner { count, .. } => (&mut arities, count),
            NodeKind::Leaf { count, .. } => (&mut leaves, count),
        };
        *histogram.entry(count).or_insert(0usize) += 1;
    }
    facts.add("inner nodes by children", histogram(&arities));
    facts.add("leaves by objects", histogram(&leaves));
}

/// `2 × 100, 3 × 7`: sizes and how many have them.
fn histogram(counts: &BTreeMap<u32, usize>) -> String {
    let bins: Vec<String> = counts.iter().map(|(size, count)| format!("{size} × {count}")).collect();
    if bins.is_empty() { "none".into() } else { bins.join(", ") }
}

/// The facts that only the scene can tell.
fn against(tree: &Bvh, file: TreeFile, scene: &Scene, facts: &mut Facts) -> Result<(), FileError> {
    file.for_boxes(&scene.boxes)?;
    validate_references(tree, &scene.boxes, &scene.primitives)?;
    facts.add("scene", &scene.name);
    facts.add("valid", "yes, over this scene's objects");
    // Boxes that the file's checksum has accepted are finite: a valid tree lies around them.
    if let Ok(greedy) = muller_fellner::Config::default().build(&scene.boxes) {
        let base = cost::internal_area(&greedy);
        if base > 0.0 {
            facts.add("internal area over Müller–Fellner's", cost::internal_area(tree) / base);
        }
    }
    match scene.triangles() {
        Ok(triangles) => {
            let overlap = cost::end_point_overlap(tree, triangles, &SahConstants::default());
            facts.add("end-point overlap", overlap);
        }
        Err(_) => facts.add("end-point overlap", "of triangles only"),
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
