//! Shortcuts change no cost, and the builders skip no work that would change one.

use bvh_build::{Builder, muller_fellner::Config};
use bvh_core::{Aabb, cost::internal_area};
use bvh_search::Shortcut;
use bvh_search::{
    Budget, Outcome, Problem, StopReason, best, exact, lower_bound, shortcuts, solve,
};

fn cube(min: [f32; 3], size: f32) -> Aabb {
    Aabb::from((min, min.map(|c| c + size)))
}

/// Scattered numbers below 100.
fn number(i: usize, salt: usize) -> f32 {
    ((i * i * (salt + 1) + i * 7919 + salt * 31 + 13) * 2_654_435 % 1009) as f32 / 10.0
}

fn scattered(n: usize) -> Vec<Aabb> {
    (0..n).map(|i| cube([number(i, 1), number(i, 2), number(i, 3)], number(i, 4) / 9.0)).collect()
}

/// Equal boxes; nested boxes; segments along each axis, in and out of order.
fn stiff(n: usize) -> Vec<Vec<Aabb>> {
    let nested = |i: usize| cube([-(i as f32); 3], 2.0 * i as f32);
    let mut scenes = vec![vec![cube([0.1; 3], 0.7); n], (1..=n).map(nested).collect()];
    for axis in 0..3 {
        let segment = |x: f32| {
            let mut ends = ([0.5; 3], [0.5; 3]);
            (ends.0[axis], ends.1[axis]) = (x, x + 0.25);
            Aabb::from(ends)
        };
        scenes.push((0..n).map(|i| segment(i as f32)).collect());
        scenes.push((0..n).map(|i| segment(number(i, 5))).collect());
    }
    scenes
}

#[test]
fn builds_that_skip_nothing_give_the_same_trees() {
    for n in [0, 1, 2, 3, 10, 257, 5000] {
        for boxes in stiff(n).into_iter().chain([scattered(n)]) {
            let default = Config::default();
            let tree = default.build(&boxes).unwrap();
            for config in [
                Config { skip_same_order: false, ..default.clone() },
                Config { skip_sorted: false, ..default.clone() },
                Config { skip_flat: false, ..default.clone() },
                Config { skip_same_order: false, skip_sorted: false, skip_flat: false, ..default },
            ] {
                assert!(tree == config.build(&boxes).unwrap(), "{n} objects, {config:?}");
            }
        }
    }
}

fn best(boxes: &[Aabb], disabled: &[Shortcut]) -> Outcome {
    let config = best::Config { work_per_object: 20_000, ..Default::default() };
    solve(&config, &Problem { disabled, ..Problem::new(boxes) }, 1, Budget::UNLIMITED, &()).unwrap()
}

#[test]
fn a_search_that_meets_the_bound_stops_with_the_cost_of_one_that_goes_on() {
    for boxes in stiff(60) {
        let stopped = best(&boxes, &[]);
        let all = best(&boxes, &[Shortcut::BoundMet]);
        assert_eq!(stopped.cost, all.cost);
        assert_eq!((stopped.stop, all.stop), (StopReason::Optimal, StopReason::Completed));
        assert!(stopped.work < all.work);
    }
}

#[test]
fn a_tiny_scene_gets_the_optimum_instead_of_a_search() {
    for n in 3..=10 {
        let boxes = scattered(n);
        let optimum = best(&boxes, &[]);
        let searched = best(&boxes, &[Shortcut::Tiny, Shortcut::BoundMet]);
        let exact =
            solve(&exact::Config {}, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()).unwrap();
        assert_eq!(optimum.tree, exact.tree);
        assert_eq!((optimum.stop, optimum.evaluations), (StopReason::Optimal, 1));
        assert!(optimum.cost <= searched.cost * (1.0 + 1e-14), "{n}");
    }
}

#[test]
fn no_tree_is_below_the_bound_and_stiff_scenes_meet_it() {
    for n in 2..=9 {
        for (boxes, met) in
            stiff(n).into_iter().map(|boxes| (boxes, true)).chain([(scattered(n), false)])
        {
            let exact =
                solve(&exact::Config {}, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()).unwrap();
            let bound = lower_bound::of_largest(&boxes);
            assert!(bound <= exact.cost * (1.0 + 1e-14), "{bound} {}", exact.cost);
            assert!(!met || bound >= exact.cost * (1.0 - 1e-14), "{bound} {}", exact.cost);
        }
    }
    assert_eq!(lower_bound::of_largest(&scattered(1)), 0.0);
}

#[test]
fn the_shortcuts_of_a_scene_are_known_before_the_search() {
    fn shortcuts(boxes: &[Aabb]) -> Vec<Shortcut> {
        let found = shortcuts::of(boxes).unwrap();
        found.into_iter().map(|(shortcut, _)| shortcut).collect()
    }
    assert_eq!(shortcuts(&scattered(1)), []);
    assert_eq!(shortcuts(&scattered(500)), [Shortcut::BoundMet]);
    assert_eq!(shortcuts(&scattered(12)), [Shortcut::Tiny, Shortcut::BoundMet]);
    let line = &stiff(50)[3];
    assert_eq!(shortcuts(line), [Shortcut::Flat, Shortcut::BoundMet]);
}

/// A flat axis orders the objects by index, and that may be the best order of all.
#[test]
fn a_flat_axis_that_orders_like_no_other_may_have_the_best_split() {
    // Two crossing rows of flat tiles, one after the other, and the same tiles interleaved.
    fn tile(x: f32, y: f32) -> Aabb {
        Aabb::from(([x, y, 0.0], [x + 1.0, y + 1.0, 0.0]))
    }
    fn cost(boxes: &[Aabb]) -> f64 {
        internal_area(&Config::default().build(boxes).unwrap())
    }
    let positions = (0..9u8).map(|i| 2.0 * f32::from(i));
    let (row, column): (Vec<_>, Vec<_>) =
        positions.map(|position| (tile(position, 8.0), tile(8.0, position))).unzip();
    let one_by_one: Vec<Aabb> = row.iter().chain(&column).copied().collect();
    let interleaved: Vec<Aabb> = row.iter().zip(&column).flat_map(|(a, b)| [*a, *b]).collect();
    assert!(cost(&one_by_one) < cost(&interleaved));
}
