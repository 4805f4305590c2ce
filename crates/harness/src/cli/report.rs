//! `harness report`: all results on one page.

use super::terminal::{input_folder, print_line};
use crate::Error;
use crate::page;
use std::path::PathBuf;

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
    if args.out.extension().is_none_or(|extension| extension != "html") || args.out.is_dir() {
        let found = args.out.display();
        let message = format!("--out: {found}; accepted: a file whose name ends with .html");
        return Err(Error::Usage(message));
    }
    let experiments = page::write(&args.results, &args.out)?;
    print_line(&format!("{experiments} experiments: {}", args.out.display()));
    Ok(())
}
