//! Time and peak memory of builds and bakes on scenes of millions of triangles, on one thread, and of
//! bakes on two.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench scale -- city:1000000 forest:8000000` writes
//! `results/scale/timing_scale.csv`, and keeps its rows of other scenes. Without scenes it measures
//! forests of 1, 8 and 20 million triangles.
//!
//! The program counts the bytes that it requests from its allocator; counting adds about 1 % to the
//! times.

mod landscape;
mod measured;

use bvh_build::{Builder, muller_fellner, ploc};
use bvh_core::cost;
use bvh_core::{Aabb, Bvh};
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

const FOLDER: &str = "results/scale";
const DEFAULT: [&str; 3] = ["forest:1000000", "forest:8000000", "forest:20000000"];

/// One row of `timing_scale.csv`: one phase on a scene of millions of triangles, on one thread.
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
    /// The most bytes allocated at once, the scene and the trees that the phase needs included.
    peak_bytes: usize,
    bytes_per_object: f64,
    /// Bytes that stay allocated after the phase.
    bytes_after: usize,
    /// Internal area over the greedy tree's, of phases that make a tree.
    cost_over_base: Option<f64>,
}

impl Row for ScaleRow {
    const FILE: &str = "timing_scale.csv";
}

fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(&top).expect("the project's folder");
    let mut names: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    if names.is_empty() {
        names = DEFAULT.map(String::from).into();
    }
    for name in names {
        let mut phases = Phases { scene: name, objects: 0, rows: Vec::new() };
        pool(1).install(|| phases.measure());
        measured::replace(FOLDER, phases.rows, key);
    }
}

fn key(row: &ScaleRow) -> (String, usize, String) {
    (row.processor.clone(), row.objects, row.scene.clone())
}

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads")
}

/// The measured phases of one scene.
struct Phases {
    scene: String,
    objects: usize,
    rows: Vec<ScaleRow>,
}

impl Phases {
    /// Performs a phase, and records its time and the most bytes allocated at once, those of the
    /// scene and of the trees that the phase needs included.
    fn phase<T>(&mut self, phase: &str, perform: impl FnOnce() -> T) -> T {
        ALLOCATED.reset_peak_usage();
        let start = Instant::now();
        let result = perform();
        let seconds = start.elapsed().as_secs_f64();
        let peak_bytes = ALLOCATED.peak_usage();
        let bytes_per_object = peak_bytes as f64 / self.objects as f64;
        println!(
            "{:<18} {phase:<28} {seconds:>8.2} s {bytes_per_object:>7.0} bytes per triangle",
            self.scene
        );
        self.rows.push(ScaleRow {
            scene: self.scene.clone(),
            objects: self.objects,
            processor: PROCESSOR.name(),
            phase: phase.into(),
            seconds,
            peak_bytes,
            bytes_per_object,
            bytes_after: ALLOCATED.current_usage(),
            cost_over_base: None,
        });
        result
    }

    /// Adds the cost of the tree that the last phase made.
    fn cost(&mut self, tree: &Bvh, base: f64) {
        let ratio = cost::internal_area(tree) / base;
        println!("{:<18} {:<28} {ratio:>8.4} of greedy's cost", "", "");
        self.rows.last_mut().expect("a phase").cost_over_base = Some(ratio);
    }

    fn measure(&mut self) {
        let scene = landscape::load(&self.scene).expect("a scene");
        let boxes = &scene.boxes;
        self.objects = boxes.len();
        let greedy = self.phase("build greedy", || {
            muller_fellner::Config::default().build(boxes).expect("finite boxes")
        });
        let base = cost::internal_area(&greedy);
        self.cost(&greedy, base);
        drop(greedy);
        let clustered = self
            .phase("build PLOC", || ploc::Config::default().build(boxes).expect("finite boxes"));
        self.cost(&clustered, base);
        drop(clustered);
        // The library's stopwatch excludes the conversion to our tree.
        let built = self.phase("build obvhs VerySlow", || {
            attic::build_by_obvhs(attic::Preset::VerySlow, boxes)
        });
        self.rows.last_mut().expect("a phase").seconds = built.seconds;
        self.cost(&built.tree, base);
        drop(built);
        for (seconds, threads) in [(10, 1), (10, 2), (18, 1), (60, 2), (60, 1)] {
            self.bake(boxes, base, seconds, threads);
        }
    }

    /// Bakes for `seconds` as the program does, which builds the greedy tree before the time
    /// begins.
    fn bake(&mut self, boxes: &[Aabb], base: f64, seconds: u64, threads: usize) {
        let config = best::Config { horizon: Some(Horizon::Known), ..Default::default() };
        let plural = if threads == 1 { "" } else { "s" };
        let name = format!("bake {seconds} s, {threads} thread{plural}");
        let bake = || {
            let greedy = muller_fellner::Config::default().build(boxes).expect("finite boxes");
            let deadline = Deadline::after(Duration::from_secs(seconds));
            let problem = Problem::new(boxes);
            let greedy = Kept::new(greedy, &problem);
            solve_or_keep(&config, &problem, Some(greedy), 1, Budget::UNLIMITED, &deadline)
                .expect("a tree")
                .tree
        };
        let baked = self.phase(&name, || pool(threads).install(bake));
        self.cost(&baked, base);
    }
}
