//! A running external program, which ends together with all processes that it has started.

use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus};

/// A running program. Dropping it kills the program and all processes that it has started, even if
/// the program itself has ended.
///
/// The processes are members of its process group. On Linux, processes that left the group are
/// found by the variable [`MARK`] in their environment. A process that leaves the group and clears
/// its environment escapes.
#[derive(Debug)]
pub struct Program {
    child: Child,
    #[cfg(target_os = "linux")]
    mark: Vec<u8>,
}

/// The environment variable that identifies the program's processes; its value is the folder that
/// program and harness share.
const MARK: &str = "BVH_FOLDER";

impl Program {
    /// Starts a program. No other program may get the same `folder`.
    pub fn start(command: &mut Command, folder: &Path) -> io::Result<Self> {
        command.env(MARK, folder);
        // A separate group can be killed as a whole, and Ctrl-C in the terminal does not reach it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let child = command.spawn()?;
        Ok(Self {
            child,
            #[cfg(target_os = "linux")]
            mark: [MARK.as_bytes(), b"=", folder.as_os_str().as_encoded_bytes()].concat(),
        })
    }

    /// Returns the exit status if the program has ended.
    pub fn status(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The system reuses the number of a group only after its last member has ended.
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

/// Finds processes by a variable of their environment, which child processes inherit.
#[cfg(target_os = "linux")]
mod marked {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;
    use std::fs;
    use std::thread::sleep;
    use std::time::Duration;

    /// The maximum number of searches. A process needs a moment to end, in which it may start
    /// others.
    const ROUNDS: usize = 200;

    /// Kills all processes that have `variable` in their environment.
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
        let Ok(entries) = fs::read_dir("/proc") else { return vec![] };
        entries.flatten().filter_map(|entry| marked_process(&entry, variable)).collect()
    }

    fn marked_process(entry: &fs::DirEntry, variable: &[u8]) -> Option<Pid> {
        let number = entry.file_name().to_str()?.parse().ok()?;
        // The environments of other users' processes cannot be read.
        let environment = fs::read(entry.path().join("environ")).ok()?;
        let mut variables = environment.split(|&byte| byte == 0);
        variables.any(|found| found == variable).then(|| Pid::from_raw(number))
    }
}
