//! Müller–Fellner against an O(n²) transcription of the paper, and the laws it must obey.

use bvh_build::muller_fellner::{Config, Heuristic, MadeUpCosts};
use bvh_build::top_down::AreaOnly;
use bvh_build::{BuildError, Builder};
use bvh_core::{Aabb, Bvh, validate};
use proptest::prelude::*;

/// The sorted object ids below every node, the node's own first, then its children's: the topology of a tree
/// whose nodes come depth first, left before right.
fn topology(tree: &Bvh) -> Vec<Vec<u32>> {
    let mut stack = if tree.nodes.is_empty() { vec![] } else { vec![0] };
    let mut sets = Vec::new();
    while let Some(index) = stack.pop() {
        let mut below = Vec::new();
        let mut todo = vec![index];
        while let Some(at) = todo.pop() {
            below.extend(&tree.prim_ids[tree.nodes[at].prims()]);
            todo.extend(tree.nodes[at].children());
        }
        below.sort_unstable();
        sets.push(below);
        stack.extend(tree.nodes[index].children().rev());
    }
    sets
}

/// The paper's Table 1 word by word: every candidate of every axis from scratch, no blocks, no pruning. The same
/// topology as [`topology`] returns, for `weight` per object and a cost of a split from areas and loads.
fn brute_force(boxes: &[Aabb], weights: &[f32], cost: fn([f64; 2], [f64; 2]) -> f64) -> Vec<Vec<u32>> {
    let around = |ids: &[u32]| ids.iter().fold(Aabb::EMPTY, |b, &id| b.union(&boxes[id as usize]));
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
            ids.sort_unstable();
            ids.sort_by(|&a, &b| {
                let key = |id: u32| boxes[id as usize].doubled_centroid()[axis];
                key(a).total_cmp(&key(b))
            });
            let spanned = [ids[0], ids[n - 1]].iter().all(|&id| boxes[id as usize] == around(&ids));
            for left in if spanned { n / 2..n / 2 + 1 } else { 1..n } {
                let (l, r) = ids.split_at(left);
                let areas = [around(l).half_area(), around(r).half_area()];
                let value = cost(areas, [load(l), load(r)]);
                candidates.push((value, n.abs_diff(2 * left), axis, left, l.to_vec(), r.to_vec()));
            }
        }
        let best = candidates
            .into_iter()
            .min_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2, a.3).cmp(&(b.1, b.2, b.3))));
        let (.., l, r) = best.unwrap();
        stack.extend([r, l]);
    }
    sets
}

/// Boxes on a coarse grid, so that ties, coincidence and zero extents are common, or anywhere.
fn scene(max: usize) -> impl Strategy<Value = Vec<Aabb>> {
    let cell = || (0..8i32).prop_map(|c| c as f32);
    let grid = (prop::array::uniform3(cell()), prop::array::uniform3((0..3i32).prop_map(|c| c as f32)));
    let real = (prop::array::uniform3(-1e3f32..1e3), prop::array::uniform3(0f32..50.0));
    let boxed = |(low, size): ([f32; 3], [f32; 3])| {
        Aabb::from((low, std::array::from_fn(|axis| low[axis] + size[axis])))
    };
    prop_oneof![
        prop::collection::vec(grid.prop_map(boxed), 0..max),
        prop::collection::vec(real.prop_map(boxed), 0..max),
    ]
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
    fn the_tree_is_the_brute_force_one(boxes in scene(120)) {
        let tree = valid(&Config::default(), &boxes);
        let ones = vec![1.0; boxes.len()];
        prop_assert_eq!(topology(&tree), brute_force(&boxes, &ones, |[a, b], [m, n]| a * m + b * n));
    }

    #[test]
    fn the_weighted_tree_is_the_brute_force_one(boxes in scene(60), seed in 0u32..1000) {
        // Whole numbers, whose sums are exact in any order.
        let weights: Vec<f32> = (0..boxes.len() as u32).map(|i| ((i * 7919 + seed) % 5) as f32).collect();
        let tree = Config::default().build_weighted(&boxes, &weights).unwrap();
        validate(&tree, &boxes).unwrap();
        prop_assert_eq!(topology(&tree), brute_force(&boxes, &weights, |[a, b], [m, n]| a * m + b * n));
    }

    #[test]
    fn made_up_costs_are_weights(boxes in scene(60), every in 1u32..5, cost in 0u8..9) {
        let dear = |object: u32| object.is_multiple_of(every);
        let weights = (0..boxes.len() as u32).map(|object| if dear(object) { f32::from(cost) } else { 1.0 });
        let weights: Vec<f32> = weights.collect();
        let costs = MadeUpCosts { every, cost: cost.into() };
        let config = Config { heuristic: Heuristic::AreaTimesCost(costs), ..Config::default() };
        prop_assert_eq!(config.build(&boxes).unwrap(), Config::default().build_weighted(&boxes, &weights).unwrap());
    }

    #[test]
    fn every_reading_of_table_2_is_the_brute_force_one(boxes in scene(70)) {
        type Formula = fn([f64; 2], [f64; 2]) -> f64;
        let readings: [(AreaOnly, Formula); 6] = [
            (AreaOnly::Sum, |[a, b], _| a + b),
            (AreaOnly::InnerSum, |[a, b], [m, n]| if m == 1.0 { 0.0 } else { a } + if n == 1.0 { 0.0 } else { b }),
            (AreaOnly::Max, |[a, b], _| a.max(b)),
            (AreaOnly::SumOfSquares, |[a, b], _| a * a + b * b),
            (AreaOnly::Difference, |[a, b], _| (a - b).abs()),
            (AreaOnly::Product, |[a, b], _| a * b),
        ];
        let ones = vec![1.0; boxes.len()];
        for (reading, formula) in readings {
            let config = Config { heuristic: Heuristic::AreaOnly(reading), ..Config::default() };
            prop_assert_eq!(topology(&valid(&config, &boxes)), brute_force(&boxes, &ones, formula), "{:?}", reading);
        }
    }

    #[test]
    fn skipping_identical_orders_changes_nothing(boxes in scene(200), flat in 0..4usize) {
        let mut boxes = boxes;
        if flat < 3 {
            // Two axes alike: identical orders from the root on.
            boxes.iter_mut().for_each(|b| {
                (b.min[flat], b.max[flat]) = (b.min[(flat + 1) % 3], b.max[(flat + 1) % 3]);
            });
        }
        let skipping = Config::default();
        let scanning = Config { skip_same_order: false, ..Config::default() };
        prop_assert_eq!(skipping.build(&boxes), scanning.build(&boxes));
    }
}

/// A reproducible scatter of `n` small boxes.
fn scatter(n: u32) -> Vec<Aabb> {
    let hash = |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 65_521) as f32;
    (0..n)
        .map(|i| {
            let low = [hash(i, 3), hash(i, 11), hash(i, 19)];
            Aabb::from((low, low.map(|c| c + hash(i, 27) / 4096.0)))
        })
        .collect()
}

#[test]
fn any_number_of_threads_builds_the_same_bytes() {
    let boxes = scatter(30_000);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| valid(&Config::default(), &boxes))
    };
    let one = on(1);
    for threads in [2, 3, 8] {
        assert!(one == on(threads), "{threads} threads");
    }
}

#[test]
fn a_chain_does_not_overflow_any_stack() {
    // Growing concentric boxes: S(L) + S(R) peels one at a time.
    let boxes: Vec<Aabb> = (1..20_000).map(|i| Aabb::from(([-(i as f32); 3], [i as f32; 3]))).collect();
    let config = Config { heuristic: Heuristic::AreaOnly(AreaOnly::Sum), ..Config::default() };
    assert!(valid(&config, &boxes).depth() > 15_000);
}

#[test]
fn what_cannot_be_built_is_refused_by_name() {
    let boxes = scatter(3);
    let weighted = |weights: &[f32]| Config::default().build_weighted(&boxes, weights).unwrap_err().to_string();
    assert_eq!(weighted(&[1.0]), "1 weights were given for 3 objects");
    assert!(weighted(&[1.0, -2.0, 0.0]).starts_with("the weight of object 1 is -2;"));
    let mut bad = boxes.clone();
    bad[2].max.y = f32::NAN;
    assert!(matches!(Config::default().build(&bad), Err(BuildError::InvalidBox(error)) if error.index == 2));
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn scenes_of_few_distinct_boxes_have_exact_boxes_too(corners in prop::collection::vec(any::<[bool; 6]>(), 1..300)) {
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|c| {
                let at = c.map(|bit| f32::from(u8::from(bit)));
                let min = [at[0] * at[3], at[1] * at[4], at[2] * at[5]];
                Aabb::from((min, std::array::from_fn(|k| at[k].max(at[k + 3] * at[0] * at[1]))))
            })
            .collect();
        let tree = Config::default().build(&boxes).unwrap();
        validate(&tree, &boxes).unwrap();
        prop_assert!(tree.is_tight(&boxes));
    }
}
