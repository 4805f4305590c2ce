//! Time and peak memory of every phase on scenes of millions of triangles, on one thread, and of
//! bakes on two.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench scale -- terrain:1000000 forest:8000000` writes
//! `results/scale/timing_scale.csv`, and keeps its rows of other scenes. Without scenes it measures
//! forests of 1, 8 and 20 million triangles.
//!
//! The program counts the bytes that it requests from its allocator; counting adds about 1 % to the
//! times. Mapped files are not counted.

mod landscape;
mod measured;

use bvh_build::{Builder, Watch, muller_fellner, ploc, spatial};
use bvh_core::cost;
use bvh_core::file::{self, Origin, TreeFile};
use bvh_core::{Aabb, Bvh, WideBvh, validate};
use bvh_scenes::Scene;
use bvh_scenes::load;
use bvh_search::best::{self, Horizon};
use bvh_search::{Budget, Deadline, Kept, Problem, solve_or_keep};
use harness::processor::PROCESSOR;
use harness::rows::Row;
use memmap2::Mmap;
use peak_alloc::PeakAlloc;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
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
    /// Load, build, bake, save, map, inspect or lay out.
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
    /// Megabytes of the mesh file per second, of phases that load it.
    megabytes_per_s: Option<f64>,
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
            megabytes_per_s: None,
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
        let folder = tempfile::tempdir().expect("a folder");
        let ply = folder.path().join("scene.ply");
        let obj = folder.path().join("scene.obj");
        {
            let scene = landscape::load(&self.scene).expect("a scene");
            self.objects = scene.boxes.len();
            write_ply(&scene, &ply);
            write_obj(&scene, &obj);
        }
        for (path, kind) in [(&obj, "OBJ"), (&ply, "PLY")] {
            let megabytes = fs::metadata(path).expect("a file").len() as f64 / 1e6;
            self.phase(&format!("load {kind}"), || {
                load::load(path).expect("a mesh")
            });
            let row = self.rows.last_mut().expect("a phase");
            row.megabytes_per_s = Some(megabytes / row.seconds);
        }
        let name = ply.to_str().expect("a name").to_owned();
        let scene = self.phase("load as a scene", || Scene::load(&name).expect("a scene"));
        let boxes = &scene.boxes;
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
        let triangles = scene.triangles().expect("triangles");
        self.phase("build with spatial splits", || {
            let most = boxes.len() * 6 / 5;
            spatial::build(most, boxes, &triangles, &Watch::default()).expect("finite boxes")
        });
        self.peers(&scene, base);
        drop(self.bake(boxes, base, 10, 1));
        drop(self.bake(boxes, base, 10, 2));
        drop(self.bake(boxes, base, 18, 1));
        drop(self.bake(boxes, base, 60, 2));
        let baked = self.bake(boxes, base, 60, 1);
        let path = folder.path().join("tree.bvh");
        self.phase("save", || {
            let bytes = file::save(&baked, boxes, &Origin::default()).expect("a valid tree");
            fs::write(&path, bytes).expect("a file");
        });
        self.phase("map, check and view", || {
            let file = File::open(&path).expect("the file");
            // SAFETY: the file is in a temporary folder of this process, which does not write to it
            // while it is mapped.
            let bytes = unsafe { Mmap::map(&file) }.expect("a mapping");
            let file = TreeFile::open(&bytes).expect("a tree file");
            let file = file.for_boxes(boxes).expect("a tree of these boxes");
            assert_eq!(file.view().expect("a tree").nodes.len(), baked.nodes.len());
        });
        self.phase("inspect", || {
            validate(&baked, boxes).expect("a valid tree");
            [cost::internal_area(&baked), cost::goldsmith_salmon(&baked)]
        });
        self.phase("wide layout", || WideBvh::new(&baked, triangles).expect("a layout").bytes());
    }

    /// Bakes for `seconds` as the program does, which builds the greedy tree before the time
    /// begins.
    fn bake(&mut self, boxes: &[Aabb], base: f64, seconds: u64, threads: usize) -> Bvh {
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
        baked
    }

    fn peers(&mut self, scene: &Scene, base: f64) {
        use attic::{Preset, build_by_obvhs};
        for preset in [Preset::Medium, Preset::VerySlow] {
            let name = format!("build obvhs {preset:?}");
            let built = self.phase(&name, || build_by_obvhs(preset, &scene.boxes));
            // The library's stopwatch excludes the conversion to our tree.
            self.rows.last_mut().expect("a phase").seconds = built.seconds;
            self.cost(&built.tree, base);
        }
    }
}

/// Writes a binary PLY file in which every triangle has three vertices of its own.
fn write_ply(scene: &Scene, path: &Path) {
    let triangles = scene.triangles().expect("triangles");
    let mut out = BufWriter::new(File::create(path).expect("a file"));
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float \
         y\nproperty float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        3 * triangles.len(),
        triangles.len()
    );
    out.write_all(header.as_bytes()).expect("a file");
    for number in
        triangles.iter().flat_map(|triangle| triangle.0).flat_map(|corner| corner.to_array())
    {
        out.write_all(&number.to_le_bytes()).expect("a file");
    }
    for face in 0..triangles.len() as i32 {
        out.write_all(&[3]).expect("a file");
        for corner in 0..3 {
            out.write_all(&(3 * face + corner).to_le_bytes()).expect("a file");
        }
    }
    out.flush().expect("a file");
}

fn write_obj(scene: &Scene, path: &Path) {
    let triangles = scene.triangles().expect("triangles");
    let mut out = BufWriter::new(File::create(path).expect("a file"));
    for corner in triangles.iter().flat_map(|triangle| triangle.0) {
        writeln!(out, "v {} {} {}", corner.x, corner.y, corner.z).expect("a file");
    }
    for face in 0..triangles.len() {
        writeln!(out, "f {} {} {}", 3 * face + 1, 3 * face + 2, 3 * face + 3).expect("a file");
    }
    out.flush().expect("a file");
}
