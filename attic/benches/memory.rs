//! The peak memory of each method of `experiments/anytime.toml`, beyond the scene, on one thread.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench memory` writes `results/memory/memory.csv`; scenes that have not
//! been fetched are skipped.
//!
//! The program counts the bytes that it requests from its allocator, without pages, padding and the
//! program itself, hence the numbers are the same on every 64-bit machine. A buffer that grows
//! counts twice while it is copied.

use bvh_scenes::Scene;
use bvh_search::{Problem, solve};
use harness::contestant::Contestant;
use harness::rows::{Row, to_bytes};
use harness::spec::{Experiment, Overrides};
use peak_alloc::PeakAlloc;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// One row of `memory.csv`: the most memory that a method had allocated at once, on one thread.
#[derive(Serialize, Deserialize)]
struct MemoryRow {
    scene: String,
    objects: usize,
    method: String,
    /// Trees, working memory and history; not the scene's boxes.
    peak_bytes: usize,
    bytes_per_object: f64,
}

impl Row for MemoryRow {
    const FILE: &str = "memory.csv";
}

fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(&top).expect("the project's folder");
    let experiment = Experiment::read(Path::new("experiments/anytime.toml"), &Overrides::default())
        .expect("a spec");
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of threads");
    let mut rows = Vec::new();
    for name in experiment.scenes.iter().chain(&experiment.optional_scenes) {
        match Scene::load(name) {
            Ok(scene) => one.install(|| measure(&experiment, &scene, &mut rows)),
            Err(error) => println!("{error}"),
        }
    }
    let path = Path::new("results/memory/memory.csv");
    fs::create_dir_all(path.parent().expect("a folder")).expect("a folder for results");
    fs::write(path, to_bytes(&rows, path).expect("rows")).expect("a file");
}

/// Measures the first run of every method of the experiment.
fn measure(experiment: &Experiment, scene: &Scene, rows: &mut Vec<MemoryRow>) {
    for labelled in &experiment.methods {
        let Contestant::Ours(method) = &labelled.method else { continue };
        let problem = Problem { objective: experiment.objective, ..Problem::new(&scene.boxes) };
        let seed = experiment.seed_of(&scene.name, &labelled.label, 0);
        let before = ALLOCATED.current_usage();
        ALLOCATED.reset_peak_usage();
        drop(
            solve(method, &problem, seed, experiment.budget_of(labelled), &())
                .expect("finite boxes"),
        );
        let peak_bytes = ALLOCATED.peak_usage() - before;
        let objects = scene.boxes.len();
        let bytes_per_object = peak_bytes as f64 / objects as f64;
        println!(
            "{:<10} {:<24} {bytes_per_object:>9.1} bytes per object",
            scene.name, labelled.label
        );
        let scene = scene.name.clone();
        let method = labelled.label.clone();
        rows.push(MemoryRow { scene, objects, method, peak_bytes, bytes_per_object });
    }
}
