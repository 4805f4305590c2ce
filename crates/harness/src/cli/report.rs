//! `harness report`: all results on one page.

use crate::Error;
use crate::cli::arguments::{PAGE, input_folder, output_file};
use crate::cli::output::print_line;
use crate::page;
use std::path::PathBuf;

/// Write all results on one HTML page.
#[derive(clap::Args, Clone, Debug)]
pub struct ReportArgs {
    /// Folder with the results of experiments.
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub results: PathBuf,
    /// The page.
    #[arg(long, value_name = "FILE.html", default_value = "results/report.html")]
    pub out: PathBuf,
}

/// Writes the page, and prints how many experiments are on it.
pub fn report(args: &ReportArgs) -> Result<(), Error> {
    output_file("--out", &args.out, &PAGE)?;
    input_folder("--results", &args.results)?;
    let experiments = page::write(&args.results, &args.out)?;
    print_line(&format!("{experiments} experiments: {}", args.out.display()));
    Ok(())
}
