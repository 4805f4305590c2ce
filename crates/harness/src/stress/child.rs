//! Builds in a separate process, whose peak memory is measured.

use bvh_scenes::builtin::stiff;
use bvh_search::{Budget, Method, Problem, solve};
use std::process::{Command, Stdio};

/// The hidden command of the harness that [`main`] performs.
pub const COMMAND: &str = "suite-child";

/// Measures the peak memory of a build beyond its boxes, in bytes, in a child process; `None` if
/// the system does not report it.
pub fn peak_bytes(method: &Method, case: &str, objects: usize) -> Option<u64> {
    let method = toml::to_string(method).ok()?;
    let output = Command::new(std::env::current_exe().ok()?)
        .arg(COMMAND)
        .args([&method, case, &objects.to_string()])
        .stdin(Stdio::null())
        .output()
        .ok()?;
    let answer = String::from_utf8(output.stdout).ok()?;
    answer.trim().parse().ok()
}

/// Performs the child's work and returns its output. `method` is in the notation of specs.
pub fn main(method: &str, id: &str, objects: usize) -> Result<String, String> {
    let generator = stiff::by_id(id).ok_or_else(|| format!("{id} is no case with a scene"))?;
    let triangles = generator(objects);
    let method: Method = toml::from_str(method).map_err(|error| error.to_string())?;
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
    let line = status.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
