//! `best` against the clock: percent below greedy Müller–Fellner, one triangle per leaf, after each
//! limit in seconds.
//!
//! `cargo bench -p harness --bench search -- [--seconds 0.1,1,10,60] [--threads 1,2] [--seed N]
//! SCENE...`
//!
//! The time includes the build and the final conversion. The numbers of threads alternate. Runs on
//! more than one thread have 0.6 of the limit, and should reach the cost of one thread after the
//! full limit.

mod clock;

use bvh_build::{Builder, muller_fellner};
use bvh_core::cost;
use bvh_scenes::Scene;
use clap::Parser;

/// The fraction of the limit for runs on more than one thread.
const LESS_TIME: f64 = 0.6;

/// The fraction of the limit that the search may plan with; the conversion of its result needs the
/// rest.
const PLANNED: f64 = 0.97;

#[derive(Parser)]
struct Args {
    /// Names or paths of scenes of triangles.
    #[arg(required = true)]
    scenes: Vec<String>,
    /// Limits, in seconds.
    #[arg(long, value_delimiter = ',', default_value = "0.1,1,10,60")]
    seconds: Vec<f64>,
    /// Numbers of threads.
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    threads: Vec<usize>,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Cargo passes this to every benchmark.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let Args { scenes, seconds, threads, seed, .. } = Args::parse();
    println!(
        "{:<24} {:>7} {:>7} {:>10} {:>10}",
        "scene", "threads", "limit/s", "taken/s", "below/%"
    );
    for name in scenes {
        match Scene::load(&name) {
            Ok(scene) => measure(&scene, &seconds, &threads, seed),
            Err(error) => println!("{error}"),
        }
    }
}

fn measure(scene: &Scene, seconds: &[f64], threads: &[usize], seed: u64) {
    let greedy = muller_fellner::Config::default()
        .build(&scene.boxes)
        .expect("finite boxes");
    let base = cost::internal_area(&greedy);
    for &limit in seconds {
        for &threads in threads {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a pool of threads");
            let limit = if threads > 1 { LESS_TIME * limit } else { limit };
            let (taken, area) = pool.install(|| clock::best(scene, PLANNED * limit, seed));
            let below = 100.0 * (1.0 - area / base);
            let name = scene.name.rsplit('/').next().unwrap_or_default();
            println!("{name:<24} {threads:>7} {limit:>7.2} {taken:>10.3} {below:>10.3}");
        }
    }
}
