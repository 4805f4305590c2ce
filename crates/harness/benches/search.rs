//! The portfolio against the clock: percent below greedy Müller–Fellner, one triangle per leaf, after so many seconds.
//!
//! `cargo bench -p harness --bench search -- [--seconds 0.1,1,10,60] [--threads 1,2] [--seed N] SCENE...`
//!
//! The time is that of the whole call, build and final conversion included. Threads take turns, and every further
//! number of threads has 0.6 of the first one's time, so that a line should show no less in its later columns.

mod clock;

use bvh_build::{Builder, muller_fellner};
use bvh_core::cost;
use harness::scenes::Scene;

/// The part of the first number of threads' time that further ones have.
const LESS_TIME: f64 = 0.6;

/// The part of the time that the search may plan with: the conversion of its result takes the rest.
const PLANNED: f64 = 0.97;

fn main() {
    let (mut seconds, mut threads, mut seed) = (vec![0.1, 1.0, 10.0, 60.0], vec![1, 2], 1);
    let mut scenes = Vec::new();
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--seconds" => seconds = list(arguments.next()),
            "--threads" => threads = list(arguments.next()),
            "--seed" => seed = list(arguments.next())[0],
            _ => scenes.push(argument),
        }
    }
    println!("{:<24} {:>7} {:>7} {:>10} {:>10}", "scene", "threads", "limit/s", "taken/s", "below/%");
    for name in scenes {
        match Scene::load(&name) {
            Ok(scene) => measure(&scene, &seconds, &threads, seed),
            Err(error) => println!("{error}"),
        }
    }
}

/// The numbers of a list with commas.
fn list<T: std::str::FromStr>(text: Option<String>) -> Vec<T> {
    let number = |part: &str| part.parse().unwrap_or_else(|_| panic!("`{part}` is no number"));
    text.expect("an option wants a list").split(',').map(number).collect()
}

fn measure(scene: &Scene, seconds: &[f64], threads: &[usize], seed: u64) {
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("finite boxes");
    let base = cost::internal_area(&greedy);
    for &limit in seconds {
        for &threads in threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
            let limit = if threads > 1 { LESS_TIME * limit } else { limit };
            let (taken, area) = pool.install(|| clock::best(scene, PLANNED * limit, seed));
            let below = 100.0 * (1.0 - area / base);
            let name = scene.name.rsplit('/').next().unwrap_or_default();
            println!("{name:<24} {threads:>7} {limit:>7.2} {taken:>10.3} {below:>10.3}");
        }
    }
}
