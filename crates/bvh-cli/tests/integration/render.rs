//! `bvh render` from the command line.

use crate::support::{names, refused, said};
use std::collections::BTreeSet;
use std::fs;

#[test]
fn every_structure_and_any_number_of_threads_write_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = BTreeSet::new();
    let structures = ["brute", "kdtree", "bvh", "wide"];
    for (accel, jobs) in structures.into_iter().zip(["1", "2", "3", "1"]) {
        let render = ["render", "escher:cluster:300:1", "--out=p.png", "--size=50x31"];
        let with = ["--accel", accel, "--jobs", jobs];
        let said = said(folder.path(), &[&render[..], &with].concat());
        assert_eq!(said.contains("per ray"), accel != "wide", "{said}");
        files.insert(fs::read(folder.path().join("p.png")).unwrap());
    }
    assert_eq!(files.len(), 1);
}

#[test]
fn the_eye_may_be_anywhere_and_the_scene_a_single_point() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("point.obj"), "v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("flat.obj"), "v 0 0 0\nv 1e30 0 0\nv 0 0 1e30\nf 1 2 3\n")
        .unwrap();
    for scene in ["point.obj", "flat.obj"] {
        for eye in
            [&[][..], &["--from", "-1,2,3", "--at", "-1,2,3"], &["--from", "1,2,3", "--no-lights"]]
        {
            let args = ["render", scene, "--out", "p.png", "--size", "20x10", "--heatmap"];
            said(folder.path(), &[&args, eye].concat());
        }
    }
}

#[test]
fn invalid_pictures_are_rejected_with_the_accepted_values() {
    let folder = tempfile::tempdir().unwrap();
    for (args, parts) in [
        (&["sofa"][..], &["no such scene", "spheres75"][..]),
        (&["spheres75", "--accel", "octree"], &["octree", "brute, kdtree, bvh, wide"]),
        (&["spheres75", "--accel", "none.bvh"], &["none.bvh"]),
        (&["spheres75", "--accel", "wide"], &["spheres75 has spheres", "--accel brute"]),
        (&["escher", "--accel", "wide", "--heatmap"], &["counts no tests"]),
        (&["spheres75", "--size", "0x10"], &["--size", "960x540"]),
        (&["spheres75", "--from", "1,2"], &["--from", "three numbers"]),
        (&["spheres75", "--fov", "180"], &["--fov", "1 to 170"]),
        (&["spheres75", "--samples", "0"], &["--samples", "1..=16"]),
        (&["spheres75", "--light", "0,0,0", "--no-lights"], &["--light", "--no-lights"]),
    ] {
        refused(folder.path(), &[&["render", "--out", "p.png"], args].concat(), 2, parts);
    }
    assert_eq!(names(folder.path()).len(), 0, "nothing was written");
}
