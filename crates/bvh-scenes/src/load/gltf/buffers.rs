//! The buffers of a glTF file. A buffer is read when a mesh first needs it, and a file once.

use super::document::{Compressed, Document};
use super::{MOST_BYTES, get};
use crate::files::{read, regular};
use data_url::DataUrl;
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{BufferView, Filter, Mode};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// The buffers of one glTF file.
pub struct Buffers<'a> {
    pub document: &'a Document,
    path: &'a Path,
    /// The binary chunk of a GLB file.
    chunk: Option<&'a [u8]>,
    /// The contents of the URIs of buffers that a mesh has needed, by the buffer's number.
    contents: BTreeMap<usize, Rc<Vec<u8>>>,
    /// The contents of files by their canonical path. Several buffers may name the same file.
    files: BTreeMap<PathBuf, Rc<Vec<u8>>>,
    /// The contents of compressed views, by the view's number.
    decoded: BTreeMap<usize, Vec<u8>>,
    /// Bytes read so far.
    total: u64,
    /// Items of accessors read so far.
    pub item_count: u64,
}

impl<'a> Buffers<'a> {
    /// Prepares the buffers of the file at `path` without reading any.
    pub fn new(document: &'a Document, path: &'a Path, chunk: Option<&'a [u8]>) -> Self {
        let (contents, files, decoded) = Default::default();
        Self { document, path, chunk, contents, files, decoded, total: 0, item_count: 0 }
    }

    /// Returns the bytes of a buffer, which is read if no mesh has needed it before.
    pub fn bytes(&mut self, number: usize) -> Result<&[u8], String> {
        let buffer = get(&self.document.buffers, number, "buffers")?;
        let bytes = match (&buffer.uri, self.chunk) {
            (Some(uri), _) => self.contents(number, uri),
            (None, Some(chunk)) if number == 0 => Ok(chunk),
            (None, _) => Err("no URI; expected one, or the binary chunk of a GLB file, which is \
                              buffers[0]"
                .into()),
        };
        let whole = bytes.and_then(|bytes| match buffer.byte_length > bytes.len() {
            true => Err(format!("{} bytes; expected {}", bytes.len(), buffer.byte_length)),
            false => Ok(bytes),
        });
        whole.map_err(|message| format!("buffers[{number}]: {message}"))
    }

    /// Returns the bytes of a view, decoded; `None` if the buffer ends before it.
    pub fn view(&mut self, number: usize) -> Result<Option<&[u8]>, String> {
        let document = self.document;
        let view = get(&document.buffer_views, number, "bufferViews")?;
        if let Some(compressed) = &view.extensions.meshopt {
            if !self.decoded.contains_key(&number) {
                let bytes = self
                    .decode(compressed, view.byte_length)
                    .map_err(|message| format!("bufferViews[{number}]: {message}"))?;
                self.decoded.insert(number, bytes);
            }
            return Ok(Some(&self.decoded[&number]));
        }
        let buffer = self.bytes(view.buffer)?;
        Ok(part(buffer, view.byte_offset, view.byte_length))
    }

    /// Decodes a view of this many bytes, as `EXT_meshopt_compression` says.
    fn decode(&mut self, from: &Compressed, length: usize) -> Result<Vec<u8>, String> {
        let Compressed { count, byte_stride, ref mode, ref filter, .. } = *from;
        let filter = filter.as_deref().unwrap_or("NONE");
        let invalid = |error| {
            format!("{count} items of {byte_stride} bytes, {mode}, {filter}, meshopt: {error}")
        };
        let view = (Mode::parse(mode).and_then(|mode| Ok((mode, Filter::parse(filter)?))))
            .and_then(|(mode, filter)| BufferView::new(mode, filter, count, byte_stride));
        let view = view.map_err(invalid)?;
        view.validate_parent(length, None).map_err(invalid)?;
        // The count of a small file must not take memory that its bytes cannot fill.
        self.count(length as u64)?;
        let bytes = part(self.bytes(from.buffer)?, from.byte_offset, from.byte_length)
            .ok_or("the buffer ends before its compressed bytes; expected them in it")?;
        view.decode(bytes, &mut Workspace::default()).map_err(invalid)
    }

    fn contents(&mut self, number: usize, uri: &str) -> Result<&[u8], String> {
        if !self.contents.contains_key(&number) {
            let bytes = self.read(uri)?;
            self.contents.insert(number, bytes);
        }
        Ok(&self.contents[&number])
    }

    fn read(&mut self, uri: &str) -> Result<Rc<Vec<u8>>, String> {
        if let Ok(data) = DataUrl::process(uri) {
            let (bytes, _) = data.decode_to_vec().map_err(|_| "a data URI of invalid base64")?;
            self.count(bytes.len() as u64)?;
            return Ok(Rc::new(bytes));
        }
        if uri.contains("://") {
            return Err(format!("`{uri}`; expected a file in this folder, or a data URI"));
        }
        let path = self.path_of(uri).or_else(|error| {
            // Windows writes `\` for `/`, and viewers on the web add a query.
            let address = uri.split(['?', '#']).next().unwrap_or_default().replace('\\', "/");
            self.path_of(&address).map_err(|_| error)
        });
        let path = path?;
        if let Some(bytes) = self.files.get(&path) {
            return Ok(Rc::clone(bytes));
        }
        // A file that is too long is rejected before it takes memory.
        self.count(regular(&path).map_err(|error| error.to_string())?)?;
        let bytes = Rc::new(read(&path).map_err(|error| error.to_string())?);
        self.files.insert(path, Rc::clone(&bytes));
        Ok(bytes)
    }

    /// Returns the path of the file by a URI, if there is one in the folder.
    fn path_of(&self, uri: &str) -> Result<PathBuf, String> {
        let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
        let path = self.allowed(Path::new(&*name)).ok_or_else(|| {
            format!(
                "`{name}` may be outside the scene's folder; accepted: a file in this folder or \
                 below, by a path without `..`"
            )
        })?;
        regular(&path).map(|_| path).map_err(|error| error.to_string())
    }

    /// Returns the canonical path of the file by this name in a URI if it is in the folder of the
    /// glTF file or below. Otherwise the author of a file would decide which files of the user are
    /// opened.
    fn allowed(&self, name: &Path) -> Option<PathBuf> {
        // The name is judged first, because the answer must not reveal whether the file exists.
        let is_below = |part| matches!(part, Component::Normal(_) | Component::CurDir);
        if !name.components().all(is_below) {
            return None;
        }
        let path = self.path.with_file_name(name);
        // A missing file has no canonical path; the reader then reports that the file is missing.
        let Ok(path) = fs::canonicalize(&path) else { return Some(path) };
        // A file name without a folder has the empty parent, which cannot be canonicalised.
        let folder = Path::new(".").join(self.path.parent().unwrap_or(Path::new("")));
        // Canonical paths follow symbolic links, which the name alone does not reveal.
        let folder = fs::canonicalize(folder).ok()?;
        path.starts_with(folder).then_some(path)
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

fn part(bytes: &[u8], offset: usize, length: usize) -> Option<&[u8]> {
    bytes.get(offset..)?.get(..length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_several_buffers_name_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("b.bin"), [7; 60]).unwrap();
        let path = folder.path().join("scene.gltf");
        let names = ["b.bin", "b.bin", "./b.bin", "%62.bin"];
        let list = names.map(|name| format!(r#"{{"byteLength": 60, "uri": "{name}"}}"#)).join(", ");
        let document = serde_json::from_str(&format!(r#"{{"buffers": [{list}]}}"#)).unwrap();
        let mut buffers = Buffers::new(&document, &path, None);
        for number in [0, 1, 2, 3, 3] {
            assert_eq!(buffers.bytes(number), Ok(&[7; 60][..]));
        }
        assert_eq!((buffers.files.len(), buffers.total), (1, 60));
    }
}
