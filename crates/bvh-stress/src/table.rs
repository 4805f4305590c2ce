//! The table of cases.

use crate::case::Check::{Method, Outcome, Part, Refused};
use crate::case::{Case, Check, Size};
use crate::checks::{files, methods, rays, scenes};
use bvh_core::{Aabb, Triangle};
use glam::Vec3;

/// Returns the case with this identifier.
pub fn by_id(id: &str) -> Option<&'static Case> {
    CASES.iter().find(|case| case.id == id)
}

/// Returns the scene of every case that has one, in its smallest size and with at most `most`
/// triangles.
pub fn scenes(most: usize) -> impl Iterator<Item = (&'static Case, Vec<Triangle>)> {
    CASES.iter().filter_map(move |case| {
        let few = case.sizes?[Size::Few as usize];
        Some((case, case.triangles(few.min(most))))
    })
}

const fn bare(id: &'static str, name: &'static str, checks: &'static [Check]) -> Case {
    Case { id, name, sizes: None, checks }
}

const fn case(
    id: &'static str,
    name: &'static str,
    sizes: [usize; 3],
    checks: &'static [Check],
) -> Case {
    Case { id, name, sizes: Some(sizes), checks }
}

/// All cases in order. Sizes: for searches and rays; for builders in the tests; for builders at the
/// full size of the case.
pub static CASES: [Case; 45] = [
    case("S01", "empty", [0, 0, 0], &[Outcome(scenes::fewest_nodes)]),
    case("S02", "one object", [1, 1, 1], &[Outcome(scenes::fewest_nodes)]),
    case("S03", "two objects", [2, 2, 2], &[Outcome(scenes::fewest_nodes)]),
    case("S04", "identical boxes", [100, 20_000, 100_000], &[Outcome(scenes::balanced)]),
    case(
        "S05",
        "identical points",
        [100, 20_000, 100_000],
        &[Outcome(scenes::balanced_at_no_cost)],
    ),
    case("S06", "concentric boxes", [100, 2_000, 20_000], &[]),
    case("S07", "65 537 coincident boxes", [257, 65_537, 65_537], &[Outcome(scenes::balanced)]),
    case(
        "S08",
        "centres collinear",
        [100, 3_000, 20_000],
        &[Outcome(scenes::same_orders_change_nothing)],
    ),
    case("S09", "planar grid", [144, 4_096, 65_536], &[Outcome(scenes::about_one_cover_per_level)]),
    case("S10", "all on a line", [100, 20_000, 100_000], &[Outcome(scenes::shallow_at_no_cost)]),
    case("S11", "axis-parallel facets", [120, 3_000, 30_000], &[]),
    case("S12", "rays in planes, edges, vertices", [192, 3_072, 30_000], &[]),
    case("S13", "directions with signed zeros", [108, 1_200, 1_200], &[]),
    case("S14", "origins inside, on faces, at corners", [12, 12, 12], &[]),
    bare("S15", "rays that are none", &[Part("rays", rays::no_such_rays)]),
    bare("S16", "ranges of rays", &[Part("rays", rays::ranges_are_defined)]),
    case(
        "S17",
        "degenerate triangles",
        [120, 3_000, 30_000],
        &[Part("OBJ files", files::degenerate_are_counted)],
    ),
    bare(
        "S18",
        "NaN",
        &[
            Refused(|b| b.max.y = f32::NAN),
            Refused(|b| *b = Aabb { min: Vec3::NAN, max: Vec3::NAN }),
            Part("OBJ files", files::nan_in_a_file),
        ],
    ),
    bare(
        "S19",
        "infinite coordinate",
        &[
            Refused(|b| b.max.z = f32::INFINITY),
            Refused(|b| *b = Aabb::EMPTY),
            Part("OBJ files", files::infinity_in_a_file),
        ],
    ),
    bare("S20", "min above max", &[Refused(|b| std::mem::swap(&mut b.min, &mut b.max))]),
    case("S21", "scales 2^-120 to 2^120", [100, 1_000, 10_000], &[Method("", methods::scales)]),
    case("S22", "denormal sizes", [100, 3_000, 30_000], &[Part("rays", rays::denormal_distances)]),
    case("S23", "coordinates at 3e38", [100, 3_000, 30_000], &[]),
    case("S24", "unit detail at 1e6 and 1e8", [100, 3_000, 30_000], &[]),
    case("S25", "positions 2^k", [120, 250, 250], &[]),
    case("S26", "sorted order", [100, 20_000, 1_000_000], &[]),
    case(
        "S27",
        "teapot in a stadium",
        [150, 3_000, 30_000],
        &[Outcome(scenes::teapot_is_isolated)],
    ),
    case("S28", "giant over many small", [150, 3_000, 30_000], &[Outcome(scenes::both_costs)]),
    case("S29", "slivers", [120, 3_000, 30_000], &[]),
    case("S30", "overlapping large triangles", [120, 3_000, 10_000], &[]),
    case("S31", "two densities", [150, 3_000, 30_000], &[]),
    case(
        "S32",
        "symmetric scene",
        [120, 3_000, 30_000],
        &[Outcome(scenes::reflection_costs_the_same)],
    ),
    case(
        "S33",
        "objects permuted",
        [120, 3_000, 30_000],
        &[Outcome(scenes::order_does_not_matter)],
    ),
    case("S34", "every triangle 10 times", [120, 20_000, 100_000], &[]),
    bare("S35", "OBJ files as they come", &[Part("OBJ files", files::files_as_people_write_them)]),
    case("S36", "uniform triangles", [300, 50_000, 10_000_000], &[]),
    bare("S37", "threads and seeds", &[Method("", methods::threads_and_seeds)]),
    bare("S38", "damaged tree files", &[Part("tree files", files::damaged_tree_files)]),
    bare("S39", "budgets 0, 1 ms, cancelled", &[Method("", methods::budgets_end)]),
    bare("S40", "genetic edge cases", &[Method("genetic", methods::genetic_edges)]),
    bare("S41", "GRASP edge cases", &[Method("grasp", methods::grasp_edges)]),
    bare(
        "S42",
        "a million moves",
        &[
            Method("annealing", methods::a_million_moves),
            Part("costs", methods::insertion_keeps_its_cost),
        ],
    ),
    bare("S43", "exact optimum known", &[Method("", methods::above_the_optimum)]),
    bare("S44", "ray estimator", &[Part("rays", rays::estimates_converge)]),
    case("S45", "two unit cubes", [2, 2, 2], &[Outcome(scenes::root_area_is_seven)]),
];

/// The kinds of cases by name, in the order of figures. Every case has one.
pub const KINDS: [(&str, &[&str]); 10] = [
    ("Nothing, one, two", &["S01", "S02", "S03", "S45"]),
    ("All the same", &["S04", "S05", "S06", "S07", "S34"]),
    ("Flat or on a line", &["S08", "S09", "S10", "S11", "S12", "S26"]),
    ("Degenerate, slivers", &["S17", "S29", "S30"]),
    ("Huge, tiny, far away", &["S21", "S22", "S23", "S24", "S25"]),
    ("NaN, infinite, inverted", &["S18", "S19", "S20"]),
    ("Uneven sizes", &["S27", "S28", "S31", "S36"]),
    ("Symmetry, order", &["S32", "S33"]),
    ("Odd rays", &["S13", "S14", "S15", "S16", "S44"]),
    ("Files, budgets, edges", &["S35", "S37", "S38", "S39", "S40", "S41", "S42", "S43"]),
];
