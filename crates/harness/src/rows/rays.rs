//! The rows about rays that are traced through trees.
#![allow(missing_docs, reason = "columns in the table of `rows`, or whose names are clear")]

use super::Row;
use serde::{Deserialize, Serialize};

rows! {
    #[derive(Default)]
    /// One row of `traversal.csv`: what rays of one kind found and took in one layout of a run's
    /// tree.
    TraceRow in "traversal.csv" {
        scene: String,
        method: String,
        layout: String,
        /// Kind of the rays, the same ones for all methods and layouts.
        rays: String,
        count: u64,
        /// Number of rays that hit something.
        hits: u64,
        missed_hits: u64,
        false_hits: u64,
        other_hits: u64,
        /// Mean number of tests against boxes, the root's included where it is tested; 8 for every
        /// wide node.
        boxes_per_ray: Option<f64>,
        /// Mean number of tests against objects; 4 for every block of triangles.
        objects_per_ray: Option<f64>,
    }

    #[derive(Default)]
    /// One row of `timing_traversal.csv`: the time of rays of one kind in one layout of a run's
    /// tree, on one thread.
    TraceTimeRow in "timing_traversal.csv" {
        scene: String,
        method: String,
        layout: String,
        rays: String,
        count: u64,
        /// Turns that were timed.
        rounds: u32,
        /// Wall time of making the layout from the tree; for other libraries, with the tree.
        preparation_seconds: f64,
        /// Wall time of all rays: the sum over small parts of them of each part's fastest turn.
        seconds: f64,
        /// Sum over the same parts of each part's median turn.
        median_seconds: f64,
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
        references_per_object: f64,
        /// Bytes of the wide layout per object.
        bytes_per_object: f64,
        collapsed_sah: f64,
        /// Nodes and blocks of triangles that a random line through the root's box is expected to
        /// visit.
        layout_over_root: f64,
    }
}
