//! The harness with other libraries as methods, and a lower bound.

fn main() -> std::process::ExitCode {
    harness::peers::bring(attic::OTHERS);
    harness::cli::program::main()
}
