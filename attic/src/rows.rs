//! The rows of traced rays, and of comparisons with other libraries.

use harness::rows::Row;
use serde::{Deserialize, Serialize};

/// One row of `timing_rays.csv`, of a comparison with other libraries: the speed of rays of one
/// kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PeerRayRow {
    /// Name of the scene, or that the row is a mean over all scenes.
    pub scene: String,
    /// The processor that was measured.
    pub processor: String,
    /// The instruction set that the library is held to.
    pub instructions: String,
    /// The library, or ours.
    pub library: String,
    /// The version of the library.
    pub version: String,
    /// The library's settings and its structure for rays.
    pub mode: String,
    /// The kind of rays.
    pub rays: String,
    /// Million rays per second on one thread, each part of the rays by its fastest turn.
    pub million_per_s: f64,
    /// Wall time of building tree and layout; in the mean over scenes, their mean.
    pub build_seconds: f64,
    /// Rays that this contender answers otherwise than brute force.
    pub disagreements: u64,
}

impl Row for PeerRayRow {
    const FILE: &str = "timing_rays.csv";
}

/// One row of `timing_ratios.csv`: the speed of rays of one kind in one of our modes, over the
/// fastest mode of other libraries on the same scene; after the scenes the geometric mean over
/// them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RayRatioRow {
    pub scene: String,
    /// The processor that was measured, and the instruction set that all are held to.
    pub processor: String,
    /// Our mode.
    pub mode: String,
    /// The modes compared with: `any mode` of the same precision, `single calls`, those of `whole
    /// triangles`, or Embree's in `double` or `robust` ones.
    pub against: String,
    /// The fastest of them on this scene; empty for means.
    pub fastest: String,
    pub rays: String,
    /// Our speed over the fastest of theirs, to six decimals like all ratios here; more than 1
    /// is faster.
    pub ratio: f64,
    /// The least ratio of one turn.
    pub least_turn: f64,
    /// The greatest ratio of one turn.
    pub greatest_turn: f64,
    /// Wall time of building tree and layout; in the mean over scenes, their mean.
    pub build_seconds: f64,
    /// The scene that lifts the mean most; empty for scenes.
    pub carried_by: String,
    /// The geometric mean without that scene; empty for scenes.
    pub ratio_without: Option<f64>,
}

impl Row for RayRatioRow {
    const FILE: &str = "timing_ratios.csv";
}

/// One row of `traversal.csv`: what rays of one kind found and took in one layout of a run's tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceRow {
    pub scene: String,
    pub method: String,
    /// Layout of the tree in memory while rays are traced.
    pub layout: String,
    /// Kind of the rays, the same ones for all methods and layouts.
    pub rays: String,
    /// Number of the rays.
    pub count: u64,
    /// Number of rays that hit something.
    pub hits: u64,
    /// Rays that miss a hit.
    pub missed_hits: u64,
    /// Rays that hit nothing real.
    pub false_hits: u64,
    /// Rays that hit elsewhere.
    pub other_hits: u64,
    /// Mean number of tests against boxes, the root's included where it is tested; 8 for every wide
    /// node.
    pub boxes_per_ray: Option<f64>,
    /// Mean number of tests against objects; 4 for every block of triangles.
    pub objects_per_ray: Option<f64>,
}

impl Row for TraceRow {
    const FILE: &str = "traversal.csv";
}

/// One row of `timing_traversal.csv`: the time of rays of one kind in one layout of a run's tree, on
/// one thread.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceTimeRow {
    pub scene: String,
    pub method: String,
    /// Layout of the tree in memory while rays are traced.
    pub layout: String,
    pub rays: String,
    /// Number of the rays.
    pub count: u64,
    /// Turns that were timed.
    pub rounds: u32,
    /// Wall time of making the layout from the tree; for other libraries, with the tree.
    pub preparation_seconds: f64,
    /// Wall time of all rays: the sum over small parts of them of each part's fastest turn.
    pub seconds: f64,
    /// Sum over the same parts of each part's median turn.
    pub median_seconds: f64,
}

impl Row for TraceTimeRow {
    const FILE: &str = "timing_traversal.csv";
}
