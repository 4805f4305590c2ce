//! The seconds from Ctrl-C to the end of `bvh bake`, the file of the best tree so far included.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench interrupt` bakes a city of five million triangles, by area and
//! for a million recorded rays, interrupts each bake at several times, and writes
//! `results/interrupt/timing_interrupt.csv`. About ten minutes.

mod landscape;
mod measured;

use bvh_scenes::Scene;
use bvh_search::Stream;
use harness::processor::PROCESSOR;
use harness::rows::Row;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const FOLDER: &str = "results/interrupt";
const SCENE: &str = "city:5000000";
const SEGMENTS: usize = 1_000_000;
/// Bakes are interrupted in the greedy build, in the first passes of reinsertion and far into the
/// search; fractions keep the signals off the ends of phases that take whole seconds.
const AFTER: [f64; 6] = [4.3, 9.1, 17.7, 24.2, 33.9, 46.4];

/// One row of `timing_interrupt.csv`: one bake that was interrupted.
#[derive(Serialize, Deserialize)]
struct InterruptRow {
    scene: String,
    objects: usize,
    /// The processor that was measured.
    processor: String,
    /// The number of recorded rays that the tree was searched for; 0 for a bake by area.
    segments: usize,
    /// The time from the start of the program to the signal.
    after_seconds: f64,
    /// The time from the signal to the end of the program, the file of the tree included.
    seconds: f64,
}

impl Row for InterruptRow {
    const FILE: &str = "timing_interrupt.csv";
}

fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(&top).expect("the project's folder");
    let program = program();
    let scene = landscape::load(SCENE).expect("a scene");
    let objects = scene.boxes.len();
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = folder.path().join("rays.bin");
    fs::write(&recorded, segments(&scene)).expect("a file");
    let mesh = folder.path().join("city.stl");
    fs::write(&mesh, stl(&scene)).expect("a file");
    // Another scene of this size beside the bake would change what is measured.
    drop(scene);
    let processor = PROCESSOR.name();
    let mut rows = Vec::new();
    for segments in [0, SEGMENTS] {
        let recorded = (segments > 0).then_some(recorded.as_path());
        for after_seconds in AFTER {
            let seconds = interrupted(&program, &mesh, recorded, after_seconds);
            println!("{SCENE}, {segments} segments, after {after_seconds} s: {seconds:.2} s");
            let scene = SCENE.to_owned();
            let processor = processor.clone();
            rows.push(InterruptRow { scene, objects, processor, segments, after_seconds, seconds });
        }
    }
    measured::replace(FOLDER, rows, key);
}

/// Builds the program `bvh` and returns its path.
fn program() -> PathBuf {
    let built =
        Command::new(env!("CARGO")).args(["build", "--release", "--package", "bvh-cli"]).status();
    assert!(built.expect("cargo").success(), "bvh-cli was not built");
    let this = std::env::current_exe().expect("this program");
    let release = this.ancestors().nth(2).expect("the folder above `deps`");
    release.join(format!("bvh{}", std::env::consts::EXE_SUFFIX))
}

/// Returns the contents of a file of segments between random points of a scene.
fn segments(scene: &Scene) -> Vec<u8> {
    let bounds = scene.boxes.iter().copied().reduce(|all, aabb| all.union(&aabb)).expect("objects");
    let mut rng = Stream::seed_from_u64(1);
    let mut bytes = Vec::with_capacity(24 * SEGMENTS);
    for _ in 0..2 * SEGMENTS {
        for axis in 0..3 {
            let position = rng.random_range(bounds.min[axis]..=bounds.max[axis]);
            bytes.extend(position.to_le_bytes());
        }
    }
    bytes
}

/// Returns the triangles of a scene as a binary STL file.
fn stl(scene: &Scene) -> Vec<u8> {
    let triangles = scene.triangles().expect("triangles");
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for coordinate in triangle.0.iter().flat_map(|corner| corner.to_array()) {
            bytes.extend(coordinate.to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// Begins a bake and interrupts it. Returns the seconds from the signal to the end of the program.
fn interrupted(program: &Path, mesh: &Path, recorded: Option<&Path>, after: f64) -> f64 {
    let tree = mesh.with_extension("bvh");
    let mut bake = Command::new(program);
    bake.arg("bake")
        .arg(mesh)
        .args(["--budget", "10m", "--out"])
        .arg(&tree)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    if let Some(recorded) = recorded {
        bake.arg("--rays").arg(recorded);
    }
    let mut child = bake.spawn().expect("bvh");
    std::thread::sleep(Duration::from_secs_f64(after));
    let signal = Instant::now();
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.expect("kill").success(), "the bake had ended");
    let status = child.wait().expect("the bake");
    let seconds = signal.elapsed().as_secs_f64();
    assert_eq!(status.code(), Some(130), "the bake ended otherwise than by the signal");
    // Without a greedy tree yet, there is no file.
    if tree.exists() {
        fs::remove_file(&tree).expect("the file of the tree");
    }
    seconds
}

fn key(row: &InterruptRow) -> (String, usize, String) {
    (row.processor.clone(), row.objects, row.scene.clone())
}
