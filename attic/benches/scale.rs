//! Time and peak memory of builds and bakes on scenes of millions of triangles, on one thread, and of
//! bakes on two.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench scale -- city:1000000 forest:8000000` writes
//! `results/scale/timing_scale.csv`, and keeps its rows of other scenes.
//!
//! The program counts the bytes that it requests from its allocator; counting adds about 1 % to the
//! times.

mod landscape;
mod measured;

use attic::obvhs::{self, Obvhs, Preset};
use bvh_build::{Builder, muller_fellner, ploc};
use bvh_core::{Aabb, Bvh, cost};
use bvh_scenes::Scene;
use bvh_search::best::{self, Horizon};
use bvh_search::{Budget, Deadline, Kept, Problem, solve_or_keep};
use harness::processor::PROCESSOR;
use harness::rows::Row;
use peak_alloc::PeakAlloc;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::{Duration, Instant};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// One row of `timing_scale.csv`: a tree over a scene of millions of triangles.
#[derive(Serialize, Deserialize)]
struct ScaleRow {
    scene: String,
    objects: usize,
    /// The processor that was measured.
    processor: String,
    /// A build or a bake.
    phase: String,
    /// Wall time; of a bake, the greedy tree included.
    seconds: f64,
    /// The most bytes allocated at once, the scene included.
    peak_bytes: usize,
    bytes_per_object: f64,
    /// Bytes that stay allocated after the phase.
    bytes_after: usize,
    /// Internal area over the greedy tree's.
    cost_over_base: f64,
}

impl Row for ScaleRow {
    const FILE: &str = "timing_scale.csv";
}

fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(&top).expect("the project's folder");
    // Cargo passes a flag to every benchmark.
    for name in std::env::args().skip(1).filter(|argument| !argument.starts_with("--")) {
        let scene = landscape::load(&name).expect("a scene");
        let mut phases = Phases { scene, rows: Vec::new(), base: None };
        pool(1).install(|| phases.measure());
        measured::replace("results/scale", phases.rows, key);
    }
}

fn key(row: &ScaleRow) -> (String, usize, String) {
    (row.processor.clone(), row.objects, row.scene.clone())
}

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads")
}

fn greedy(boxes: &[Aabb]) -> Bvh {
    muller_fellner::Config::default().build(boxes).expect("finite boxes")
}

/// The measured phases of one scene.
struct Phases {
    scene: Scene,
    rows: Vec<ScaleRow>,
    /// The area of the first phase's tree, the greedy one.
    base: Option<f64>,
}

impl Phases {
    fn measure(&mut self) {
        self.phase("build greedy", greedy);
        self.phase("build PLOC", |boxes| {
            ploc::Config::default().build(boxes).expect("finite boxes")
        });
        // The library's stopwatch excludes the conversion to our tree.
        let mut seconds = 0.0;
        let settings = Obvhs { preset: Preset::VerySlow, ..Obvhs::default() };
        self.phase("build obvhs VerySlow", |boxes| {
            let built = obvhs::build(&settings, boxes);
            seconds = built.seconds;
            built.tree
        });
        self.rows.last_mut().expect("a phase").seconds = seconds;
        for (seconds, threads) in [(10, 1), (10, 2), (18, 1), (60, 2), (60, 1)] {
            let plural = if threads == 1 { "" } else { "s" };
            let name = format!("bake {seconds} s, {threads} thread{plural}");
            self.phase(&name, |boxes| pool(threads).install(|| bake(boxes, seconds)));
        }
    }

    /// Makes a tree. Records the time, the most bytes allocated at once, the scene included, and the
    /// cost.
    fn phase(&mut self, phase: &str, make: impl FnOnce(&[Aabb]) -> Bvh) {
        ALLOCATED.reset_peak_usage();
        let start = Instant::now();
        let tree = make(&self.scene.boxes);
        let seconds = start.elapsed().as_secs_f64();
        let (peak_bytes, bytes_after) = (ALLOCATED.peak_usage(), ALLOCATED.current_usage());
        let area = cost::internal_area(&tree);
        let cost_over_base = area / *self.base.get_or_insert(area);
        let objects = self.scene.boxes.len();
        let bytes_per_object = peak_bytes as f64 / objects as f64;
        println!(
            "{:<18} {phase:<22} {seconds:>8.2} s {bytes_per_object:>7.0} bytes per triangle \
             {cost_over_base:>8.4} of greedy's cost",
            self.scene.name
        );
        self.rows.push(ScaleRow {
            scene: self.scene.name.clone(),
            objects,
            processor: PROCESSOR.name(),
            phase: phase.into(),
            seconds,
            peak_bytes,
            bytes_per_object,
            bytes_after,
            cost_over_base,
        });
    }
}

/// Bakes for `seconds` as the program does, which builds the greedy tree before the time begins.
fn bake(boxes: &[Aabb], seconds: u64) -> Bvh {
    let config = best::Config { horizon: Some(Horizon::Known), ..Default::default() };
    let greedy = greedy(boxes);
    let deadline = Deadline::after(Duration::from_secs(seconds));
    let problem = Problem::new(boxes);
    let greedy = Kept::new(greedy, &problem);
    solve_or_keep(&config, &problem, Some(greedy), 1, Budget::UNLIMITED, &deadline)
        .expect("a tree")
        .tree
}
