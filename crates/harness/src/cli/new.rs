//! `harness new` and `harness schema`: a spec to begin with, and the schema that editors complete
//! it by.

use super::terminal::print_line;
use crate::{Error, spec};
use clap::Args;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;

/// Write a commented spec to begin with.
#[derive(Args, Clone, Debug)]
pub struct NewArgs {
    /// The file to write; an existing file is never replaced.
    #[arg(value_name = "NAME.toml")]
    pub file: PathBuf,
}

/// The spec to begin with.
const TEMPLATE: &str = include_str!("new.toml");

/// Writes the spec unless the file exists.
pub fn new(args: &NewArgs) -> Result<(), Error> {
    let file = &args.file;
    if file.extension().is_none_or(|extension| extension != "toml") {
        return Err(Error::Usage(format!(
            "{}: accepted: a name that ends with .toml",
            file.display()
        )));
    }
    // A check before the write could miss a file that appears in between.
    let mut new = File::create_new(file).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => Error::Usage(format!("{} exists already", file.display())),
        _ => Error::io(file, "write the file")(error),
    })?;
    new.write_all(TEMPLATE.as_bytes()).map_err(Error::io(file, "write the file"))?;
    print_line(&format!("{0} is written; `harness {0} --quick` runs it small", file.display()));
    Ok(())
}

/// Prints the JSON schema of specs.
pub fn schema() {
    print_line(&format!("{:#}", spec::schema()));
}
