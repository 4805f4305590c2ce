//! The command line: reads arguments, calls the library, prints what it returns, sets the exit code.

use clap::{Args, Parser, Subcommand};
use harness::cli::arguments::{input_file, input_folder, output_file, output_folder};
use harness::cli::bake::{BakeArgs, bake};
use harness::cli::inspect::{InspectArgs, inspect};
use harness::render::command as render;
use harness::run::execute::Extent;
use harness::run::merge::{self, Shard};
use harness::scenes::standin::STAND_INS;
use harness::scenes::{FETCHED, SPHERES, Scene, fetched_path};
use harness::spec::{Experiment, Overrides};
use harness::stress::child;
use harness::{Error, cli::explain, report::page, run::check, run::execute, run::reference};
use std::fmt::Arguments;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
#[derive(Parser)]
#[command(name = "harness", version, args_conflicts_with_subcommands = true, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Subcommand)]
enum Command {
    /// List the built-in scenes, their sizes, and what each stands in for.
    Scenes,
    /// Write all results on one HTML page.
    Report {
        /// Folder with the results of experiments.
        #[arg(long, value_name = "DIR", default_value = "results")]
        results: PathBuf,
        /// The page.
        #[arg(long, value_name = "FILE.html", default_value = "results/report.html")]
        out: PathBuf,
    },
    /// Join the parts of experiments made with --shard into what one run would have written.
    Merge {
        /// Folders that were given as --out to runs with --shard.
        #[arg(value_name = "DIR", required = true)]
        folders: Vec<PathBuf>,
        /// Folder for the results.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Draw a scene: a small Whitted ray tracer, the same picture with any structure.
    Render(render::Args),
    /// One case of the suite, in a process of its own.
    #[command(name = child::COMMAND, hide = true)]
    SuiteChild {
        subject: String,
        case: String,
        objects: usize,
    },
    Bake(BakeArgs),
    Inspect(InspectArgs),
}

#[derive(Args)]
struct RunArgs {
    /// Experiment specs, run one after the other.
    #[arg(value_name = "SPEC.toml", required = true)]
    specs: Vec<PathBuf>,
    /// Folder for the results; each experiment has one of its own in it.
    #[arg(long, value_name = "DIR", default_value = "results")]
    out: PathBuf,
    /// Scene to run on in place of the spec's, by name or path of an OBJ file; may be repeated.
    #[arg(long = "scene", value_name = "NAME|PATH")]
    scenes: Vec<String>,
    /// Number of threads; as many as processors if not given. Changes no result but the times.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Seed in place of the spec's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Run the spec's smaller variant, into a folder of its own.
    #[arg(long)]
    quick: bool,
    /// Compare with the committed results instead of writing any; exit code 1 on a difference.
    #[arg(long, conflicts_with = "resume")]
    check: bool,
    /// Make the tables and figures again from the rows there are, with the best known costs of now; run nothing.
    #[arg(long, conflicts_with_all = ["check", "resume", "shard"])]
    redraw: bool,
    /// Keep the finished runs of an interrupted experiment and do the rest.
    #[arg(long)]
    resume: bool,
    /// Do only the I-th of N parts of the runs, from 1, and leave them for `harness merge`. Every part needs an --out
    /// of its own.
    #[arg(long, value_name = "I/N", conflicts_with = "check")]
    shard: Option<Shard>,
    /// Say first what each scene does not need and is left out, and why.
    #[arg(long)]
    explain: bool,
}

/// Set by Ctrl-C. A second one ends the program at once; finished runs are kept either way.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    let cli = Cli::parse();
    let handler = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Relaxed) {
            std::process::exit(130);
        }
    });
    if let Err(error) = handler {
        complain(format_args!("warning: Ctrl-C will end the program at once: {error}"));
    }
    let result = check_paths(&cli).and_then(|()| match cli.command {
        Some(Command::Scenes) => list_scenes(),
        Some(Command::Report { results, out }) => write_page(&results, &out),
        Some(Command::Merge { folders, out }) => merge(&folders, &out),
        Some(Command::Render(args)) => draw(&args),
        Some(Command::SuiteChild { subject, case, objects }) => child::main(&subject, &case, objects)
            .map(|answer| say(format_args!("{answer}")))
            .map_err(Error::Usage),
        Some(Command::Bake(args)) => use_threads(args.jobs).and_then(|()| explain_and_bake(&args)),
        Some(Command::Inspect(args)) => inspect(&args).map(print),
        None => run(&cli.run),
    });
    match result {
        Ok(()) if UNHEARD.load(Relaxed) => {
            complain(format_args!("error: not all that was to be said could be written to standard output"));
            ExitCode::FAILURE
        }
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(format_args!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Refuses paths of the wrong kind before any work.
fn check_paths(cli: &Cli) -> Result<(), Error> {
    match &cli.command {
        None => output_folder("--out", &cli.run.out),
        Some(Command::Report { results, out }) => {
            output_file("--out", out)?;
            input_folder("--results", results)
        }
        Some(Command::Merge { out, .. }) => output_folder("--out", out),
        Some(Command::Render(args)) => {
            if args.accel.ends_with(".bvh") {
                input_file("--accel", Path::new(&args.accel))?;
            }
            output_file("--out", &args.out)
        }
        Some(Command::Bake(args)) => {
            args.from.as_deref().map_or(Ok(()), |from| input_file("--from", from))?;
            output_file("--out", &args.out)
        }
        Some(Command::Inspect(args)) => {
            args.nodes.as_deref().map_or(Ok(()), |nodes| output_file("--nodes", nodes))
        }
        Some(Command::Scenes | Command::SuiteChild { .. }) => Ok(()),
    }
}

/// Set when something could not be said.
static UNHEARD: AtomicBool = AtomicBool::new(false);

/// Prints a line. A reader that has gone, as `head` does, is no error: the results are in files.
fn say(line: Arguments) {
    let mut out = std::io::stdout();
    if let Err(error) = writeln!(out, "{line}").and_then(|()| out.flush())
        && error.kind() != std::io::ErrorKind::BrokenPipe
    {
        UNHEARD.store(true, Relaxed);
    }
}

/// Prints a line to standard error.
fn complain(line: Arguments) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Prints a text that may be several lines.
fn print(text: String) {
    say(format_args!("{}", text.trim_end()));
}

/// Makes all threads of this program that many.
fn use_threads(jobs: Option<u16>) -> Result<(), Error> {
    let Some(jobs) = jobs else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(jobs.into())
        .build_global()
        .map_err(|error| Error::Usage(format!("--jobs {jobs}: {error}")))
}

fn explain_and_bake(args: &BakeArgs) -> Result<(), Error> {
    if args.explain {
        print(explain::scene(&Scene::load(&args.scene)?)?);
    }
    bake(args, &INTERRUPTED).map(print)
}

fn run(args: &RunArgs) -> Result<(), Error> {
    use_threads(args.jobs)?;
    let overrides = Overrides { scenes: args.scenes.clone(), seed: args.seed, quick: args.quick };
    // All specs are checked before the first one is run.
    let experiments =
        args.specs.iter().map(|path| Experiment::read(path, &overrides)).collect::<Result<Vec<_>, _>>()?;
    let extent = Extent { resume: args.resume, shard: args.shard };
    let mut differences = 0;
    for experiment in &experiments {
        if args.explain {
            print(explain::experiment(experiment)?);
        }
        if args.check {
            differences += check(args, experiment)?;
        } else {
            let summary = if args.redraw {
                execute::report_again(experiment, &args.out)?
            } else {
                execute::execute(experiment, &args.out, extent, &INTERRUPTED)?
            };
            say(format_args!("{}", experiment.question));
            for name in &summary.left_out {
                say(format_args!("(without {name}: scripts/fetch-scenes brings it)"));
            }
            say(format_args!("\n{}Results: {}", summary.text, args.out.join(&experiment.name).display()));
        }
    }
    if differences > 0 { Err(Error::Differs { differences }) } else { Ok(()) }
}

/// Runs into a folder that is removed again. Returns the number of differences.
fn check(args: &RunArgs, experiment: &Experiment) -> Result<usize, Error> {
    let temporary = tempfile::tempdir().map_err(Error::io(&std::env::temp_dir(), "create a folder"))?;
    let (fresh, committed) = (temporary.path().join(&experiment.name), args.out.join(&experiment.name));
    reference::adopt(&committed, temporary.path())?;
    let summary = execute::execute(experiment, temporary.path(), Extent::default(), &INTERRUPTED)?;
    let found = check::compare(&fresh, &committed, &summary.left_out)?;
    for name in &summary.left_out {
        say(format_args!("{}: scene {name} is not fetched; its rows are not compared", experiment.name));
    }
    for difference in &found {
        say(format_args!("{}: {difference}", experiment.name));
    }
    if found.is_empty() {
        say(format_args!("{}: as committed", experiment.name));
    }
    Ok(found.len())
}

fn write_page(results: &Path, out: &Path) -> Result<(), Error> {
    let experiments = page::write(results, out)?;
    say(format_args!("{experiments} experiments: {}", out.display()));
    Ok(())
}

fn merge(folders: &[PathBuf], out: &Path) -> Result<(), Error> {
    for (name, text) in merge::merge(folders, out)? {
        say(format_args!("{text}Results: {}", out.join(name).display()));
    }
    Ok(())
}

fn draw(args: &render::Args) -> Result<(), Error> {
    use_threads(args.jobs)?;
    say(format_args!("{}", render::run(args, &INTERRUPTED)?));
    Ok(())
}

fn list_scenes() -> Result<(), Error> {
    let mut table = comfy_table::Table::new();
    table.load_preset(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["name", "objects", "kind", "what it is"]);
    for scene in STAND_INS {
        let kind = format!("stand-in for {}", scene.original);
        table.add_row([scene.name, &scene.triangle_count.to_string(), &kind, scene.character]);
    }
    for (name, count) in SPHERES {
        table.add_row([name, &count.to_string(), "procedural", "Spheres, as in the second source document."]);
    }
    for (name, package) in FETCHED {
        let objects = match fetched_path(name) {
            Some(_) => Scene::load(name)?.boxes.len().to_string(),
            None => "not fetched".into(),
        };
        table.add_row([
            name,
            &objects,
            "file",
            &format!("From the Rust package {package}, by scripts/fetch-scenes."),
        ]);
    }
    say(format_args!("{table}\nAny OBJ file can be named by its path."));
    Ok(())
}
