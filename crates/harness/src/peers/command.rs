//! Programs of others as methods, in whatever language: the boxes of a scene in a file, and a tree file back.

use super::program::Program;
use crate::error::CommandFault;
use bvh_config::{OutOfRange, above};
use bvh_core::file::{self, FileError};
use bvh_core::{Aabb, Bvh, Clip, validate_references};
use bvh_scenes::ReadError;
use bvh_scenes::tree_file::{self, TreeFileError};
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

bvh_config::config! { serde;
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

impl Config {
    /// The method's name in specs.
    pub const NAME: &str = "external";

    fn names_a_program(&self) -> Option<OutOfRange> {
        let is_empty = self.command.first().is_none_or(String::is_empty);
        is_empty
            .then(|| OutOfRange::new("command", "empty", "a list of a program and its arguments"))
    }

    /// The program's tree over `boxes`, those of the `objects`, and the seconds that it took, its start and files included. Ends the
    /// program as soon as the run is `cancelled`, and with the program, however it ends, all that it has started.
    pub fn build(
        &self,
        boxes: &[Aabb],
        objects: &dyn Clip,
        seed: u64,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<(Bvh, f64), CommandFault> {
        let folder = tempfile::tempdir()?;
        let [given, tree, said] =
            ["boxes", "tree.bvh", "stderr"].map(|name| folder.path().join(name));
        let corners = boxes
            .iter()
            .flat_map(|aabb| [aabb.min.to_array(), aabb.max.to_array()])
            .flatten();
        fs::write(
            &given,
            corners
                .flat_map(f32::to_le_bytes)
                .collect::<Vec<u8>>(),
        )?;
        let mut command = Command::new(&self.command[0]);
        command
            .args(&self.command[1..])
            .args([&given, &tree])
            .env("BVH_SEED", seed.to_string());
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(File::create(&said)?);
        let start = Instant::now();
        let mut program =
            Program::start(&mut command, folder.path()).map_err(CommandFault::NotStarted)?;
        let status = loop {
            if let Some(status) = program.status()? {
                break status;
            }
            let elapsed = start.elapsed();
            let late = self
                .timeout_seconds
                .filter(|limit| elapsed.as_secs_f64() > *limit);
            if late.is_some() || cancelled() {
                return Err(late.map_or(CommandFault::Interrupted, CommandFault::TimedOut));
            }
            // The wait is at most a fiftieth of what is measured.
            std::thread::sleep(
                (elapsed / 50).clamp(Duration::from_micros(200), Duration::from_millis(20)),
            );
        };
        let seconds = start.elapsed().as_secs_f64();
        drop(program);
        if !status.success() {
            return Err(CommandFault::Failed { status, last_line: last_line(&said)? });
        }
        let tree = file::load(&tree_file::read(&tree)?, boxes)?;
        validate_references(&tree, boxes, objects).map_err(FileError::Tree)?;
        Ok((tree, seconds))
    }
}

impl From<TreeFileError> for CommandFault {
    fn from(error: TreeFileError) -> Self {
        match error {
            TreeFileError::Read(ReadError::Failed { source, .. }) => Self::Exchange(source),
            TreeFileError::Read(_) => Self::NoTree,
            TreeFileError::Invalid { source, .. } => Self::Refused(source),
        }
    }
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
    Ok(last
        .map_or_else(|| "it says nothing on standard error".into(), |line| line.trim().to_owned()))
}
