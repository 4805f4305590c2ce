//! The time and cost of every other library, and the cost of `best` in the same time.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench peers -- [--rounds N] SCENE...`
//!
//! Use `RUSTFLAGS="-C target-cpu=native"`, which `obvhs` gains from. All run on one thread, with
//! one object per leaf, in interleaved rounds. Costs are ratios to greedy Müller–Fellner. A
//! library's time is its least over the rounds, without the conversion of its tree; the time of
//! `best` includes the full call. The table shows the round of `best` with the least cost among the
//! rounds that took no longer than the library, or the quickest round if all took longer.

mod clock;

use attic::{Preset, build_by_bvh, build_by_obvhs};
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, cost};
use bvh_scenes::Scene;
use clap::Parser;
use harness::peers::Built;

/// The fraction of a library's time that `best` may plan with, because other programs disturb both.
const PLANNED: f64 = 0.99;

/// The largest ratio of times that count as equal.
const SAME: f64 = 1.02;

#[derive(Parser)]
struct Args {
    /// Names or paths of scenes.
    #[arg(required = true)]
    scenes: Vec<String>,
    #[arg(long, default_value_t = 15)]
    rounds: usize,
    /// Cargo passes this to every benchmark.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let Args { scenes, rounds, .. } = Args::parse();
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    println!(
        "{:<16} {:<18} {:>9} {:>7} {:>9} {:>7}",
        "scene", "library", "time/ms", "cost", "best/ms", "cost"
    );
    for name in scenes {
        match Scene::load(&name) {
            Ok(scene) => pool.install(|| measure(&scene, rounds)),
            Err(error) => println!("{error}"),
        }
    }
}

/// A library's name and build.
type Peer = (String, Box<dyn Fn(&[Aabb]) -> Built>);

fn libraries() -> Vec<Peer> {
    let presets = [
        ("fastest", Preset::Fastest),
        ("very fast", Preset::VeryFast),
        ("fast", Preset::Fast),
        ("medium", Preset::Medium),
        ("slow", Preset::Slow),
        ("very slow", Preset::VerySlow),
    ];
    let mut libraries: Vec<Peer> = vec![("bvh".into(), Box::new(build_by_bvh))];
    for (name, preset) in presets {
        let build = move |boxes: &[Aabb]| build_by_obvhs(preset, boxes);
        libraries.push((format!("obvhs {name}"), Box::new(build)));
    }
    libraries
}

fn measure(scene: &Scene, rounds: usize) {
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("finite boxes");
    let base = cost::internal_area(&greedy);
    let name = scene.name.rsplit('/').next().unwrap_or_default();
    for (library, build) in libraries() {
        let theirs = || build(&scene.boxes);
        // The first builds warm memory and caches up, and their time sets the limit.
        let mut least = (0..3).map(|_| theirs().seconds).fold(f64::INFINITY, f64::min);
        let mut their_cost = f64::INFINITY;
        let mut ours = Vec::new();
        for round in 0..rounds {
            let built = theirs();
            least = least.min(built.seconds);
            their_cost = cost::internal_area(&built.tree) / base;
            let (taken, area) = clock::best(scene, PLANNED * least, round as u64);
            ours.push((taken, area / base));
        }
        let in_time = ours.iter().filter(|(taken, _)| *taken <= SAME * least);
        let (taken, our_cost) = *in_time
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .or(ours.iter().min_by(|a, b| a.0.total_cmp(&b.0)))
            .expect("one round or more");
        let ahead = taken <= SAME * least && our_cost <= their_cost;
        println!(
            "{name:<16} {library:<18} {:>9.3} {their_cost:>7.4} {:>9.3} {our_cost:>7.4} {}",
            1e3 * least,
            1e3 * taken,
            if ahead { "" } else { "behind" }
        );
    }
}
