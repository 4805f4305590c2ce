//! The table of cases.

use super::Check::{Method, Part, Refused, Scene};
use super::{Also, Case, Check, SceneCase, behaviour, extra, scenes};
use bvh_core::{Aabb, Triangle};
use glam::Vec3;

const fn case(id: &'static str, name: &'static str, checks: &'static [Check]) -> Case {
    Case { id, name, checks }
}

/// A scene with a promise of its own.
const fn scene(scene: fn(usize) -> Vec<Triangle>, sizes: [usize; 3], also: Also) -> Check {
    Scene(SceneCase { scene, sizes, also: Some(also) })
}

/// A scene of which P1 to P7 are asked.
const fn plain(scene: fn(usize) -> Vec<Triangle>, sizes: [usize; 3]) -> Check {
    Scene(SceneCase { scene, sizes, also: None })
}

/// The uniform scene with one object changed.
fn with_bad_object(n: usize, damage: fn(&mut Aabb)) -> Vec<Aabb> {
    let mut boxes = scenes::boxes(&scenes::uniform(n));
    boxes.iter_mut().skip(BAD).take(1).for_each(damage);
    boxes
}

/// The object that is changed.
const BAD: usize = 7;

const fn refused(boxes: fn(usize) -> Vec<Aabb>) -> Check {
    Refused { boxes, object: BAD }
}

/// All cases in order. Sizes: for searches and rays; for builders in the tests; for builders as the case is meant.
pub static CASES: [Case; 45] = [
    case("S01", "empty", &[scene(scenes::uniform, [0, 0, 0], extra::empty_tree)]),
    case("S02", "one object", &[scene(scenes::uniform, [1, 1, 1], extra::one_leaf)]),
    case("S03", "two objects", &[scene(scenes::uniform, [2, 2, 2], extra::one_inner_node)]),
    case("S04", "identical boxes", &[scene(scenes::identical_boxes, [100, 20_000, 100_000], extra::balanced)]),
    case(
        "S05",
        "identical points",
        &[scene(scenes::identical_points, [100, 20_000, 100_000], extra::balanced_for_nothing)],
    ),
    case("S06", "concentric boxes", &[plain(scenes::concentric, [100, 2_000, 20_000])]),
    case(
        "S07",
        "65 537 coincident boxes",
        &[scene(scenes::identical_boxes, [257, 65_537, 65_537], extra::balanced)],
    ),
    case(
        "S08",
        "centres collinear",
        &[scene(scenes::collinear_centres, [100, 3_000, 20_000], extra::same_orders_change_nothing)],
    ),
    case(
        "S09",
        "planar grid",
        &[scene(scenes::planar_grid, [144, 4_096, 65_536], extra::about_one_cover_per_level)],
    ),
    case(
        "S10",
        "all on a line",
        &[scene(scenes::on_a_line, [100, 20_000, 100_000], extra::shallow_for_nothing)],
    ),
    case("S11", "axis-parallel facets", &[plain(scenes::facets, [120, 3_000, 30_000])]),
    case("S12", "rays in planes, edges, vertices", &[plain(scenes::closed_box, [192, 3_072, 30_000])]),
    case("S13", "directions with signed zeros", &[plain(scenes::closed_box, [108, 1_200, 1_200])]),
    case("S14", "origins inside, on faces, at corners", &[plain(scenes::closed_box, [12, 12, 12])]),
    case("S15", "rays that are none", &[Part("rays", behaviour::no_such_rays)]),
    case("S16", "ranges of rays", &[Part("rays", behaviour::ranges_are_defined)]),
    case(
        "S17",
        "degenerate triangles",
        &[
            plain(scenes::degenerate, [120, 3_000, 30_000]),
            Part("OBJ files", behaviour::degenerate_are_counted),
        ],
    ),
    case(
        "S18",
        "NaN",
        &[
            refused(|n| with_bad_object(n, |b| b.max.y = f32::NAN)),
            refused(|n| with_bad_object(n, |b| *b = Aabb { min: Vec3::NAN, max: Vec3::NAN })),
            Part("OBJ files", behaviour::nan_in_a_file),
        ],
    ),
    case(
        "S19",
        "infinite coordinate",
        &[
            refused(|n| with_bad_object(n, |b| b.max.z = f32::INFINITY)),
            refused(|n| with_bad_object(n, |b| *b = Aabb::EMPTY)),
            Part("OBJ files", behaviour::infinity_in_a_file),
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
        &[plain(scenes::uniform, [100, 1_000, 10_000]), Method(None, behaviour::scales)],
    ),
    case("S22", "denormal sizes", &[plain(scenes::denormal, [100, 3_000, 30_000])]),
    case("S23", "coordinates at 3e38", &[plain(scenes::enormous, [100, 3_000, 30_000])]),
    case("S24", "unit detail at 1e6 and 1e8", &[plain(scenes::far_away, [100, 3_000, 30_000])]),
    case("S25", "positions 2^k", &[plain(scenes::powers_of_two, [120, 250, 250])]),
    case("S26", "sorted order", &[plain(scenes::sorted, [100, 20_000, 1_000_000])]),
    case(
        "S27",
        "teapot in a stadium",
        &[scene(scenes::teapot_in_a_stadium, [150, 3_000, 30_000], extra::teapot_is_isolated)],
    ),
    case(
        "S28",
        "giant over many small",
        &[scene(scenes::giant_over_small, [150, 3_000, 30_000], extra::both_costs)],
    ),
    case("S29", "slivers", &[plain(scenes::slivers, [120, 3_000, 30_000])]),
    case("S30", "overlapping large triangles", &[plain(scenes::overlapping, [120, 3_000, 10_000])]),
    case("S31", "two densities", &[plain(scenes::two_densities, [150, 3_000, 30_000])]),
    case(
        "S32",
        "symmetric scene",
        &[scene(scenes::symmetric, [120, 3_000, 30_000], extra::reflection_costs_the_same)],
    ),
    case(
        "S33",
        "objects permuted",
        &[scene(scenes::uniform, [120, 3_000, 30_000], extra::order_does_not_matter)],
    ),
    case("S34", "every triangle 10 times", &[plain(scenes::tenfold, [120, 20_000, 100_000])]),
    case("S35", "OBJ files as they come", &[Part("OBJ files", behaviour::files_as_people_write_them)]),
    case("S36", "ten million triangles", &[plain(scenes::uniform, [300, 50_000, 10_000_000])]),
    case("S37", "threads and seeds", &[Method(None, behaviour::threads_and_seeds)]),
    case("S38", "damaged tree files", &[Part("tree files", behaviour::damaged_tree_files)]),
    case("S39", "budgets 0, 1 ms, cancelled", &[Method(None, behaviour::budgets_end)]),
    case("S40", "genetic edge cases", &[Method(Some("genetic"), behaviour::genetic_edges)]),
    case("S41", "GRASP edge cases", &[Method(Some("grasp"), behaviour::grasp_edges)]),
    case(
        "S42",
        "a million moves",
        &[
            Method(Some("annealing"), behaviour::a_million_moves),
            Part("costs", behaviour::insertion_keeps_its_cost),
        ],
    ),
    case("S43", "exact optimum known", &[Method(None, behaviour::above_the_optimum)]),
    case("S44", "ray estimator", &[Part("rays", behaviour::estimates_converge)]),
    case("S45", "two unit cubes", &[scene(scenes::two_cubes, [2, 2, 2], extra::seven)]),
];
