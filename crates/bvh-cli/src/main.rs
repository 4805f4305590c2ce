//! The program `bvh`: parses the arguments, runs the command, and sets the exit code.

mod answer;
mod arguments;
mod bake;
mod error;
mod export;
mod inspect;
mod interrupt;
mod memory;
mod npy;
mod output;
mod rays;
mod render;
mod report;
mod scenes;

use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use error::Error;
use interrupt::INTERRUPTED;
use output::{answered, print_bytes, print_error, succeeded};
use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: memory::HugePages = memory::HugePages;

/// Bounding volume hierarchies by stochastic search: bake the best tree within a budget, inspect
/// it, and export it.
#[derive(Parser)]
#[command(name = "bvh", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Bake(Box<bake::BakeArgs>),
    Inspect(inspect::InspectArgs),
    Verify(inspect::VerifyArgs),
    Export(export::ExportArgs),
    Render(render::RenderArgs),
    Report(report::ReportArgs),
    Scenes(scenes::ScenesArgs),
    /// Print the file with which a shell completes arguments.
    Completions {
        shell: Shell,
    },
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(answer) => return answered(&answer),
    };
    // Signals are heard before any work begins.
    interrupt::listen();
    match run(cli.command) {
        Ok(()) => succeeded(),
        Err(error) => {
            print_error(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(command: Command) -> Result<(), Error> {
    match command {
        Command::Bake(args) if args.instances => bake::instances::bake(&args, &INTERRUPTED),
        Command::Bake(args) => match args.parts {
            Some(count) => bake::parts::bake(&args, count, &INTERRUPTED),
            None => bake::bake(&args, &INTERRUPTED),
        },
        Command::Inspect(args) => inspect::inspect(&args),
        Command::Verify(args) => inspect::verify(&args),
        Command::Export(args) => export::export(&args),
        Command::Render(args) => render::render(&args),
        Command::Report(args) => report::report(&args),
        Command::Scenes(args) => scenes::scenes(&args),
        Command::Completions { shell } => {
            let mut file = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "bvh", &mut file);
            print_bytes(&file);
            Ok(())
        }
    }
}
