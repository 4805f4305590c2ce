//! The buffers of a glTF file. A buffer is read when a mesh first needs it, and a file once.

use super::document::{Buffer, Document};
use super::{MOST_BYTES, get};
use crate::files::{read, regular};
use data_url::DataUrl;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// The binary chunk of a GLB file, or what was read. Several buffers may name the same file.
type Bytes<'a> = Rc<Cow<'a, [u8]>>;

/// The buffers of one glTF file.
pub struct Buffers<'a> {
    path: &'a Path,
    /// The binary chunk of a GLB file.
    chunk: Option<&'a [u8]>,
    /// The buffers that a mesh has needed, by their number.
    needed: BTreeMap<usize, Bytes<'a>>,
    /// The files that buffers have named, by their canonical path.
    files: BTreeMap<PathBuf, Bytes<'a>>,
    /// Bytes read so far.
    total: u64,
}

impl<'a> Buffers<'a> {
    /// Prepares the buffers of the file at `path` without reading any.
    pub fn new(path: &'a Path, chunk: Option<&'a [u8]>) -> Self {
        Self { path, chunk, needed: BTreeMap::new(), files: BTreeMap::new(), total: 0 }
    }

    /// Returns the bytes of a buffer, which is read if no mesh has needed it before.
    pub fn bytes(&mut self, document: &Document, number: usize) -> Result<&[u8], String> {
        if !self.needed.contains_key(&number) {
            let buffer = get(&document.buffers, number, "buffers")?;
            let read = self.read(number, buffer);
            let bytes = read.map_err(|message| format!("buffers[{number}]: {message}"))?;
            self.needed.insert(number, bytes);
        }
        Ok(&self.needed[&number])
    }

    fn read(&mut self, number: usize, buffer: &Buffer) -> Result<Bytes<'a>, String> {
        let bytes = match (&buffer.uri, self.chunk) {
            (Some(uri), _) => self.of_uri(uri)?,
            (None, Some(chunk)) if number == 0 => Rc::new(chunk.into()),
            (None, _) => {
                return Err("no URI; expected one, or the binary chunk of a GLB file, which is \
                            buffers[0]"
                    .into());
            }
        };
        match buffer.byte_length > bytes.len() {
            true => Err(format!("{} bytes; expected {}", bytes.len(), buffer.byte_length)),
            false => Ok(bytes),
        }
    }

    fn of_uri(&mut self, uri: &str) -> Result<Bytes<'a>, String> {
        if let Ok(data) = DataUrl::process(uri) {
            let (bytes, _) = data.decode_to_vec().map_err(|_| "a data URI of invalid base64")?;
            self.count(bytes.len() as u64)?;
            return Ok(Rc::new(bytes.into()));
        }
        if uri.contains("://") {
            return Err(format!("`{uri}`; expected a file in this folder, or a data URI"));
        }
        let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
        let path = self.allowed(Path::new(&*name))?;
        if let Some(bytes) = self.files.get(&path) {
            return Ok(bytes.clone());
        }
        // A file that is too long is rejected before it takes memory.
        self.count(regular(&path).map_err(|error| error.to_string())?)?;
        let bytes = Rc::new(read(&path).map_err(|error| error.to_string())?.into());
        self.files.insert(path, Rc::clone(&bytes));
        Ok(bytes)
    }

    /// Returns the path of a file by its name in a URI. Rejects a file outside the folder of the
    /// glTF file, also one behind a symbolic link, because otherwise the author of a file decides
    /// which files of the user are opened.
    fn allowed(&self, name: &Path) -> Result<PathBuf, String> {
        let path = self.path.with_file_name(name);
        if leaves(name) {
            return Err(outside_message(name));
        }
        // A missing file has no canonical path; the reader then reports that the file is missing.
        let Ok(path) = fs::canonicalize(&path) else { return Ok(path) };
        // A file name without a folder has the empty parent, which cannot be canonicalised.
        let folder = Path::new(".").join(self.path.parent().unwrap_or(Path::new("")));
        // Canonical paths follow symbolic links, which the name alone does not reveal.
        let is_below = fs::canonicalize(folder).is_ok_and(|folder| path.starts_with(folder));
        if !is_below {
            return Err(outside_message(name));
        }
        Ok(path)
    }

    /// Adds to the bytes read so far, and rejects more than a scene can use.
    fn count(&mut self, bytes: u64) -> Result<(), String> {
        self.total = self.total.saturating_add(bytes);
        match self.total > MOST_BYTES {
            true => Err(format!(
                "{} bytes with those before it; expected at most {MOST_BYTES}",
                self.total
            )),
            false => Ok(()),
        }
    }
}

fn outside_message(name: &Path) -> String {
    format!(
        "`{}` is outside the scene's folder; accepted: a file in this folder or below",
        name.display()
    )
}

/// Returns whether a path leads out of its folder or is absolute.
fn leaves(name: &Path) -> bool {
    let mut depth = 0i64;
    name.components().any(|component| {
        depth += match component {
            Component::Normal(_) => 1,
            Component::CurDir => 0,
            Component::ParentDir => -1,
            Component::Prefix(_) | Component::RootDir => return true,
        };
        depth < 0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_several_buffers_name_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("a")).unwrap();
        fs::write(folder.path().join("b.bin"), [7; 60]).unwrap();
        let path = folder.path().join("scene.gltf");
        let mut buffers = Buffers::new(&path, None);
        for name in ["b.bin", "./b.bin", "a/../b.bin", "%62.bin"] {
            assert_eq!(buffers.of_uri(name).unwrap()[..], [7; 60], "{name}");
        }
        assert_eq!((buffers.files.len(), buffers.total), (1, 60));
    }

    #[test]
    fn paths_that_lead_out_of_their_folder_are_recognised() {
        for name in ["a.bin", "./a.bin", "a/b/../../c.bin", "..a/b", "a..", ".a"] {
            assert!(!leaves(Path::new(name)), "{name}");
        }
        for name in ["../a.bin", "a/../../b.bin", "/a.bin", "./../a", ".."] {
            assert!(leaves(Path::new(name)), "{name}");
        }
    }
}
