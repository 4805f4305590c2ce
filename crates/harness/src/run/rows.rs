//! The rows of the CSV files: flat, units in the names, full precision.

use crate::Error;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::path::Path;

/// One row of `runs.csv`: what one run of one method on one scene found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunRow {
    /// Name of the scene.
    pub scene: String,
    /// `stand-in`, `procedural` or `file`.
    pub scene_kind: String,
    /// Label of the method in the spec.
    pub method: String,
    /// Seed of this run, derived from the spec's.
    pub seed: u64,
    /// From 0.
    pub repetition: u32,
    /// Number of objects in the scene.
    pub objects: usize,
    /// Trees or moves evaluated.
    pub evaluations: u64,
    /// Nodes made or visited.
    pub work: u64,
    /// Why the run ended.
    pub stop: bvh_search::StopReason,
    /// The objective's value for the best tree found.
    pub cost: f64,
    /// The objective's value for the greedy Müller–Fellner tree of the scene, the base of ratios.
    pub base_cost: f64,
    /// `cost` divided by `base_cost`; 1 when that is 0.
    pub cost_over_base: f64,
    /// `internal_area` divided by the root's half area.
    pub cost_over_root_area: f64,
    /// The paper's objective: total half area of inner nodes, world units squared.
    pub internal_area: f64,
    /// The Goldsmith–Salmon cost.
    pub goldsmith_salmon: f64,
    /// The surface area heuristic with both constants 1.
    pub sah: f64,
    /// Number of nodes of the tree.
    pub nodes: usize,
    /// Edges from the root to the deepest leaf.
    pub depth: usize,
}

/// One row of `history.csv`: one trial, generation or improvement of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HistoryRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec.
    pub method: String,
    /// Seed of the run.
    pub seed: u64,
    /// From 0.
    pub repetition: u32,
    /// Trees or moves evaluated so far.
    pub evaluations: u64,
    /// Nodes made or visited so far.
    pub work: u64,
    /// The objective's value found now.
    pub cost: f64,
    /// The lowest value so far.
    pub incumbent: f64,
}

/// One row of `timing.csv`, the only CSV file with seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimingRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec.
    pub method: String,
    /// Seed of the run.
    pub seed: u64,
    /// From 0.
    pub repetition: u32,
    /// Threads at its disposal.
    pub threads: usize,
    /// Wall time of the whole run.
    pub seconds: f64,
}

/// One row of `timing_history.csv`: when the event of the same row of `history.csv` happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec.
    pub method: String,
    /// From 0.
    pub repetition: u32,
    /// Number of the event within its run, from 0.
    pub event: usize,
    /// Wall time since the run began.
    pub seconds: f64,
}

/// One row of `rays.csv`: the tests that random rays took in a run's tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RayRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec.
    pub method: String,
    /// Seed of the run; the rays are the same for all runs on a scene.
    pub seed: u64,
    /// From 0.
    pub repetition: u32,
    /// Where the rays come from.
    pub family: String,
    /// What they ask.
    pub query: String,
    /// Number of rays.
    pub rays: u64,
    /// Fraction of them that hit something.
    pub hit_fraction: f64,
    /// Mean number of tests against boxes, the root's and the leaves' included.
    pub boxes_per_ray: f64,
    /// Its standard error.
    pub boxes_standard_error: f64,
    /// Lower end of its 95 % interval.
    pub boxes_low: f64,
    /// Upper end.
    pub boxes_high: f64,
    /// Mean number of tests against objects.
    pub objects_per_ray: f64,
    /// Its standard error.
    pub objects_standard_error: f64,
}

/// One row of `renders.csv`: the tests that one picture took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec, or what is not a tree.
    pub method: String,
    /// From 0.
    pub repetition: u32,
    /// Number of objects in the scene.
    pub objects: usize,
    /// Number of rays: through pixels, to lights, and mirrored.
    pub rays: u64,
    /// Mean number of tests against boxes, or of cells of a KD-tree.
    pub boxes_per_ray: f64,
    /// Mean number of tests against objects.
    pub objects_per_ray: f64,
    /// 64-bit FNV-1a of the pixels: the same for all structures.
    pub picture: String,
}

/// One row of `timing_renders.csv`: the seconds of the same row of `renders.csv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderTimeRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec, or what is not a tree.
    pub method: String,
    /// From 0.
    pub repetition: u32,
    /// How often the picture was drawn.
    pub repeats: usize,
    /// Wall time of making the structure.
    pub build_seconds: f64,
    /// Wall time of drawing on one thread, the least of all repeats.
    pub render_seconds: f64,
}

/// One row of `traversal.csv`: what rays of one kind found and took in one layout of a run's tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TraceRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec.
    pub method: String,
    /// How the tree is laid out.
    pub layout: String,
    /// Kind of the rays, the same ones for all methods and layouts.
    pub rays: String,
    /// Number of rays.
    pub count: u64,
    /// How many hit something.
    pub hits: u64,
    /// Rays that should hit and do not.
    pub missed_hits: u64,
    /// Rays that should not hit and do.
    pub false_hits: u64,
    /// Rays that hit elsewhere than they should.
    pub other_hits: u64,
    /// Mean number of tests against boxes, the root's included where it is tested; 8 for every wide node.
    pub boxes_per_ray: Option<f64>,
    /// Mean number of tests against objects; 4 for every block of triangles.
    pub objects_per_ray: Option<f64>,
}

/// One row of `timing_traversal.csv`: the time of rays of one kind in one layout of a run's tree, on one thread.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TraceTimeRow {
    /// Name of the scene.
    pub scene: String,
    /// Label of the method in the spec.
    pub method: String,
    /// How the tree is laid out.
    pub layout: String,
    /// Kind of the rays.
    pub rays: String,
    /// Number of rays.
    pub count: u64,
    /// Turns that were timed.
    pub rounds: u32,
    /// What it took to make the layout from the tree; for other libraries with the tree.
    pub preparation_seconds: f64,
    /// What all rays took: the sum over small parts of them of each part's fastest turn.
    pub seconds: f64,
    /// The same with each part's median turn.
    pub median_seconds: f64,
}

/// One row of `bounds.csv`: a proven lower bound of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoundRow {
    /// Name of the scene.
    pub scene: String,
    /// Number of objects in the scene.
    pub objects: usize,
    /// No binary tree with one object per leaf has less `internal_area`.
    pub lower_bound: f64,
}

/// One row of `best_known.csv` and `references.csv`: what gaps are measured from, for one scene and objective. Only
/// binary trees with one object per leaf count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceRow {
    /// Name of the scene.
    pub scene: String,
    /// Number of objects in the scene.
    pub objects: usize,
    /// Of the boxes, hexadecimal: scenes of the same name are told apart by it.
    pub checksum: String,
    /// Which cost.
    pub objective: String,
    /// The least known, or the exact optimum.
    pub cost: f64,
    /// Label of the method that found it; `exact` for the optimum.
    pub method: String,
    /// Seed of the run that found it.
    pub seed: u64,
    /// Git revision of the program that found it.
    pub revision: String,
    /// The greatest proven lower bound known, in the unit of `cost`.
    pub lower_bound: Option<f64>,
}

/// Costs that differ by less than this, relatively, are equal: the rest is rounding.
pub const ROUNDING: f64 = 1e-12;

impl ReferenceRow {
    /// Whether the lower bound proves the reference to be the optimum.
    pub fn is_optimum(&self) -> bool {
        self.lower_bound.is_some_and(|bound| bound >= self.cost * (1.0 - ROUNDING))
    }
}

/// A kind of rows in a file of its own.
pub trait Row: Serialize + DeserializeOwned {
    /// The CSV file that holds them; its name begins with `timing` if they hold seconds.
    const FILE: &'static str;
}

macro_rules! rows {
    ($($kind:ident => $file:literal,)*) => {
        $(impl Row for $kind {
            const FILE: &'static str = $file;
        })*
    };
}

rows! {
    RunRow => "runs.csv",
    HistoryRow => "history.csv",
    TimingRow => "timing.csv",
    ClockRow => "timing_history.csv",
    RayRow => "rays.csv",
    BoundRow => "bounds.csv",
    RenderRow => "renders.csv",
    ReferenceRow => "references.csv",
    TraceRow => "traversal.csv",
    TraceTimeRow => "timing_traversal.csv",
    RenderTimeRow => "timing_renders.csv",
}

/// Reads all rows of a kind from an experiment's folder; none if no run left any.
pub fn read_if_any<R: Row>(folder: &Path) -> Result<Vec<R>, Error> {
    let path = folder.join(R::FILE);
    if path.is_file() { read(&path) } else { Ok(vec![]) }
}

/// Reads all rows of a CSV file.
pub fn read<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, Error> {
    let mut reader = csv::Reader::from_path(path).map_err(Error::csv(path))?;
    reader.deserialize().collect::<Result<_, _>>().map_err(Error::csv(path))
}

/// The bytes of a CSV file with a header and these rows; the header alone needs at least one row.
pub fn to_bytes<R: Serialize>(rows: &[R], path: &Path) -> Result<Vec<u8>, Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(Error::csv(path))?;
    }
    writer.into_inner().map_err(|error| Error::Io {
        path: path.to_owned(),
        action: "write",
        source: std::io::Error::other(error.to_string()),
    })
}
