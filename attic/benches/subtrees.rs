//! `best` with a budget of work by the number of subtrees that are annealed at once: cost over the
//! cost of greedy Müller–Fellner, and seconds on one thread and on two.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench subtrees -- [--subtrees 1,8,64,512] [--million-work
//! 400] [--seeds 3] SCENE...` writes `results/threads/timing_subtrees.csv`, and keeps its rows of
//! other scenes and processors.
//!
//! One thread and two alternate, and their trees are the same. The seconds of more threads are
//! expected by Amdahl's law from these two, so far as there are that many subtrees.

mod landscape;
mod measured;

use bvh_build::{Builder, muller_fellner};
use bvh_core::cost;
use bvh_scenes::Scene;
use bvh_search::{Budget, Problem, best, solve};
use clap::Parser;
use harness::processor::PROCESSOR;
use harness::rows::Row;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// Numbers of threads that are expected and not measured.
const EXPECTED: [usize; 2] = [8, 64];

const FOLDER: &str = "results/threads";

/// One row of `timing_subtrees.csv`: one run of `best` with a budget of work.
#[derive(Serialize, Deserialize)]
struct SubtreesRow {
    scene: String,
    objects: usize,
    /// The processor that was measured.
    processor: String,
    /// The subtrees, or the copies of the whole tree, that are annealed at once.
    at_once: String,
    /// The threads, and whether their seconds are expected by Amdahl's law or measured.
    threads: String,
    seed: u64,
    /// Wall time of the run.
    seconds: f64,
    /// Internal area over the greedy tree's.
    cost_over_base: f64,
}

impl Row for SubtreesRow {
    const FILE: &str = "timing_subtrees.csv";
}

#[derive(Parser)]
struct Args {
    /// Names or paths of scenes of triangles.
    #[arg(required = true)]
    scenes: Vec<String>,
    /// Numbers of subtrees.
    #[arg(long, value_delimiter = ',', default_value = "1,8,64,512")]
    subtrees: Vec<u32>,
    /// The work of a run, in millions of nodes.
    #[arg(long, default_value_t = 400)]
    million_work: u64,
    /// Number of runs of each kind.
    #[arg(long, default_value_t = 3)]
    seeds: u64,
    /// Cargo passes this to every benchmark.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(&top).expect("the project's folder");
    let args = Args::parse();
    for name in &args.scenes {
        match landscape::load(name) {
            Ok(scene) => measured::replace(FOLDER, measure(&scene, &args), key),
            Err(error) => println!("{error}"),
        }
    }
}

fn measure(scene: &Scene, args: &Args) -> Vec<SubtreesRow> {
    let greedy = muller_fellner::Config::default().build(&scene.boxes).expect("finite boxes");
    let base = cost::internal_area(&greedy);
    let mut rows = Vec::new();
    for seed in 1..=args.seeds {
        for &subtrees in &args.subtrees {
            let config = best::Config { pieces: subtrees, ..Default::default() };
            let at_once = match subtrees {
                1 => "the whole tree".to_string(),
                _ => format!("{subtrees} subtrees"),
            };
            let (one, area) = run(scene, args.million_work, &config, seed, 1);
            let (two, area_of_two) = run(scene, args.million_work, &config, seed, 2);
            assert_eq!(area.to_bits(), area_of_two.to_bits(), "threads change the tree");
            let row = |threads: String, seconds: f64| SubtreesRow {
                scene: scene.name.clone(),
                objects: scene.boxes.len(),
                processor: PROCESSOR.name(),
                at_once: at_once.clone(),
                threads,
                seed,
                seconds,
                cost_over_base: area / base,
            };
            rows.push(row("1".to_string(), one));
            rows.push(row("2".to_string(), two));
            for threads in EXPECTED {
                let seconds = expected(one, two, threads.min(subtrees as usize));
                rows.push(row(format!("{threads}, expected"), seconds));
            }
            println!(
                "{:<24} {at_once:>14}, seed {seed}: {one:.2} s, {two:.2} s, {:.5} of greedy's cost",
                scene.name,
                area / base
            );
        }
    }
    rows
}

/// Returns the seconds of a run on `threads` threads and the internal area of its tree.
fn run(
    scene: &Scene,
    million_work: u64,
    config: &best::Config,
    seed: u64,
    threads: usize,
) -> (f64, f64) {
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
    let budget = Budget { max_work: Some(million_work * 1_000_000), ..Budget::UNLIMITED };
    let problem = Problem::new(&scene.boxes);
    let began = Instant::now();
    let outcome = pool.install(|| solve(config, &problem, seed, budget, &()));
    let seconds = began.elapsed().as_secs_f64();
    (seconds, cost::internal_area(&outcome.expect("finite boxes").tree))
}

/// Returns the seconds on `threads` threads by Amdahl's law, from the seconds on one and on two.
fn expected(one: f64, two: f64, threads: usize) -> f64 {
    let serial = (2.0 * two - one).clamp(0.0, one);
    serial + (one - serial) / threads as f64
}

fn key(row: &SubtreesRow) -> (String, usize, String) {
    (row.processor.clone(), row.objects, row.scene.clone())
}
