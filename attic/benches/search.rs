//! `best` against the clock on one thread and on two: cost over the cost of greedy Müller–Fellner, one
//! triangle per leaf, after each limit in seconds.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench search -- [--seconds 0.1,1,10,60] [--seeds 5] SCENE...` writes
//! `results/threads/timing_threads.csv`, and keeps its rows of other scenes and processors.
//!
//! The time includes the build and the final conversion. The runs of one limit alternate: one
//! thread, two threads, and one thread with 1.8 times the time, whose cost two threads should reach.

mod measured;

use bvh_build::{Builder, muller_fellner};
use bvh_core::{cost, validate};
use bvh_scenes::Scene;
use bvh_search::{Budget, Deadline, Problem, best, solve};
use clap::Parser;
use harness::processor::PROCESSOR;
use harness::rows::Row;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;

/// Every run by its name, its threads, and its time as a multiple of the limit.
const RUNS: [(&str, usize, f64); 3] =
    [("1 thread", 1, 1.0), ("2 threads", 2, 1.0), ("1 thread, 1.8 times the time", 1, 1.8)];

/// The fraction of the limit that the search may plan with; the conversion of its result needs the
/// rest.
const PLANNED: f64 = 0.97;

/// One row of `timing_threads.csv`: one run of `best` against the clock.
#[derive(Serialize, Deserialize)]
struct ThreadsRow {
    scene: String,
    objects: usize,
    /// The processor that was measured.
    processor: String,
    /// The limit of a run of factor 1.
    limit_seconds: f64,
    /// The threads, and the time limit as a multiple of `limit_seconds` unless it is 1.
    run: String,
    seed: u64,
    /// Wall time of the run.
    seconds: f64,
    /// Internal area over the greedy tree's.
    cost_over_base: f64,
}

impl Row for ThreadsRow {
    const FILE: &str = "timing_threads.csv";
}

#[derive(Parser)]
struct Args {
    /// Names or paths of scenes of triangles.
    #[arg(required = true)]
    scenes: Vec<String>,
    /// Limits, in seconds.
    #[arg(long, value_delimiter = ',', default_value = "0.1,1,10,60")]
    seconds: Vec<f64>,
    /// Number of runs of each kind.
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// Cargo passes this to every benchmark.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(&top).expect("the project's folder");
    let Args { scenes, seconds, seeds, .. } = Args::parse();
    for name in scenes {
        let scene = Scene::load(&name).expect("a scene");
        measured::replace("results/threads", measure(&scene, &seconds, seeds), key);
    }
}

fn measure(scene: &Scene, seconds: &[f64], seeds: u64) -> Vec<ThreadsRow> {
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("finite boxes");
    let base = cost::internal_area(&greedy);
    let mut rows = Vec::new();
    for &limit in seconds {
        for seed in 1..=seeds {
            for (name, threads, factor) in RUNS {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .expect("a pool of threads");
                let planned = PLANNED * factor * limit;
                let (seconds, area) = pool.install(|| run(scene, planned, seed));
                let row = ThreadsRow {
                    scene: scene.name.clone(),
                    objects: scene.boxes.len(),
                    processor: PROCESSOR.name(),
                    limit_seconds: limit,
                    run: name.to_string(),
                    seed,
                    seconds,
                    cost_over_base: area / base,
                };
                println!(
                    "{:<24} {limit:>6.2} s, seed {seed}, {name}: {:.5} of greedy's cost",
                    row.scene, row.cost_over_base
                );
                rows.push(row);
            }
        }
    }
    rows
}

/// Runs `best` with a plan of `planned` seconds. Returns its wall time and the internal area of its
/// valid tree.
fn run(scene: &Scene, planned: f64, seed: u64) -> (f64, f64) {
    let deadline = Deadline::after(Duration::from_secs_f64(planned));
    let problem = Problem::new(&scene.boxes);
    let outcome = solve(&best::Config::default(), &problem, seed, Budget::UNLIMITED, &deadline);
    let taken = deadline.elapsed().as_secs_f64();
    let tree = outcome.expect("finite boxes").tree;
    validate(&tree, &scene.boxes).expect("a valid tree");
    (taken, cost::internal_area(&tree))
}

fn key(row: &ThreadsRow) -> (String, usize, String) {
    (row.processor.clone(), row.objects, row.scene.clone())
}
