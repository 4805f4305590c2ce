//! External programs as methods, in any language: they read the boxes of a scene from a file and
//! write a tree file.

use super::{BuildFault, Built, Library, Task};
use bvh_config::fault;
use bvh_config::{OutOfRange, above};
use bvh_core::{file, validate_references};
use bvh_scenes::tree_file::{self, TreeFileError};
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use toml::Table;

bvh_config::config! { serde;
    /// A program that builds trees, called as `COMMAND… BOXES TREE` in the harness's working
    /// folder.
    ///
    /// The file `BOXES` holds min x, y, z, max x, y, z of every object as little-endian `f32`, and
    /// nothing else: object `i` begins at byte `24 i`, and the CRC-32 of the file is the checksum
    /// of the scene in a tree file. The program writes the [tree file](bvh_core::file) to the path
    /// `TREE`. The environment variable `BVH_SEED` holds the seed of the run. The harness ignores
    /// the program's output, except the last line on standard error if the program fails.
    pub struct Config {
        /// The program and its first arguments. Everybody who runs the spec runs this program.
        command: Vec<String>;
        /// Seconds after which the program is killed and the run fails. Default none.
        #[serde(skip_serializing_if = "Option::is_none")]
        timeout_seconds: Option<f64>, in above(0.0);
    }
    check Self::check_command;
}

/// Programs as a library.
pub struct Programs;

impl Library for Programs {
    fn name(&self) -> &'static str {
        "external"
    }

    fn check(&self, settings: &Table) -> Result<(), OutOfRange> {
        fault::deserialize::<Config>(settings.clone()).map(|_| ())
    }

    fn build(&self, settings: &Table, task: &Task) -> Result<Built, BuildFault> {
        let config: Config = fault::deserialize(settings.clone())?;
        let command = config.command.join(" ");
        config.build(task).map_err(|fault| format!("command `{command}`: {fault}").into())
    }
}

/// A failure of the files that a program and the harness exchange.
fn exchange(error: io::Error) -> String {
    format!("its input or output files cannot be written or read: {error}")
}

impl Config {
    fn check_command(&self) -> Result<(), OutOfRange> {
        match self.command.first() {
            Some(program) if !program.is_empty() => Ok(()),
            _ => Err(OutOfRange::new("command", "empty", "a list of a program and its arguments")),
        }
    }

    /// Runs the program. The seconds include its start and its files.
    ///
    /// Kills the program once the task is cancelled. Whenever the program ends, all processes of
    /// its group are killed as well.
    fn build(&self, task: &Task) -> Result<Built, String> {
        let Task { boxes, objects, seed, cancelled } = *task;
        let folder = tempfile::tempdir().map_err(exchange)?;
        let boxes_path = folder.path().join("boxes");
        let tree_path = folder.path().join("tree.bvh");
        // Without a name, so that the program cannot replace it.
        let mut errors = tempfile::tempfile().map_err(exchange)?;
        let box_bytes: Vec<u8> = boxes
            .iter()
            .flat_map(|aabb| [aabb.min.to_array(), aabb.max.to_array()])
            .flatten()
            // The checksum of a scene knows no −0.
            .flat_map(|x| (x + 0.0).to_le_bytes())
            .collect();
        fs::write(&boxes_path, box_bytes).map_err(exchange)?;
        let mut command = Command::new(&self.command[0]);
        command
            .args(&self.command[1..])
            .args([&boxes_path, &tree_path])
            .env("BVH_SEED", seed.to_string());
        // Standard error goes to a file: a full pipe that nobody reads would stop the program.
        let stderr = errors.try_clone().map_err(exchange)?;
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        let start = Instant::now();
        let mut program = Program::start(&mut command)
            .map_err(|error| format!("it cannot be started: {error}"))?;
        let status = loop {
            if let Some(status) = program.status().map_err(exchange)? {
                break status;
            }
            // The limit comes before the interruption, so that a slow program is named as such.
            let elapsed = start.elapsed();
            if let Some(limit) = self.timeout_seconds
                && elapsed.as_secs_f64() > limit
            {
                return Err(format!("it did not end within {limit} s"));
            }
            if cancelled() {
                return Err("it was interrupted".into());
            }
            // A fiftieth of the elapsed time bounds the error of the measured seconds.
            let pause = elapsed / 50;
            std::thread::sleep(pause.clamp(Duration::from_micros(200), Duration::from_millis(20)));
        };
        let seconds = start.elapsed().as_secs_f64();
        // No child of the program may write to the tree file while it is read.
        drop(program);
        if !status.success() {
            return Err(format!("{status}: {}", last_line(&mut errors).map_err(exchange)?));
        }
        let bytes = tree_file::read(&tree_path).map_err(|error| match error {
            TreeFileError::Read(error) if error.is_of_the_path() => {
                "it wrote no file at the path that is its last argument".into()
            }
            TreeFileError::Read(error) => exchange(error.source),
            TreeFileError::Invalid { source, .. } => invalid(&source),
        })?;
        let tree = file::load(&bytes, boxes).map_err(|error| invalid(&error))?;
        validate_references(&tree, boxes, objects).map_err(|error| invalid(&error))?;
        Ok(Built { tree, seconds })
    }
}

/// A running program. Dropping it kills the program and all processes of its process group, even if
/// the program itself has ended. A process that leaves the group escapes.
#[derive(Debug)]
struct Program(Child);

impl Program {
    /// Starts a program.
    fn start(command: &mut Command) -> io::Result<Self> {
        // A separate group can be killed as a whole, and Ctrl-C in the terminal does not reach it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        command.spawn().map(Self)
    }

    /// Returns the exit status if the program has ended.
    fn status(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The system reuses the number of a group only after its last member has ended.
        #[cfg(unix)]
        {
            use nix::{sys::signal, unistd::Pid};
            let group = Pid::from_raw(self.0.id().cast_signed());
            let _ = signal::killpg(group, signal::Signal::SIGKILL);
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A tree that is damaged or was built over other boxes.
fn invalid(error: &dyn std::error::Error) -> String {
    format!("its tree is invalid: {error}")
}

/// Returns the last line of a text file that is not blank.
fn last_line(file: &mut File) -> io::Result<String> {
    // The file may be long, so only its end is read.
    const MOST_BYTES: u64 = 2048;
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(length.saturating_sub(MOST_BYTES)))?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes)?;
    // The window may begin within a character.
    let text = String::from_utf8_lossy(&bytes);
    match text.lines().rfind(|line| !line.trim().is_empty()) {
        Some(line) => Ok(line.trim().to_owned()),
        None => Ok("it printed nothing on standard error".into()),
    }
}
