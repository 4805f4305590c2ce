//! `bvh render` and `bvh report` from the command line.

use crate::support::{bvh, names, wrong};
use std::collections::BTreeSet;
use std::fs;

#[test]
fn every_structure_and_any_number_of_threads_write_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = BTreeSet::new();
    for (accel, jobs) in [("brute", 1), ("kdtree", 2), ("bvh", 3), ("wide", 1)] {
        let render = "render escher:cluster:300:1 --out=p.png --size=50x31";
        let said = bvh(folder.path(), &format!("{render} --accel={accel} --jobs={jobs}"));
        assert_eq!(said.contains("per ray"), accel != "wide", "{said}");
        files.insert(fs::read(folder.path().join("p.png")).unwrap());
    }
    assert_eq!(files.len(), 1);
}

#[test]
fn the_eye_may_be_anywhere_and_the_scene_a_single_point() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("point.obj"), "v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n").unwrap();
    fs::write(at.join("a&b.obj"), "v 0 0 0\nv 1e30 0 0\nv 0 0 1e30\nf 1 2 3\n").unwrap();
    for scene in ["point.obj", "a&b.obj"] {
        for eye in ["", "--from=-1,2,3 --at=-1,2,3", "--from=1,2,3"] {
            bvh(at, &format!("render {scene} --out=p.png --size=20x10 --heatmap 9 {eye}"));
            bvh(at, &format!("render {scene} --out=p.png --size=1x1 {eye}"));
        }
        bvh(at, &format!("bake {scene} --out={scene}.bvh --budget=0s"));
        bvh(at, &format!("report {scene}.bvh {scene}"));
    }
    let page = fs::read_to_string(at.join("a&b.obj.html")).unwrap();
    assert_eq!(page.matches("a&amp;b").count(), 2, "names are escaped");
}

#[test]
fn a_report_compares_a_tree_with_the_greedy_tree_on_one_page_and_replaces_no_file_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (scene, has_layout) in [("escher:500", true), ("spheres75", false)] {
        bvh(at, &format!("bake {scene} --budget=1Mwork --out=a.bvh"));
        let title = bvh(at, &format!("report a.bvh {scene} --out=a.html"));
        let title = title.trim_end().strip_prefix("a.html: ").unwrap();
        assert!(title.ends_with(" % area against a plain build"), "{title}");
        let page = fs::read_to_string(at.join("a.html")).unwrap();
        for part in [title, "Area of inner nodes", "greedy tree: median"] {
            assert!(page.contains(part), "{scene}: {part}");
        }
        assert_eq!(page.matches("data:image/png;base64,").count(), 3, "{scene}");
        assert!(!page.contains("://") && !page.contains("<script"), "{scene}");
        assert_eq!(page.contains("<td>Tests per ray</td>"), has_layout, "{scene}");
    }
    // The first words are about what the tree was searched for.
    for flags in ["--rays=default", "--cost=layout"] {
        bvh(at, &format!("bake escher:500 --budget=1Mwork --out=r.bvh {flags}"));
        let title = bvh(at, "report r.bvh escher:500 --out=a.html");
        assert!(title.contains('−') && title.contains("tests per ray"), "{title}");
    }
    wrong(at, "report a.bvh spheres75", &["a.html exists", "--out"]);
    assert_eq!(names(at), ["a.bvh", "a.html", "r.bvh"]);
}
