//! Baking from the command line: files that are written, kept and rejected.

use crate::support::{
    begin, cost, ended, facts, names, number, refused, run_on_a_small_disk, said,
};
use bvh_core::{Aabb, Bvh, Node, Segment};
use bvh_scenes::Scene;
use bvh_scenes::tree_file;
use bvh_search::{Budget, Objects, Options, OwnedTree};
use std::fs;
use std::time::{Duration, Instant};

#[test]
fn a_bake_of_work_writes_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = ["1", "2"].map(|jobs| {
        let out = format!("{jobs}.bvh");
        let args = ["bake", "escher", "--budget", "10Mwork", "--out", &out, "--jobs", jobs];
        assert!(said(folder.path(), &args).contains("below Müller–Fellner's"));
        fs::read(folder.path().join(out)).unwrap()
    });
    assert!(bytes[0] == bytes[1]);
    assert_eq!(names(folder.path()).len(), 2, "no other file is left");
    let scene = Scene::load("escher").unwrap();
    let (tree, _) = tree_file::load(&folder.path().join("1.bvh"), &scene).unwrap();
    let facts = facts(&said(folder.path(), &["inspect", "1.bvh", "escher"]));
    let area = &facts["internal area"];
    assert_eq!(*area, bvh_core::cost::internal_area(&tree).to_string());
    assert_eq!((facts["method"].as_str(), &facts["cost when saved"]), ("best", area));
    assert!(number(&facts, "internal area over Müller–Fellner's") < 0.9);
    assert!(facts["valid"].starts_with("yes"));
}

#[test]
fn a_bake_for_rays_saves_the_number_of_visits_of_each_node() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    let name = "best for rays";
    for rays in ["default", "walk.toml"] {
        let bake = ["bake", "escher", "--budget=2Mwork", "--out=x.bvh", "--rays", rays];
        let bytes = ["1", "2"].map(|jobs| {
            let said = said(at, &[&bake[..], &["--jobs", jobs]].concat());
            assert!(
                said.contains("wide layout for rays") && said.contains("below Müller–Fellner's"),
                "{said}"
            );
            assert!(said.contains("risk: a tree for rays may be worse for others"), "{said}");
            fs::read(at.join("x.bvh")).unwrap()
        });
        assert!(bytes[0] == bytes[1], "{rays}: the same bytes on any number of threads");
        let scene = Scene::load("escher").unwrap();
        let file =
            bvh_core::file::TreeFile::open(&bytes[0]).unwrap().for_boxes(&scene.boxes).unwrap();
        assert_eq!(file.header().method, name);
        let tree = file.tree().unwrap();
        let visits = file.visits().unwrap().unwrap();
        assert_eq!(visits[0], 1.0);
        bvh_core::WideBvh::for_rays(&tree, scene.triangles().unwrap(), &visits).unwrap();
        assert_eq!(facts(&said(at, &["inspect", "x.bvh", "escher"]))["method"], name);
        let by_area = [&bake[..], &["--cost", "area"]].concat();
        assert!(said(at, &by_area).contains("visits of rays times root area"));
        assert!(
            fs::read(at.join("x.bvh")).unwrap() != bytes[0],
            "{rays}: another cost, another tree"
        );
    }
    fs::write(at.join("wrong.toml"), WALK.replace("bounces = 2", "bounces = 2\nbouncy = 1"))
        .unwrap();
    fs::write(at.join("none.toml"), "bounces = 1").unwrap();
    for (file, parts) in [
        ("wrong.toml", &["wrong.toml", "line 3", "bouncy", "bounces"][..]),
        ("none.toml", &["none.toml", "cameras is empty", "eye"]),
        ("gone.toml", &["--rays", "gone.toml", "no such file"]),
    ] {
        let bake = ["bake", "escher", "--budget=1s", "--out=y.bvh", "--rays", file];
        refused(at, &bake, 2, parts);
        assert!(!at.join("y.bvh").exists());
    }
}

#[test]
fn a_bake_of_work_writes_the_bytes_that_the_library_gives_other_languages() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:400").unwrap();
    let segments: Vec<Segment> = (0..90u8)
        .map(|i| Segment { from: [0.0, 9.0, f32::from(i)], to: [1.0, 0.5, f32::from(i) / 9.0] })
        .collect();
    let coordinates = segments.iter().flat_map(|segment| [segment.from, segment.to]).flatten();
    let bytes: Vec<u8> = coordinates.flat_map(f32::to_le_bytes).collect();
    fs::write(at.join("rays.bin"), bytes).unwrap();
    // The last budget is long enough for a tree of reinsertion aside.
    for (flags, references, rays, work) in [
        (&["--budget=300kwork"][..], 1.0, &[][..], 300_000),
        (&["--budget=300kwork", "--references=1.3"], 1.3, &[], 300_000),
        (&["--budget=300kwork", "--rays=rays.bin"], 1.0, &segments, 300_000),
        (&["--budget=9Mwork", "--rays=rays.bin", "--references=1.3"], 1.3, &segments, 9_000_000),
    ] {
        said(at, &[&["bake", "escher:400", "--out=x.bvh", "--seed=5"], flags].concat());
        let objects = Objects::Shapes(scene.primitives.clone());
        let budget = Budget { max_work: Some(work), ..Budget::UNLIMITED };
        let options = Options { references, seed: 5, budget, rays };
        let owned = OwnedTree::find(objects, &options, &()).unwrap();
        assert!(fs::read(at.join("x.bvh")).unwrap() == owned.save().unwrap(), "{flags:?}");
    }
}

#[test]
fn recorded_rays_that_all_miss_the_scene_are_rejected_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let away = "1000,1000,1000,1001,1002,1003\n".repeat(9);
    fs::write(at.join("away.csv"), &away).unwrap();
    fs::write(at.join("one.csv"), away + "-50,1,0.5,50,1,0.5\n").unwrap();
    let args = ["bake", "escher", "--budget=100s", "--out=x.bvh", "--rays=away.csv"];
    let parts = ["away.csv: none of the 9 segments meets the box of scene escher", "accepted: one"];
    refused(at, &args, 2, &parts);
    assert_eq!(names(at), ["away.csv", "one.csv"]);
    said(at, &["bake", "escher", "--budget=10kwork", "--out=x.bvh", "--rays=one.csv"]);
}

/// A walk through escher's stairs.
const WALK: &str = "count = 5000
bounces = 2
lights = [[0.0, 9.0, 0.0]]
cameras = [
    { eye = [9.0, 5.0, 8.0], target = [0.0, 0.0, 0.0] },
    { eye = [-9.0, 6.0, 8.0], target = [0.0, 1.0, 0.0] },
]
";

#[test]
fn a_bake_from_an_earlier_tree_is_never_worse() {
    let folder = tempfile::tempdir().unwrap();
    let bake = |out: &str, more: &[&str]| {
        said(folder.path(), &[&["bake", "spheres750", "--out", out], more].concat());
        cost(folder.path(), out)
    };
    let greedy = bake("a.bvh", &["--method", "muller_fellner", "--budget", "1s"]);
    let mut before = greedy;
    for (seed, budget) in
        [("1", "0s"), ("2", "1work"), ("3", "2Mwork"), ("4", "4Mwork"), ("5", "100ms")]
    {
        let after = bake("a.bvh", &["--from", "a.bvh", "--seed", seed, "--budget", budget]);
        assert!(after <= before, "{before} became {after} within {budget}");
        before = after;
    }
    assert!(before < greedy);
    assert_eq!(facts(&said(folder.path(), &["inspect", "a.bvh"]))["seed"], "5");
}

#[test]
fn a_bake_uses_its_whole_time() {
    let folder = tempfile::tempdir().unwrap();
    let start = Instant::now();
    said(folder.path(), &["bake", "spheres75", "--budget", "500ms", "--out", "a.bvh"]);
    assert!(start.elapsed() >= Duration::from_millis(500));
}

#[test]
fn a_kill_leaves_the_old_file_or_a_complete_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bvh");
    let scene = Scene::load("spheres750").unwrap();
    let bake =
        ["bake", "spheres750", "--method", "muller_fellner", "--budget", "0s", "--out", "a.bvh"];
    said(folder.path(), &bake);
    let old = fs::read(&path).unwrap();
    let mut replaced = 0;
    // The kills come before, during and after the write, also on a busy machine.
    for milliseconds in [0, 5, 10, 20, 30, 40, 60, 80, 120, 160, 240, 320] {
        fs::write(&path, &old).unwrap();
        let args = ["bake", "spheres750", "--budget", "20ms", "--out", "a.bvh", "--seed", "2"];
        let mut child = begin(folder.path(), &args);
        std::thread::sleep(Duration::from_millis(milliseconds));
        child.kill().unwrap();
        child.wait().unwrap();
        tree_file::load(&path, &scene).unwrap();
        replaced += usize::from(fs::read(&path).unwrap() != old);
    }
    eprintln!("{replaced} of 12 were killed too late");
}

#[test]
fn invalid_bakes_and_inspections_are_rejected_and_change_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    said(folder.path(), &["bake", "spheres75", "--budget", "0s", "--out", "good.bvh"]);
    let good = fs::read(path("good.bvh")).unwrap();
    fs::write(path("cut.bvh"), &good[..good.len() - 1]).unwrap();
    let mut flipped = good.clone();
    flipped[300] ^= 1;
    fs::write(path("flipped.bvh"), flipped).unwrap();
    fs::write(path("file"), "").unwrap();
    fs::create_dir(path("folder")).unwrap();
    let three = Scene::load("spheres75:3").unwrap();
    fs::write(path("wide.bvh"), wide_file(&three.boxes)).unwrap();
    let into = |out: &'static str| vec!["bake", "spheres75", "--budget=0s", "--out", out];
    let kept = |more: &[&'static str]| [&into("good.bvh")[..], more].concat();
    for (args, parts) in [
        (into("folder"), &["folder; accepted"][..]),
        (into("file/x.bvh"), &["file is no folder"]),
        (kept(&["--method", "greedy"]), &["greedy", "accepted: muller_fellner"]),
        (kept(&["--method", "grasp", "--from", "good.bvh"]), &["grasp", "--from", "best"]),
        (kept(&["--from", "cut.bvh"]), &["cut.bvh", "cut or extended"]),
        (kept(&["--from", "flipped.bvh"]), &["flipped.bvh", "checksum"]),
        (kept(&["--from", "file"]), &["file", "not a tree file"]),
        (
            vec!["bake", "spheres75:3", "--budget=0s", "--out=good.bvh", "--from=wide.bvh"],
            &["--from wide.bvh", "inner node 0 has 3 children", "nodes with two"],
        ),
        (kept(&["--from", "x.bvh"]), &["x.bvh", "no such file"]),
        (vec!["bake", "sofa", "--budget=1s", "--out=good.bvh"], &["sofa", "accepted: bijou"]),
        (vec!["bake", "spheres75", "--budget=ten", "--out=good.bvh"], &["ten", "10s", "50Mwork"]),
        (vec!["inspect", "good.bvh", "spheres750"], &["good.bvh", "75 objects", "750"]),
        (vec!["inspect", "good.bvh", "spheres750:75"], &["good.bvh", "another scene"]),
        (vec!["inspect", "flipped.bvh"], &["flipped.bvh", "checksum"]),
    ] {
        refused(folder.path(), &args, 2, parts);
    }
    assert_eq!(fs::read(path("good.bvh")).unwrap(), good);
    assert_eq!(names(folder.path()).len(), 6, "nothing was left behind");
}

/// Returns the file of a tree of one node and its leaves.
fn wide_file(boxes: &[Aabb]) -> Vec<u8> {
    let count = boxes.len() as u32;
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(aabb));
    let mut tree =
        Bvh { nodes: vec![Node::inner(bounds, 1, count)], prim_ids: (0..count).collect() };
    for (&aabb, object) in boxes.iter().zip(0..) {
        tree.nodes.push(Node::leaf(aabb, object, 1));
    }
    bvh_core::file::save(&tree, boxes, &bvh_core::file::Origin::default()).unwrap()
}

#[test]
fn a_file_that_somebody_creates_at_the_name_after_the_scene_stays_and_the_tree_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut bake = begin(folder.path(), &["bake", "spheres75", "--budget", "1s"]);
    // The bake has reserved its file once the new one exists.
    while names(folder.path()).is_empty() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let notes = folder.path().join("spheres75.bvh");
    fs::write(&notes, "notes").unwrap();
    assert_eq!(bake.wait().unwrap().code(), Some(1));
    assert_eq!(fs::read(&notes).unwrap(), b"notes");
    let names = names(folder.path());
    let kept = names.iter().find(|name| *name != "spheres75.bvh").unwrap();
    let scene = Scene::load("spheres75").unwrap();
    tree_file::load(&folder.path().join(kept), &scene).unwrap();
}

#[test]
fn a_disk_without_room_is_noticed_before_the_search_and_the_old_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let old = b"\x89BVH\r\n\x1a\nold";
    fs::write(folder.path().join("a.bvh"), old).unwrap();
    // A budget of an hour would make the test time out if the search came first.
    let bake = "bake spheres75 --budget 1h --out a.bvh";
    let Some(output) = run_on_a_small_disk(folder.path(), bake, 4) else { return };
    ended(&output, 1, &["a.bvh: cannot reserve the file's space"]);
    assert_eq!(fs::read(folder.path().join("a.bvh")).unwrap(), old);
    assert_eq!(names(folder.path()).len(), 1);
}

#[test]
fn a_bake_without_flags_chooses_says_why_and_writes_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bytes = ["1", "2"].map(|jobs| {
        let out = format!("{jobs}.bvh");
        let said = said(at, &["bake", "escher:400", "--out", &out, "--jobs", jobs]);
        for choice in ["budget: 3 Mwork, 8000 nodes per object", "cost: ", "rays: ", "references: "]
        {
            assert_eq!(said.matches(choice).count(), 1, "{choice}: {said}");
        }
        fs::read(at.join(out)).unwrap()
    });
    assert!(bytes[0] == bytes[1]);
}

#[test]
fn a_given_choice_is_kept_and_not_tried() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (flags, kept) in [
        (&["--cost", "area"][..], "cost: "),
        (&["--rays", "default"], "rays: "),
        (&["--references", "1"], "references: "),
    ] {
        let bake = ["bake", "escher:200", "--out", "a.bvh"];
        let said = said(at, &[&bake[..], flags].concat());
        assert!(said.contains("budget: ") && !said.contains(kept), "{flags:?}: {said}");
    }
    // Spheres have no wide layout, and other methods than `best` offer no choices.
    for flags in [&["spheres75"][..], &["escher:200", "--method", "reinsertion"]] {
        let said = said(at, &[&["bake", "--out", "a.bvh"][..], flags].concat());
        assert!(said.contains("budget: ") && !said.contains("references: "), "{flags:?}: {said}");
    }
}

#[test]
fn a_bake_without_a_name_writes_a_new_file_named_after_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bake = ["bake", "escher:50", "--budget=0s"];
    said(at, &bake);
    assert_eq!(names(at), ["escher-50.bvh"]);
    refused(at, &bake, 2, &["escher-50.bvh exists", "--out"]);
}
