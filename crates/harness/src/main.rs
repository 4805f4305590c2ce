//! The command line: parses the arguments, dispatches to a command, and sets the exit code.

use clap::{Parser, Subcommand};
use harness::cli::interrupt::{self, INTERRUPTED};
use harness::cli::output::{STDOUT_FAILED, print_error, print_line};
use harness::cli::{bake, inspect, merge, render, report, run, scenes};
use harness::{Error, stress::child};
use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;

/// Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
#[derive(Parser)]
#[command(name = "harness", version, args_conflicts_with_subcommands = true, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunArgs,
}

#[derive(Subcommand)]
enum Command {
    /// List the built-in scenes, their sizes, and what each stands in for.
    Scenes,
    Report(report::ReportArgs),
    Merge(merge::MergeArgs),
    Render(render::RenderArgs),
    Bake(bake::BakeArgs),
    Inspect(inspect::InspectArgs),
    /// One case of the suite, in a process of its own.
    #[command(name = child::COMMAND, hide = true)]
    SuiteChild {
        subject: String,
        case: String,
        objects: usize,
    },
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    interrupt::listen();
    let result = match cli.command {
        None => run::run(&cli.run, &INTERRUPTED),
        Some(Command::Scenes) => scenes::scenes(),
        Some(Command::Report(args)) => report::report(&args),
        Some(Command::Merge(args)) => merge::merge(&args),
        Some(Command::Render(args)) => render::render(&args, &INTERRUPTED),
        Some(Command::Bake(args)) => bake::bake(&args, &INTERRUPTED),
        Some(Command::Inspect(args)) => inspect::inspect(&args),
        Some(Command::SuiteChild { subject, case, objects }) => {
            child::main(&subject, &case, objects).map(|answer| print_line(&answer)).map_err(Error::Usage)
        }
    };
    match result {
        Ok(()) if STDOUT_FAILED.load(Relaxed) => {
            print_error("error: some of the output could not be written to standard output");
            ExitCode::FAILURE
        }
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_error(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}
