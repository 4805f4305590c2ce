//! Programs of others as methods, in whatever language: the boxes of a scene in a file, and a tree file back.

use bvh_build::OutOfRange;
use bvh_build::config::above;
use bvh_core::file::{self, FileError};
use bvh_core::{Aabb, Bvh, Clip, validate_references};
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

bvh_build::config! { serde;
    /// A program that builds trees, called as `COMMAND… BOXES TREE` in the folder in which the harness was called.
    ///
    /// `BOXES` is a file with min x, y, z, max x, y, z of every object as little-endian `f32`, and nothing else: object `i` has
    /// the bytes from `24 i`, and the CRC-32 of the file is the checksum of the scene in a tree file. `TREE` is where the
    /// program leaves the [tree file](bvh_core::file). The environment variable `BVH_SEED` has the seed of the run. Of what
    /// is printed, only the last line on standard error is read, if the program fails.
    #[serde(tag = "method", rename = "external")]
    pub struct Config {
        /// The program and its first arguments. Whoever runs the spec runs this program.
        command: Vec<String>;
        /// Seconds after which the program is ended and the run fails. Default none.
        #[serde(skip_serializing_if = "Option::is_none")]
        timeout_seconds: Option<f64>, in above(0.0);
    }
    check Self::names_a_program;
}

/// What a program did not do.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// There is no such program, or it may not be run.
    #[error("it cannot be started: {0}")]
    NotStarted(io::Error),
    /// It reports a failure, with the last line on standard error.
    #[error("{status}: {last_line}")]
    Failed {
        /// How it ended.
        status: ExitStatus,
        /// Its last words.
        last_line: String,
    },
    /// It ended without a tree.
    #[error("it left no file at the path that is its last argument")]
    NoTree,
    /// Its tree is damaged, or none over these boxes.
    #[error("its tree is refused: {0}")]
    Refused(#[from] FileError),
    /// It took too long.
    #[error("it did not end within {0} s")]
    TimedOut(f64),
    /// The run was interrupted, and so it was ended.
    #[error("it was interrupted")]
    Interrupted,
    /// Files could not be exchanged with it.
    #[error("the files that it is given cannot be written or read: {0}")]
    Exchange(#[from] io::Error),
}

impl Config {
    /// The method's name in specs.
    pub const NAME: &str = "external";

    fn names_a_program(&self) -> Option<OutOfRange> {
        let is_empty = self.command.first().is_none_or(String::is_empty);
        is_empty.then(|| OutOfRange::new("command", "empty", "a list of a program and its arguments"))
    }

    /// The program's tree over `boxes`, those of the `objects`, and the seconds that it took, its start and files included. Ends the
    /// program, and all that it has started, as soon as the run is `cancelled`.
    pub fn build(
        &self,
        boxes: &[Aabb],
        objects: &dyn Clip,
        seed: u64,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<(Bvh, f64), Fault> {
        let folder = tempfile::tempdir()?;
        let [given, tree, said] = ["boxes", "tree.bvh", "stderr"].map(|name| folder.path().join(name));
        let corners = boxes.iter().flat_map(|aabb| [aabb.min.to_array(), aabb.max.to_array()]).flatten();
        fs::write(&given, corners.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())?;
        let mut command = Command::new(&self.command[0]);
        command.args(&self.command[1..]).args([&given, &tree]).env("BVH_SEED", seed.to_string());
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(File::create(&said)?);
        // In a group of its own, so that what it starts can be ended with it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let start = Instant::now();
        let mut child = command.spawn().map_err(Fault::NotStarted)?;
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            let elapsed = start.elapsed();
            let late = self.timeout_seconds.filter(|limit| elapsed.as_secs_f64() > *limit);
            if late.is_some() || cancelled() {
                end(child);
                return Err(late.map_or(Fault::Interrupted, Fault::TimedOut));
            }
            // The wait is at most a fiftieth of what is measured.
            std::thread::sleep((elapsed / 50).clamp(Duration::from_micros(200), Duration::from_millis(20)));
        };
        let seconds = start.elapsed().as_secs_f64();
        if !status.success() {
            return Err(Fault::Failed { status, last_line: last_line(&said)? });
        }
        // A pipe could keep us waiting for ever.
        if !tree.is_file() {
            return Err(Fault::NoTree);
        }
        let tree = file::load(&fs::read(&tree)?, boxes)?;
        validate_references(&tree, boxes, objects).map_err(FileError::Tree)?;
        Ok((tree, seconds))
    }
}

/// Kills a program and its group. It may have ended meanwhile.
fn end(mut child: Child) {
    #[cfg(unix)]
    {
        use nix::{sys::signal, unistd::Pid};
        let group = Pid::from_raw(child.id().cast_signed());
        let _ = signal::killpg(group, signal::Signal::SIGKILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

/// The last line of a text file that says something; the file may be long.
fn last_line(path: &Path) -> io::Result<String> {
    const MOST_BYTES: u64 = 2048;
    let mut file = File::open(path)?;
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(length.saturating_sub(MOST_BYTES)))?;
    let mut end = Vec::new();
    file.read_to_end(&mut end)?;
    let end = String::from_utf8_lossy(&end);
    let last = end.lines().rfind(|line| !line.trim().is_empty());
    Ok(last.map_or_else(|| "it says nothing on standard error".into(), |line| line.trim().to_owned()))
}
