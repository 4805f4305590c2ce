//! The program `bvh`: parses the arguments, runs the command, and sets the exit code.

mod answer;
mod arguments;
mod bake;
mod bench;
mod error;
mod export;
mod inspect;
mod interrupt;
mod memory;
mod npy;
mod orient;
mod output;
mod rays;
mod render;
mod report;
mod scenes;
mod sky;
mod table;

use answer::Answer;
use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use error::Error;
use inspect::InspectArgs;
use output::{answered, print_bytes, print_error, succeeded};
use std::ffi::OsString;
use std::path::PathBuf;
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
    /// Print the results as JSON, with all digits.
    #[arg(long, global = true)]
    json: bool,
    /// Number of threads; the default is one per processor. It changes only times, and the results
    /// of budgets of time.
    #[arg(long, global = true, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

#[derive(Subcommand)]
enum Command {
    Bake(Box<bake::BakeArgs>),
    Bench(bench::BenchArgs),
    Inspect(InspectArgs),
    /// Prove that a tree file from any source contains a tree for a scene. Computes validity and
    /// costs again.
    Verify {
        /// The tree file.
        #[arg(value_name = "FILE.bvh")]
        file: PathBuf,
        /// The tree's scene, by name or path of a mesh file.
        scene: String,
    },
    Export(export::ExportArgs),
    Orient(orient::OrientArgs),
    Render(render::RenderArgs),
    Report(report::ReportArgs),
    Sky(Box<sky::SkyArgs>),
    /// List the built-in scenes and their sizes.
    Scenes,
    /// Print the file with which a shell completes arguments.
    Completions {
        shell: Shell,
    },
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse_from(joined(std::env::args_os())) {
        Ok(cli) => cli,
        Err(answer) => return answered(&answer),
    };
    // Signals are heard before any work begins.
    interrupt::listen();
    match run(cli) {
        Ok(()) => succeeded(),
        Err(error) => {
            print_error(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Joins `--heatmap 50`, whose number the parser would take for a scene, because it is optional.
fn joined(args: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    for arg in args {
        let is_number = arg.to_str().is_some_and(|arg| arg.parse::<u32>().is_ok());
        match joined.last_mut().filter(|last| is_number && *last == "--heatmap") {
            Some(last) => last.extend([OsString::from("="), arg]),
            None => joined.push(arg),
        }
    }
    joined
}

fn run(Cli { command, json, jobs }: Cli) -> Result<(), Error> {
    // By default rayon starts one thread per processor when it is first used.
    if let Some(jobs) = jobs {
        rayon::ThreadPoolBuilder::new()
            .num_threads(jobs.into())
            .build_global()
            .map_err(|error| Error::Usage(format!("--jobs {jobs}: {error}")))?;
    }
    let mut answer = Answer::new(json);
    let done = answered_by(command, &mut answer);
    match &done {
        Ok(()) => answer.end(),
        Err(Error::Interrupted(left)) => {
            answer.record("interrupted", left.as_str());
            answer.end();
        }
        Err(_) => {}
    }
    done
}

fn answered_by(command: Command, answer: &mut Answer) -> Result<(), Error> {
    match command {
        Command::Bake(args) => match args.parts {
            Some(count) => bake::parts::bake(&args, count, answer)?,
            None => bake::bake(&args, answer)?,
        },
        Command::Bench(args) => bench::bench(&args, answer)?,
        Command::Inspect(args) => inspect::inspect(&args, answer)?,
        Command::Verify { file, scene } => {
            let args = InspectArgs { file, scene: Some(scene), rays: None, nodes: None };
            inspect::inspect(&args, answer)?;
        }
        Command::Export(args) => export::export(&args, answer)?,
        Command::Orient(args) => orient::orient(&args, answer)?,
        Command::Render(args) => render::render(&args, answer)?,
        Command::Report(args) => report::report(&args, answer)?,
        Command::Sky(args) => sky::sky(&args, answer)?,
        Command::Scenes => scenes::scenes(answer)?,
        Command::Completions { .. } if answer.is_json() => {
            return Err(Error::Usage("--json: completions are a script; accepted: none".into()));
        }
        Command::Completions { shell } => {
            let mut file = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "bvh", &mut file);
            print_bytes(&file);
        }
    }
    Ok(())
}
