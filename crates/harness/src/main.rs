//! The program, without third-party libraries.

fn main() -> std::process::ExitCode {
    harness::cli::program::main()
}
