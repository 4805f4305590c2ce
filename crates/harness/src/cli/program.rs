//! The program: parses the arguments, dispatches to a command, and sets the exit code.

use super::terminal::{self, INTERRUPTED, print_error};
use super::{compare, jobs, merge, new, report, run};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
#[derive(Parser)]
#[command(
    name = "harness",
    version,
    args_conflicts_with_subcommands = true,
    arg_required_else_help = true
)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunArgs,
}

#[derive(Subcommand)]
enum Command {
    Report(report::ReportArgs),
    Jobs(jobs::JobsArgs),
    Merge(merge::MergeArgs),
    Compare(compare::CompareArgs),
    New(new::NewArgs),
    /// Print the JSON schema of specs, which lets editors complete and check them.
    Schema,
}

/// Runs the program with the arguments of this process.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    terminal::listen();
    let result = match cli.command {
        None => run::run(&cli.run, &INTERRUPTED),
        Some(Command::Report(args)) => report::report(&args),
        Some(Command::Jobs(args)) => jobs::jobs(&args),
        Some(Command::Merge(args)) => merge::merge(&args, &INTERRUPTED),
        Some(Command::Compare(args)) => compare::compare(&args),
        Some(Command::New(args)) => new::new(&args),
        Some(Command::Schema) => {
            new::schema();
            Ok(())
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_error(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}
