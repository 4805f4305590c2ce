//! The page about a tree file.

use crate::support::{names, refused, said};
use std::fs;

#[test]
fn a_report_compares_a_tree_with_the_greedy_tree_on_one_page_and_replaces_no_file_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (scene, has_layout) in [("escher", true), ("spheres75", false)] {
        said(at, &["bake", scene, "--budget=1Mwork", "--out=a.bvh"]);
        let written = said(at, &["report", "a.bvh", scene, "--out=a.html"]);
        assert!(written.contains("a.html"), "{written}");
        let page = fs::read_to_string(at.join("a.html")).unwrap();
        for part in ["Internal area over root area", "greedy tree: median", "Cost by level"] {
            assert!(page.contains(part), "{scene}: {part}");
        }
        assert_eq!(page.matches("data:image/png;base64,").count(), 3, "{scene}");
        assert_eq!(page.contains("Expected tests of a ray"), has_layout, "{scene}");
    }
    refused(at, &["report", "a.bvh", "spheres75"], 2, &["a.html exists", "--out"]);
    refused(at, &["report", "a.bvh", "escher", "--out=b.html"], 2, &["a.bvh", "scene"]);
    assert_eq!(names(at), ["a.bvh", "a.html"]);
}
