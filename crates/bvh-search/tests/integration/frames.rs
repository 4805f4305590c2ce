//! Bakes turn the boxes of oblique scenes, and leave all others as they are.

use crate::work;
use bvh_scenes::Scene;
use bvh_search::bvh_core::export::{ExportError, Target};
use bvh_search::bvh_core::file::FileError;
use bvh_search::bvh_core::glam::{DMat3, DVec3, EulerRot};
use bvh_search::bvh_core::{DTriangle, Frame, InFrame, Primitives, validate_references};
use bvh_search::{Choice, Frames, Objects, Observer, Options, OwnedTree, Reason, prelude::*};
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

fn triangles(scene: &str) -> Vec<Triangle> {
    Scene::load(scene).unwrap().triangles().unwrap().to_vec()
}

fn turned(triangles: &[Triangle], number: u8, scale: f64, offset: DVec3) -> Vec<Triangle> {
    let angle = f64::from(number);
    let rotation = DMat3::from_euler(EulerRot::XYZ, 0.3 + angle, 1.1 * angle, 0.7 * angle);
    let moved = |corner: Vec3| (rotation * corner.as_dvec3() * scale + offset).as_vec3();
    triangles.iter().map(|Triangle(corners)| Triangle(corners.map(moved))).collect()
}

fn shapes(triangles: &[Triangle]) -> Objects {
    Objects::Shapes(Primitives::Triangles(triangles.to_vec()))
}

/// Returns the area of the inner nodes of the greedy tree.
fn area(triangles: &[Triangle], frame: Option<Frame>) -> f64 {
    let boxes = InFrame { triangles, frame: frame.as_ref() }.boxes();
    cost::internal_area(&muller_fellner::Config::default().build(&boxes).unwrap())
}

#[test]
fn a_turned_building_costs_what_it_cost_along_its_own_walls() {
    for scene in ["escher", "cloister"] {
        let straight = triangles(scene);
        for (number, scale, offset) in
            [(1, 1.0, DVec3::ZERO), (2, 1e-30, DVec3::ZERO), (3, 1e30, DVec3::ZERO)]
        {
            let triangles = turned(&straight, number, scale, offset);
            // The last budget permits only samples of some hundred triangles.
            for budget in [30_000_000, 2_000_000, 400_000] {
                let choice = Choice::of(&triangles, work(budget), &());
                let frame = choice.frame.expect("a frame");
                assert_eq!(frame.centre(), DVec3::ZERO);
                let ratio = area(&triangles, Some(frame)) / (area(&straight, None) * scale * scale);
                assert!(ratio < 1.03, "{scene}, {number}, {budget}: {ratio}");
                assert!((0.1..1.0).contains(&choice.gain) && choice.agreeing > 0.05, "{choice:?}");
            }
        }
        let far = turned(&straight, 4, 100.0, DVec3::new(512_345.0, 5_412_345.0, 0.0));
        let frame = Choice::of(&far, work(30_000_000), &()).frame.expect("a frame");
        let bounds = Aabb::union_of(&frame.boxes(&far));
        assert!(bounds.max.max_element() <= bounds.extent().max_element() as f32, "{frame:?}");
    }
}

#[test]
fn the_choice_is_the_same_for_any_number_of_threads() {
    let triangles = turned(&triangles("bijou:2000"), 1, 1.0, DVec3::ZERO);
    let chosen = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Choice::of(&triangles, work(3_000_000), &()))
    });
    assert_eq!(chosen[0], chosen[1]);
    assert_eq!(chosen[0], chosen[2]);
}

#[test]
fn scenes_along_their_axes_and_budgets_of_nothing_keep_their_bytes() {
    let escher = triangles("escher");
    let oblique = turned(&escher, 1, 1.0, DVec3::ZERO);
    for (triangles, most) in [(&escher, 400_000), (&escher, 5_000_000), (&oblique, 0)] {
        let [auto, file] = [Frames::Auto, Frames::File].map(|frame| {
            let options = Options { budget: work(most), frame, ..Options::default() };
            OwnedTree::find(shapes(triangles), &options, &()).unwrap().save().unwrap()
        });
        // Only what the budget sufficed for was tried.
        let choice = Choice::of(triangles, work(most), &());
        assert_eq!(choice.sufficed, most > 0);
        assert_eq!(Reason::Frame(choice).to_string().contains("budget"), most == 0);
        assert!(auto == file, "{most}");
    }
    let over = Deadline::after(Duration::ZERO);
    assert_eq!(Choice::of(&oblique, Budget::UNLIMITED, &over), Choice::FILE);
    let cancelled = AtomicBool::new(true);
    assert_eq!(Choice::of(&oblique, Budget::UNLIMITED, &cancelled), Choice::FILE);
}

/// A clock by which every look takes the same share of all time.
struct Clock(f64, AtomicU32);

impl Observer for Clock {
    fn progress(&self) -> Option<f64> {
        Some(self.0 * f64::from(self.1.fetch_add(1, Relaxed)))
    }
}

#[test]
fn a_clock_gives_a_choice_the_work_that_its_first_price_tells() {
    let oblique = turned(&triangles("escher"), 1, 1.0, DVec3::ZERO);
    // A sample of 1024 triangles is priced between two looks, with 20 units of work for each. Larger
    // samples may take twice the time per triangle, and short searches begin with trees, too.
    let worth = |share: f64| work((20.0 * 1024.0 / (4.0 * share)) as u64);
    for (share, finds) in [(0.001, true), (0.0005, true), (0.1, false)] {
        let choice = Choice::of(&oblique, Budget::UNLIMITED, &Clock(share, AtomicU32::new(0)));
        assert_eq!(choice, Choice::of(&oblique, worth(share), &()));
        assert_eq!(choice.frame.is_some(), finds, "{share}: {choice:?}");
        assert!(!finds || choice != Choice::of(&oblique, worth(share / 2.0), &()), "{share}");
    }
}

#[test]
fn odd_scenes_have_a_valid_tree_that_costs_no_more() {
    let grid = turned(&triangles("S09:400"), 1, 1.0, DVec3::ZERO);
    let needles = grid.iter().map(|&Triangle([a, b, _])| Triangle([a, b, a])).collect();
    let mut scenes = vec![vec![], grid[..1].to_vec(), grid[..2].to_vec(), grid.clone(), needles];
    scenes.push(turned(&grid, 2, 5e36, DVec3::ZERO));
    for scene in ["S05", "S06", "S17", "S22", "S23", "S24", "S25", "S29"] {
        scenes.push(triangles(&format!("{scene}:300")));
    }
    for (index, triangles) in scenes.iter().enumerate() {
        let [auto, file] = [Frames::Auto, Frames::File].map(|frame| {
            let options = Options { budget: work(3_000_000), frame, ..Options::default() };
            OwnedTree::find(shapes(triangles), &options, &()).unwrap()
        });
        let loaded = OwnedTree::load(shapes(triangles), &auto.save().unwrap()).unwrap();
        assert_eq!(loaded.tree(), auto.tree(), "scene {index}");
        let [auto, file] = [auto, file].map(|owned| owned.cost(Objective::InternalArea));
        assert!(auto <= 1.005 * file, "scene {index}: {auto} {file}");
    }
}

#[test]
fn a_tree_in_a_frame_keeps_it_and_the_answers_of_rays() {
    let straight = triangles("escher:300");
    let triangles = turned(&straight, 2, 1.0, DVec3::ZERO);
    let bounds = Aabb::union_of(&boxes(&triangles));
    let size = bounds.extent().length() as f32;
    let middle = (0.5 * bounds.doubled_centroid()).as_vec3();
    let ray = |i: u16| {
        let at = triangles[usize::from(i) * 7 % triangles.len()].0[0];
        Ray::half_line(middle, at - middle + 0.001 * size).unwrap()
    };
    let rays: Vec<Segment> =
        (0..500).filter_map(|i| Segment::of_ray(&ray(i), 0.1 * size)).collect();
    for (references, rays) in [(1.0, &[][..]), (1.2, &[]), (1.2, &rays)] {
        let [owned, plain] = [Frames::Auto, Frames::File].map(|frame| {
            let budget = work(2_000_000);
            let references = Some(references);
            let options = Options { references, budget, rays, frame, ..Options::default() };
            OwnedTree::find(shapes(&triangles), &options, &()).unwrap()
        });
        let frame = owned.tree().frame.expect("a frame");
        let framed = InFrame { triangles: &triangles, frame: Some(&frame) };
        validate_references(owned.tree(), &framed.boxes(), &framed).unwrap();
        assert!(owned.cost(Objective::InternalArea) < plain.cost(Objective::InternalArea));
        let bytes = owned.save().unwrap();
        let mut loaded = OwnedTree::load(shapes(&triangles), &bytes).unwrap();
        assert_eq!((loaded.tree(), loaded.boxes()), (owned.tree(), owned.boxes()));
        loaded.apply(loaded.improvement(work(100_000), &()).unwrap());
        assert_eq!(loaded.tree().frame, Some(frame));
        let spheres = Objects::Boxes(boxes(&triangles));
        assert_eq!(OwnedTree::load(spheres, &bytes).unwrap_err(), FileError::Frame);
        let moved = turned(&straight, 3, 2.0, DVec3::ONE);
        let refitted = owned.refitted(shapes(&moved)).unwrap();
        assert_eq!(refitted.tree().frame, Some(frame));
        let plain_moved = plain.refitted(shapes(&moved)).unwrap();
        for (found, plain) in [(&owned, &plain), (&loaded, &plain), (&refitted, &plain_moved)] {
            let [found, plain] = [found, plain].map(|owned| owned.layout().unwrap().unwrap());
            let hits =
                |wide: &WideBvh| (0..500).map(|i| wide.nearest_hit(&ray(i))).collect::<Vec<_>>();
            assert_eq!(hits(&found), hits(&plain));
            assert!(hits(&found).iter().flatten().count() > 50);
        }
        assert_eq!(owned.export(&Target::ALL[0], false), Err(ExportError::Framed));
        assert!(plain.export(&Target::ALL[0], true).is_ok());
    }
}

#[test]
fn triangles_in_f64_are_baked_at_map_coordinates_and_told_from_others_by_their_file() {
    let far = DVec3::new(512_345.678, 5_412_345.678, 0.1);
    let turn = DMat3::from_euler(EulerRot::XYZ, 0.3, 1.1, 0.7);
    let moved = |corner: Vec3| turn * corner.as_dvec3() + far;
    let straight = triangles("escher");
    let triangles: Vec<DTriangle> =
        straight.iter().map(|Triangle(corners)| DTriangle(corners.map(moved))).collect();
    let objects =
        |triangles: &[DTriangle]| Objects::Shapes(Primitives::Doubles(triangles.to_vec()));
    let baked = |frame, references| {
        let options = Options { frame, references, budget: work(10_000_000), ..Options::default() };
        OwnedTree::find(objects(&triangles), &options, &()).unwrap()
    };
    let [file, auto, divided] =
        [(Frames::File, Some(1.0)), (Frames::Auto, Some(1.0)), (Frames::Auto, Some(1.3))]
            .map(|(frame, references)| baked(frame, references));
    let [along, turned] = [&file, &auto].map(|owned| owned.tree().frame.unwrap());
    assert!(along.centre() == turned.centre() && along.rotation() != turned.rotation());
    let [along, turned] = [&file, &auto].map(|owned| cost::internal_area(owned.tree()));
    assert!(turned < 0.9 * along, "{turned} of {along}");
    assert!(divided.tree().prim_ids.len() > triangles.len());
    for owned in [file, auto, divided] {
        let bytes = owned.save().unwrap();
        let loaded = OwnedTree::load(objects(&triangles), &bytes).unwrap();
        assert_eq!((loaded.tree(), loaded.boxes()), (owned.tree(), owned.boxes()));
        // The boxes in f32 stay the same.
        for moved in [1000.0, 1e-7] {
            let mut other = triangles.clone();
            other[0].0[0] += DVec3::splat(moved);
            let refused = OwnedTree::load(objects(&other), &bytes).map(drop);
            assert!(matches!(refused, Err(FileError::OtherScene { .. })), "{moved}");
        }
    }
}
