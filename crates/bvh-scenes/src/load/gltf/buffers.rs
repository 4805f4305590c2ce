//! The buffers of a glTF file, each read when a mesh first needs it, and each file once.

use super::{MOST_BYTES, OutsideFiles};
use crate::read;
use base64::Engine as _;
use gltf_json::{Buffer, Root};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// The bytes of one buffer.
#[derive(Clone, Debug)]
enum Bytes<'a> {
    /// The binary chunk of a GLB file.
    Chunk(&'a [u8]),
    /// Those of a file, which several buffers may name, or of a data URI.
    Read(Rc<Vec<u8>>),
}

/// The buffers of one glTF file.
pub struct Buffers<'a> {
    path: &'a Path,
    outside: OutsideFiles,
    /// The binary chunk of a GLB file.
    chunk: Option<&'a [u8]>,
    /// Those that a mesh has needed, by their number.
    needed: BTreeMap<usize, Bytes<'a>>,
    files: BTreeMap<PathBuf, Rc<Vec<u8>>>,
    /// Bytes read so far.
    total: u64,
}

impl<'a> Buffers<'a> {
    /// The buffers of the file at `path`, none of which is read yet.
    pub fn new(path: &'a Path, outside: OutsideFiles, chunk: Option<&'a [u8]>) -> Self {
        Self { path, outside, chunk, needed: BTreeMap::new(), files: BTreeMap::new(), total: 0 }
    }

    /// Reads a buffer unless that is done. Returns what is wrong with it otherwise.
    pub fn need(&mut self, root: &Root, number: usize) -> Result<(), String> {
        if self.needed.contains_key(&number) {
            return Ok(());
        }
        let buffer = root
            .buffers
            .get(number)
            .ok_or_else(|| format!("no buffers[{number}]; expected one that exists"))?;
        let bytes = self
            .read(number, buffer)
            .map_err(|message| format!("buffers[{number}]: {message}"))?;
        self.needed.insert(number, bytes);
        Ok(())
    }

    /// The bytes of a buffer that was [needed](Self::need).
    pub fn bytes(&self, number: usize) -> Option<&[u8]> {
        Some(match self.needed.get(&number)? {
            Bytes::Chunk(bytes) => bytes,
            Bytes::Read(bytes) => bytes,
        })
    }

    fn read(&mut self, number: usize, buffer: &Buffer) -> Result<Bytes<'a>, String> {
        let (bytes, length) = match (&buffer.uri, self.chunk) {
            (Some(uri), _) => {
                let bytes = self.of_uri(uri)?;
                let length = bytes.len();
                (Bytes::Read(bytes), length)
            }
            (None, Some(chunk)) if number == 0 => (Bytes::Chunk(chunk), chunk.len()),
            (None, Some(_)) => {
                return Err("no URI; expected one, the binary chunk is that of buffers[0]".into());
            }
            (None, None) => {
                return Err("no URI; expected one, or a GLB file with a binary chunk".into());
            }
        };
        match buffer.byte_length.0 > length as u64 {
            true => Err(format!("{length} bytes; expected {}", buffer.byte_length.0)),
            false => Ok(bytes),
        }
    }

    /// The bytes of a `data:` URI, or of a file beside the one that names it.
    fn of_uri(&mut self, uri: &str) -> Result<Rc<Vec<u8>>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data
                .split_once(";base64,")
                .ok_or("a data URI that is not base64")?
                .1;
            let decoded = base64::engine::general_purpose::STANDARD.decode(encoded);
            let bytes = decoded.map_err(|error| error.to_string())?;
            self.count(bytes.len())?;
            return Ok(Rc::new(bytes));
        }
        if uri.contains("://") {
            return Err(format!("`{uri}`; expected a file beside this one, or data in base64"));
        }
        let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
        let path = self.allowed(Path::new(&*name))?;
        if let Entry::Occupied(file) = self.files.entry(path.clone()) {
            return Ok(file.get().clone());
        }
        let bytes = Rc::new(read(&path).map_err(|error| error.to_string())?);
        self.count(bytes.len())?;
        self.files.insert(path, bytes.clone());
        Ok(bytes)
    }

    /// The path of a file by its name in a URI. Refuses one outside the folder of the file that names it, also where links lead there,
    /// unless such files are allowed.
    fn allowed(&self, name: &Path) -> Result<PathBuf, String> {
        let refused = || {
            let name = name.display();
            Err(format!(
                "`{name}` is outside the scene's folder; accepted: a file in it, or any with --outside-files"
            ))
        };
        let path = self.path.with_file_name(name);
        if self.outside == OutsideFiles::Refused && leaves(name) {
            return refused();
        }
        // Of a file that is not there, the reader says so.
        let Ok(path) = fs::canonicalize(&path) else { return Ok(path) };
        // Of a name alone the parent is empty, which is no path.
        let folder = Path::new(".").join(self.path.parent().unwrap_or(Path::new("")));
        let is_below = fs::canonicalize(folder).is_ok_and(|folder| path.starts_with(folder));
        if self.outside == OutsideFiles::Refused && !is_below { refused() } else { Ok(path) }
    }

    fn count(&mut self, bytes: usize) -> Result<(), String> {
        self.total += bytes as u64;
        match self.total > MOST_BYTES {
            true => Err(format!(
                "{} bytes with those before it; expected at most {MOST_BYTES}",
                self.total
            )),
            false => Ok(()),
        }
    }
}

/// Whether a relative path leads out of its folder, or the path is not relative.
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
        let mut buffers = Buffers::new(&path, OutsideFiles::Refused, None);
        for name in ["b.bin", "./b.bin", "a/../b.bin", "%62.bin"] {
            assert_eq!(*buffers.of_uri(name).unwrap(), [7; 60], "{name}");
        }
        assert_eq!((buffers.files.len(), buffers.total), (1, 60));
    }

    #[test]
    fn paths_that_lead_out_of_their_folder_are_told_from_those_that_do_not() {
        for name in ["a.bin", "./a.bin", "a/b/../../c.bin", "..a/b", "a..", ".a"] {
            assert!(!leaves(Path::new(name)), "{name}");
        }
        for name in ["../a.bin", "a/../../b.bin", "/a.bin", "./../a", ".."] {
            assert!(leaves(Path::new(name)), "{name}");
        }
    }
}
