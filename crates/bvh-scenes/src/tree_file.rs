//! Tree files, read completely and checked against a scene's objects.

use crate::Scene;
use crate::files::{ReadError, regular};
use bvh_core::Bvh;
use bvh_core::cost::call_in_turn;
use bvh_core::file::{FileError, Header, TreeFile};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The reason why a file gave no tree.
#[derive(Debug, thiserror::Error)]
pub enum TreeFileError {
    /// The file does not exist or cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file is damaged or belongs to a different scene.
    #[error("{}: {source}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The fault of its contents.
        source: FileError,
    },
}

impl TreeFileError {
    /// Returns a function for `map_err` that names the file.
    pub fn of(path: &Path) -> impl FnOnce(FileError) -> Self {
        move |source| Self::Invalid { path: path.to_owned(), source }
    }
}

/// Returns the bytes of the tree file at `path`. If the header is invalid or does not match the
/// file's length, rejects the file before it reads the rest.
pub fn read(path: &Path) -> Result<Vec<u8>, TreeFileError> {
    let (_, mut bytes, file, length) = begin(path)?;
    let after_header = length.saturating_sub(bytes.len() as u64);
    // An intact file may still be larger than the memory, which is an error and no abort.
    bytes
        .try_reserve_exact(after_header as usize)
        .map_err(|_| ReadError::of(path)(io::ErrorKind::OutOfMemory.into()))?;
    file.take(after_header).read_to_end(&mut bytes).map_err(ReadError::of(path))?;
    Ok(bytes)
}

/// Returns the header of the tree file at `path`. Does not read the rest.
pub fn header(path: &Path) -> Result<Header, TreeFileError> {
    Ok(begin(path)?.0)
}

/// Returns a file's header, which matches its length, and its bytes, the rest, and that length.
fn begin(path: &Path) -> Result<(Header, Vec<u8>, File, u64), TreeFileError> {
    let length = regular(path)?;
    let mut file = File::open(path).map_err(ReadError::of(path))?;
    let mut bytes = Vec::new();
    let beginning = file.by_ref().take(Header::BYTES as u64).read_to_end(&mut bytes);
    beginning.map_err(ReadError::of(path))?;
    let header = Header::of_file(&bytes, length).map_err(TreeFileError::of(path))?;
    Ok((header, bytes, file, length))
}

/// Reads the tree over a scene's objects from the file at `path`, and the file's header. Without a
/// scene, checks the tree alone.
///
/// # Errors
///
/// [`TreeFileError`] if the file is damaged or was saved for another scene, or if its tree is not
/// [valid](bvh_core::validate_references) over these objects.
pub fn load<'a>(
    path: &Path,
    scene: impl Into<Option<&'a Scene>>,
) -> Result<(Bvh, Header), TreeFileError> {
    let bytes = read(path)?;
    let scene = scene.into();
    let checked = || {
        let file = TreeFile::open(&bytes)?;
        let header = file.header().clone();
        let tree = match scene {
            Some(Scene { boxes, primitives, .. }) => {
                let file = file.for_objects(boxes, Some(primitives))?;
                file.tree_over(boxes, Some(primitives), &call_in_turn)?
            }
            None => file.tree()?,
        };
        Ok((tree, header))
    };
    checked().map_err(TreeFileError::of(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::file::{self, Origin};
    use bvh_core::{Aabb, Node};
    use std::fs;

    fn tree() -> Vec<u8> {
        let aabb = Aabb::from([[0.0; 3], [1.0; 3]]);
        let tree = Bvh::new(vec![Node::leaf(aabb, 0, 1)], vec![0]);
        file::save(&tree, &[aabb], &Origin::default()).unwrap()
    }

    #[test]
    fn a_tree_file_is_read_completely_and_nothing_else_is_opened() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        for wrong in [folder.path(), &path, Path::new("/dev/zero")] {
            assert!(matches!(read(wrong), Err(TreeFileError::Read(_))), "{}", wrong.display());
        }
        fs::write(&path, tree()).unwrap();
        assert_eq!(read(&path).unwrap(), tree());
    }

    // Linux stores holes of files, so that this file needs no space on the disk.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_64_gigabytes_is_rejected_by_its_header() {
        let length = 64 << 30;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("huge.bvh");
        for (beginning, expected) in [
            (vec![], FileError::Magic),
            (tree(), FileError::Length { found: length, expected: tree().len() as u64 }),
        ] {
            fs::write(&path, beginning).unwrap();
            File::options().write(true).open(&path).unwrap().set_len(length).unwrap();
            let Err(TreeFileError::Invalid { source, .. }) = read(&path) else {
                panic!("no fault of the contents")
            };
            assert_eq!(source, expected);
        }
    }
}
