//! A program as a child process, and the files that it leaves. `PROGRAM` in the parent module is
//! its path.
#![allow(dead_code)] // each test file uses some of it

mod flags;

use super::PROGRAM;
pub use flags::wrong_flags;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The pages at the top, of the two folders of `docs/`, of `results/`, and of the crates.
pub fn pages() -> Vec<PathBuf> {
    let mut pages = vec![top().join("results/README.md")];
    let crates = fs::read_dir(top().join("crates")).unwrap();
    let of_crates = crates.map(|entry| entry.unwrap().path().join("README.md"));
    pages.extend(of_crates.filter(|page| page.is_file()));
    for folder in [top(), top().join("docs/use"), top().join("docs/evidence")] {
        let entries = fs::read_dir(folder).unwrap();
        pages.extend(entries.map(|entry| entry.unwrap().path()));
    }
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages
}

pub fn folder_with(spec: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(spec), text).unwrap();
    folder
}

pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Prepares the program in a folder, without input.
pub fn program(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(args).stdin(Stdio::null());
    command
}

/// Runs the program, and returns its output and exit code.
pub fn run(folder: &Path, args: &[&str]) -> Output {
    program(folder, args).output().unwrap()
}

/// Runs the program where no file may be larger than `blocks` blocks of 512 bytes. Larger writes
/// fail as they do on a full disk. Windows has no such limit.
pub fn run_on_a_small_disk(folder: &Path, args: &str, blocks: u32) -> Option<Output> {
    if cfg!(windows) {
        eprintln!("not tried: this system cannot limit the size of files");
        return None;
    }
    // A signal that the shell ignores is ignored by the program too: its writes fail instead.
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec '{PROGRAM}' {args}");
    let output = Command::new("sh").args(["-c", &script]).current_dir(folder).output();
    Some(output.unwrap())
}

pub fn wait_for(path: &Path) {
    wait_until(&path.display().to_string(), || path.exists());
}

/// Waits until what has this name is there.
pub fn wait_until(name: &str, is_there: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_there() {
        assert!(start.elapsed() < Duration::from_secs(60), "{name} never came");
        std::thread::sleep(Duration::from_millis(1));
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs a command that must succeed, and returns its standard output.
pub fn said(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    assert!(output.status.success(), "{args:?}: {}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// Asserts that a command fails if its output is lost. Only Linux has the device that loses it.
pub fn unsaid(folder: &Path, args: &[&str]) {
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let output = program(folder, args).stdout(full).output().unwrap();
    ended(&output, 1, &["could not be written to standard output"]);
}

/// Runs a command that must end with this code, with each of the parts on standard error.
pub fn refused(folder: &Path, args: &[&str], code: i32, parts: &[&str]) {
    ended(&run(folder, args), code, parts);
}

/// Asserts the exit code of a command, and the parts of its message on standard error.
pub fn ended(output: &Output, code: i32, parts: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{parts:?}: {message}");
    let listed = include_str!("../../README.md").contains(&format!("\n| {code} | "));
    assert!(listed, "the list of exit codes lacks {code}");
    for part in parts {
        assert!(message.contains(part), "{part} in {message}");
    }
}

/// Starts the program in the background with a pipe from its standard error.
pub fn begin(folder: &Path, args: &[&str]) -> Child {
    program(folder, args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

pub fn send(signal: &str, to: &Child) {
    let status = Command::new("kill").args([signal, &to.id().to_string()]).status();
    assert!(status.unwrap().success());
}
