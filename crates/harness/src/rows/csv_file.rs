//! CSV files as rows of a type, whose fields are the columns.

use crate::Error;
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// A kind of rows with a separate file.
pub trait Row: Serialize + DeserializeOwned {
    /// The CSV file that holds them; its name begins with `timing` if they hold seconds.
    const FILE: &'static str;
}

/// Reads all rows of a CSV file.
pub fn read<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, Error> {
    parse(&bvh_scenes::files::read(path)?, path)
}

/// Reads all rows of the bytes of a CSV file.
pub fn parse<R: DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<Vec<R>, Error> {
    let mut reader = csv::Reader::from_reader(bytes);
    reader.deserialize().collect::<Result<_, _>>().map_err(Error::csv(path))
}

/// Reads all rows of a kind from an experiment's folder; none if no run left any.
pub fn read_if_any<R: Row>(folder: &Path) -> Result<Vec<R>, Error> {
    let path = folder.join(R::FILE);
    if path.is_file() { read(&path) } else { Ok(vec![]) }
}

/// Returns the bytes of a CSV file with these rows. Without rows there is no header either.
pub fn to_bytes<R: Serialize>(rows: &[R], path: &Path) -> Result<Vec<u8>, Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(Error::csv(path))?;
    }
    bytes_of(writer, path)
}

/// Returns what has been written for the file `path`.
pub fn bytes_of(writer: csv::Writer<Vec<u8>>, path: &Path) -> Result<Vec<u8>, Error> {
    writer.into_inner().map_err(|error| Error::Io {
        path: path.to_owned(),
        action: "write",
        source: std::io::Error::other(error.to_string()),
    })
}
