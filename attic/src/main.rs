//! The harness with other libraries as methods, and the times of rays.

fn main() -> std::process::ExitCode {
    harness::peers::bring(attic::OTHERS);
    harness::cli::program::main()
}
