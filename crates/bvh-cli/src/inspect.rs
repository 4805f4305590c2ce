//! `bvh inspect` and `bvh verify`: report the origin of a tree file, and the costs and the shape of
//! its tree.

use crate::arguments::output_file;
use crate::output::print_line;
use crate::rays::Rays;
use crate::scene_files::SceneFiles;
use crate::{Error, csv_table};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_core::file::{FileError, Header, TreeFile};
use bvh_core::{Aabb, Bvh, NodeKind, validate_references};
use bvh_scenes::Scene;
use bvh_scenes::files;
use bvh_scenes::tree_file::{self, TreeFileError};
use clap::Args;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

/// Report the origin of a tree file, and the costs, depth, arity and validity of its tree.
#[derive(Args, Clone, Debug)]
pub struct InspectArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file. Checks the tree against the scene's
    /// objects, and compares it with the Müller–Fellner tree.
    pub scene: Option<String>,
    /// Measure the expected tests of rays in the wide layout of the tree: `default` for rays that
    /// need no camera, or a file that describes the rays of a renderer. No bake trains on the same
    /// default rays.
    #[arg(long, value_name = "default|FILE.toml", requires = "scene")]
    pub rays: Option<String>,
    /// Write the nodes to a CSV file, one row each, in full precision.
    #[arg(long, value_name = "NODES.csv")]
    pub nodes: Option<PathBuf>,
    /// Permits files outside the scene's folder.
    #[command(flatten)]
    pub files: SceneFiles,
    /// Print the facts as JSON with the same names.
    #[arg(long)]
    pub json: bool,
}

/// The columns of the nodes, which docs/TREE_FILES.md describes.
const COLUMNS: &str = "node,parent,kind,first,count,min_x,min_y,min_z,max_x,max_y,max_z";

/// Named facts in the order of the output, each with its value as text and as JSON.
#[derive(Default)]
struct Facts(Vec<(String, String, serde_json::Value)>);

impl Facts {
    fn add(&mut self, name: &str, value: impl Display + Serialize) {
        self.0.push((name.into(), value.to_string(), json!(value)));
    }
}

impl Display for Facts {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|(name, text, _)| writeln!(f, "{name}: {text}"))
    }
}

impl Serialize for Facts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, _, value)| (name, value)))
    }
}

/// Inspects a file, and prints each fact as a line `name: value`, or all as JSON. Rejects a damaged
/// file, and a file for a different scene.
pub fn inspect(args: &InspectArgs) -> Result<(), Error> {
    // A wrong path is reported before the scene is loaded, which may take long.
    if let Some(nodes) = &args.nodes {
        output_file("--nodes", nodes, "csv")?;
    }
    let rays = args.rays.as_deref().map(Rays::read).transpose()?;
    let scene = args.scene.as_deref().map(|name| args.files.load(name)).transpose()?;
    if let (Some(named), Some(rays), Some(scene)) = (&args.rays, &rays, &scene) {
        rays.check(named, scene)?;
    }
    let (tree, mut facts) = examine(&args.file, scene.as_ref())?;
    if let (Some(rays), Some(scene)) = (rays, &scene) {
        let tests = rays.expected_tests(&tree, scene)?;
        facts.add("expected tests of a ray", tests);
    }
    if let Some(path) = &args.nodes {
        write_nodes(&tree, path)?;
    }
    print(&facts, args.json);
    Ok(())
}

/// Prove that a tree file from any source contains a tree for a scene. Computes validity and costs
/// again.
#[derive(Args, Clone, Debug)]
pub struct VerifyArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file.
    pub scene: String,
    /// Permits files outside the scene's folder.
    #[command(flatten)]
    pub files: SceneFiles,
    /// Print the facts as JSON with the same names.
    #[arg(long)]
    pub json: bool,
}

/// Does the same as [`inspect`], and requires a scene.
pub fn verify(args: &VerifyArgs) -> Result<(), Error> {
    let scene = args.files.load(&args.scene)?;
    let (_, facts) = examine(&args.file, Some(&scene))?;
    print(&facts, args.json);
    Ok(())
}

fn print(facts: &Facts, as_json: bool) {
    print_line(&if as_json { format!("{:#}", json!(facts)) } else { facts.to_string() });
}

/// Reads the tree in a file, and lists the facts about it.
fn examine(path: &Path, scene: Option<&Scene>) -> Result<(Bvh, Facts), Error> {
    let bytes = tree_file::read(path)?;
    let file = tree_file::open(path, &bytes)?;
    let mut facts = Facts::default();
    describe(file.header(), &bytes, &mut facts);
    let tree = file.tree().map_err(TreeFileError::of(path))?;
    measure(&tree, &mut facts);
    match scene {
        Some(scene) => against(&tree, file, scene, &mut facts).map_err(TreeFileError::of(path))?,
        // Without a scene there are no boxes to check against, which the fact must not hide.
        None => facts.add("valid", "as a tree; name a scene to check its objects too"),
    }
    Ok((tree, facts))
}

fn describe(header: &Header, bytes: &[u8], facts: &mut Facts) {
    let objective = match header.objective {
        Objective::InternalArea => "internal area".to_owned(),
        Objective::GoldsmithSalmon => "Goldsmith–Salmon".to_owned(),
        Objective::Layout => "cost of the wide layout, by area".to_owned(),
        Objective::Sah(constants) => {
            let traversal = constants.traversal();
            let intersection = constants.intersection();
            format!("surface area heuristic, traversal {traversal}, intersection {intersection}")
        }
    };
    // The version follows the magic number.
    let version =
        bytes[Header::MAGIC.len()..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
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

/// Adds the facts that follow from the tree alone.
fn measure(tree: &Bvh, facts: &mut Facts) {
    let area = cost::internal_area(tree);
    facts.add("inner nodes", tree.inner_count());
    facts.add("leaves", tree.nodes.len() - tree.inner_count());
    facts.add("depth", tree.depth());
    facts.add("internal area", area);
    facts.add("internal area over root area", cost::over_root_area(tree, area));
    facts.add("Goldsmith–Salmon cost", cost::goldsmith_salmon(tree));
    facts.add("surface area heuristic", cost::sah(tree, &SahConstants::default()));
    // Sorted by size, so that the same tree always gives the same line.
    let mut arities = BTreeMap::new();
    let mut leaves = BTreeMap::new();
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

/// Lists sizes with their frequencies, such as `2 × 100, 3 × 7`.
fn histogram(counts: &BTreeMap<u32, usize>) -> String {
    let bins: Vec<String> =
        counts.iter().map(|(size, count)| format!("{size} × {count}")).collect();
    if bins.is_empty() { "none".into() } else { bins.join(", ") }
}

fn against(tree: &Bvh, file: TreeFile, scene: &Scene, facts: &mut Facts) -> Result<(), FileError> {
    file.for_boxes(&scene.boxes)?;
    validate_references(tree, &scene.boxes, &scene.primitives)?;
    facts.add("scene", &scene.name);
    facts.add("valid", "yes, over this scene's objects");
    // The build cannot fail, because a valid tree over these boxes proves that they are finite.
    if let Ok(greedy) = muller_fellner::Config::default().build(&scene.boxes) {
        let base = cost::internal_area(&greedy);
        if base > 0.0 {
            facts.add("internal area over Müller–Fellner's", cost::internal_area(tree) / base);
        }
    }
    Ok(())
}

fn write_nodes(tree: &Bvh, path: &Path) -> Result<(), Error> {
    // The flat tree stores no parents, so one pass over all children finds them.
    let mut parents = vec![None; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        parents[node.children()].fill(Some(index));
    }
    let nodes = tree.nodes.iter().zip(parents).enumerate();
    let rows = nodes.map(|(index, (node, parent))| {
        let (kind, first, count) = match node.kind() {
            NodeKind::Inner { first, count } => ("inner", first, count),
            NodeKind::Leaf { first, count } => ("leaf", first, count),
        };
        let Aabb { min, max } = node.aabb;
        (index, parent, kind, first, count, min.to_array(), max.to_array())
    });
    let table = csv_table::to_bytes(COLUMNS, rows).map_err(Error::csv(path))?;
    Ok(files::write(path, &table)?)
}
