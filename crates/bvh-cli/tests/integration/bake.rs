//! Baking from the command line: the trees, the choices, and the files in all circumstances.

use crate::support::{
    begin, bvh, cost, ended, facts, names, number, obj, run_on_a_small_disk, wait_until, wrong,
};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{internal_area, layout_area};
use bvh_core::file::TreeFile;
use bvh_core::{Segment, Triangle};
use bvh_scenes::{Precision, Scene, tree_file};
use bvh_search::{Anywhere, Budget, Frames, Objects, Options, OwnedTree};
use glam::{DVec3, Mat3};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

const WALK: &str = "count = 5000
bounces = 2
lights = [[0.0, 9.0, 0.0]]
cameras = [
    { eye = [9.0, 5.0, 8.0], target = [0.0, 0.0, 0.0] },
    { eye = [-9.0, 6.0, 8.0], target = [0.0, 1.0, 0.0] },
]
";

/// Bakes into `x.bvh` with one thread and with two, which must give the same bytes. Returns what
/// was printed, and the bytes.
fn bake_twice(at: &Path, line: &str) -> (String, Vec<u8>) {
    let [one, two] = [1, 2].map(|jobs| {
        let said = bvh(at, &format!("bake {line} --out=x.bvh --jobs={jobs}"));
        (said, fs::read(at.join("x.bvh")).unwrap())
    });
    assert!(one.1 == two.1, "{line}: other bytes on another number of threads");
    one
}

#[test]
fn a_bake_of_work_writes_the_same_bytes_on_any_number_of_threads_and_says_what_it_gained() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (said, _) = bake_twice(at, "escher --budget=10Mwork");
    let scene = Scene::load("escher").unwrap();
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    let facts = facts(at, "inspect x.bvh escher");
    let area = internal_area(&tree);
    for fact in ["area", "cost_when_saved", "cost"] {
        assert_eq!(facts[fact], area, "{fact}");
    }
    assert_eq!(facts["method"], "best");
    let saved = facts["saved"].as_f64().unwrap();
    let gain = format!("−{:.1} % area of inner nodes", 100.0 * saved);
    assert!(saved > 0.1 && said.contains(&gain), "{gain}: {said}");
    assert_eq!(names(at).len(), 1, "no other file is left");
    // Seconds alone depend on the machine.
    let json = crate::support::facts(at, "bake escher --budget=10Mwork --out=x.bvh");
    for fact in ["area", "cost", "method", "greedy_area", "saved", "references", "frame"] {
        assert_eq!(json[fact], facts[fact], "{fact}");
    }
    // Rays gain where boxes shrink.
    assert!((0.05..0.5).contains(&json["tests_saved"].as_f64().unwrap()), "{json:?}");
}

#[test]
fn a_bake_for_rays_saves_the_number_of_visits_of_each_node() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    let scene = Scene::load("escher:500").unwrap();
    for rays in ["default", "walk.toml"] {
        let bake = format!("escher:500 --budget=1Mwork --rays={rays}");
        let (said, bytes) = bake_twice(at, &bake);
        assert!(said.contains("cost of the wide layout for rays, which was minimised, "), "{said}");
        let file = TreeFile::open(&bytes).unwrap().for_boxes(&scene.boxes).unwrap();
        assert_eq!(file.header().method, "best for rays");
        assert_eq!(file.visits().unwrap().unwrap()[0], 1.0);
        // The recorded cost is that for random lines.
        let baked = facts(at, &format!("bake {bake} --out=x.bvh"));
        assert_eq!(baked["cost"], layout_area(&file.tree().unwrap()));
        assert_ne!(baked["cost"], baked["minimised_cost"]);
    }
    let bake = "bake escher:500 --budget=1Mwork --rays=walk.toml --cost=area --out=area.bvh";
    let said = bvh(at, bake);
    assert!(said.contains("visits of rays, which was minimised, "), "{said}");
}

#[test]
fn a_bake_of_work_or_without_flags_writes_the_bytes_that_the_library_gives_other_languages() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:120").unwrap();
    let segments: Vec<Segment> = (0..90u8)
        .map(|i| Segment { from: [0.0, 9.0, f32::from(i)], to: [1.0, 0.5, f32::from(i) / 9.0] })
        .collect();
    let coordinates = segments.iter().flat_map(|segment| [segment.from, segment.to]).flatten();
    let bytes: Vec<u8> = coordinates.flat_map(f32::to_le_bytes).collect();
    fs::write(at.join("rays.bin"), bytes).unwrap();
    // One budget is long enough for a tree of reinsertion aside; without any, both choose.
    for (flags, references, rays, max_work) in [
        ("--budget=90kwork", None, &[][..], Some(90_000)),
        ("--budget=90kwork --references=1.3", Some(1.3), &[], Some(90_000)),
        ("--budget=90kwork --rays=rays.bin", None, &segments, Some(90_000)),
        ("--budget=3Mwork --rays=rays.bin --references=1.3", Some(1.3), &segments, Some(3_000_000)),
        ("", None, &[], None),
        ("--rays=rays.bin", None, &segments, None),
    ] {
        bvh(at, &format!("bake escher:120 --out=x.bvh --seed=5 {flags}"));
        let objects = Objects::Shapes(scene.primitives.clone());
        let budget = Budget { max_work, ..Budget::UNLIMITED };
        let anywhere: Option<Anywhere> = Some(bvh_scenes::rays::anywhere);
        let frame = Frames::Auto;
        let options = Options { references, seed: 5, budget, rays, anywhere, frame };
        let owned = OwnedTree::find(objects, &options, &()).unwrap();
        assert!(fs::read(at.join("x.bvh")).unwrap() == owned.save().unwrap(), "{flags}");
    }
}

#[test]
fn a_bake_gives_the_greedy_tree_or_the_tree_it_starts_from_without_a_budget_and_no_worse_one_with()
{
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:200").unwrap();
    let tree = |file: &str| tree_file::load(&at.join(file), &scene).unwrap().0;
    bvh(at, "bake escher:200 --budget=300kwork --out=start.bvh");
    let greedy = muller_fellner::Config::default().build(&scene.boxes).unwrap();
    for budget in ["0s", "0work"] {
        for more in ["", "--references=1.5", "--rays=default", "--method=reinsertion"] {
            let bake = format!("bake escher:200 --budget={budget} --out=x.bvh {more}");
            let found = facts(at, &bake);
            assert_eq!((&found["moves"], &found["work"]), (&0.into(), &0.into()), "{bake}");
            assert!(tree("x.bvh") == greedy, "{bake}");
        }
        let said =
            bvh(at, &format!("bake escher:200 --budget={budget} --out=x.bvh --references=1.5"));
        assert!(said.contains("no object is divided, because no division paid"), "{said}");
        bvh(at, &format!("bake escher:200 --budget={budget} --out=x.bvh --from=start.bvh"));
        assert_eq!(cost(at, "x.bvh"), cost(at, "start.bvh"), "{budget}");
    }
    for (seed, budget) in [(2, "1work"), (3, "2Mwork"), (4, "100ms")] {
        let before = cost(at, "x.bvh");
        let bake = format!("bake escher:200 --out=x.bvh --from=x.bvh --seed={seed}");
        bvh(at, &format!("{bake} --budget={budget}"));
        assert!(cost(at, "x.bvh") <= before, "{budget}");
    }
    assert_eq!(facts(at, "inspect x.bvh")["seed"], 4);
}

#[test]
fn a_later_bake_continues_for_the_cost_and_the_rays_of_its_tree_where_none_are_given() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bake = |out: &str, more: &str| facts(at, &format!("bake escher:200 --out={out} {more}"));
    let number =
        |facts: &serde_json::Map<_, serde_json::Value>, name| facts[name].as_f64().unwrap();
    for (first, method, objective, choices) in [
        ("--cost=layout", "best", "cost of the wide layout", 1),
        ("--rays=default", "best for rays", "cost of the wide layout", 2),
        ("--rays=default --cost=area", "best for rays", "internal area", 1),
        ("", "best", "internal area", 0),
    ] {
        let first = bake("a.bvh", &format!("--budget=150kwork {first}"));
        for budget in ["0s", "1work", "500kwork", "200ms"] {
            let later = bake("b.bvh", &format!("--budget={budget} --from=a.bvh"));
            assert!(number(&later, "minimised_cost") <= number(&later, "minimised_cost_of_start"));
            if !budget.ends_with('s') {
                let [before, same] =
                    [("minimised_cost", &first), ("minimised_cost_of_start", &later)]
                        .map(|(name, facts)| number(facts, name));
                assert!((before - same).abs() < 1e-9 * before, "{budget}: {before} {same}");
                let found = later.get("choices").map_or(0, |list| list.as_array().unwrap().len());
                assert_eq!(found, choices, "{later:?}");
            }
            let inspected = facts(at, "inspect b.bvh");
            assert_eq!(
                (&inspected["method"], &inspected["objective"]),
                (&method.into(), &objective.into())
            );
        }
    }
    // What is given counts.
    bake("a.bvh", "--budget=1kwork --rays=default");
    bake("b.bvh", "--budget=1kwork --from=a.bvh --cost=area");
    assert_eq!(facts(at, "inspect b.bvh")["method"], "best");
}

#[test]
fn a_bake_divides_objects_where_it_pays_and_minimises_the_cost_of_the_layout() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bake = |out: &str, more: &str| {
        let said = bvh(at, &format!("bake pinecon2 --budget=1Mwork --out={out} {more}"));
        let inspect = format!("inspect {out} pinecon2");
        (said, ["objects", "references"].map(|name| number(at, &inspect, name)))
    };
    let (said, [objects, references]) = bake("split.bvh", "--references=1.3");
    for part in ["area of all nodes, which was minimised, ", " references to "] {
        assert!(said.contains(part), "{said}");
    }
    assert!(references > objects && references <= 1.3 * objects, "{references} of {objects}");
    let (said, _) = bake("layout.bvh", "--cost=layout");
    assert!(said.contains("cost of the wide layout, which was minimised, "), "{said}");
    assert_eq!(facts(at, "inspect layout.bvh")["objective"], "cost of the wide layout");
    let (_, [_, further]) = bake("further.bvh", "--from=split.bvh");
    assert!(further > objects && further <= references, "{further} of {references}");
    // A limit that is given, or that of a tracer of whole objects, is not raised.
    let accepted = (100.0 * references / objects).ceil() / 100.0;
    let message = format!(
        "--from split.bvh: the tree has {references} references to {objects} objects; accepted: \
         --references {accepted:.2} or more"
    );
    for limit in ["--references=1", "--for=json", "--for=json --references=1.001"] {
        let bake = "bake pinecon2 --budget=1000Gwork --out=no.bvh --from=split.bvh";
        wrong(at, &format!("{bake} {limit}"), &[&message]);
    }
}

#[test]
fn a_scene_that_needs_no_divided_objects_gives_the_same_tree_and_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for scene in ["spheres75 --cost=layout", "S04:3000 --cost=area"] {
        let [(whole, _), (divided, said)] = [1.0, 1.5].map(|references| {
            let bake = format!("bake {scene} --budget=300kwork --references={references}");
            let said = bvh(at, &format!("{bake} --out=x.bvh"));
            (fs::read(at.join("x.bvh")).unwrap(), said)
        });
        assert!(said.contains("no object is divided") && whole == divided, "{scene}: {said}");
    }
}

#[test]
fn a_bake_without_budget_tries_what_is_not_given_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Other methods than `best` offer no choices.
    for (bake, tried) in [
        ("escher:120", &["cost: ", "rays: ", "references: "][..]),
        ("escher:60 --cost=area --references=1", &["rays: "]),
        ("escher:60 --rays=default", &["references: "]),
        ("escher:60 --method=reinsertion", &[]),
    ] {
        let (said, _) = bake_twice(at, bake);
        for choice in ["cost: ", "rays: ", "references: "] {
            let count = usize::from(tried.contains(&choice));
            assert_eq!(said.matches(choice).count(), count, "{bake}, {choice}: {said}");
        }
        assert!(said.contains("budget: "), "{bake}: {said}");
    }
    let json = facts(at, "bake escher:120 --out=x.bvh");
    assert_eq!(json["choices"].as_array().unwrap().len(), 4);
}

#[test]
fn a_bake_without_a_name_uses_its_whole_time_for_a_new_file_and_replaces_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let start = Instant::now();
    let mut bake = begin(at, &["bake", "escher:50", "--budget=1s"]);
    // The bake has reserved its file once the new one exists.
    wait_until("the file", || !names(at).is_empty());
    let notes = at.join("escher-50.bvh");
    fs::write(&notes, "notes").unwrap();
    assert_eq!(bake.wait().unwrap().code(), Some(1));
    assert!(start.elapsed() >= Duration::from_secs(1));
    assert_eq!(fs::read(&notes).unwrap(), b"notes");
    let kept = names(at).into_iter().find(|name| name != "escher-50.bvh").unwrap();
    tree_file::load(&at.join(kept), &Scene::load("escher:50").unwrap()).unwrap();
    wrong(at, "bake escher:50 --budget=0s", &["escher-50.bvh exists", "--out"]);
}

#[test]
fn the_printed_seconds_and_a_budget_of_time_are_the_whole_wait() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // To make this scene and its greedy tree takes longer than all the rest.
    for budget in ["0s", "500ms"] {
        let start = Instant::now();
        let seconds =
            number(at, &format!("bake S34:300000 --budget={budget} --out=x.bvh"), "seconds");
        let waited = start.elapsed().as_secs_f64();
        assert!((0.5 * waited..waited).contains(&seconds), "{budget}: {seconds} of {waited}");
    }
    // To make all of these rays takes longer than the budget.
    fs::write(at.join("walk.toml"), WALK.replace("5000", "250000")).unwrap();
    let found = facts(at, "bake escher:500 --budget=2s --rays=walk.toml --out=x.bvh");
    assert!(found["work"].as_u64() > Some(0), "{found:?}");
    assert!(found["choices"][0].as_str().unwrap().starts_with("rays: one in "), "{found:?}");
}

#[test]
fn a_disk_without_room_is_noticed_before_the_search_and_the_old_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let old = b"\x89BVH\r\n\x1a\nold";
    fs::write(at.join("a.bvh"), old).unwrap();
    // A budget of an hour would make the test time out if the search came first.
    let bake = "bake spheres75 --budget 1h --out a.bvh";
    let Some(output) = run_on_a_small_disk(at, bake, 4) else { return };
    ended(&output, 1, &["a.bvh: cannot reserve the file's space"]);
    assert_eq!(fs::read(at.join("a.bvh")).unwrap(), old);
    assert_eq!(names(at).len(), 1);
}

#[test]
fn an_oblique_scene_is_baked_in_a_frame_that_every_command_and_later_bake_keeps() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:4000").unwrap();
    let rotation = Mat3::from_rotation_z(0.6) * Mat3::from_rotation_x(0.4);
    let turned = |triangle: &Triangle| triangle.0.map(|corner| (rotation * corner).as_dvec3());
    let mesh = obj(scene.triangles().unwrap().iter().map(turned));
    fs::write(at.join("turned.obj"), mesh).unwrap();
    let bake = "bake turned.obj --budget=4Mwork";
    assert!(bvh(at, &format!("{bake} --explain --out=a.bvh")).contains("frame: turned by "));
    let baked = facts(at, &format!("{bake} --out=a.bvh"));
    let frame = &baked["frame"];
    assert!(frame["rotation"].as_array().unwrap().len() == 3 && frame["centre"][2] == 0.0);
    // All commands compare with the greedy tree along the file's axes, and agree.
    let inspected = facts(at, "verify a.bvh turned.obj");
    for key in ["frame", "area", "greedy_area", "saved", "cost", "method"] {
        assert_eq!(inspected[key], baked[key], "{key}");
    }
    let reported = facts(at, "report a.bvh turned.obj --out=a.html");
    assert_eq!(reported["area"]["greedy"], baked["greedy_area"]);
    let auto = facts(at, "bake turned.obj:100 --out=auto.bvh");
    assert!(auto["frame"].is_object() && auto["method"] == facts(at, "inspect auto.bvh")["method"]);
    let reported = facts(at, "report auto.bvh turned.obj:100 --out=a.html");
    let [ours, plain] =
        ["baked", "greedy"].map(|tree| reported["tests_per_ray"][tree].as_f64().unwrap());
    let saved = auto["tests_saved"].as_f64().unwrap();
    assert!((saved - (1.0 - ours / plain)).abs() < 1e-9, "{saved}: {reported:?}");
    let file = facts(at, &format!("{bake} --frame=file --out=b.bvh"));
    assert!(file["frame"].is_null() && cost(at, "a.bvh") < 0.7 * cost(at, "b.bvh"));
    let later = "bake turned.obj --budget=500kwork --from=a.bvh --rays=default --out=c.bvh";
    assert_eq!(facts(at, later)["frame"], *frame);
    // The rays and the pictures of both trees are the same, and take fewer tests in the frame.
    let tests = |tree: &str| {
        number(at, &format!("inspect {tree} turned.obj --rays=default"), "tests_per_ray")
    };
    assert!(0.0 < tests("c.bvh") && tests("c.bvh") < 0.9 * tests("b.bvh"));
    let picture = |file: &str| {
        bvh(at, &format!("render turned.obj --accel={file} --size=40x30 --out={file}.png"));
        fs::read(at.join(format!("{file}.png"))).unwrap()
    };
    assert!(picture("a.bvh") == picture("b.bvh"));
    wrong(at, "export a.bvh turned.obj --for=json --out=x.json", &["a.bvh", "--frame file"]);
    wrong(at, &format!("{bake} --from=a.bvh --frame=file --out=d.bvh"), &["--frame", "--from"]);
}

#[test]
fn a_bake_in_double_precision_has_the_numbers_of_the_file_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let away = DVec3::new(5e5, 5.4e6, 0.1);
    let scene = Scene::load("escher:300").unwrap();
    let moved = |triangle: &Triangle| triangle.0.map(|corner| corner.as_dvec3() + away);
    let mesh = obj(scene.triangles().unwrap().iter().map(moved));
    fs::write(at.join("far.obj"), &mesh).unwrap();
    fs::write(at.join("moved.obj"), mesh.replacen(".1", ".10000001", 1)).unwrap();
    let path = at.join("far.obj");
    let scene = Scene::load_as(path.to_str().unwrap(), Precision::Double).unwrap();
    for (flags, frame, references) in [
        ("", Frames::Auto, None),
        (" --frame=file", Frames::File, None),
        (" --references=1.3", Frames::Auto, Some(1.3)),
    ] {
        let line = format!("far.obj --precision=double --budget=300kwork --seed=5{flags}");
        let (_, bytes) = bake_twice(at, &line);
        let budget = Budget { max_work: Some(300_000), ..Budget::UNLIMITED };
        let options = Options { references, seed: 5, budget, frame, ..Options::default() };
        let objects = Objects::Shapes(scene.primitives.clone());
        assert!(bytes == OwnedTree::find(objects, &options, &()).unwrap().save().unwrap());
        assert!(facts(at, "verify x.bvh far.obj")["saved"].as_f64() > Some(0.0), "{flags}");
        wrong(at, "verify x.bvh moved.obj", &["x.bvh", "another scene"]);
        bvh(at, "bake far.obj --from=x.bvh --budget=1kwork --out=y.bvh");
        bvh(at, "verify y.bvh far.obj");
    }
    let kinds = facts(at, "bench x.bvh far.obj --time=1ms");
    assert!(kinds["kinds"].as_array().unwrap().iter().all(|kind| kind["ratio"].is_number()));
    bvh(at, "report x.bvh far.obj");
    bvh(at, "render far.obj --accel=x.bvh --size=40x30 --out=x.png");
    assert!(number(at, "inspect x.bvh far.obj --rays=default", "tests_per_ray") > 0.0);
    wrong(at, "export x.bvh far.obj --for=json --out=x.json", &["f64; accepted", "f32"]);
    let double = "bake far.obj --precision=double --out=z.bvh --budget=0s";
    for flags in ["--parts=2", "--for=json"] {
        wrong(at, &format!("{double} {flags}"), &["double", "--precision single"]);
    }
    wrong(at, &format!("{double} --from=x.bvh").replace("double", "single"), &["f64", "double"]);
    wrong(at, "bake spheres75 --precision=double --out=z.bvh", &["spheres75", "triangles"]);
    wrong(at, &double.replace("double", "half"), &["half", "single", "double"]);
}
