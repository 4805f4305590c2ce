//! A running external program, which ends together with the processes that it has started.

use std::io;
use std::process::{Child, Command, ExitStatus};

/// A running program. Dropping it kills the program and all processes of its process group, even if
/// the program itself has ended. A process that leaves the group escapes.
#[derive(Debug)]
pub struct Program(Child);

impl Program {
    /// Starts a program.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        // A separate group can be killed as a whole, and Ctrl-C in the terminal does not reach it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        command.spawn().map(Self)
    }

    /// Returns the exit status if the program has ended.
    pub fn status(&mut self) -> io::Result<Option<ExitStatus>> {
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
