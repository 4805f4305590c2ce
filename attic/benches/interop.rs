//! What rays cost in other people's tracers, in their own trees and in searched ones, written to
//! `results/interop`: counted tests, the same on every machine, and speeds.
//!
//! `scripts/interop [--time] [SCENE...]` builds the programs that this one calls, and runs it. With
//! scenes, it only prints their table.

mod tracer_scenes;

use ::bvh::bvh::Bvh as TheirBvh;
use ::obvhs::bvh2::builder::build_bvh2_from_tris;
use ::obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris, bvh2_to_cwbvh::bvh2_to_cwbvh};
use ::obvhs::{BvhBuildParams, traverse};
use attic::tracing::contender::{Batch, Trace};
use attic::tracing::rays::{coherence, query, rays};
use attic::tracing::speed::{in_turns, ratio_of_rounds};
use attic::{bvh, obvhs};
use bvh_build::{Builder, muller_fellner};
use bvh_core::export::Target;
use bvh_core::{Bvh, PreparedRay, Ray, TestCounts, Triangle, any_hit_by, nearest_hit_by};
use bvh_scenes::rays::{Kind, Viewpoint};
use bvh_scenes::{Scene, files, trace::Query};
use bvh_search::{Bake, Budget};
// For the library's macro.
use glam::UVec2;
use harness::processor::PROCESSOR;
use harness::statistics::{self, geometric_mean};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use tracer_scenes::scenes;

/// What every scene is searched for, in nodes visited.
const WORK: u64 = 100_000_000;
const RAYS: u32 = 16_384;
const ROUNDS: usize = 15;
const KINDS: [Kind; 3] = [Kind::Primary, Kind::Incoherent, Kind::Shadow];
/// The searched trees, and the references per triangle.
const SEARCHED: [(&str, f64); 2] = [("searched", 1.0), ("divided", 1.3)];
/// The scenes of the geometric means.
const BUILDINGS: &str = "sponza and kitchen";

/// What a test of a box, or a visit of a wide node, and a test of a triangle, or a block of four,
/// cost in a tracer.
fn costs(tracer: &str) -> [f64; 2] {
    match tracer {
        // What the library's wide tree is made by.
        "obvhs CwBvh" => [1.0, 0.3],
        "tinybvh BVH4_CPU" | "tinybvh BVH8_CPU" => [1.0, 1.0],
        binary => {
            let constants = Target::named(binary).expect("a target").constants;
            [0.5 * constants.traversal(), constants.intersection()]
        }
    }
}

/// Rays of one kind through a tree in a tracer.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Case {
    tracer: String,
    rays: String,
    tree: String,
}

/// What programs have measured in a scene.
#[derive(Default)]
struct Measured {
    /// The number of hits, tests of boxes, and tests of triangles.
    tests: BTreeMap<Case, [u64; 3]>,
    /// The seconds of each round.
    seconds: BTreeMap<Case, Vec<f64>>,
}

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let (flags, only): (Vec<_>, Vec<_>) =
        arguments.into_iter().partition(|word| word.starts_with("--"));
    assert!(flags.iter().all(|flag| flag == "--time"), "{flags:?}; accepted: --time");
    let rounds = if flags.is_empty() { 0 } else { ROUNDS };
    let mut of_buildings = BTreeMap::new();
    println!("{}", PROCESSOR.name());
    let mut tests =
        "tracer,scene,triangles,rays,count,tree,hits,box_tests,triangle_tests\n".to_owned();
    let mut gains = "tracer,scene,rays,tree,over,gain\n".to_owned();
    let mut speeds = "tracer,processor,scene,rays,count,rounds,tree,over,over_tree,ratio_median,\
                      ratio_low,ratio_high\n"
        .to_owned();
    for (scene, view) in scenes(&only) {
        let measured = measure(&scene, &view, rounds);
        let name = &*scene.name;
        for (Case { tracer, rays, tree }, [hits, boxes, triangles]) in &measured.tests {
            let all = scene.boxes.len();
            tests +=
                &format!("{tracer},{name},{all},{rays},{RAYS},{tree},{hits},{boxes},{triangles}\n");
        }
        compare(name, &measured, &mut gains, &mut speeds, &mut of_buildings);
    }
    let processor = PROCESSOR.name();
    for ((Case { tracer, rays, tree }, over), Ratios { tests, speeds: of_scenes }) in &of_buildings
    {
        let line = format!("{BUILDINGS:18} {tracer:16} {rays:10} {tree:8}");
        // Without the trees that a library can trace in one of the scenes only.
        if let [_, _] = tests[..] {
            let mean = geometric_mean(tests);
            println!("{line}  tests {mean:.2} over {over}");
            gains += &format!("{tracer},{BUILDINGS},{rays},{tree},{over},{mean:.4}\n");
        }
        if let [one, other] = of_scenes[..] {
            let mean = |of: usize| geometric_mean(&[one[of], other[of]]);
            let [low, middle, high] = [0, 1, 2].map(mean);
            println!("{line}  speed {middle:.2} [{low:.2}, {high:.2}] over {over}");
            speeds += &format!(
                "{tracer},\"{processor}\",{BUILDINGS},{rays},{RAYS},{ROUNDS},{tree},{over},,\
                 {middle:.4},{low:.4},{high:.4}\n"
            );
        }
    }
    if only.is_empty() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../results/interop");
        let mut tables = vec![("tracer_tests.csv", tests), ("tracer_gains.csv", gains)];
        if rounds > 0 {
            tables.push(("timing_tracers.csv", speeds));
        }
        for (file, text) in tables {
            files::write(&folder.join(file), text.as_bytes()).expect("a folder of results");
        }
    }
}

/// A searched tree over a tracer's own, one for each building: tests, and the low end, the median
/// and the high end of speeds.
#[derive(Default)]
struct Ratios {
    tests: Vec<f64>,
    speeds: Vec<[f64; 3]>,
}

/// Compares the searched trees of a scene with the best of each tracer's own ones, with the best of
/// those that divide no triangle, and with the default. Prints the first comparison.
fn compare(
    scene: &str,
    measured: &Measured,
    gains: &mut String,
    speeds: &mut String,
    of_buildings: &mut BTreeMap<(Case, &str), Ratios>,
) {
    let processor = PROCESSOR.name();
    let is_ours = |case: &Case| SEARCHED.iter().any(|(name, _)| case.tree == *name);
    let cases: BTreeSet<&Case> = measured.tests.keys().chain(measured.seconds.keys()).collect();
    let median = |seconds: &[f64]| statistics::median(seconds).expect("rounds");
    for case in cases.iter().filter(|case| is_ours(case)) {
        let Case { tracer, rays, tree } = case;
        let cost = |case: &Case| {
            let &[_, boxes, triangles] = measured.tests.get(case)?;
            let [node, triangle] = costs(tracer);
            Some(node * boxes as f64 + triangle * triangles as f64)
        };
        let own: Vec<&Case> = cases
            .iter()
            .filter(|own| !is_ours(own) && own.tracer == *tracer && own.rays == *rays)
            .copied()
            .collect();
        let whole = own.iter().filter(|own| !own.tree.contains("divided")).copied().collect();
        let default = own.iter().filter(|own| own.tree == "default").copied().collect();
        for (over, own) in [("best", own), ("best whole", whole), ("default", default)] {
            let mut line = format!("{scene:8} {tracer:16} {rays:10} {tree:8}");
            let mut of_case = Ratios::default();
            let best = own.iter().filter_map(|own| cost(own)).min_by(f64::total_cmp);
            if let (Some(theirs), Some(ours)) = (best, cost(case)) {
                let gain = theirs / ours;
                *gains += &format!("{tracer},{scene},{rays},{tree},{over},{gain:.4}\n");
                line += &format!("  tests {gain:.2}");
                of_case.tests.push(gain);
            }
            let timed = own.iter().filter_map(|own| Some((own, measured.seconds.get(own)?)));
            let fastest = timed.min_by(|(_, a), (_, b)| median(a).total_cmp(&median(b)));
            if let (Some((own, theirs)), Some(ours)) = (fastest, measured.seconds.get(case)) {
                let [middle, low, high] = ratio_of_rounds(theirs, ours);
                let own = &own.tree;
                *speeds += &format!(
                    "{tracer},\"{processor}\",{scene},{rays},{RAYS},{ROUNDS},{tree},{over},{own},\
                     {middle:.4},{low:.4},{high:.4}\n"
                );
                line += &format!("  speed {middle:.2} [{low:.2}, {high:.2}] over {own}");
                of_case.speeds.push([low, middle, high]);
            }
            if over == "best" {
                println!("{line}");
            }
            if BUILDINGS.contains(scene) {
                let ratios = of_buildings.entry(((**case).clone(), over)).or_default();
                ratios.tests.extend(of_case.tests);
                ratios.speeds.extend(of_case.speeds);
            }
        }
    }
}

/// Measures all tracers. Those in other languages read the scene from a folder.
fn measure(scene: &Scene, view: &Viewpoint, rounds: usize) -> Measured {
    let triangles = scene.triangles().expect("triangles");
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("a tree");
    let searched = SEARCHED.map(|(name, references)| {
        let budget = Budget { max_work: Some(WORK), ..Budget::UNLIMITED };
        let bake = Bake { references, budget, ..Bake::new(&scene.boxes) };
        let bake = Bake { shapes: Some(&scene.primitives), ..bake };
        (name, bake.search(None, &()).expect("a tree").outcome.tree)
    });
    let fitted = |target: &Target, tree: &Bvh| target.fit_better(tree, &greedy, triangles).tree;
    let rays = KINDS.map(|kind| (kind, rays(kind, RAYS, scene, &greedy, view, 1)));
    let mut measured = Measured::default();

    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = top.join("target/interop").join(&scene.name);
    let write = |file: &str, bytes: &[u8]| {
        files::write(&folder.join(file), bytes).expect("a folder of scenes");
    };
    std::fs::create_dir_all(&folder).expect("a folder of scenes");
    write("triangles.bin", bytemuck::cast_slice(triangles));
    for (kind, rays) in &rays {
        let numbers: Vec<f32> = rays.iter().flat_map(numbers).collect();
        write(&format!("{}.bin", kind.name()), bytemuck::cast_slice(&numbers));
    }
    for target in [Target::THREE_MESH_BVH, Target::TINYBVH, Target::MADMANN91_BVH] {
        for (name, tree) in &searched {
            let bytes = target.bytes(&fitted(&target, tree), &scene.boxes);
            write(&format!("{name}.{}.bin", target.name), &bytes);
        }
    }
    let compiled = top.join("target/ray-peers/interop");
    let script = top.join("crates/bvh-js/bench/interop.js");
    let mut node = Command::new("node");
    node.arg(script);
    for mut program in [Command::new(compiled), node] {
        program.arg(&folder).arg(rounds.to_string());
        let output = program.args(SEARCHED.map(|(name, _)| name)).output();
        let output = output.unwrap_or_else(|error| panic!("{program:?}: {error}"));
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program:?}: {errors}");
        let said = String::from_utf8_lossy(&output.stdout);
        // tinybvh adds warnings.
        let is_row = |line: &&str| line.starts_with("tests,") || line.starts_with("times,");
        for line in said.lines().filter(is_row) {
            measured.read(line).unwrap_or_else(|| panic!("{program:?}: {line}"));
        }
    }
    let contenders = contenders(&searched, &fitted, scene, triangles);
    for (kind, rays) in &rays {
        let case = |contender: &Contender| Case {
            tracer: contender.tracer.into(),
            rays: kind.name().into(),
            tree: contender.tree.into(),
        };
        for contender in &contenders {
            let mut counts = TestCounts::default();
            let query = query(*kind);
            let is_hit = |ray: &&Ray| hits(&contender.counted, triangles, ray, query, &mut counts);
            let found = rays.iter().filter(is_hit).count() as u64;
            measured.tests.insert(case(contender), [found, counts.boxes, counts.objects]);
        }
        let coherence = coherence(*kind);
        let batch = Batch { query: query(*kind), coherence, in_squares: false, rays };
        let mut answers = vec![None; rays.len()];
        let trace = |at: usize| {
            let seconds = (contenders[at].trace)(&batch, &mut answers).expect("answers");
            seconds.iter().sum()
        };
        let seconds = in_turns(contenders.len(), rounds, trace);
        if rounds > 0 {
            measured.seconds.extend(contenders.iter().map(case).zip(seconds));
        }
    }
    eprintln!("{}", scene.name);
    measured
}

impl Measured {
    /// Adds what a program has written: a tracer, rays, a tree, and either three numbers of tests
    /// or the seconds of the rounds.
    fn read(&mut self, line: &str) -> Option<()> {
        let [what, tracer, rays, tree, numbers] =
            line.split(',').collect::<Vec<_>>().try_into().ok()?;
        let [tracer, rays, tree] = [tracer, rays, tree].map(str::to_owned);
        let case = Case { tracer, rays, tree };
        let numbers = numbers.split(' ');
        if what == "tests" {
            let tests = numbers.map(|number| number.parse().ok()).collect::<Option<Vec<u64>>>()?;
            self.tests.insert(case, tests.try_into().ok()?);
        } else {
            let seconds = numbers.map(|number| number.parse().ok()).collect::<Option<_>>()?;
            self.seconds.insert(case, seconds);
        }
        Some(())
    }
}

/// The eight numbers of a ray in a file.
fn numbers(ray: &Ray) -> [f32; 8] {
    let [[x, y, z], [dx, dy, dz]] = [ray.origin(), ray.direction()].map(|v| v.to_array());
    [x, y, z, ray.t_min(), dx, dy, dz, ray.t_max()]
}

/// A tree as its library traces it, for counts.
enum Counted {
    /// By the nearer child of two first. Where the library looks into a far leaf before a near
    /// node, it tests more triangles than are counted.
    Binary(Bvh),
    Wide(CwBvh),
}

/// A tree in a tracer in Rust.
struct Contender {
    tracer: &'static str,
    tree: &'static str,
    counted: Counted,
    trace: Trace<'static>,
}

/// Returns the trees of the libraries in Rust, and for each the searched ones.
fn contenders(
    searched: &[(&'static str, Bvh)],
    fitted: &dyn Fn(&Target, &Bvh) -> Bvh,
    scene: &Scene,
    triangles: &[Triangle],
) -> Vec<Contender> {
    let mut contenders = Vec::new();
    let mut add = |tracer, tree, counted, trace| {
        contenders.push(Contender { tracer, tree, counted, trace });
    };
    let mut shapes = bvh::shapes(triangles);
    let own = TheirBvh::build(&mut shapes);
    let counted = Counted::Binary(bvh::to_our_tree(&own, &scene.boxes));
    add("bvh", "own", counted, bvh::trace(own, shapes.clone()));
    let theirs = obvhs::triangles(triangles);
    let slow = BvhBuildParams::very_slow_build();
    for (name, parameters) in [
        ("medium", BvhBuildParams::medium_build()),
        ("very slow whole", BvhBuildParams { pre_split: false, ..slow }),
        ("very slow divided", slow),
        ("reinsertion 4 divided", BvhBuildParams { reinsertion_batch_ratio: 4.0, ..slow }),
    ] {
        let mut time = Default::default();
        let binary = build_bvh2_from_tris(&theirs, parameters, &mut time);
        let counted = Counted::Binary(obvhs::to_our_tree(&binary));
        add("obvhs", name, counted, obvhs::trace_binary(binary, &theirs));
        let wide = build_cwbvh_from_tris(&theirs, parameters, &mut time);
        let counted = Counted::Wide(wide.clone());
        add("obvhs CwBvh", name, counted, obvhs::trace_wide(wide, &theirs));
    }
    for (name, tree) in searched {
        let ours = fitted(&Target::BVH, tree);
        let binary = bvh::to_theirs(&ours, &mut shapes);
        add("bvh", name, Counted::Binary(ours), bvh::trace(binary, shapes.clone()));
        let ours = fitted(&Target::OBVHS, tree);
        let binary = obvhs::to_theirs(&ours);
        add("obvhs", name, Counted::Binary(ours), obvhs::trace_binary(binary, &theirs));
        let wide = bvh2_to_cwbvh(&obvhs::to_theirs(tree), 3, true, false);
        let counted = Counted::Wide(wide.clone());
        add("obvhs CwBvh", name, counted, obvhs::trace_wide(wide, &theirs));
    }
    contenders
}

/// Returns whether a ray hits anything, and counts its tests.
fn hits(
    counted: &Counted,
    triangles: &[Triangle],
    ray: &Ray,
    query: Query,
    counts: &mut TestCounts,
) -> bool {
    let prepared = PreparedRay::new(ray);
    let distance = |id: u32, most| triangles[id as usize].intersect(&prepared, most);
    match (counted, query) {
        (Counted::Binary(tree), Query::Any) => {
            any_hit_by(tree, ray, |id| distance(id, ray.t_max()).is_some(), counts)
        }
        (Counted::Binary(tree), _) => nearest_hit_by(tree, ray, distance, counts).is_some(),
        (Counted::Wide(tree), query) => {
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
