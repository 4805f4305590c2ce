//! Tree files: read whole, opened by name.

use crate::ReadError;
use crate::read::regular;
use bvh_core::file::{FileError, Header, TreeFile};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Why a file gave no tree.
#[derive(Debug, thiserror::Error)]
pub enum TreeFileError {
    /// There is no file, or it cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file is damaged, or for another scene.
    #[error("{}: {source}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Why it is rejected.
        source: FileError,
    },
}

impl TreeFileError {
    /// Returns a function for `map_err` that names the file.
    pub fn of(path: &Path) -> impl FnOnce(FileError) -> Self {
        move |source| Self::Invalid { path: path.to_owned(), source }
    }
}

/// Returns the bytes of the tree file at `path`. Rejects a file by its header, before it reads the rest, where the header is none of a
/// tree file or asks for another length.
pub fn read(path: &Path) -> Result<Vec<u8>, TreeFileError> {
    let length = regular(path)?;
    let failed = |source| ReadError::Failed { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    file.by_ref()
        .take(Header::BYTES as u64)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    Header::of_file(&bytes, length).map_err(TreeFileError::of(path))?;
    let rest = length.saturating_sub(bytes.len() as u64);
    bytes
        .try_reserve_exact(rest as usize)
        .map_err(|_| failed(io::ErrorKind::OutOfMemory.into()))?;
    file.take(rest)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    Ok(bytes)
}

/// Opens the bytes of a tree file; `path` names it in errors.
pub fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<TreeFile<'a>, TreeFileError> {
    TreeFile::open(bytes).map_err(TreeFileError::of(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::file::{self, Origin};
    use bvh_core::{Aabb, Bvh, Node};
    use std::fs;

    /// A tree file over one box.
    fn tree() -> Vec<u8> {
        let aabb = Aabb::from([[0.0; 3], [1.0; 3]]);
        let tree = Bvh { nodes: vec![Node::leaf(aabb, 0, 1)], prim_ids: vec![0] };
        file::save(&tree, &[aabb], &Origin::default()).unwrap()
    }

    #[test]
    fn a_tree_file_is_read_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        fs::write(&path, tree()).unwrap();
        assert_eq!(read(&path).unwrap(), tree());
    }

    // Where files have holes, so that this one takes no space.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_64_gigabytes_is_refused_by_its_header() {
        let length = 64 << 30;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("huge.bvh");
        for (beginning, expected) in [
            (vec![], FileError::Magic),
            (tree(), FileError::Length { found: length, expected: tree().len() as u64 }),
        ] {
            fs::write(&path, beginning).unwrap();
            File::options()
                .write(true)
                .open(&path)
                .unwrap()
                .set_len(length)
                .unwrap();
            let refused = read(&path);
            assert!(
                matches!(&refused, Err(TreeFileError::Invalid { source, .. }) if *source == expected),
                "{refused:?}"
            );
        }
    }
}
