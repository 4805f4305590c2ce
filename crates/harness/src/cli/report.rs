//! `harness report`: all results on one page.

use crate::Error;
use crate::page;
use bvh_terminal::arguments::{FileKind, input_folder, output_file};
use bvh_terminal::output::print_line;
use std::path::PathBuf;

/// The kind of file that holds the page.
const PAGE: FileKind =
    FileKind { name: "an HTML page", beginning: b"<!DOCTYPE html>", extension: "html" };

/// Write all results on one HTML page.
#[derive(clap::Args, Clone, Debug)]
pub struct ReportArgs {
    /// Folder with the results of experiments.
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub results: PathBuf,
    /// The page to write.
    #[arg(long, value_name = "FILE.html", default_value = "results/report.html")]
    pub out: PathBuf,
}

/// Writes the page and prints the number of experiments on it.
pub fn report(args: &ReportArgs) -> Result<(), Error> {
    input_folder("--results", &args.results)?;
    output_file("--out", &args.out, &PAGE)?;
    let experiments = page::write(&args.results, &args.out)?;
    print_line(&format!("{experiments} experiments: {}", args.out.display()));
    Ok(())
}
