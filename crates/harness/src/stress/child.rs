//! Work in a separate process: other libraries, whose crash or hang must not end the run, and
//! builds whose peak memory is measured.

use super::peers::{self, Found};
use bvh_scenes::builtin::stiff;
use bvh_search::{Budget, Method, Problem, solve};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The hidden command of the harness that [`main`] performs.
pub const COMMAND: &str = "suite-child";

/// Runs this program again and returns its output, or an error if it fails or exceeds `limit`.
fn ask(arguments: [&str; 3], limit: Duration) -> Result<String, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let start = Instant::now();
    let mut child = Command::new(program)
        .arg(COMMAND)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| error.to_string())?;
    // The output fits into the pipe, so nobody needs to read it before the end.
    loop {
        match child
            .try_wait()
            .map_err(|error| error.to_string())?
        {
            Some(_) => break,
            None if start.elapsed() > limit => {
                // It may have ended meanwhile.
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("no end within {} s", limit.as_secs()));
            }
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    }
    let output = child
        .wait_with_output()
        .map_err(|error| error.to_string())?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        // Rust programs exit with this code after a panic.
        false if output.status.code() == Some(101) => Err("panic".into()),
        false => Err(format!("crash, {}", output.status)),
    }
}

/// Examines another library on the scene of a case in a child process. An error describes how the
/// child failed.
pub fn examine(peer: &str, case: &str, objects: usize, limit: Duration) -> Result<Found, String> {
    let answer = ask([peer, case, &objects.to_string()], limit)?;
    toml::from_str(&answer).map_err(|error| error.to_string())
}

/// Measures the peak memory of a build beyond its boxes, in bytes, in a child process; `None` if
/// the system does not report it.
pub fn peak_bytes(method: &Method, case: &str, objects: usize) -> Option<u64> {
    let method = toml::to_string(method).ok()?;
    let answer = ask([&method, case, &objects.to_string()], Duration::from_secs(3600)).ok()?;
    answer.trim().parse().ok()
}

/// Performs the child's work and returns its output. `subject` is a library's name or a method in
/// the notation of specs.
pub fn main(subject: &str, id: &str, objects: usize) -> Result<String, String> {
    let generator = stiff::by_id(id).ok_or_else(|| format!("{id} is no case with a scene"))?;
    let triangles = generator(objects);
    if let Some(found) = peers::examine(subject, &triangles) {
        return toml::to_string(&found).map_err(|error| error.to_string());
    }
    let method: Method = toml::from_str(subject).map_err(|error| error.to_string())?;
    let boxes = stiff::boxes(&triangles);
    // The peak must count the build alone.
    drop(triangles);
    let before = status("VmRSS");
    let outcome = solve(&method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &())
        .map_err(|e| e.to_string())?;
    let peak = status("VmHWM");
    // The outcome lives until here, so that its memory is part of the peak.
    drop(outcome);
    match (before, peak) {
        (Some(before), Some(peak)) => Ok(peak.saturating_sub(before).to_string()),
        _ => Err("this system does not report memory".into()),
    }
}

/// Returns a size in bytes from the process status of Linux.
fn status(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    Some(
        line.trim()
            .strip_suffix("kB")?
            .trim()
            .parse::<u64>()
            .ok()?
            * 1024,
    )
}
