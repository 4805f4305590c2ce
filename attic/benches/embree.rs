//! Our trees in Embree's kernels: which part of a ratio of speeds is the tree's, and which part the
//! kernel's. Written to `results/interop/timing_embree.csv`.
//!
//! `scripts/interop --embree [SCENE...]` fetches Embree's library, and runs this. With scenes, it
//! only prints their table. Both are held to AVX2.

mod embree_library;
mod tracer_scenes;

use attic::tracing::answers::disagreements;
use attic::tracing::contender::{Batch, Tracer};
use attic::tracing::rays::{coherence, is_in_squares, query, rays};
use attic::tracing::speed::{in_turns, ratio_of_rounds};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::{Bvh, Hit, Kernel, WideBvh};
use bvh_scenes::rays::{Kind, Viewpoint};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_scenes::{Scene, files};
use bvh_search::{Bake, Budget};
use embree_library::{Calls, Embree, Traced};
use harness::processor::PROCESSOR;
use harness::statistics::{geometric_mean, median};
use std::collections::BTreeMap;
use std::path::Path;
use tracer_scenes::scenes;

/// What every scene is searched for, in nodes visited.
const WORK: u64 = 300_000_000;
const RAYS: u32 = 65_536;
const ROUNDS: usize = 15;
const KINDS: [Kind; 4] = [Kind::Primary, Kind::Bounce, Kind::Shadow, Kind::Incoherent];
/// Embree's own trees; the second one divides triangles.
const OWN: [&str; 2] = ["default", "high quality"];
/// The searched trees, and the references per triangle. Both kernels visit nodes of eight children
/// and blocks of four triangles, so that their cost is the one to search by.
const SEARCHED: [(&str, f64); 2] = [("searched", 1.0), ("divided", 1.3)];
/// The scenes of the geometric means, those of experiments/peers.toml and the smooth ones.
const MEANS: [(&str, &[&str]); 2] = [
    ("geometric mean", &["sponza", "kitchen", "cloister", "escher"]),
    ("smooth", &["spot", "knot", "pebble"]),
];

/// A tree in a kernel.
struct Contender<'a> {
    kernel: &'static str,
    tree: &'static str,
    mode: &'static str,
    tracer: Tracer<'a>,
}

impl Contender<'_> {
    /// Answers the rays, and returns the seconds.
    fn trace(&self, batch: &Batch, hits: &mut [Option<Hit>]) -> f64 {
        self.tracer.trace(batch, hits).expect("answers").iter().sum()
    }
}

/// Ratios of speeds by what is called, the part that they tell, the tree and the rays.
type Ratios = BTreeMap<[&'static str; 4], BTreeMap<String, [f64; 3]>>;

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let folder = words.next().expect("the folder of Embree's library");
    let embree = Embree::load(Path::new(&folder));
    let only: Vec<String> = words.collect();
    let processor = PROCESSOR.name();
    println!("{processor}");
    let mut table =
        "calls,part,tree,processor,scene,rays,count,rounds,mode,over,million_rays,unlike,\
                     ratio_median,ratio_low,ratio_high\n"
            .to_owned();
    let mut ratios = Ratios::new();
    for (scene, view) in scenes(&only) {
        table += &measure(&embree, &scene, &view, &processor, &mut ratios);
    }
    for ([calls, part, tree, rays], of_scenes) in &ratios {
        for (name, scenes) in MEANS {
            let found: Option<Vec<[f64; 3]>> =
                scenes.iter().map(|scene| of_scenes.get(*scene).copied()).collect();
            let Some(found) = found else { continue };
            let mean =
                |of: usize| geometric_mean(&found.iter().map(|all| all[of]).collect::<Vec<_>>());
            let [middle, low, high] = [0, 1, 2].map(mean);
            println!(
                "{calls:6} {part:6} {tree:12} {name:14} {rays:10} {middle:.2} [{low:.2}, {high:.2}]"
            );
            table += &format!(
                "{calls},{part},{tree},\"{processor}\",{name},{rays},{RAYS},{ROUNDS},,,,,\
                 {middle:.4},{low:.4},{high:.4}\n"
            );
        }
    }
    if only.is_empty() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../results/interop");
        let file = folder.join("timing_embree.csv");
        files::write(&file, table.as_bytes()).expect("a folder of results");
    }
}

/// Traces all rays of a scene by all trees and kernels, and returns the rows.
fn measure(
    embree: &Embree,
    scene: &Scene,
    view: &Viewpoint,
    processor: &str,
    ratios: &mut Ratios,
) -> String {
    let triangles = scene.triangles().expect("triangles");
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("a tree");
    let trees = SEARCHED.map(|(name, references)| {
        let budget = Budget { max_work: Some(WORK), ..Budget::UNLIMITED };
        let bake = Bake { references, budget, ..Bake::new(&scene.boxes) };
        let objective = Some(Objective::Layout);
        let bake = Bake { shapes: Some(&scene.primitives), objective, ..bake };
        let tree = bake.search(None, &()).expect("a tree").outcome.tree;
        let wide = WideBvh::new(&tree, triangles).expect("a valid tree");
        (name, wide.with_kernel(Kernel::Avx2).expect("a processor with AVX2"))
    });
    let own = OWN.map(|name| (name, Traced::own(embree, triangles, name != OWN[0])));
    let of_ours = |(name, wide): &(&'static str, WideBvh)| {
        (*name, Traced::with_tree(embree, triangles, &wide.to_tree()))
    };
    let in_embree: Vec<(&str, Traced)> = own.into_iter().chain(trees.iter().map(of_ours)).collect();
    let contenders = contenders(&in_embree, &trees, scene);
    let mut rows = String::new();
    for kind in KINDS {
        let rays = rays(kind, RAYS, scene, &greedy, view, 1);
        let in_squares = is_in_squares(kind, RAYS);
        let batch =
            Batch { query: query(kind), coherence: coherence(kind), in_squares, rays: &rays };
        let unlike = unlike(&contenders, &batch, &greedy);
        let mut hits = vec![None; rays.len()];
        let trace = |at: usize| contenders[at].trace(&batch, &mut hits);
        let seconds = in_turns(contenders.len(), ROUNDS, trace);
        let middle = |at: usize| median(&seconds[at]).expect("rounds");
        for (calls, part, one, over) in comparisons(&contenders, middle) {
            let [ratio, low, high] = ratio_of_rounds(&seconds[over], &seconds[one]);
            let Contender { tree, mode, .. } = contenders[one];
            let over = format!("{}: {}", contenders[over].tree, contenders[over].mode);
            let (name, kind, count, unlike) = (&scene.name, kind.name(), rays.len(), unlike[one]);
            let speed = count as f64 / middle(one) / 1e6;
            println!(
                "{name:8} {kind:10} {calls:6} {part:6} {tree:12} {speed:7.2} {ratio:.2} [{low:.2}, {high:.2}] \
                 {mode} over {over}, {unlike} unlike"
            );
            rows += &format!(
                "{calls},{part},{tree},\"{processor}\",{name},{kind},{count},{ROUNDS},{mode},{over},\
                 {speed:.3},{unlike},{ratio:.4},{low:.4},{high:.4}\n"
            );
            let of_scenes = ratios.entry([calls, part, tree, kind]).or_default();
            of_scenes.insert(name.clone(), [ratio, low, high]);
        }
    }
    rows
}

/// Returns all trees in Embree's kernels and ours in our own, by every kind of calls.
fn contenders<'a>(
    in_embree: &'a [(&'static str, Traced)],
    ours: &[(&'static str, WideBvh)],
    scene: &'a Scene,
) -> Vec<Contender<'a>> {
    let mut contenders = Vec::new();
    for (tree, traced) in in_embree {
        for (mode, calls) in [
            ("single", Calls::Single),
            ("packets", Calls::Eight),
            ("coherent packets", Calls::EightTogether),
        ] {
            let trace =
                move |batch: &Batch, hits: &mut [Option<Hit>]| Ok(traced.trace(calls, batch, hits));
            let tracer = Tracer::Other(Box::new(trace));
            contenders.push(Contender { kernel: "embree", tree, mode, tracer });
        }
    }
    for (tree, wide) in ours {
        let structure = Structure::Wide(wide.clone());
        let single = Tracer::Own(Accelerator::new(&scene.primitives, structure));
        for (mode, tracer) in [("single", single), ("batches", Tracer::Batches(wide.clone()))] {
            contenders.push(Contender { kernel: "ours", tree, mode, tracer });
        }
    }
    contenders
}

/// Returns how many answers of each contender are not those of Embree's single calls in its default
/// tree. In Embree's kernels, equal distances have equal bits. Its coherent packets miss a few hits in
/// any tree.
fn unlike(contenders: &[Contender], batch: &Batch, greedy: &Bvh) -> Vec<u64> {
    let mut expected = vec![None; batch.rays.len()];
    contenders[0].trace(batch, &mut expected);
    let distance = |hit: &Option<Hit>| hit.map(|hit| hit.t);
    let count = |contender: &Contender| {
        let mut hits = vec![None; batch.rays.len()];
        contender.trace(batch, &mut hits);
        let unlike = if contender.kernel == "embree" {
            let pairs = expected.iter().zip(&hits);
            pairs.filter(|(a, b)| distance(a) != distance(b)).count() as u64
        } else {
            let found = disagreements(&expected, &hits, greedy, batch.rays);
            found.missed + found.false_hits + found.other
        };
        let Contender { kernel, tree, mode, .. } = contender;
        assert!(unlike * 100 <= hits.len() as u64, "{kernel} {tree} {mode}: {unlike} unlike");
        unlike
    };
    contenders.iter().map(count).collect()
}

/// Returns the calls, the part that a ratio tells, and the contender over another: both are the
/// fastest of those calls, by their seconds.
fn comparisons(
    contenders: &[Contender],
    seconds: impl Fn(usize) -> f64,
) -> Vec<(&'static str, &'static str, usize, usize)> {
    let mut comparisons = Vec::new();
    for calls in ["single", "any"] {
        let fastest = |kernel: &str, trees: &[&str]| {
            let is_of = |at: &usize| {
                let Contender { kernel: its, tree, mode, .. } = contenders[*at];
                its == kernel && trees.contains(&tree) && (calls == "any" || mode == calls)
            };
            let all = (0..contenders.len()).filter(is_of);
            all.min_by(|&a, &b| seconds(a).total_cmp(&seconds(b))).expect("a contender")
        };
        let own = fastest("embree", &OWN);
        comparisons.extend(OWN.map(|tree| (calls, "tree", fastest("embree", &[tree]), own)));
        for (tree, _) in SEARCHED {
            let [theirs, ours] = ["embree", "ours"].map(|kernel| fastest(kernel, &[tree]));
            comparisons.push((calls, "tree", theirs, own));
            comparisons.push((calls, "kernel", ours, theirs));
            comparisons.push((calls, "both", ours, own));
        }
    }
    comparisons
}
