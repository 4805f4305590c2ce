//! Shortcuts change no cost.

use crate::scatter;
use bvh_core::Aabb;
use bvh_search::{
    Budget, Outcome, Problem, Shortcut, StopReason, best, exact, lower_bound, shortcuts, solve,
};

fn cube(min: [f32; 3], size: f32) -> Aabb {
    Aabb::from((min, min.map(|c| c + size)))
}

/// Scattered numbers below 100.
fn number(i: usize) -> f32 {
    ((6 * i * i + 7919 * i + 168) * 2_654_435 % 1009) as f32 / 10.0
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
        scenes.push((0..n).map(|i| segment(number(i))).collect());
    }
    scenes
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
        let boxes = scatter(n as u32, 1);
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
            stiff(n).into_iter().map(|boxes| (boxes, true)).chain([(scatter(n as u32, 1), false)])
        {
            let exact =
                solve(&exact::Config {}, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()).unwrap();
            let bound = lower_bound::of_largest(&boxes);
            assert!(bound <= exact.cost * (1.0 + 1e-14), "{bound} {}", exact.cost);
            assert!(!met || bound >= exact.cost * (1.0 - 1e-14), "{bound} {}", exact.cost);
        }
    }
    assert_eq!(lower_bound::of_largest(&scatter(1, 1)), 0.0);
}

#[test]
fn the_shortcuts_of_a_scene_are_known_before_the_search() {
    fn shortcuts(boxes: &[Aabb]) -> Vec<Shortcut> {
        let found = shortcuts::of(boxes).unwrap();
        found.into_iter().map(|(shortcut, _)| shortcut).collect()
    }
    assert_eq!(shortcuts(&scatter(1, 1)), []);
    assert_eq!(shortcuts(&scatter(500, 1)), []);
    assert_eq!(shortcuts(&scatter(12, 1)), [Shortcut::Tiny]);
    let line = &stiff(50)[3];
    assert_eq!(shortcuts(line), [Shortcut::Flat]);
}
