//! Who is ahead at each budget: every other library's time and cost, and the cost of `best` given the same time.
//!
//! `cargo bench -p harness --bench peers --features peers -- [--rounds N] SCENE...`
//!
//! With `RUSTFLAGS="-C target-cpu=native"`, which `obvhs` gains from. One thread, one object per leaf, cost over that
//! of greedy Müller–Fellner. A library's time is its least over the rounds, without the conversion of its tree; the
//! time of `best` is that of the whole call. Rounds are in turns. Of the rounds of `best`, that of least cost among
//! those that were done in the library's time, as far as a clock tells; else the quickest.

mod clock;

use bvh_build::{Builder, muller_fellner};
use bvh_core::cost;
use harness::peers::{NoSettings, Obvhs, Peer, Preset};
use harness::scenes::Scene;

/// The part of a library's time that `best` may plan with: other programs disturb both.
const PLANNED: f64 = 0.99;

/// What counts as the same time.
const SAME: f64 = 1.02;

fn main() {
    let (mut rounds, mut scenes) = (15, Vec::new());
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--rounds" => {
                rounds = arguments.next().and_then(|text| text.parse().ok()).expect("a number of rounds")
            }
            _ => scenes.push(argument),
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    println!("{:<16} {:<18} {:>9} {:>7} {:>9} {:>7}", "scene", "library", "time/ms", "cost", "best/ms", "cost");
    for name in scenes {
        match Scene::load(&name) {
            Ok(scene) => pool.install(|| measure(&scene, rounds)),
            Err(error) => println!("{error}"),
        }
    }
}

fn libraries() -> Vec<(String, Peer)> {
    let presets = [
        ("fastest", Preset::Fastest),
        ("very fast", Preset::VeryFast),
        ("fast", Preset::Fast),
        ("medium", Preset::Medium),
        ("slow", Preset::Slow),
        ("very slow", Preset::VerySlow),
    ];
    let obvhs = presets
        .map(|(name, preset)| (format!("obvhs {name}"), Peer::Obvhs(Obvhs { preset, reinsertion: None })));
    obvhs.into_iter().chain([("bvh".into(), Peer::Bvh(NoSettings {}))]).collect()
}

fn measure(scene: &Scene, rounds: usize) {
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("finite boxes");
    let base = cost::internal_area(&greedy);
    let name = scene.name.rsplit('/').next().unwrap_or_default();
    for (library, peer) in libraries() {
        let theirs = || peer.build(scene).expect("a library of this program");
        // The first times are for memory, caches and the limit.
        let mut least = (0..3).map(|_| theirs().seconds).fold(f64::INFINITY, f64::min);
        let (mut their_cost, mut ours) = (f64::INFINITY, Vec::new());
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
