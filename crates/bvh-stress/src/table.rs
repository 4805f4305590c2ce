//! The table of cases.

use crate::case::Check::{Method, Part, Refused, Scene};
use crate::case::Part::{Costs, ObjFiles, Rays, TreeFiles};
use crate::case::{Also, Case, Check, SceneCase, Size};
use crate::checks::{files, methods, rays, scenes};
use bvh_core::{Aabb, Triangle};
use bvh_scenes::builtin::stiff;
use glam::Vec3;

/// Returns the case with this identifier.
pub fn by_id(id: &str) -> Option<&'static Case> {
    CASES.iter().find(|case| case.id == id)
}

/// Returns the scene of every case that has one, in its smallest size and with at most `most`
/// triangles.
pub fn scenes(most: usize) -> impl Iterator<Item = (&'static Case, Vec<Triangle>)> {
    CASES.iter().filter_map(move |case| {
        let few = case.scene()?.sizes[Size::Few as usize];
        Some((case, case.triangles(few.min(most))))
    })
}

const fn case(id: &'static str, name: &'static str, checks: &'static [Check]) -> Case {
    Case { id, name, checks }
}

/// A scene with a further promise.
const fn scene(sizes: [usize; 3], also: Also) -> Check {
    Scene(SceneCase { sizes, also: Some(also) })
}

/// A scene with only the general promises.
const fn plain(sizes: [usize; 3]) -> Check {
    Scene(SceneCase { sizes, also: None })
}

/// Returns the uniform scene with one damaged box.
fn with_bad_object(n: usize, damage: fn(&mut Aabb)) -> Vec<Aabb> {
    // All other boxes are valid, so that the error can only be about this one.
    let mut boxes = stiff::boxes(&stiff::uniform(n));
    boxes.iter_mut().skip(BAD).take(1).for_each(damage);
    boxes
}

/// The index of the damaged object.
const BAD: usize = 7;

const fn refused(boxes: fn(usize) -> Vec<Aabb>) -> Check {
    Refused { boxes, object: BAD }
}

/// All cases in order. Sizes: for searches and rays; for builders in the tests; for builders at the
/// full size of the case.
pub static CASES: [Case; 45] = [
    case("S01", "empty", &[scene([0, 0, 0], scenes::empty_tree)]),
    case("S02", "one object", &[scene([1, 1, 1], scenes::one_leaf)]),
    case("S03", "two objects", &[scene([2, 2, 2], scenes::one_inner_node)]),
    case("S04", "identical boxes", &[scene([100, 20_000, 100_000], scenes::balanced)]),
    case("S05", "identical points", &[scene([100, 20_000, 100_000], scenes::balanced_at_no_cost)]),
    case("S06", "concentric boxes", &[plain([100, 2_000, 20_000])]),
    case("S07", "65 537 coincident boxes", &[scene([257, 65_537, 65_537], scenes::balanced)]),
    case(
        "S08",
        "centres collinear",
        &[scene([100, 3_000, 20_000], scenes::same_orders_change_nothing)],
    ),
    case("S09", "planar grid", &[scene([144, 4_096, 65_536], scenes::about_one_cover_per_level)]),
    case("S10", "all on a line", &[scene([100, 20_000, 100_000], scenes::shallow_at_no_cost)]),
    case("S11", "axis-parallel facets", &[plain([120, 3_000, 30_000])]),
    case("S12", "rays in planes, edges, vertices", &[plain([192, 3_072, 30_000])]),
    case("S13", "directions with signed zeros", &[plain([108, 1_200, 1_200])]),
    case("S14", "origins inside, on faces, at corners", &[plain([12, 12, 12])]),
    case("S15", "rays that are none", &[Part(Rays, rays::no_such_rays)]),
    case("S16", "ranges of rays", &[Part(Rays, rays::ranges_are_defined)]),
    case(
        "S17",
        "degenerate triangles",
        &[plain([120, 3_000, 30_000]), Part(ObjFiles, files::degenerate_are_counted)],
    ),
    case(
        "S18",
        "NaN",
        &[
            refused(|n| with_bad_object(n, |b| b.max.y = f32::NAN)),
            refused(|n| with_bad_object(n, |b| *b = Aabb { min: Vec3::NAN, max: Vec3::NAN })),
            Part(ObjFiles, files::nan_in_a_file),
        ],
    ),
    case(
        "S19",
        "infinite coordinate",
        &[
            refused(|n| with_bad_object(n, |b| b.max.z = f32::INFINITY)),
            refused(|n| with_bad_object(n, |b| *b = Aabb::EMPTY)),
            Part(ObjFiles, files::infinity_in_a_file),
        ],
    ),
    case(
        "S20",
        "min above max",
        &[refused(|n| with_bad_object(n, |b| std::mem::swap(&mut b.min, &mut b.max)))],
    ),
    case(
        "S21",
        "scales 2^-120 to 2^120",
        &[plain([100, 1_000, 10_000]), Method(None, methods::scales)],
    ),
    case(
        "S22",
        "denormal sizes",
        &[plain([100, 3_000, 30_000]), Part(Rays, rays::denormal_distances)],
    ),
    case("S23", "coordinates at 3e38", &[plain([100, 3_000, 30_000])]),
    case("S24", "unit detail at 1e6 and 1e8", &[plain([100, 3_000, 30_000])]),
    case("S25", "positions 2^k", &[plain([120, 250, 250])]),
    case("S26", "sorted order", &[plain([100, 20_000, 1_000_000])]),
    case("S27", "teapot in a stadium", &[scene([150, 3_000, 30_000], scenes::teapot_is_isolated)]),
    case("S28", "giant over many small", &[scene([150, 3_000, 30_000], scenes::both_costs)]),
    case("S29", "slivers", &[plain([120, 3_000, 30_000])]),
    case("S30", "overlapping large triangles", &[plain([120, 3_000, 10_000])]),
    case("S31", "two densities", &[plain([150, 3_000, 30_000])]),
    case(
        "S32",
        "symmetric scene",
        &[scene([120, 3_000, 30_000], scenes::reflection_costs_the_same)],
    ),
    case("S33", "objects permuted", &[scene([120, 3_000, 30_000], scenes::order_does_not_matter)]),
    case("S34", "every triangle 10 times", &[plain([120, 20_000, 100_000])]),
    case("S35", "OBJ files as they come", &[Part(ObjFiles, files::files_as_people_write_them)]),
    case("S36", "uniform triangles", &[plain([300, 50_000, 10_000_000])]),
    case("S37", "threads and seeds", &[Method(None, methods::threads_and_seeds)]),
    case("S38", "damaged tree files", &[Part(TreeFiles, files::damaged_tree_files)]),
    case("S39", "budgets 0, 1 ms, cancelled", &[Method(None, methods::budgets_end)]),
    case("S40", "genetic edge cases", &[Method(Some("genetic"), methods::genetic_edges)]),
    case("S41", "GRASP edge cases", &[Method(Some("grasp"), methods::grasp_edges)]),
    case(
        "S42",
        "a million moves",
        &[
            Method(Some("annealing"), methods::a_million_moves),
            Part(Costs, methods::insertion_keeps_its_cost),
        ],
    ),
    case("S43", "exact optimum known", &[Method(None, methods::above_the_optimum)]),
    case("S44", "ray estimator", &[Part(Rays, rays::estimates_converge)]),
    case("S45", "two unit cubes", &[scene([2, 2, 2], scenes::root_area_is_seven)]),
];
