//! Writes the rows that a benchmark has measured, and keeps the rows of other scenes and processors.

use harness::rows::{Row, read_if_any, to_bytes};
use std::fs;
use std::path::Path;

/// Replaces the rows in `folder` whose key a measured row has. The file is sorted by the key, which
/// has the processor and the scene.
pub fn replace<R: Row, K: Ord>(folder: &str, measured: Vec<R>, key: fn(&R) -> K) {
    let folder = Path::new(folder);
    fs::create_dir_all(folder).expect("a folder for results");
    let mut rows: Vec<R> = read_if_any(folder).expect("rows");
    rows.retain(|row| measured.iter().all(|new| key(new) != key(row)));
    rows.extend(measured);
    rows.sort_by_key(key);
    let path = folder.join(R::FILE);
    fs::write(&path, to_bytes(&rows, &path).expect("rows")).expect("a file");
}
