//! What a bake chooses by itself, and when.

use crate::{scatter, work};
use bvh_scenes::Scene;
use bvh_scenes::rays::anywhere;
use bvh_search::bvh_core::Primitives;
use bvh_search::{
    Chosen, Frames, More, Objects, Observer, Open, Options, OwnedTree, Reason, Tried, prelude::*,
};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Leaves everything open, but makes no rays.
const BUT_RAYS: Open =
    Open { budget: true, cost: true, references: true, rays: None, anywhere: None };

fn chosen(scene: &Scene, open: &Open, observer: &dyn Observer) -> Chosen {
    let bake = Bake { shapes: Some(&scene.primitives), ..Bake::new(&scene.boxes) };
    bake.choose(open, None, observer).unwrap()
}

/// Returns what was tried, and whether it was chosen.
fn tried(chosen: &Chosen) -> Vec<(Tried, bool)> {
    let tried = |reason: &Reason| match *reason {
        Reason::Tried { choice, is_chosen, saved } => {
            assert!(!is_chosen || saved > 0.0, "{reason}");
            Some((choice, is_chosen))
        }
        _ => None,
    };
    chosen.reasons.iter().filter_map(tried).collect()
}

#[test]
fn only_what_is_open_is_tried_and_only_with_an_open_budget() {
    let scene = Scene::load("escher:60").unwrap();
    let made = |tree: &_, seed, is_over: &dyn Fn() -> bool| {
        anywhere(&scene.primitives, tree, seed, is_over)
    };
    let all = Open { anywhere: Some(&made), ..BUT_RAYS };
    let (cost, rays, references) = (Tried::Layout, Tried::Rays, Tried::References);
    for (open, expected) in [
        (all, &[cost, rays, references][..]),
        (Open { cost: false, references: false, ..all }, &[rays]),
        (Open { rays: Some(&made), ..all }, &[references]),
        (BUT_RAYS, &[cost, references]),
        (Open { budget: false, ..all }, &[]),
        (Open::default(), &[]),
    ] {
        let found = chosen(&scene, &open, &());
        let names: Vec<Tried> = tried(&found).into_iter().map(|(choice, _)| choice).collect();
        assert_eq!(names, expected);
        let is_open = found.reasons.iter().any(|reason| matches!(reason, Reason::Work { .. }));
        assert_eq!(is_open, open.budget);
        assert_eq!(found.greedy.is_some(), !expected.is_empty());
    }
    // Only triangles have a wide layout.
    assert_eq!(tried(&chosen(&Scene::load("spheres75").unwrap(), &BUT_RAYS, &())), []);
    let bake = Bake { shapes: Some(&scene.primitives), ..Bake::new(&scene.boxes) };
    let start = bake.greedy(&()).unwrap().unwrap();
    let later = Bake { start: Some(&start), ..bake }.choose(&all, None, &()).unwrap();
    assert_eq!(tried(&later), []);
}

#[test]
fn few_objects_which_have_an_exact_optimum_and_objects_without_area_are_chosen_for_without_doubt() {
    let on_a_line = |count: u8| {
        let at = |x: u8| [f32::from(x), 0.0, 0.0];
        let triangles = (0..count).map(|x| Triangle::from([at(x), at(x + 1), at(x)])).collect();
        Scene::new("line", bvh_scenes::SceneKind::File, Primitives::Triangles(triangles))
    };
    for (count, tries) in [(1, false), (2, false), (10, false), (11, true)] {
        let scene = on_a_line(count);
        let made = |tree: &_, seed, is_over: &dyn Fn() -> bool| {
            assert!(tries, "rays take as long for one triangle as for many");
            anywhere(&scene.primitives, tree, seed, is_over)
        };
        let found = chosen(&scene, &Open { anywhere: Some(&made), ..BUT_RAYS }, &());
        let saved = found.reasons.iter().filter_map(|reason| match *reason {
            Reason::Tried { saved, .. } => Some(saved),
            _ => None,
        });
        assert_eq!(saved.collect::<Vec<f64>>(), if tries { &[0.0; 3][..] } else { &[] });
    }
}

#[test]
fn objects_are_divided_where_they_are_large_and_oblique_and_not_where_they_are_boxes_themselves() {
    let choice = |name: &str| {
        let chosen = chosen(&Scene::load(name).unwrap(), &BUT_RAYS, &());
        tried(&chosen).into_iter().find(|(choice, _)| *choice == Tried::References).unwrap().1
    };
    assert!(choice("escher:3000"));
    // Triangles along the axes fill their boxes.
    assert!(!choice("S04:2000"));
    // The division that was tried is used, whatever the bake would have permitted.
    let Scene { primitives, boxes, .. } = &Scene::load("escher:3000").unwrap();
    let bake = Bake { shapes: Some(primitives), references: 2.0, ..Bake::new(boxes) };
    let chosen = bake.choose(&BUT_RAYS, None, &()).unwrap();
    let divided = chosen.bake(&bake).divided.unwrap();
    assert!(divided.prim_ids.len() as f64 <= Open::REFERENCES * boxes.len() as f64);
}

#[test]
fn little_to_be_won_ends_a_bake_early_and_says_so() {
    // A smooth surface of equal triangles has hardly a better tree than the greedy one.
    let height = |x: u16, y: u16| (f32::from(x) / 30.0).sin() * 20.0 + (f32::from(y) / 40.0).cos();
    let at = |x: u16, y: u16| [f32::from(x), height(x, y), f32::from(y)];
    let mut triangles = Vec::new();
    for (x, y) in (0..200u16).flat_map(|x| (0..180u16).map(move |y| (x, y))) {
        triangles.push(Triangle::from([at(x, y), at(x + 1, y), at(x, y + 1)]));
    }
    let scene = Scene::new("hill", bvh_scenes::SceneKind::File, Primitives::Triangles(triangles));
    let open = Open { references: false, ..BUT_RAYS };
    let hill = chosen(&scene, &open, &());
    let Some(&Reason::Work { work, more: More::Little(saved), .. }) = hill.reasons.first() else {
        panic!("{:?}", hill.reasons)
    };
    let ample = Budget::of_objects(scene.boxes.len()).max_work.unwrap();
    assert!(work < ample && (0.0..1.0 / 16.0).contains(&saved), "{work} {saved}");
}

#[test]
fn parts_of_a_large_scene_choose_the_same_on_any_number_of_threads() {
    let scene = Scene::load("S34:140000").unwrap();
    let open = Open { references: false, ..BUT_RAYS };
    let found = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| chosen(&scene, &open, &()).reasons)
    });
    assert_eq!(found[0], found[1]);
    assert_eq!(found[0].len(), 2);
}

/// Cancels before the combination of this number, counted from 0.
struct Before(usize, AtomicUsize);

impl Observer for Before {
    fn trying(&self, tried: usize, _of: usize) {
        self.1.store(tried, Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.1.load(Relaxed) >= self.0
    }
}

#[test]
fn a_cancelled_choice_keeps_the_best_tree_that_it_tried() {
    let scene = Scene::load("escher:400").unwrap();
    for (last, has_tree) in [(0, false), (3, true)] {
        let found = chosen(&scene, &BUT_RAYS, &Before(last, AtomicUsize::new(0)));
        assert_eq!((found.tried.is_some(), found.reasons.len()), (has_tree, 0), "{last}");
        let Some(baked) = found.tried.as_ref() else { continue };
        let greedy = found.tests_per_ray(found.greedy.as_ref().unwrap());
        assert!(found.tests_per_ray(&baked.outcome.tree) < greedy);
    }
}

#[test]
fn an_owned_tree_without_a_limit_chooses_and_keeps_its_cost_in_files() {
    let scene = Scene::load("escher:400").unwrap();
    let shapes = || Objects::Shapes(scene.primitives.clone());
    let options = Options { anywhere: Some(anywhere), ..Options::default() };
    let owned = OwnedTree::find(shapes(), &options, &()).unwrap();
    assert_eq!(owned.reasons().len(), 5, "{:?}", owned.reasons());
    let limited = Options { budget: work(100_000), frame: Frames::File, ..options };
    assert_eq!(OwnedTree::find(shapes(), &limited, &()).unwrap().reasons(), []);
    let file = owned.save().unwrap();
    let mut loaded = OwnedTree::load(shapes(), &file).unwrap();
    let before = loaded.cost(Objective::Layout);
    let improvement = loaded.improvement(work(300_000), &()).unwrap();
    loaded.apply(improvement);
    assert!(loaded.cost(Objective::Layout) <= before);
    let boxes = Objects::Boxes(scatter(50, 1));
    assert_eq!(OwnedTree::find(boxes, &options, &()).unwrap().reasons().len(), 1);
}
