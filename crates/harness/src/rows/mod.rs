//! The rows of the CSV files: flat, units in the names, full precision.
//!
//! Columns mean the same in every file: a comment on the first field of a name holds for the others.
//! `docs/evidence/COLUMNS.md` is made of these comments.
#![allow(missing_docs, reason = "columns that are described at their first occurrence")]

pub mod csv_file;
pub mod kept_run;
pub mod lock;
pub mod store;

pub use csv_file::{Row, read, read_if_any, to_bytes};
use serde::{Deserialize, Serialize};

/// Declares kinds of rows with the names of their files.
macro_rules! rows {
    ($($(#[$meta:meta])* $kind:ident in $file:literal { $($(#[$of:meta])* $column:ident: $type:ty,)* })*) => {
        $(
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub struct $kind {
            $($(#[$of])* pub $column: $type,)*
        }

        impl Row for $kind {
            const FILE: &'static str = $file;
        }
        )*

        /// The files that runs write; the program in `attic/` has the rows of the last two.
        pub const FILES: &[&str] = &[$($file,)* "traversal.csv", "timing_traversal.csv"];
    };
}

rows! {
    /// One row of `runs.csv`: what one run of one method on one scene found.
    RunRow in "runs.csv" {
        /// Name of the scene.
        scene: String,
        /// `stand-in`, `procedural` or `file`.
        scene_kind: String,
        /// Label of the method in the spec.
        method: String,
        /// Seed of the run.
        seed: u64,
        /// Number of the repetition, from 0.
        repetition: u32,
        /// Number of the scene's objects.
        objects: usize,
        /// Trees or moves evaluated.
        evaluations: u64,
        /// Nodes made or visited.
        work: u64,
        /// Reason to stop: `completed`, `optimal`, `evaluations`, `work` or `cancelled`.
        stop: bvh_search::StopReason,
        /// The objective's value for the best tree found.
        cost: f64,
        /// The objective's value for the greedy Müller–Fellner tree of the scene, the base of
        /// ratios.
        base_cost: f64,
        /// `cost` divided by `base_cost`; 1 when that is 0.
        cost_over_base: f64,
        /// `internal_area` divided by the root's half area.
        cost_over_root_area: f64,
        /// The paper's objective: total half area of inner nodes, world units squared.
        internal_area: f64,
        /// Boxes below the root that a random line through the root's box is tested against.
        goldsmith_salmon: f64,
        /// The surface area heuristic with both constants 1.
        sah: f64,
        /// Nodes of the tree, 2n − 1 for a binary tree of n whole objects.
        nodes: usize,
        /// Edges from the root to the deepest leaf.
        depth: usize,
    }

    /// One row of `history.csv`: the first event of a run, an improvement, or the last event. The
    /// file exists if a report reads it or the spec has no reports.
    HistoryRow in "history.csv" {
        scene: String,
        method: String,
        repetition: u32,
        /// Trees or moves evaluated so far.
        evaluations: u64,
        /// Nodes made or visited so far.
        work: u64,
        /// The objective's lowest value so far.
        incumbent: f64,
    }

    /// One row of `trial_costs.csv`: one trial or generation of a run, of methods whose trials a
    /// report reads.
    TrialRow in "trial_costs.csv" {
        scene: String,
        method: String,
        repetition: u32,
        /// Trees evaluated so far.
        evaluations: u64,
        /// The objective's value for this trial's tree, or for the best one of the generation.
        cost: f64,
    }

    /// One row of `timing.csv`: how long a run took.
    TimingRow in "timing.csv" {
        scene: String,
        method: String,
        seed: u64,
        repetition: u32,
        /// Number of the run's threads.
        threads: usize,
        /// Wall time of the whole run.
        seconds: f64,
    }

    /// One row of `timing_history.csv`: the time of the event in the same row of `history.csv`.
    ClockRow in "timing_history.csv" {
        scene: String,
        method: String,
        repetition: u32,
        /// Number of the row within its run, from 0.
        event: usize,
        /// Wall time since the run began.
        seconds: f64,
    }

    /// One row of `rays.csv`: the tests that random rays took in a run's tree.
    RayRow in "rays.csv" {
        scene: String,
        method: String,
        /// Seed of the run; the rays are the same for all runs on a scene.
        seed: u64,
        repetition: u32,
        /// Family of the rays: `inside` or `lines`.
        family: String,
        /// Query of the rays: `any`, `nearest` or `all`.
        query: String,
        /// Number of rays.
        rays: u64,
        /// Fraction of the rays that hit something.
        hit_fraction: f64,
        /// Mean number of tests against boxes, the root's and the leaves' included.
        boxes_per_ray: f64,
        /// Standard error of `boxes_per_ray`.
        boxes_standard_error: f64,
        /// Lower end of the 95 % interval of `boxes_per_ray`.
        boxes_low: f64,
        /// Its upper end.
        boxes_high: f64,
        /// Mean number of tests against objects.
        objects_per_ray: f64,
        /// Standard error of `objects_per_ray`.
        objects_standard_error: f64,
    }

    /// One row of `tests.csv`: the tests of rays that a tree was not trained on, in the wide
    /// layout.
    TestRow in "tests.csv" {
        scene: String,
        method: String,
        /// The method's label, or `rays` if the tree was trained on rays.
        tree: String,
        /// `none`, `default` or `camera`.
        trained_on: String,
        /// Kind of the rays.
        judged_on: String,
        /// Path of cameras of the rays: `same` as in the training, `other`, or `none` without a
        /// camera.
        camera: String,
        /// Mean number of nodes tested per ray, eight boxes each: over all rays and repetitions.
        node_tests: f64,
        /// Mean number of blocks of four triangles tested per ray.
        block_tests: f64,
        /// Runs with other seeds and, if they are trained, other rays.
        repetitions: usize,
        /// Standard error of the sum of both tests over the repetitions; empty for one.
        tests_standard_error: Option<f64>,
        /// Number of rays.
        rays: u64,
    }

    /// One row of `visits.csv`: the cost of a run's tree for one kind of rays, others than those
    /// that are tested.
    VisitRow in "visits.csv" {
        scene: String,
        method: String,
        repetition: u32,
        /// Kind of the rays.
        rays: String,
        /// The Goldsmith–Salmon cost by the density of these rays.
        goldsmith_salmon: f64,
    }

    /// One row of `run_tests.csv`: the tests that rays took in the wide layout of a run's tree.
    RunTestRow in "run_tests.csv" {
        scene: String,
        method: String,
        repetition: u32,
        judged_on: String,
        camera: String,
        /// Tests of nodes and of blocks of triangles per ray.
        tests: f64,
    }

    /// One row of `layouts.csv`: the size and the cost of a method's trees and of the wide layouts
    /// that rays are traced through.
    LayoutRow in "layouts.csv" {
        scene: String,
        method: String,
        /// Trees that the numbers are means over.
        repetitions: usize,
        /// Leaves that name an object, per object: above 1 where objects are divided.
        references_per_object: f64,
        /// Bytes of the wide layout per object.
        bytes_per_object: f64,
        /// Surface area heuristic with both constants 1, after the best collapse of leaves.
        collapsed_sah: f64,
        /// Nodes and blocks of triangles that a random line through the root's box is expected to
        /// visit.
        layout_over_root: f64,
    }

    /// One row of `renders.csv`: the tests that one picture took.
    RenderRow in "renders.csv" {
        scene: String,
        method: String,
        repetition: u32,
        objects: usize,
        /// Number of rays: through pixels, to lights, and mirrored.
        rays: u64,
        /// Mean number of tests against boxes, or of cells of a KD-tree.
        boxes_per_ray: f64,
        objects_per_ray: f64,
        /// 64-bit FNV-1a of the pixels: the same for all structures.
        picture: String,
    }

    /// One row of `timing_renders.csv`: the seconds of the same row of `renders.csv`.
    RenderTimeRow in "timing_renders.csv" {
        scene: String,
        method: String,
        repetition: u32,
        /// Number of times that the picture was drawn.
        repeats: usize,
        /// Wall time of building the structure.
        build_seconds: f64,
        /// Wall time of drawing on one thread, the least of all repeats.
        render_seconds: f64,
    }

    /// One row of `turns.csv`: how a turned scene stands.
    TurnRow in "turns.csv" {
        scene: String,
        /// The scene that is turned.
        mesh: String,
        /// The angle about the vertical; empty for a random rotation.
        degrees: Option<u16>,
        /// The seed of the random rotation.
        rotation: Option<u64>,
    }

    /// One row of `best_known.csv` and `references.csv`: what gaps are measured from. Trees are
    /// binary, with one object per leaf.
    ReferenceRow in "references.csv" {
        scene: String,
        objects: usize,
        /// Checksum of the boxes, hexadecimal, which distinguishes scenes of the same name.
        checksum: String,
        /// Name of the objective.
        objective: String,
        /// The least known.
        cost: f64,
        /// Label of the method that found it.
        method: String,
        /// Seed of the run that found it.
        seed: u64,
        /// Git revision of the program that found it.
        revision: String,
    }
}

/// Costs that differ by less than this, relatively, are equal: the rest is rounding.
pub const ROUNDING: f64 = 1e-12;
