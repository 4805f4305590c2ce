//! The everyday calls keep their time limit, use all of it, and end with good trees.

use crate::{scatter, work};
use bvh_scenes::Scene;
use bvh_search::bvh_core::Primitives;
use bvh_search::{Anywhere, Objects, Options, OwnedTree, prelude::*};
use std::time::Instant;

#[test]
fn a_bake_of_a_moment_beats_the_greedy_tree_and_ends_in_time() {
    let boxes = scatter(5000, 1);
    let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
    let start = Instant::now();
    let baked = bake(&boxes, Duration::from_millis(400)).unwrap();
    // Other tests share the machine, hence the generous limit.
    let seconds = start.elapsed().as_secs_f64();
    assert!((0.3..4.0).contains(&seconds), "{seconds} s");
    validate(&baked.tree, &boxes).unwrap();
    assert!(baked.cost < cost::internal_area(&greedy));

    let improved = improve(&greedy, &boxes, Duration::from_millis(200)).unwrap();
    validate(&improved.tree, &boxes).unwrap();
    assert!(improved.cost < cost::internal_area(&greedy));
}

#[test]
fn a_time_of_zero_still_gives_a_tree() {
    let boxes = scatter(5000, 1);
    validate(&bake(&boxes, Duration::ZERO).unwrap().tree, &boxes).unwrap();
    let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
    assert!(improve(&greedy, &boxes, Duration::ZERO).unwrap().cost <= cost::internal_area(&greedy));
    assert!(bake(&[], Duration::ZERO).unwrap().tree.nodes.is_empty());
}

#[test]
fn a_tree_of_many_references_per_object_is_loaded_and_improved() {
    let corners = scatter(20, 1).into_iter().map(|aabb| {
        Triangle::from([aabb.min.to_array(), aabb.max.to_array(), aabb.min.to_array()])
    });
    let triangles: Vec<Triangle> = corners.collect();
    let boxes = boxes(&triangles);
    let shapes = Primitives::Triangles(triangles);
    let mut tree = muller_fellner::Config::default().build(&boxes.repeat(17)).unwrap();
    tree.prim_ids.iter_mut().for_each(|id| *id %= 20);
    let bake = Bake { shapes: Some(&shapes), ..Bake::new(&boxes) };
    let bytes = bake.write(&tree, 0, |sections| sections.concat()).unwrap();
    let mut owned = OwnedTree::load(Objects::Shapes(shapes), &bytes).unwrap();
    let before = owned.cost(Objective::InternalArea);
    owned.apply(owned.improvement(work(100_000), &()).unwrap());
    assert!(owned.cost(Objective::InternalArea) <= before);
}

#[test]
fn a_tree_with_its_objects_is_improved_saved_and_loaded_divided_or_whole() {
    // Dividing these pays.
    let Scene { primitives, boxes, .. } = Scene::load("escher:300").unwrap();
    let shapes = || Objects::Shapes(primitives.clone());
    for (objects, references) in
        [(shapes(), 1.0), (shapes(), 2.0), (Objects::Boxes(boxes.clone()), 2.0)]
    {
        let budget = work(30_000);
        let options =
            Options { references: Some(references), seed: 7, budget, ..Options::default() };
        let mut owned = OwnedTree::find(objects.clone(), &options, &()).unwrap();
        let first = cost::total_area(owned.tree());
        owned.apply(owned.improvement(work(3_000_000), &()).unwrap());
        assert!(cost::total_area(owned.tree()) <= first * (1.0 + 1e-12));
        let may_divide = references > 1.0 && owned.triangles().is_some();
        assert_eq!(owned.tree().prim_ids.len() > boxes.len(), may_divide);
        let saved = owned.save().unwrap();
        let mut loaded = OwnedTree::load(objects, &saved).unwrap();
        assert!(loaded.save().unwrap() == saved, "another seed or work");
        assert_eq!((loaded.tree(), loaded.objects()), (owned.tree(), boxes.len()));
        loaded.apply(loaded.improvement(work(100_000), &()).unwrap());
        assert!(cost::total_area(loaded.tree()) <= first * (1.0 + 1e-12));
    }
}

#[test]
fn a_tree_with_its_objects_follows_a_seed_a_budget_recorded_rays_and_moved_objects() {
    let at = |x: f32, z: f32| [[x, 0.0, z], [x + 1.5, 0.2, z], [x, 1.0, z + 0.1]];
    let triangles: Vec<Triangle> =
        (0..400u16).map(|i| Triangle::from(at(f32::from(i % 20), f32::from(i / 20)))).collect();
    let shapes =
        |triangles: &[Triangle]| Objects::Shapes(Primitives::Triangles(triangles.to_vec()));
    let rays: Vec<Segment> = (0..300u16)
        .map(|i| Segment { from: [0.0, 0.5, -5.0], to: [f32::from(i % 5), 0.3, f32::from(i % 7)] })
        .collect();
    let find = |seed: u64, rays: &[Segment]| {
        let budget = Budget { max_evaluations: Some(2000), ..Budget::UNLIMITED };
        let options = Options { seed, budget, rays, ..Options::default() };
        OwnedTree::find(shapes(&triangles), &options, &()).unwrap()
    };
    assert_eq!(find(1, &[]).tree(), find(1, &[]).tree());
    assert_eq!(find(2, &rays).tree(), find(2, &rays).tree());
    assert_ne!(find(2, &rays).tree(), find(2, &[]).tree());
    let bad = [Segment { from: [f32::NAN; 3], to: [0.0; 3] }];
    let options = Options { rays: &bad, ..Options::default() };
    let error = OwnedTree::find(shapes(&triangles), &options, &()).unwrap_err();
    assert_eq!(error.to_string(), "rays: segment 0 has a coordinate that is not finite");

    let owned = find(1, &rays);
    let moved: Vec<Triangle> = triangles
        .iter()
        .map(|triangle| Triangle(triangle.0.map(|corner| corner * 2.0 + Vec3::Y)))
        .collect();
    let owned = owned.refitted(shapes(&moved)).unwrap();
    validate(owned.tree(), &boxes(&moved)).unwrap();
    let ray = Ray::half_line([0.5, 1.5, -5.0], [0.0, 0.0, 1.0]).unwrap();
    let hit = owned.layout().unwrap().unwrap().nearest_hit(&ray);
    assert_eq!(hit, nearest_hit(owned.tree(), &moved, &ray));
    assert!(hit.is_some());
}

#[test]
fn no_bake_of_work_is_behind_reinsertion_within_the_same_work() {
    for (name, objects) in [("escher", 60), ("bijou", 500), ("konistil", 300), ("S04", 200)] {
        let scene = Scene::load(&format!("{name}:{objects}")).unwrap();
        let boxes = &scene.boxes;
        for per_object in [1, 5, 20, 30, 50, 100, 200, 400, 1000, 3000, 20_000, 60_000] {
            let budget = work(per_object * objects);
            let method = bvh_search::reinsertion::Config::default();
            for objective in [Objective::InternalArea, Objective::Layout] {
                let problem = Problem { objective, ..Problem::new(boxes) };
                let plain = solve(&method, &problem, 1, budget, &()).unwrap();
                let bake = Bake { objective: Some(objective), budget, ..Bake::new(boxes) };
                let baked = bake.search(None, &()).unwrap().outcome;
                assert!(baked.cost <= plain.cost, "{name}, {per_object}, {objective:?}");
                if objective == Objective::InternalArea {
                    let bake = Bake { shapes: Some(&scene.primitives), references: 1.2, ..bake };
                    let baked = bake.search(None, &()).unwrap().outcome;
                    let [baked, plain] = [baked, plain].map(|found| cost::total_area(&found.tree));
                    assert!(baked <= plain, "{name}, {per_object}, divided: {baked} {plain}");
                }
            }
        }
    }
}

#[test]
fn references_that_no_bake_may_have_are_rejected_and_a_tree_over_nothing_is_improved() {
    let boxes = scatter(5000, 1);
    for references in [0.5, 16.5, f64::NAN] {
        let error = Bake { references, ..Bake::new(&boxes) }.search(None, &()).unwrap_err();
        let expected = format!("references is {references}; accepted: 1 to 16");
        assert_eq!(error.to_string(), expected);
    }
    let nothing = || Objects::Boxes(Vec::new());
    let empty = OwnedTree::find(nothing(), &Options::default(), &()).unwrap();
    let anywhere: Option<Anywhere> = Some(bvh_scenes::rays::anywhere);
    for max_work in [None, Some(1000)] {
        let budget = Budget { max_work, ..Budget::UNLIMITED };
        let options = Options { budget, anywhere, ..Options::default() };
        let no_triangles = Objects::Shapes(Primitives::Triangles(Vec::new()));
        assert!(OwnedTree::find(no_triangles, &options, &()).unwrap().tree().nodes.is_empty());
    }
    let loaded = OwnedTree::load(nothing(), &empty.save().unwrap()).unwrap();
    assert_eq!(loaded.improvement(Budget::UNLIMITED, &()).unwrap().outcome.cost, 0.0);
}
