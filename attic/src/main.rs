//! The harness with other libraries as methods.

fn main() -> std::process::ExitCode {
    harness::peers::bring(attic::LIBRARIES, &attic::RayPrograms);
    harness::cli::program::main()
}
