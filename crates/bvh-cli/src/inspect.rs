//! `bvh inspect` and `bvh verify`: report the origin of a tree file, and the costs and the shape of
//! its tree.

use crate::Error;
use crate::answer::{Answer, frame_facts, saved};
use crate::arguments::{greedy, output_file, scene_of};
use crate::output::write_table;
use crate::rays::Rays;
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_core::file::Header;
use bvh_core::{Bvh, NodeKind};
use bvh_scenes::{files, tree_file};
use clap::Args;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Report the origin of a tree file, and the costs, depth, arity and validity of its tree.
#[derive(Args, Clone, Debug)]
pub struct InspectArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file. Checks the tree against the scene's
    /// objects, and compares it with the greedy tree.
    pub scene: Option<String>,
    /// Measure the expected tests of rays in the wide layout of the tree: `default` for rays that
    /// need no camera, or a file that describes the rays of a renderer. No bake trains on the same
    /// default rays.
    #[arg(long, value_name = "default|FILE.toml", requires = "scene")]
    pub rays: Option<String>,
    /// Write the nodes to a CSV file, one row each, in full precision.
    #[arg(long, value_name = "NODES.csv")]
    pub nodes: Option<PathBuf>,
}

/// Prints the facts about a file. Rejects a damaged file, and a file for a different scene.
pub fn inspect(args: &InspectArgs, answer: &mut Answer) -> Result<(), Error> {
    // A wrong path is reported before the scene is loaded, which may take long.
    if let Some(nodes) = &args.nodes {
        output_file("--nodes", nodes, "csv")?;
    }
    let rays = args.rays.as_deref().map(Rays::read).transpose()?;
    let scene = args.scene.as_deref().map(|scene| scene_of(&args.file, scene)).transpose()?;
    let (tree, header) = tree_file::load(&args.file, scene.as_ref())?;
    // Rays that miss the scene are rejected before the first fact is printed.
    let tests = match (&rays, &scene) {
        (Some(rays), Some(scene)) => Some(rays.expected_tests(&tree, scene)?),
        _ => None,
    };
    match &scene {
        Some(scene) => {
            answer.say("valid: yes, over this scene's objects");
            answer.record("valid", true);
            answer.fact("scene", scene.name.as_str());
        }
        // Without a scene there are no boxes to check against, which the fact must not hide.
        None => {
            answer.say("valid: as a tree; name a scene to check its objects too");
            answer.record("valid", true);
            answer.record("scene", serde_json::Value::Null);
        }
    }
    answer.fact("version", Header::VERSION);
    answer.fact("bytes", files::regular(&args.file)?);
    describe(&header, answer);
    answer.fact("frame", frame_facts(tree.frame.as_ref()));
    answer.fact("cost", header.objective.cost(&tree));
    measure(&tree, answer);
    // The build cannot fail, because a valid tree over these boxes proves that they are finite.
    if let Some(scene) = &scene
        && let Ok(greedy) = greedy(scene)
    {
        let base = cost::internal_area(&greedy);
        answer.fact("greedy area", base);
        answer.fact("saved", saved(cost::internal_area(&tree), base));
    }
    if let Some(tests) = tests {
        answer.fact("tests per ray", tests);
    }
    if let Some(path) = &args.nodes {
        write_nodes(&tree, path)?;
    }
    Ok(())
}

/// Writes the nodes as CSV, whose columns docs/use/TREE_FILES.md describes.
fn write_nodes(tree: &Bvh, path: &Path) -> Result<(), Error> {
    // The flat tree stores no parents, so one pass over all children finds them.
    let mut parents = vec![None; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        parents[node.children()].fill(Some(index));
    }
    let rows = tree.nodes.iter().zip(parents).enumerate().map(|(index, (node, parent))| {
        let (kind, first, count) = match node.kind() {
            NodeKind::Inner { first, count } => ("inner", first, count),
            NodeKind::Leaf { first, count } => ("leaf", first, count),
        };
        (index, parent, kind, first, count, node.aabb.min.to_array(), node.aabb.max.to_array())
    });
    let columns = "node,parent,kind,first,count,min_x,min_y,min_z,max_x,max_y,max_z";
    write_table(path, columns, rows)
}

fn describe(header: &Header, answer: &mut Answer) {
    answer.fact("method", header.method.as_str());
    // Digits in groups would be no seed on the command line.
    answer.say(&format!("seed: {}", header.seed));
    answer.record("seed", header.seed);
    answer.fact("work", header.work);
    answer.fact("objective", objective(&header.objective));
    answer.fact("cost when saved", header.cost);
    answer.fact("checksum of the scene", format!("{:08x}", header.scene));
    answer.fact("objects", header.objects);
    answer.fact("precision", if header.is_double { "double" } else { "single" });
    answer.fact("references", header.references);
    answer.fact("nodes", header.nodes);
}

fn objective(objective: &Objective) -> String {
    match objective {
        Objective::InternalArea => "internal area".to_owned(),
        Objective::GoldsmithSalmon => "Goldsmith–Salmon".to_owned(),
        Objective::Layout => "cost of the wide layout".to_owned(),
        Objective::Sah(constants) => {
            let traversal = constants.traversal();
            let intersection = constants.intersection();
            format!("surface area heuristic, traversal {traversal}, intersection {intersection}")
        }
    }
}

fn measure(tree: &Bvh, answer: &mut Answer) {
    let area = cost::internal_area(tree);
    answer.fact("inner nodes", tree.inner_count());
    answer.fact("leaves", tree.nodes.len() - tree.inner_count());
    answer.fact("depth", tree.depth());
    answer.fact("area", area);
    answer.fact("area over root area", cost::over_root_area(tree, area));
    answer.fact("Goldsmith–Salmon cost", cost::goldsmith_salmon(tree));
    answer.fact("surface area heuristic", cost::sah(tree, &SahConstants::default()));
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
    answer.fact("inner nodes by children", histogram(&arities));
    answer.fact("leaves by objects", histogram(&leaves));
}

/// Lists sizes with their frequencies, such as `2 × 100, 3 × 7`.
fn histogram(counts: &BTreeMap<u32, usize>) -> String {
    let bins: Vec<String> =
        counts.iter().map(|(size, count)| format!("{size} × {count}")).collect();
    if bins.is_empty() { "none".into() } else { bins.join(", ") }
}
