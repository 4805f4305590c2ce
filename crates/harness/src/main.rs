//! The command line: parses the arguments, dispatches to a command, and sets the exit code.

use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use harness::cli::interrupt::{self, INTERRUPTED};
use harness::cli::output::{STDOUT_FAILED, print_bytes, print_error, print_line};
use harness::cli::{bake, bake_instances, commands, inspect, merge, new, render, report, run, scenes};
use harness::{Error, stress::child};
use std::path::Path;
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
    Verify(inspect::VerifyArgs),
    New(new::NewArgs),
    /// Print the JSON schema of specs, by which editors complete and check them.
    Schema,
    /// Print the file by which a shell completes arguments.
    Completions {
        shell: Shell,
    },
    /// Print the manual page, for `man -l -`.
    Man,
    /// One case of the suite, in a process of its own.
    #[command(name = child::COMMAND, hide = true)]
    SuiteChild {
        subject: String,
        case: String,
        objects: usize,
    },
}

fn main() -> ExitCode {
    if let Some(message) = commands::mistyped(std::env::args_os().nth(1).as_deref(), &Cli::command()) {
        print_error(&format!("error: {message}"));
        return ExitCode::from(2);
    }
    let cli = Cli::parse();
    interrupt::listen();
    let result = match cli.command {
        None => run::run(&cli.run, &INTERRUPTED),
        Some(Command::Scenes) => scenes::scenes(),
        Some(Command::Report(args)) => report::report(&args),
        Some(Command::Merge(args)) => merge::merge(&args),
        Some(Command::Render(args)) => render::render(&args, &INTERRUPTED),
        Some(Command::Bake(args)) if args.instances => bake_instances::bake(&args, &INTERRUPTED),
        Some(Command::Bake(args)) => bake::bake(&args, &INTERRUPTED),
        Some(Command::Inspect(args)) => inspect::inspect(&args),
        Some(Command::Verify(args)) => inspect::verify(&args),
        Some(Command::New(args)) => new::new(&args),
        Some(Command::Schema) => {
            new::schema();
            Ok(())
        }
        Some(Command::Completions { shell }) => {
            print_bytes(&commands::completions(shell, &mut Cli::command()));
            Ok(())
        }
        Some(Command::Man) => commands::manual(Cli::command())
            .map(|page| print_bytes(&page))
            .map_err(Error::io(Path::new("the manual page"), "write")),
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
