//! `harness report`: all results on one page.

use super::terminal::{input_folder, print_line};
use crate::Error;
use crate::page;
use std::path::PathBuf;

/// Write all results on one HTML page, `report.html` in their folder.
#[derive(clap::Args, Clone, Debug)]
pub struct ReportArgs {
    /// Folder with the results of experiments.
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub results: PathBuf,
}

/// Writes the page and prints the number of experiments on it.
pub fn report(args: &ReportArgs) -> Result<(), Error> {
    input_folder("--results", &args.results)?;
    let (experiments, page) = page::write(&args.results)?;
    print_line(&format!("{experiments} experiments: {}", page.display()));
    Ok(())
}
