//! A program of others at work, and the end of all that it has started.

use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus};

/// A program, ended with all that it has started as soon as this is dropped, also if it has ended by itself.
///
/// What it starts is in its process group. On Linux what has left that group is found by the variable [`MARK`] of its environment; nothing
/// is known of a process that leaves the group and clears its environment.
#[derive(Debug)]
pub struct Program {
    child: Child,
    #[cfg(target_os = "linux")]
    mark: Vec<u8>,
}

/// The environment variable with the folder that program and harness share, by which its processes are told from all others.
const MARK: &str = "BVH_FOLDER";

impl Program {
    /// Starts a program; `folder` is one that no other program is given.
    pub fn start(command: &mut Command, folder: &Path) -> io::Result<Self> {
        command.env(MARK, folder);
        // In a group of its own, so that what it starts can be ended with it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let child = command.spawn()?;
        Ok(Self {
            child,
            #[cfg(target_os = "linux")]
            mark: [MARK.as_bytes(), b"=", folder.as_os_str().as_encoded_bytes()].concat(),
        })
    }

    /// How it has ended, if it has.
    pub fn status(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The system gives the number of a group to nobody else while anything is in it.
        #[cfg(unix)]
        {
            use nix::{sys::signal, unistd::Pid};
            let group = Pid::from_raw(self.child.id().cast_signed());
            let _ = signal::killpg(group, signal::Signal::SIGKILL);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
        #[cfg(target_os = "linux")]
        marked::end(&self.mark);
    }
}

/// Processes by a variable of their environment, which all that they start inherits.
#[cfg(target_os = "linux")]
mod marked {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;
    use std::fs;
    use std::thread::sleep;
    use std::time::Duration;

    /// How often processes are looked for, because they take a moment to end, and may start others in it.
    const ROUNDS: usize = 200;

    /// Kills all processes of which `variable` is in the environment.
    pub fn end(variable: &[u8]) {
        for _ in 0..ROUNDS {
            let found = processes(variable);
            if found.is_empty() {
                return;
            }
            for process in found {
                let _ = kill(process, Signal::SIGKILL);
            }
            sleep(Duration::from_millis(1));
        }
    }

    fn processes(variable: &[u8]) -> Vec<Pid> {
        let entries = fs::read_dir("/proc")
            .into_iter()
            .flatten()
            .flatten();
        let process = |entry: fs::DirEntry| {
            let number = entry.file_name().to_str()?.parse().ok()?;
            // Those of other users cannot be read.
            let environment = fs::read(entry.path().join("environ")).ok()?;
            let is_marked = environment
                .split(|&byte| byte == 0)
                .any(|found| found == variable);
            is_marked.then(|| Pid::from_raw(number))
        };
        entries.filter_map(process).collect()
    }
}
