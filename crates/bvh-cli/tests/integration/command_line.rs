//! The commands of `bvh` that build no tree, and the rejection of invalid input by all commands.

// Tests that send signals or make links and pipes are left out on Windows, and their imports stay.
#![cfg_attr(windows, allow(unused_imports))]

use crate::support::{
    ReadOnly, ended, names, outside_buffer, outside_scene, program, refused, run_in_little_memory,
    said, unsaid, wrong_flags,
};
use std::fs;
use std::path::Path;
use std::process::Stdio;

#[test]
fn scenes_are_listed_with_the_originals_that_they_replace() {
    assert!(said(Path::new("."), &["scenes"]).contains("stand-in for Cloister"));
}

#[test]
fn every_shell_gets_all_commands() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let said = said(folder.path(), &["completions", shell]);
        for part in ["inspect", "budget", "heatmap"] {
            assert!(said.contains(part), "{shell}: {part}");
        }
    }
}

#[test]
fn only_files_of_the_same_kind_are_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    fs::write(at.join("mesh.obj"), mesh).unwrap();
    let bake = ["bake", "mesh.obj", "--budget=0s"];
    let render = ["render", "mesh.obj", "--size=8x8"];
    said(at, &[&bake[..], &["--out=tree.bvh"]].concat());
    let before = names(at);
    for (args, parts) in [
        (&[&bake[..], &["--out=mesh.obj"]].concat()[..], ["--out: mesh.obj", ".bvh"]),
        (&[&bake[..], &["--out=tree"]].concat(), ["--out: tree", ".bvh"]),
        (&[&render[..], &["--out=mesh.obj"]].concat(), ["--out: mesh.obj", ".png"]),
        (&[&render[..], &["--accel=tree.bvh", "--out=tree.bvh"]].concat(), ["--out", ".png"]),
        (&["inspect", "tree.bvh", "--nodes=tree.bvh"], ["--nodes: tree.bvh", ".csv"]),
        (&["report", "tree.bvh", "mesh.obj", "--out=tree.bvh"], ["--out: tree.bvh", ".html"]),
    ] {
        refused(at, args, 2, &parts);
    }
    assert_eq!(
        (names(at), fs::read_to_string(at.join("mesh.obj")).unwrap()),
        (before, mesh.into())
    );
    said(at, &[&bake[..], &["--out=tree.bvh", "--from=tree.bvh"]].concat());
    for _ in 0..2 {
        said(at, &["inspect", "tree.bvh", "--nodes=nodes.csv"]);
        said(at, &[&render[..], &["--out=x.png"]].concat());
    }
}

#[cfg(unix)]
#[test]
fn pipes_devices_and_folders_are_rejected_as_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let made = std::process::Command::new("mkfifo").arg("p.bvh").current_dir(at).status();
    assert!(made.unwrap().success());
    fs::create_dir(at.join("folder.bvh")).unwrap();
    for (args, parts) in [
        (&["inspect", "p.bvh"][..], &["p.bvh", "not a regular file"][..]),
        (&["bake", "spheres75", "--budget=0s", "--from=p.bvh", "--out=x.bvh"], &["p.bvh"]),
        (&["bake", "/dev/zero", "--budget=0s", "--out=x.bvh"], &["/dev/zero"]),
        (&["inspect", "folder.bvh"], &["folder.bvh", "a folder"]),
        (&["render", "spheres75", "--accel=folder.bvh", "--out=x.png"], &["--accel", "folder.bvh"]),
    ] {
        refused(at, args, 2, parts);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_scene_that_needs_more_memory_than_the_limit_is_rejected_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let limited = |args: &str| run_in_little_memory(folder.path(), args, 4_000_000);
    // A rejection of the scene's own size would end with code 2.
    let output = limited("bake S21:100000000 --budget=0s --out=x.bvh");
    ended(&output, 1, &["S21:100000000", "100000000 objects", "32600000000 bytes", "fewer"]);
    let output = limited("render S21:100000000 --out=x.png");
    ended(&output, 2, &["S21:100000000", "6000000000 bytes"]);
    assert_eq!(names(folder.path()), [""; 0]);
    ended(&limited("bake S21:1000 --budget=0s --out=x.bvh"), 0, &[]);
}

// Linux stores holes of files, so that this file needs no space on the disk.
#[cfg(target_os = "linux")]
#[test]
fn a_file_of_64_gigabytes_is_rejected_by_its_header() {
    let folder = tempfile::tempdir().unwrap();
    fs::File::create(folder.path().join("huge.bvh")).unwrap().set_len(64 << 30).unwrap();
    refused(folder.path(), &["inspect", "huge.bvh"], 2, &["huge.bvh: not a tree file"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_output_is_an_error_and_a_closed_pipe_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let output = program(folder.path(), &["scenes"]).stdout(full).output().unwrap();
    ended(&output, 1, &["standard output"]);
    for args in [&["scenes"][..], &["--help"]] {
        let mut child = program(folder.path(), args).stdout(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        assert!(child.wait().unwrap().success(), "{args:?}");
    }
    // A new file replaces the file with its name, and must never replace a device.
    refused(
        folder.path(),
        &["render", "spheres75", "--out", "/dev/full"],
        2,
        &["--out", "/dev/full"],
    );
}

#[test]
fn help_and_version_on_a_full_output_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    for args in
        [&["--help"][..], &["--version"], &["-h"], &["bake", "--help"], &["help", "inspect"]]
    {
        unsaid(folder.path(), args);
    }
}

#[test]
fn a_missing_folder_is_named_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    said(at, &["bake", "spheres75", "--budget=0s", "--out=tree.bvh"]);
    // The work would take so long that the test would time out.
    for args in [
        &["bake", "spheres75", "--budget=1h", "--out=no/x.bvh"][..],
        &["render", "spheres7500", "--accel=brute", "--size=10000x10000", "--out=no/x.png"],
        &["inspect", "tree.bvh", "--nodes=no/x.csv"],
        &["report", "tree.bvh", "spheres7500", "--out=no/x.html"],
        &["bake", "spheres7500", "--parts=2", "--budget=1Gwork", "--out=no/x.bvh"],
    ] {
        refused(at, args, 2, &["no is no folder", "accepted: a path in a folder that is there"]);
    }
    assert_eq!(names(at), ["tree.bvh"]);
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let locked = at.join("locked");
    fs::create_dir(&locked).unwrap();
    said(at, &["bake", "spheres75", "--budget=0s", "--out=good.bvh"]);
    let Some(_guard) = ReadOnly::new(&locked) else {
        eprintln!("not tried: this user can write into any folder here");
        return;
    };
    for (args, parts) in [
        (
            &["bake", "spheres75", "--budget=1h", "--out=locked/x.bvh"][..],
            ["locked", "cannot create"],
        ),
        (&["inspect", "good.bvh", "--nodes=locked/x.csv"], ["locked/x.csv", "cannot write"]),
        (&["render", "spheres75", "--size=8x8", "--out=locked/x.png"], ["locked/x.png", "cannot"]),
    ] {
        refused(at, args, 1, &parts);
    }
    assert_eq!(fs::read_dir(&locked).unwrap().count(), 0);
}

#[test]
fn a_wrong_value_of_any_flag_is_rejected_with_the_flags_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    said(at, &["bake", "spheres75", "--budget=0s", "--out=good.bvh"]);
    // Every command needs its required arguments before a flag can be wrong.
    let flags = wrong_flags(
        at,
        &[
            ("bake", &["spheres75", "--budget=0s", "--out=x.bvh"]),
            ("inspect", &["good.bvh", "spheres75"]),
            ("verify", &["good.bvh", "spheres75"]),
            ("export", &["good.bvh", "spheres75", "--for=obvhs", "--out=x.bin"]),
            ("render", &["spheres75", "--out=x.png", "--size=8x8"]),
            ("report", &["good.bvh", "spheres75"]),
            ("scenes", &[]),
            ("completions", &["bash"]),
        ],
    );
    assert!(flags > 20, "{flags} flags");
}

#[test]
fn every_command_reads_buffers_outside_the_folder_of_a_scene_only_with_permission() {
    let folder = tempfile::tempdir().unwrap();
    let at = &folder.path().join("inner");
    fs::create_dir(at).unwrap();
    fs::write(at.join("scene.gltf"), outside_scene("../outside.bin")).unwrap();
    fs::write(folder.path().join("outside.bin"), outside_buffer()).unwrap();
    let bake = ["bake", "scene.gltf", "--budget=0s", "--out=x.bvh"];
    for command in [
        &bake[..],
        &["bake", "scene.gltf", "--instances", "--budget=0s", "--out=x"],
        &["inspect", "x.bvh", "scene.gltf"],
        &["verify", "x.bvh", "scene.gltf"],
        &["render", "scene.gltf", "--size=8x8", "--out=x.png"],
        &["report", "x.bvh", "scene.gltf"],
    ] {
        refused(at, command, 2, &["buffers[0]", "outside the scene's folder", "--outside-files"]);
        said(at, &[command, &["--outside-files"]].concat());
    }
}
