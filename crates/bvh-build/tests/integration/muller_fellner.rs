//! Müller–Fellner compared with an O(n²) transcription of the paper, and the laws of the method.

use crate::{hash, sized_box};
use bvh_build::muller_fellner::{Config, Heuristic, MadeUpCosts};
use bvh_build::top_down::AreaOnly;
use bvh_build::{BuildError, Builder};
use bvh_core::{Aabb, Bvh, validate};
use proptest::prelude::*;

/// Returns the sorted object ids below every node, depth first and left before right. This
/// describes the topology of a tree.
fn topology(tree: &Bvh) -> Vec<Vec<u32>> {
    let mut stack = if tree.nodes.is_empty() { vec![] } else { vec![0] };
    let mut sets = Vec::new();
    while let Some(index) = stack.pop() {
        let mut below = Vec::new();
        let mut todo = vec![index];
        while let Some(descendant) = todo.pop() {
            let node = &tree.nodes[descendant];
            below.extend(&tree.prim_ids[node.prims()]);
            todo.extend(node.children());
        }
        below.sort_unstable();
        sets.push(below);
        stack.extend(tree.nodes[index].children().rev());
    }
    sets
}

/// The cost of a split from the areas and the loads of its sides.
type Formula = fn([f64; 2], [f64; 2]) -> f64;

/// The readings of Table 2.
const READINGS: [(AreaOnly, Formula); 6] = [
    (AreaOnly::Sum, |[a, b], _| a + b),
    (AreaOnly::InnerSum, |areas, loads| inner(areas[0], loads[0]) + inner(areas[1], loads[1])),
    (AreaOnly::Max, |[a, b], _| a.max(b)),
    (AreaOnly::SumOfSquares, |[a, b], _| a * a + b * b),
    (AreaOnly::Difference, |[a, b], _| (a - b).abs()),
    (AreaOnly::Product, |[a, b], _| a * b),
];

fn inner(area: f64, load: f64) -> f64 {
    if load == 1.0 { 0.0 } else { area }
}

/// Follows the paper's Table 1 literally: examines every candidate of every axis, without blocks
/// and without pruning. Returns the same topology as [`topology`].
fn brute_force(boxes: &[Aabb], weights: &[f32], cost: Formula) -> Vec<Vec<u32>> {
    let load = |ids: &[u32]| ids.iter().map(|&id| f64::from(weights[id as usize])).sum::<f64>();
    let mut stack: Vec<Vec<u32>> = vec![(0..boxes.len() as u32).collect()];
    let mut sets = Vec::new();
    while let Some(mut ids) = stack.pop() {
        ids.sort_unstable();
        if !ids.is_empty() {
            sets.push(ids.clone());
        }
        if ids.len() < 2 {
            continue;
        }
        let n = ids.len();
        let mut candidates = Vec::new();
        for axis in 0..3 {
            sort_along(&mut ids, axis, boxes);
            // If the first and the last box each span all others, all parts of all splits have the
            // same box, and the split in the middle is the only candidate.
            let around_all = around(&ids, boxes);
            let is_spanned =
                boxes[ids[0] as usize] == around_all && boxes[ids[n - 1] as usize] == around_all;
            for left in if is_spanned { n / 2..n / 2 + 1 } else { 1..n } {
                let (low, high) = ids.split_at(left);
                let areas = [around(low, boxes).half_area(), around(high, boxes).half_area()];
                candidates.push(Candidate {
                    cost: cost(areas, [load(low), load(high)]),
                    // Among equal costs the most even split wins, then the lowest axis.
                    rank: (n.abs_diff(2 * left), axis, left),
                    parts: [high.to_vec(), low.to_vec()],
                });
            }
        }
        candidates.sort_by(|a, b| {
            let by_cost = a.cost.total_cmp(&b.cost);
            by_cost.then(a.rank.cmp(&b.rank))
        });
        stack.extend(candidates.swap_remove(0).parts);
    }
    sets
}

/// A split of some objects.
struct Candidate {
    cost: f64,
    rank: (usize, usize, usize),
    /// The upper and the lower part.
    parts: [Vec<u32>; 2],
}

fn sort_along(ids: &mut [u32], axis: usize, boxes: &[Aabb]) {
    let key = |id: u32| boxes[id as usize].doubled_centroid()[axis];
    ids.sort_unstable();
    ids.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
}

fn around(ids: &[u32], boxes: &[Aabb]) -> Aabb {
    let mut aabb = Aabb::EMPTY;
    for &id in ids {
        aabb = aabb.union(&boxes[id as usize]);
    }
    aabb
}

/// Makes boxes on a coarse grid or anywhere, some of them in a plane or on a line. On the grid ties,
/// coincidence and zero extents are common, and on the coarsest most boxes are equal.
fn scene(max: usize) -> impl Strategy<Value = Vec<Aabb>> {
    let corner = |cells: u8| prop::array::uniform3((0..cells).prop_map(f32::from));
    let real_corner = prop::array::uniform3(-1e3f32..1e3);
    let real_size = prop::array::uniform3(0f32..50.0);
    let boxes = prop_oneof![
        prop::collection::vec((corner(8), corner(3)).prop_map(sized_box), 0..max),
        prop::collection::vec((corner(2), corner(2)).prop_map(sized_box), 0..max),
        prop::collection::vec((real_corner, real_size).prop_map(sized_box), 0..max),
    ];
    (boxes, prop::array::uniform3(0..4u8)).prop_map(|(mut boxes, flat)| {
        for axis in (0..3).filter(|&axis| flat[axis] == 0) {
            boxes.iter_mut().for_each(|aabb| (aabb.min[axis], aabb.max[axis]) = (0.5, 0.5));
        }
        boxes
    })
}

fn valid(config: &Config, boxes: &[Aabb]) -> Bvh {
    let tree = config.build(boxes).unwrap();
    validate(&tree, boxes).unwrap();
    assert!(tree.is_tight(boxes));
    tree
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn the_tree_of_every_heuristic_is_the_brute_force_one(
        boxes in scene(100), every in 1u32..5, cost in 0u8..9,
    ) {
        let ones = vec![1.0; boxes.len()];
        let mut weights = ones.clone();
        weights.iter_mut().step_by(every as usize).for_each(|weight| *weight = cost.into());
        let product: Formula = |[a, b], [m, n]| a * m + b * n;
        let weighted = Heuristic::AreaTimesCost(MadeUpCosts { every, cost: cost.into() });
        let of_counts = [(Heuristic::AreaTimesCount, &ones, product), (weighted, &weights, product)];
        let readings = READINGS.map(|(read, formula)| (Heuristic::AreaOnly(read), &ones, formula));
        for (heuristic, weights, formula) in of_counts.into_iter().chain(readings) {
            let config = Config { heuristic, ..Config::default() };
            let expected = brute_force(&boxes, weights, formula);
            prop_assert_eq!(topology(&valid(&config, &boxes)), expected, "{:?}", heuristic);
        }
    }

    #[test]
    fn skipping_work_changes_nothing(mut boxes in scene(200), copied in 0..4usize, is_sorted: bool) {
        if copied < 3 {
            // Two equal axes have identical orders from the root on.
            for aabb in &mut boxes {
                aabb.min[copied] = aabb.min[(copied + 1) % 3];
                aabb.max[copied] = aabb.max[(copied + 1) % 3];
            }
        }
        if is_sorted {
            boxes.sort_by(|a, b| a.doubled_centroid().x.total_cmp(&b.doubled_centroid().x));
        }
        let expected = Config::default().build(&boxes);
        for config in skipping_less() {
            prop_assert_eq!(&config.build(&boxes), &expected, "{:?}", config);
        }
    }
}

fn skipping_less() -> [Config; 4] {
    let skipping = |[skip_same_order, skip_sorted, skip_flat]: [bool; 3]| Config {
        skip_same_order,
        skip_sorted,
        skip_flat,
        ..Config::default()
    };
    [[false, true, true], [true, false, true], [true, true, false], [false; 3]].map(skipping)
}

#[test]
fn skipping_work_changes_nothing_where_threads_divide_the_objects() {
    let x = |i| hash(i, 3, 65_521);
    let line = |i| sized_box(([x(i), 0.5, 0.5], [0.25, 0.0, 0.0]));
    let diagonal = |i| sized_box(([x(i), x(i), hash(i, 11, 65_521)], [9.0, 9.0, 0.0]));
    for boxes in [(0..5000).map(line).collect::<Vec<_>>(), (0..5000).map(diagonal).collect()] {
        let expected = Config::default().build(&boxes);
        for config in skipping_less() {
            assert!(config.build(&boxes) == expected, "{config:?}");
        }
    }
}

fn scatter(n: u32) -> Vec<Aabb> {
    let hash = |i, salt| hash(i, salt, 65_521);
    let corner = |i| [hash(i, 3), hash(i, 11), hash(i, 19)];
    (0..n).map(|i| sized_box((corner(i), [hash(i, 27) / 4096.0; 3]))).collect()
}

#[test]
fn any_number_of_threads_builds_the_same_bytes() {
    let boxes = scatter(30_000);
    let expected = valid_on_threads(1, &boxes);
    for threads in [2, 3, 8] {
        assert!(valid_on_threads(threads, &boxes) == expected, "{threads} threads");
    }
}

fn valid_on_threads(threads: usize, boxes: &[Aabb]) -> Bvh {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
    builder.build().unwrap().install(|| valid(&Config::default(), boxes))
}

#[test]
fn a_chain_does_not_overflow_any_stack() {
    // Growing concentric boxes: S(L) + S(R) peels one at a time.
    let mut boxes = Vec::new();
    for size in (1..20_000u16).map(f32::from) {
        boxes.push(Aabb::from(([-size; 3], [size; 3])));
    }
    let config = Config { heuristic: Heuristic::AreaOnly(AreaOnly::Sum), ..Config::default() };
    assert!(valid(&config, &boxes).depth() > 15_000);
}

#[test]
fn an_error_reports_the_invalid_input() {
    let boxes = scatter(3);
    let mut bad = boxes.clone();
    bad[2].max.y = f32::NAN;
    assert!(
        matches!(Config::default().build(&bad), Err(BuildError::InvalidBox(error)) if error.index == 2)
    );
    let config = Config { heuristic: Heuristic::AreaTimesPower(1.5), ..Config::default() };
    assert_eq!(
        config.build(&boxes).unwrap_err().to_string(),
        "heuristic.area_times_power is 1.5; accepted: 0 to 1"
    );
    let costs = MadeUpCosts { every: 0, cost: 2.0 };
    let config = Config { heuristic: Heuristic::AreaTimesCost(costs), ..Config::default() };
    let message = config.build(&boxes).unwrap_err().to_string();
    assert_eq!(message, "heuristic.area_times_cost.every is 0; accepted: 1 or more");
}
