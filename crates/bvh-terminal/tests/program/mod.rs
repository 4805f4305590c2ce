//! A program as a child process, and what it leaves in a folder; `PROGRAM` of the module above is its path.
#![allow(dead_code)] // each test file uses some of it

mod flags;
mod read_only;

use super::PROGRAM;
pub use flags::wrong_flags;
#[cfg(unix)]
pub use read_only::ReadOnly;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The project's folder.
pub fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A new folder with a spec of this name in it.
pub fn folder_with(spec: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(spec), text).unwrap();
    folder
}

/// The names of what a folder holds, in order.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// The program in a folder, without input.
pub fn program(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command
        .current_dir(folder)
        .args(args)
        .stdin(Stdio::null());
    command
}

/// What it says and how it ends.
pub fn run(folder: &Path, args: &[&str]) -> Output {
    program(folder, args).output().unwrap()
}

/// [`run`] where no file may grow beyond so many blocks of 512 bytes; past the limit a write fails as on a full disk.
pub fn run_on_a_small_disk(folder: &Path, args: &str, blocks: u32) -> Output {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec '{PROGRAM}' {args}");
    Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Waits until a file or folder is there.
pub fn wait_for(path: &Path) {
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{} never came", path.display());
        std::thread::sleep(Duration::from_millis(1));
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Standard output of a command that must succeed.
pub fn said(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    assert!(output.status.success(), "{args:?}: {}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// A command whose output is lost ends with an error, and without one otherwise.
#[cfg(target_os = "linux")]
pub fn unsaid(folder: &Path, args: &[&str]) {
    let full = fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let output = program(folder, args)
        .stdout(full)
        .output()
        .unwrap();
    ended(&output, 1, &["could not be written to standard output"]);
    said(folder, args);
}

/// Runs a command that must end with this code, and say each of the parts on standard error.
pub fn refused(folder: &Path, args: &[&str], code: i32, parts: &[&str]) {
    ended(&run(folder, args), code, parts);
}

/// What a command must have ended with, and what it must have said on standard error.
pub fn ended(output: &Output, code: i32, parts: &[&str]) {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{parts:?}: {said}");
    parts
        .iter()
        .for_each(|part| assert!(said.contains(part), "{part} in {said}"));
}

/// The program at work in the background; what it says on standard error is kept.
pub fn begin(folder: &Path, args: &[&str]) -> Child {
    program(folder, args)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Sends a signal, such as `-INT`.
pub fn send(signal: &str, to: &Child) {
    assert!(
        Command::new("kill")
            .args([signal, &to.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
}

/// A glTF scene of one triangle, [`outside_buffer`], in the file that a URI names.
pub fn outside_scene(uri: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"uri": "{uri}", "byteLength": 36}}]}}"#
    )
}

/// The corners of a triangle.
pub fn outside_buffer() -> Vec<u8> {
    [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect()
}
