//! The program as a child process, and what it leaves in a folder.
#![allow(dead_code)] // each test file uses some of it

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_harness");

/// The project's folder.
pub fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The committed specs, each with its name and text, in the order of their names.
pub fn experiments() -> Vec<(String, String)> {
    let folder = top().join("experiments");
    let read =
        |file: String| (file.trim_end_matches(".toml").into(), fs::read_to_string(folder.join(file)).unwrap());
    names(&folder).into_iter().map(read).collect()
}

/// A page of the documentation is what it is made to be by the test `by`, which rewrites it where `UPDATE_DOCS` is set.
pub fn assert_current(path: &Path, made: &str, by: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(path, made).unwrap();
    }
    let text = fs::read_to_string(path).unwrap_or_default();
    let differs = text.lines().zip(made.lines()).find(|(now, then)| now != then);
    let stale = path.display();
    assert!(
        text == made,
        "{stale} is stale: {differs:?}; UPDATE_DOCS=1 cargo test -p harness --test {by} rewrites it"
    );
}

/// A new folder with a spec of this name in it.
pub fn folder_with(spec: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(spec), text).unwrap();
    folder
}

/// The names of what a folder holds, in order.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The program in a folder, without input.
pub fn harness(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(args).stdin(Stdio::null());
    command
}

/// What it says and how it ends.
pub fn run(folder: &Path, args: &[&str]) -> Output {
    harness(folder, args).output().unwrap()
}

/// [`run`] where no file may grow beyond so many blocks of 512 bytes; past the limit a write fails as on a full disk.
pub fn run_on_a_small_disk(folder: &Path, args: &str, blocks: u32) -> Output {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec '{PROGRAM}' {args}");
    Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap()
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

/// The CSV files without seconds, by name, and the resolved spec.
pub fn reproducible(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names(folder)
        .into_iter()
        .filter(|name| (name.ends_with(".csv") && !name.starts_with("timing")) || name == "resolved.toml")
        .map(|name| (name.clone(), fs::read(folder.join(name)).unwrap()))
        .collect()
}

/// The rows of a CSV file by column names.
pub fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().map(Result::unwrap).collect()
}

/// A GLB file of this JSON and these bytes.
pub fn glb(json: String, binary: &[u8]) -> Vec<u8> {
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], kind, bytes].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", binary)].concat();
    [&b"glTF\x02\0\0\0"[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

/// Standard output of a command that must succeed.
pub fn said(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    assert!(output.status.success(), "{args:?}: {}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// Runs a command that must end with this code, and say each of the parts on standard error.
pub fn refused(folder: &Path, args: &[&str], code: i32, parts: &[&str]) {
    ended(&run(folder, args), code, parts);
}

/// What a command must have ended with, and what it must have said on standard error.
pub fn ended(output: &Output, code: i32, parts: &[&str]) {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{parts:?}: {said}");
    parts.iter().for_each(|part| assert!(said.contains(part), "{part} in {said}"));
}

/// The program at work in the background; what it says on standard error is kept.
pub fn begin(folder: &Path, args: &[&str]) -> Child {
    harness(folder, args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Sends a signal, such as `-INT`.
pub fn send(signal: &str, to: &Child) {
    assert!(Command::new("kill").args([signal, &to.id().to_string()]).status().unwrap().success());
}

/// The facts that `inspect` and the readers print.
pub fn facts(text: &str) -> BTreeMap<String, String> {
    text.lines()
        .filter_map(|line| line.split_once(": "))
        .map(|(what, value)| (what.into(), value.into()))
        .collect()
}

/// The internal area of the tree in a file, as `inspect` has it.
pub fn cost(folder: &Path, file: &str) -> f64 {
    facts(&said(folder, &["inspect", file]))["internal area"].parse().unwrap()
}
