//! S36: the peak memory of builders is bounded. A program of its own, because everything that a
//! program allocates counts.

use bvh_scenes::builtin::stiff;
use bvh_search::{Budget, Method, Problem, solve};
use bvh_stress::{by_id, is_builder};
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// The most bytes per object that each builder holds at once beyond the objects' boxes. The tree
/// has 64.
const MOST: [(&str, usize); 4] = [
    ("muller_fellner", 200),
    ("median_cut", 100),
    ("goldsmith_salmon", 350),
    ("agglomerative", 200),
];

#[test]
fn builders_hold_a_bounded_number_of_bytes_per_object() {
    let case = by_id("S36").unwrap();
    let objects = case.sizes.unwrap()[1];
    let boxes = stiff::boxes(&case.triangles(objects));
    for builder in Method::all().iter().filter(|method| is_builder(method)) {
        let (name, most) = MOST.into_iter().find(|(name, _)| *name == builder.name()).unwrap();
        let before = ALLOCATED.current_usage();
        ALLOCATED.reset_peak_usage();
        let outcome = solve(builder, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()).unwrap();
        let bytes = (ALLOCATED.peak_usage() - before) / objects;
        assert!((32..=most).contains(&bytes), "{name}: {bytes} bytes per object");
        drop(outcome);
    }
}
