//! What all commands share: their output, their folders, and the rejection of invalid input.

// Tests that make pipes or lose output are left out on Windows, and their imports stay.
#![cfg_attr(windows, allow(unused_imports))]

use crate::support::{
    PROGRAM, bvh, facts, names, program, said, text, unsaid, words, wrong, wrong_flags,
};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

#[test]
fn scenes_are_listed_with_their_sizes() {
    let at = Path::new(".");
    assert!(bvh(at, "scenes").contains("32 892  stand-in"));
    assert_eq!(facts(at, "scenes")["scenes"][0]["objects"], 32_892);
}

#[test]
fn the_steps_that_a_scene_does_not_need_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    for (scene, objects, skipped) in [
        ("escher:12", "12 objects within [", "skipped: the search `best`"),
        ("S10:50", "50 objects within [", "skipped: splits along y and z"),
    ] {
        let bake = format!("bake {scene} --explain --budget=0s --out=x.bvh");
        let said = bvh(folder.path(), &bake);
        assert!(said.contains(objects) && said.contains(skipped), "{scene}: {said}");
        let json = facts(folder.path(), &bake);
        assert!(json["explanation"][0].as_str().unwrap().contains(objects), "{json:?}");
        assert!(json["explanation"][1].as_str().unwrap().contains(skipped), "{json:?}");
    }
}

#[test]
fn the_commands_that_follow_a_bake_run_in_a_shell_for_any_names() {
    if cfg!(windows) {
        eprintln!("not tried: this system has no such shell");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, scene) in [
        ("a friend's $HOME `scene`", "a friend's $HOME `scene`.obj"),
        ("-v", "./-v.obj"),
        ("plain-1_é", "plain-1_é.obj"),
    ] {
        fs::write(at.join(scene), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let said = said(at, &["bake", scene, "--budget=0s"]);
        let next = said.split_once("next: `bvh bench ").unwrap().1;
        let [bench, report] = next.split("`, `bvh ").take(2).collect::<Vec<_>>()[..] else {
            panic!("{said}")
        };
        assert_eq!(bench.contains('\''), name.contains(' '), "{bench}");
        for command in [&format!("bench {bench} --time=1ms"), report] {
            let mut shell = Command::new("sh");
            let output = shell.args(["-c", &format!("'{PROGRAM}' {command}")]).current_dir(at);
            let output = output.output().unwrap();
            assert!(output.status.success(), "{command}: {}", text(&output.stderr));
        }
        assert!(
            at.join(name).with_extension("html").exists()
                && at.join(format!("{name}.bvh")).exists()
        );
    }
}

/// Makes a folder with a valid tree file, damaged ones, a mesh, and things that are no files.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |name: &str, bytes: &[u8]| fs::write(at.join(name), bytes).unwrap();
    bvh(at, "bake spheres75 --budget=0s --out=good.bvh");
    // Insertion attaches more than two children to some nodes.
    bvh(at, "bake spheres75 --budget=1Mwork --method=goldsmith_salmon --out=wide.bvh");
    let good = fs::read(at.join("good.bvh")).unwrap();
    write("cut.bvh", &good[..good.len() - 1]);
    let mut flipped = good;
    flipped[300] ^= 1;
    write("flipped.bvh", &flipped);
    write("file", b"");
    write("mesh.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write("mesh.ply", b"ply\n");
    write("picture.glb", b"\x89PNG\r\n\x1a\n");
    write("down.csv", b"x,y,z,w\n0,0,1,1\n\n0,0,0,1\n");
    write("heavy.csv", b"0,0,1,1\n0,0,1,inf\n");
    write("yxz.csv", b"y,x,z\n0,0,1\n");
    write("wrong.toml", b"count = 9\nbouncy = 1\ncameras = []\n");
    write("blind.toml", b"cameras = [{ eye = [1.0, 2.0, 3.0] }]\n");
    write("none.toml", b"bounces = 1");
    let away = "1000,1000,1000,1001,1002,1003\n".repeat(9);
    write("away.csv", away.as_bytes());
    // One segment that meets the scene is enough.
    write("through.csv", (away + "-50,1,0.5,50,1,0.5\n").as_bytes());
    fs::create_dir(at.join("folder.bvh")).unwrap();
    fs::create_dir(at.join("full")).unwrap();
    write("full/mine", b"mine");
    folder
}

fn contents(at: &Path) -> Vec<(String, Option<Vec<u8>>)> {
    names(at).into_iter().map(|name| (name.clone(), fs::read(at.join(name)).ok())).collect()
}

/// Commands, each with words of the message that rejects it. The work of LONG and of VAST would take
/// so long that a test of it would time out.
const WRONG: &str = "
completions bash --json ! --json | a script
bake spheres75 --budget=1h --out=full ! --out: full | .bvh
bake spheres75 --budget=1h --out=no/x.bvh ! no is no folder | accepted: a path in a folder
bake mesh.obj --budget=1h --out=mesh.obj ! --out: mesh.obj | .bvh
bake spheres7500 --parts=2 --budget=1000Gwork --out=folder.bvh ! --out: folder.bvh | regular | accepted
render mesh.obj --size=8x8 --out=mesh.obj ! --out: mesh.obj | .png
render spheres75 --out=/dev/full ! --out | /dev/full
report good.bvh spheres75 --out=good.bvh ! --out: good.bvh | .html
report good.bvh escher --out=x.html ! good.bvh | scene
export good.bvh spheres75 --for=obvhs --out=x.bvh ! --out | .bin
sky mesh.obj --out=x.obj ! --out: x.obj | .csv, .ply, .glb or .png
sky mesh.ply --out=mesh.ply ! --out: mesh.ply is read | another name
sky mesh.obj --directions=away.csv --out=away.csv ! --out: away.csv is read
orient mesh.obj --out=mesh.obj ! --out: mesh.obj is the scene | another name
orient mesh.obj --out=x.glb ! --out | .obj
orient no.glb --out=x.glb ! no.glb: no such file
orient mesh.ply --out=x.ply ! mesh.ply: a file of the kind Ply | OBJ, glTF or GLB
orient good.bvh --out=x.obj ! good.bvh: a tree, not a scene
orient picture.glb --out=x.glb ! picture.glb: a PNG picture
verify spheres75 good.bvh ! good.bvh is a tree file | first the tree

bake sofa LONG ! scene sofa: no such scene; accepted: bijou
bake - LONG ! pipe | the path of a file
bake esher LONG ! no such scene; did you mean escher?
bake mash.obj LONG ! scene mash.obj: no such file; did you mean mesh.obj?
bake no.glb LONG ! error: scene no.glb: no such file
bake spheres75 LONG --from=cut.bvh ! cut.bvh | cut or extended
bake spheres75 LONG --from=flipped.bvh ! flipped.bvh | checksum
bake spheres75 LONG --from=file ! file | not a tree file
bake spheres75 LONG --from=x.bvh ! x.bvh | no such file
bake spheres75 LONG --from=wide.bvh ! --from wide.bvh: inner node | accepted: a tree of nodes with two
inspect good.bvh spheres750 ! good.bvh | 75 objects | 750
inspect good.bvh spheres750:75 ! good.bvh | another scene
inspect flipped.bvh ! flipped.bvh | checksum
inspect folder.bvh ! folder.bvh | a folder
bake /dev/zero LONG ! /dev/zero
export good.bvh escher:75 --for=obvhs --out=x.bin ! good.bvh | scene
export good.bvh spheres75 --for=obvhs --out=x.bin ! spheres75: spheres
render spheres75 --out=x.png --accel=none.bvh ! none.bvh

bake spheres75 --budget=ten --out=good.bvh ! ten | 10s | 50Mwork
bake spheres75 LONG --method=anealing ! --method | muller_fellner | exists: 'annealing'
bake spheres75 LONG --method=grasp --from=good.bvh ! grasp | --from | best
bake spheres75 LONG --method=grasp --references=1.5 ! --references 1.5 with --method grasp | best
bake spheres75 LONG --references=nan ! --references is NaN; accepted: 1 to 16
bake spheres75 LONG --rays=wrong.toml ! wrong.toml | line 2 | bouncy | bounces
bake spheres75 LONG --rays=blind.toml ! blind.toml | line 1 | target
bake spheres75 LONG --rays=none.toml ! none.toml | cameras is empty | eye
bake spheres75 LONG --rays=gone.toml ! --rays | gone.toml | no such file
bake escher LONG --rays=away.csv ! away.csv: none of the 9 segments meets the box of scene escher
bake spheres75 LONG --rays=mesh.obj ! mesh.obj: --rays accepts | .npy or .bin
bake escher VAST --parts=4 --part=0123 ! --part 0123 | no such part | --list
bake escher VAST --parts=4 --rays=default ! --parts | --rays | cannot be used with
bake spheres75 VAST --parts=76 ! --parts 76 | accepted: 2 to the number of objects, 75
bake escher:1 VAST --parts=2 ! --parts 2 | accepted: no parts
bake escher --parts=4 ! --budget
inspect good.bvh --rays=default ! --rays | SCENE
inspect good.bvh spheres75 --rays=away.csv ! away.csv: none of the 9 segments meets the box
inspect good.bvh spheres75 \u{1b}[2J ! unexpected argument '\\u{1b}[2J'
render spheres75 --out=x.png --accel=octree ! octree | brute, kdtree, bvh, wide
render spheres75 --out=x.png --accel=wide ! spheres75: spheres | --accel brute
render escher --out=x.png --accel=wide --heatmap ! counts no tests
sky spheres75 --out=x.csv ! spheres75: spheres
sky mesh.obj --out=x.csv --directions=down.csv ! down.csv: line 4: direction 1 is [0, 0, 0]
sky mesh.obj --out=x.csv --directions=heavy.csv ! heavy.csv: line 2: weight 1 is inf
sky mesh.obj --out=x.csv --directions=yxz.csv ! yxz.csv: line 1 is | y,x,z | first are x,y,z
sky mesh.obj --out=x.csv --points=away.csv --per=vertex ! --points | --per
sky mesh.obj --out=x.csv --points=heavy.csv ! heavy.csv: line 1 is | 0,0,1,1 | x,y,z,nx,ny,nz
sky mesh.obj --out=x.csv --points=mesh.obj ! mesh.obj: --points accepts | .csv or .npy
sky mesh.obj --out=x.png --per=vertex ! a point in each pixel | .glb
sky mesh.obj --out=x.csv --column=hours ! no column | hours | accepted: sky_view_factor
sky mesh.obj --out=x.csv --sun=80,0 --dates=2026-12-21 ! --dates: the sun does not rise
sky mesh.obj --out=x.csv --sun=47,8 ! --dates
sky mesh.obj -o x.csv --sun=47,8 --dates=2026-02-30 ! --dates | no such day
sky mesh.obj --out=x.csv --tree=good.bvh ! good.bvh | 75 objects
";

#[test]
fn what_is_wrong_is_named_before_the_work_and_changes_no_file() {
    let folder = folder();
    let at = folder.path();
    let before = contents(at);
    let table = WRONG
        .replace("LONG", "--budget=1h --out=good.bvh")
        .replace("VAST", "--budget=1000Gwork --out=x.bvh");
    for line in table.lines().filter(|line| !line.is_empty()) {
        let (command, parts) = line.split_once(" ! ").unwrap();
        wrong(at, command, &parts.split(" | ").collect::<Vec<&str>>());
    }
    assert!(contents(at) == before, "a file was changed or left behind");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_rejected_as_an_input_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let made = Command::new("mkfifo").arg("p.bvh").current_dir(at).status();
    assert!(made.unwrap().success());
    wrong(at, "inspect p.bvh", &["p.bvh", "not a regular file"]);
    wrong(at, "bake spheres75 --budget=0s --from=p.bvh --out=x.bvh", &["--from: p.bvh"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_output_is_an_error_and_a_closed_pipe_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let help = ["--help", "--version", "-h", "bake --help", "help inspect"];
    // Without a budget, a bake prints a line before its search.
    let results = ["scenes", "completions bash", "bake spheres75:9 --out=x.bvh"];
    for line in help.into_iter().chain(results) {
        unsaid(at, &words(line));
        // The tree of a bake is written although its results cannot be printed.
        let is_written = fs::remove_file(at.join("x.bvh")).is_ok();
        assert_eq!(is_written, line.contains("x.bvh"), "{line}");
        said(at, &words(line));
        let mut child = program(at, &words(line)).stdout(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        assert!(child.wait().unwrap().success(), "{line}");
    }
}

#[test]
fn a_wrong_value_of_any_flag_is_rejected_with_the_flags_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake spheres75 --budget=0s --out=good.bvh");
    fs::write(at.join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    // Every command needs its required arguments before a flag can be wrong.
    let flags = wrong_flags(
        at,
        &[
            ("bake", &["spheres75", "--budget=0s", "--out=x.bvh"]),
            ("bench", &["good.bvh", "spheres75"]),
            ("inspect", &["good.bvh", "spheres75"]),
            ("verify", &["good.bvh", "spheres75"]),
            ("export", &["good.bvh", "spheres75", "--for=obvhs", "--out=x.bin"]),
            ("orient", &["mesh.obj", "--out=x.obj"]),
            ("render", &["spheres75", "--out=x.png", "--size=8x8"]),
            ("report", &["good.bvh", "spheres75"]),
            ("sky", &["mesh.obj", "--out=x.csv"]),
            ("scenes", &[]),
            ("completions", &["bash"]),
        ],
    );
    assert!(flags > 20, "{flags} flags");
}

#[test]
fn the_results_of_all_commands_are_printed_as_json() {
    let folder = folder();
    for (line, fact) in [
        ("bake escher --budget=10kwork --out=x.bvh --rays=through.csv", "seconds"),
        ("bake escher --budget=1Mwork --parts=2 --list", "parts"),
        ("render spheres75 --size=8x8 --out=x.png", "rays"),
        ("render spheres75 --size=8x8 --out=x.png", "file"),
        ("orient mesh.obj --out=x.obj", "file"),
        ("report good.bvh spheres75", "depth"),
        ("sky mesh.obj --out=x.ply", "mean"),
        ("verify good.bvh spheres75", "valid"),
    ] {
        let facts = facts(folder.path(), line);
        assert!(facts.contains_key(fact), "{line}: {facts:?}");
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let odd = facts.keys().find(|key| !key.chars().all(is_plain));
        assert_eq!(odd, None, "{line}");
    }
}
