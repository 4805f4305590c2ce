//! Files that are taken for meshes of a known format.

use super::mesh::Fault;
use super::{stl, without_mark};
use bvh_core::file::Header;

/// The kinds of files by their first bytes, in capitals or not.
const KINDS: [(&[u8], &str); 30] = [
    (&Header::MAGIC, "a tree, not a scene"),
    (b"VERSION HTTPS://GIT-LFS", "a pointer of Git LFS, which `git lfs pull` replaces by the file"),
    (b"<!DOCTYPE HTML", "a web page"),
    (b"<HTML", "a web page"),
    (b"<", "XML, as COLLADA and X3D files are"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZH", "a bzip2 archive"),
    (b"\xfd7ZXZ\0", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive, as new Blender files are"),
    (b"PK\x03\x04", "a ZIP archive, as 3MF and USDZ files are"),
    (b"7Z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"KAYDARA FBX", "an FBX file"),
    (b"; FBX", "an FBX file"),
    (b"PXR-USDC", "a USD file"),
    (b"#USDA", "a USD file"),
    (b"ISO-10303-21", "a STEP file"),
    (b"BLENDER", "a Blender file"),
    (b"OFF\n", "an OFF file"),
    (b"OFF\r", "an OFF file"),
    (b"OFF ", "an OFF file"),
    (b"COFF", "an OFF file"),
    (b"NOFF", "an OFF file"),
    (b"DRACO", "a Draco file"),
    (b"# VTK", "a VTK file"),
    (b"#VRML", "a VRML file"),
    (b"#X3D", "an X3D file"),
    (b"XOF 0", "a DirectX file"),
    (b"\x93NUMPY", "an array of numpy"),
];

/// Rejects a file without contents, in UTF-16, or of a known kind that gives no triangles here.
pub fn check(bytes: &[u8]) -> Result<(), Fault> {
    let is_utf_16 = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    let found = match kind(bytes) {
        _ if bytes.trim_ascii().is_empty() => "empty",
        _ if stl::is_binary(bytes) => return Ok(()),
        _ if is_utf_16 => {
            return Err(Fault::of_file("the text is UTF-16; expected UTF-8 or ASCII"));
        }
        Some(kind) => kind,
        None => return Ok(()),
    };
    Err(Fault::of_file(format!("{found}; expected an OBJ, PLY, STL or glTF file")))
}

fn kind(bytes: &[u8]) -> Option<&'static str> {
    let bytes = without_mark(bytes).trim_ascii_start();
    let begins = |first: &[u8]| {
        bytes.get(..first.len()).is_some_and(|bytes| bytes.eq_ignore_ascii_case(first))
    };
    KINDS.iter().find(|(first, _)| begins(first)).map(|(_, kind)| *kind)
}
