//! The tests that rays take in the trees of other libraries in Rust, and in searched trees, counted
//! into `results/interop`: the same on every machine.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench interop [-- SCENE]`
//!
//! Needs `scripts/fetch-scenes`. With a scene, prints its rows instead.

use ::bvh::bvh::Bvh as TheirBvh;
use ::obvhs::bvh2::builder::build_bvh2_from_tris;
use ::obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris, bvh2_to_cwbvh::bvh2_to_cwbvh};
use ::obvhs::triangle::Triangle as TheirTriangle;
use ::obvhs::{BvhBuildParams, traverse};
use attic::{bvh, obvhs};
use bvh_core::cost::Objective;
use bvh_core::export::Target;
use bvh_core::{Bvh, PreparedRay, Ray, TestCounts, Triangle, any_hit_by, nearest_hit_by};
use bvh_scenes::rays::{Kind, Viewpoint, rays};
use bvh_scenes::{Scene, files, trace::Query};
use bvh_search::{Bake, Budget};
use glam::{UVec2, Vec3A};
use std::path::Path;

/// What every scene is searched for, in nodes visited.
const WORK: u64 = 100_000_000;
const RAYS: u32 = 65_536;
/// The scenes, and what is seen in fractions of their boxes, as in experiments/peers.toml.
const SCENES: [(&str, [[f64; 3]; 2]); 5] = [
    ("sponza", [[0.15, 0.25, 0.5], [0.9, 0.35, 0.5]]),
    ("kitchen", [[0.5, 0.6, 0.5], [0.9, 0.4, 0.9]]),
    ("cloister", [[0.2, 0.3, 0.3], [0.8, 0.4, 0.6]]),
    ("escher", [[1.9, 1.3, 2.2], [0.5; 3]]),
    ("spot", [[1.9, 1.3, 2.2], [0.5; 3]]),
];
/// What the library's wide tree is made by: a test of a triangle over one of a node.
const WIDE_TRIANGLE: f64 = 0.3;

/// A tree as its library traces it.
enum Traced {
    /// By the nearer child of two first. Where the library looks into a far leaf before a near
    /// node, it tests more triangles than are counted.
    Binary(Bvh),
    Wide(CwBvh),
}

/// A tree of a library, or a searched one.
struct Contender {
    tracer: &'static str,
    tree: &'static str,
    traced: Traced,
    /// What a test of a node's box and of a triangle cost.
    costs: [f64; 2],
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let only = arguments.iter().find(|name| SCENES.iter().any(|(scene, _)| scene == name));
    let mut tests =
        "tracer,scene,triangles,rays,count,tree,hits,box_tests,triangle_tests\n".to_owned();
    let mut gains = "tracer,scene,rays,tree,over,gain\n".to_owned();
    for (name, [eye, target]) in SCENES.iter().filter(|(name, _)| only.is_none_or(|o| o == name)) {
        let scene = Scene::load(name).unwrap_or_else(|error| panic!("{error}"));
        count(name, &scene, &Viewpoint { eye: *eye, target: *target }, &mut tests, &mut gains);
    }
    if only.is_some() {
        print!("{tests}{gains}");
        return;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../results/interop");
    for (file, text) in [("crate_tests.csv", tests), ("crate_gains.csv", gains)] {
        files::write(&folder.join(file), text.as_bytes()).expect("a folder of results");
    }
}

/// Appends the rows of a scene.
fn count(name: &str, scene: &Scene, view: &Viewpoint, tests: &mut String, gains: &mut String) {
    let triangles = scene.triangles().expect("a scene of triangles");
    let contenders = contenders(scene, triangles);
    let tree = &contenders.iter().find_map(|contender| match &contender.traced {
        Traced::Binary(tree) => Some(tree),
        Traced::Wide(_) => None,
    });
    for kind in [Kind::Primary, Kind::Incoherent, Kind::Shadow] {
        let rays = rays(kind, RAYS, scene, tree.expect("a binary tree"), view, 1);
        let mut costs = Vec::new();
        for Contender { tracer, tree, traced, costs: [node, triangle] } in &contenders {
            let mut counts = TestCounts::default();
            let is_hit = |ray: &&Ray| hits(traced, triangles, ray, kind.query(), &mut counts);
            let found = rays.iter().filter(is_hit).count();
            let TestCounts { boxes, objects } = counts;
            *tests += &format!(
                "{tracer},{name},{},{},{},{tree},{found},{boxes},{objects}\n",
                triangles.len(),
                kind.name(),
                rays.len(),
            );
            costs.push((*tracer, *tree, node * boxes as f64 + triangle * objects as f64));
        }
        for (tracer, tree, cost) in &costs {
            let own = costs.iter().filter(|(of, tree, _)| of == tracer && !is_ours(tree));
            let best = own.map(|(.., cost)| *cost).fold(f64::INFINITY, f64::min);
            if is_ours(tree) {
                *gains +=
                    &format!("{tracer},{name},{},{tree},best,{:.4}\n", kind.name(), best / cost);
            }
        }
    }
    eprintln!("{name}");
}

fn is_ours(tree: &str) -> bool {
    tree.starts_with("searched") || tree.starts_with("divided")
}

/// Returns the trees of all libraries, and for each the searched ones.
fn contenders(scene: &Scene, triangles: &[Triangle]) -> Vec<Contender> {
    let theirs: Vec<TheirTriangle> = triangles
        .iter()
        .map(|triangle| {
            let [v0, v1, v2] = triangle.0.map(Vec3A::from);
            TheirTriangle { v0, v1, v2 }
        })
        .collect();
    let binary = |target: Target, tree, built| {
        let costs = [0.5 * target.constants.traversal(), target.constants.intersection()];
        Contender { tracer: target.name, tree, traced: Traced::Binary(built), costs }
    };
    let wide = |tree, built| Contender {
        tracer: "obvhs CwBvh",
        tree,
        traced: Traced::Wide(built),
        costs: [1.0, WIDE_TRIANGLE],
    };
    let mut contenders = Vec::new();
    let own = TheirBvh::build(&mut bvh::shapes(triangles));
    contenders.push(binary(Target::BVH, "own", bvh::to_our_tree(&own, &scene.boxes)));
    let slow = BvhBuildParams::very_slow_build();
    let slowest = BvhBuildParams { reinsertion_batch_ratio: 4.0, ..slow };
    for (name, parameters) in [
        ("medium", BvhBuildParams::medium_build()),
        ("very slow", slow),
        ("reinsertion 4", slowest),
    ] {
        let mut time = Default::default();
        let built = build_bvh2_from_tris(&theirs, parameters, &mut time);
        contenders.push(binary(Target::OBVHS, name, obvhs::to_our_tree(&built)));
        contenders.push(wide(name, build_cwbvh_from_tris(&theirs, parameters, &mut time)));
    }
    for (name, references, objective) in [
        ("searched", 1.0, Objective::InternalArea),
        ("divided", 1.3, Objective::InternalArea),
        ("searched by layout", 1.0, Objective::Layout),
        ("divided by layout", 1.3, Objective::Layout),
    ] {
        let budget = Budget { max_work: Some(WORK), ..Budget::UNLIMITED };
        let bake =
            Bake { objective: Some(objective), references, budget, ..Bake::new(&scene.boxes) };
        let bake = Bake { shapes: Some(&scene.primitives), ..bake };
        let tree = bake.search(None, &()).expect("a tree").outcome.tree;
        if objective == Objective::InternalArea {
            for target in [Target::BVH, Target::OBVHS] {
                contenders.push(binary(target, name, target.fit(&tree)));
            }
        }
        contenders.push(wide(name, bvh2_to_cwbvh(&obvhs::to_theirs(&tree), 3, true, false)));
    }
    contenders
}

/// Returns whether a ray hits anything, and counts its tests.
fn hits(
    traced: &Traced,
    triangles: &[Triangle],
    ray: &Ray,
    query: Query,
    counts: &mut TestCounts,
) -> bool {
    let prepared = PreparedRay::new(ray);
    let distance = |id: u32, most| triangles[id as usize].intersect(&prepared, most);
    match (traced, query) {
        (Traced::Binary(tree), Query::Any) => {
            any_hit_by(tree, ray, |id| distance(id, ray.t_max()).is_some(), counts)
        }
        (Traced::Binary(tree), _) => nearest_hit_by(tree, ray, distance, counts).is_some(),
        (Traced::Wide(tree), query) => {
            let mut theirs = obvhs::to_their_ray(ray);
            let mut is_hit = false;
            let mut state = tree.new_traversal(theirs.direction);
            let mut node;
            traverse!(
                tree,
                node,
                state,
                {
                    counts.boxes += 1;
                    node.intersect_ray(&theirs, state.oct_inv4)
                },
                {
                    counts.objects += 1;
                    let id = tree.primitive_indices[state.primitive_id as usize];
                    if let Some(t) = distance(id, theirs.tmax) {
                        is_hit = true;
                        theirs.tmax = t;
                        if query == Query::Any {
                            break;
                        }
                    }
                }
            );
            is_hit
        }
    }
}
