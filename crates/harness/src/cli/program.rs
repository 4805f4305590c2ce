//! The program: parses the arguments, dispatches to a command, and sets the exit code.

use super::terminal::{self, INTERRUPTED, print_error};
use super::{jobs, merge, run};
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
    Jobs(jobs::JobsArgs),
    Merge(merge::MergeArgs),
}

/// Runs the program with the arguments of this process.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    terminal::listen();
    let result = match cli.command {
        None => run::run(&cli.run, &INTERRUPTED),
        Some(Command::Jobs(args)) => jobs::jobs(&args),
        Some(Command::Merge(args)) => merge::merge(&args, &INTERRUPTED),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_error(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}
