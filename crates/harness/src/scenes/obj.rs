//! Reads the triangles of a Wavefront OBJ file, or says in which line it is wrong.
//!
//! `tobj` reads the numbers, resolves relative indices and cuts polygons into triangle fans. It is
//! given only the `v` and `f` statements, each checked first, because by itself (version 4.0.5) it
//! names no line in its errors, accepts `nan` and turns `1e39` into infinity, panics in a checked
//! build on a texture index such as `-9`, reads a polyline `l 1 2 3` as a triangle, skips the first
//! vertex after a byte order mark, and refuses Latin-1 comments, comments at the end of a line,
//! continued lines, and files in which only some vertices have a colour.
//!
//! What is not a `v` or `f` statement is ignored: points, lines, curves, names, groups, materials
//! (whose files are never opened), normals, texture coordinates. Lines may end in LF, CRLF or CR,
//! and a backslash at the end continues a statement on the next line.

use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::Vec3;
use thiserror::Error;

/// The triangles of one OBJ file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Corners in world units, all finite, in the order of the file across its objects and groups.
    /// A face of n ≥ 3 vertices gives the n − 2 triangles of the fan around its first vertex: exact
    /// for convex faces, while the fan of a concave one can reach outside it.
    pub triangles: Vec<[Vec3; 3]>,
    /// Vertices that are a corner of no triangle. They must be finite, and count for nothing else.
    pub unused_vertices: usize,
    /// Faces left out because they have fewer than three vertices.
    pub short_faces: usize,
    /// Triangles of area zero (collinear or repeated corners). They are kept in `triangles`.
    pub degenerate_triangles: usize,
}

/// A line of a file; shown as `path:line`.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}:{line}", .path.display())]
pub struct Place {
    /// The file, as it was given.
    pub path: PathBuf,
    /// The line's number, from 1; of a continued statement the first line's.
    pub line: usize,
}

/// Why a file gave no triangles.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ObjError {
    /// Nothing at this path.
    #[error("{}: no such file", .path.display())]
    NotFound { path: PathBuf },
    /// A directory at this path.
    #[error("{} is a directory; expected the path of one OBJ file", .path.display())]
    Directory { path: PathBuf },
    /// The file exists and could not be read.
    #[error("{} could not be read: {source}", .path.display())]
    Read { path: PathBuf, source: io::Error },
    /// No bytes, or only blanks.
    #[error("{} is empty; expected a Wavefront OBJ file", .path.display())]
    Empty { path: PathBuf },
    /// Nothing to build a hierarchy over.
    #[error(
        "{} has {vertices} vertices and no face of three or more; expected a Wavefront OBJ file \
         with at least one such face",
        .path.display()
    )]
    NoFaces { path: PathBuf, vertices: usize },
    /// A `v` statement of a wrong length.
    #[error(
        "{place}: vertex of length {found}; expected 3 (x y z), 4 (x y z and a weight), or 6 or 7 \
         (x y z and a colour)"
    )]
    VertexLength { place: Place, found: usize },
    /// A coordinate that is no finite `f32`, also of a vertex that no face uses.
    #[error("{place}: vertex coordinate `{found}`; expected a finite number up to ±3.4e38")]
    Coordinate { place: Place, found: String },
    /// A weight that leaves no finite coordinates.
    #[error(
        "{place}: vertex weight `{found}`; expected a finite number other than 0 by which the \
         coordinates can be divided and stay within ±3.4e38"
    )]
    Weight { place: Place, found: String },
    /// A face names a vertex by something that is not an index.
    #[error(
        "{place}: face vertex `{found}`; expected a whole number, from 1 for the first vertex of \
         the file or from -1 for the latest one"
    )]
    Index { place: Place, found: String },
    /// A face names a vertex after the last one.
    #[error("{place}: face vertex {index}; expected at most {vertices}, the file's vertex count")]
    IndexAbove { place: Place, index: usize, vertices: usize },
    /// A face counts back to before the first vertex.
    #[error("{place}: face vertex {index}; expected at least -{vertices}, the number of vertices above")]
    IndexBelow { place: Place, index: isize, vertices: usize },
    /// `tobj` refused statements that had passed the checks here.
    #[error("{}: {source}; expected a Wavefront OBJ file", .path.display())]
    Tobj { path: PathBuf, source: tobj::LoadError },
}

/// Reads the OBJ file at `path`. O(bytes) in time and memory.
///
/// # Errors
///
/// See [`ObjError`]; whatever the file's bytes are, the outcome is a mesh with at least one
/// triangle or one of those errors.
pub fn load(path: &Path) -> Result<Mesh, ObjError> {
    let bytes = std::fs::read(path).map_err(|source| {
        let path = path.to_path_buf();
        if source.kind() == io::ErrorKind::NotFound {
            ObjError::NotFound { path }
        } else if path.is_dir() {
            ObjError::Directory { path }
        } else {
            ObjError::Read { path, source }
        }
    })?;
    parse(&bytes, path)
}

/// Reads the bytes of an OBJ file; `path` only names it in errors. O(bytes). Any bytes give a mesh or an error.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, ObjError> {
    let geometry = geometry(bytes, path)?;
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut &geometry.text[..], &options, no_materials)
        .map_err(|source| ObjError::Tobj { path: path.to_path_buf(), source })?;

    let mut mesh = Mesh {
        triangles: Vec::new(),
        unused_vertices: geometry.vertices,
        short_faces: geometry.short_faces,
        degenerate_triangles: 0,
    };
    for tobj::Model { mesh: model, .. } in &models {
        let (corners, _) = model.positions.as_chunks::<3>();
        let (faces, _) = model.indices.as_chunks::<3>();
        let corner = |i: u32| Vec3::from_array(corners[i as usize]);
        mesh.triangles.extend(faces.iter().map(|f| f.map(corner)));
        // tobj keeps exactly the vertices that faces use, each once.
        mesh.unused_vertices -= corners.len();
    }
    if mesh.triangles.is_empty() {
        return Err(ObjError::NoFaces { path: path.to_path_buf(), vertices: geometry.vertices });
    }
    mesh.degenerate_triangles = mesh.triangles.iter().filter(|t| has_no_area(t)).count();
    Ok(mesh)
}

/// In f64, where no product of f32 differences overflows or vanishes.
fn has_no_area(triangle: &[Vec3; 3]) -> bool {
    let [a, b, c] = triangle.map(Vec3::as_dvec3);
    (b - a).cross(c - a) == glam::DVec3::ZERO
}

/// A [`Place`] that costs nothing until an error needs it.
#[derive(Clone, Copy)]
struct Line<'a> {
    path: &'a Path,
    number: usize,
}

impl Line<'_> {
    fn place(self) -> Place {
        Place { path: self.path.to_path_buf(), line: self.number }
    }
}

/// The checked `v` and `f` statements of a file.
#[derive(Default)]
struct Geometry {
    /// One statement per line, as tobj reads them without error.
    text: Vec<u8>,
    vertices: usize,
    short_faces: usize,
    /// The highest index counted from the file's start, and the first line that names it: faces may
    /// name vertices further down, so it can be checked only at the end.
    highest_index: (usize, usize),
}

fn geometry(bytes: &[u8], path: &Path) -> Result<Geometry, ObjError> {
    if bytes.trim_ascii().is_empty() {
        let path = path.to_path_buf();
        return Err(ObjError::Empty { path });
    }
    let mut geometry = Geometry::default();
    let mut rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut line = Line { path, number: 0 };
    let mut arguments = Vec::new();
    while let Some((code, mut continued)) = next_line(&mut rest) {
        line.number += 1;
        let mut words = words(code);
        let Some(keyword @ (b"v" | b"f")) = words.next() else {
            continue;
        };
        arguments.clear();
        arguments.extend(words);
        let mut lines_joined = 0;
        while continued && let Some((code, more)) = next_line(&mut rest) {
            lines_joined += 1;
            arguments.extend(self::words(code));
            continued = more;
        }
        match keyword {
            b"v" => vertex(&arguments, line, &mut geometry)?,
            _ => face(&arguments, line, &mut geometry)?,
        }
        line.number += lines_joined;
    }
    let (index, number) = geometry.highest_index;
    if index > geometry.vertices {
        return Err(ObjError::IndexAbove {
            place: Line { path, number }.place(),
            index,
            vertices: geometry.vertices,
        });
    }
    Ok(geometry)
}

/// Checks the numbers after a `v` and adds the statement without its colour.
fn vertex(numbers: &[&[u8]], line: Line, geometry: &mut Geometry) -> Result<(), ObjError> {
    let kept = match numbers.len() {
        3 | 6 | 7 => 3,
        4 => 4,
        found => {
            let place = line.place();
            return Err(ObjError::VertexLength { place, found });
        }
    };
    let mut position = [0.0_f32; 3];
    for (coordinate, word) in position.iter_mut().zip(numbers) {
        *coordinate = number(word)
            .filter(|x: &f32| x.is_finite())
            .ok_or_else(|| ObjError::Coordinate { place: line.place(), found: shown(word) })?;
    }
    if let (4, Some(word)) = (kept, numbers.get(3)) {
        // tobj divides by the weight: x / 0 is never finite, x / infinity always is.
        number(word)
            .filter(|w: &f32| w.is_finite() && position.iter().all(|x| (x / w).is_finite()))
            .ok_or_else(|| ObjError::Weight { place: line.place(), found: shown(word) })?;
    }
    geometry.vertices += 1;
    statement(b'v', numbers.iter().take(kept).copied(), &mut geometry.text);
    Ok(())
}

/// Checks the vertex indices after an `f` and adds the statement without its texture and normal
/// indices; faces of fewer than three vertices are checked and counted only.
fn face(corners: &[&[u8]], line: Line, geometry: &mut Geometry) -> Result<(), ObjError> {
    for corner in corners {
        let index: isize = number(vertex_index(corner))
            .filter(|&index| index != 0)
            .ok_or_else(|| ObjError::Index { place: line.place(), found: shown(corner) })?;
        if index > 0 && index.unsigned_abs() > geometry.highest_index.0 {
            geometry.highest_index = (index.unsigned_abs(), line.number);
        }
        if index < 0 && index.unsigned_abs() > geometry.vertices {
            return Err(ObjError::IndexBelow { place: line.place(), index, vertices: geometry.vertices });
        }
    }
    if corners.len() < 3 {
        geometry.short_faces += 1;
        return Ok(());
    }
    let indices = corners.iter().map(|corner| vertex_index(corner));
    statement(b'f', indices, &mut geometry.text);
    Ok(())
}

/// The `7` of `7`, `7/1`, `7//3` and `7/1/3`.
fn vertex_index(corner: &[u8]) -> &[u8] {
    corner.split(|&b| b == b'/').next().unwrap_or_default()
}

fn statement<'a>(keyword: u8, words: impl Iterator<Item = &'a [u8]>, text: &mut Vec<u8>) {
    text.push(keyword);
    for word in words {
        text.push(b' ');
        text.extend_from_slice(word);
    }
    text.push(b'\n');
}

fn number<T: FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A word for an error message: printable, and short even if the file is one endless word.
fn shown(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let cut = if word.len() > LONGEST { "…" } else { "" };
    format!("{}{cut}", word[..word.len().min(LONGEST)].escape_ascii())
}

/// Takes one line off `rest`: the line without its end (LF, CRLF or CR) and comment, and whether a
/// backslash continues it on the next line.
fn next_line<'a>(rest: &mut &'a [u8]) -> Option<(&'a [u8], bool)> {
    if rest.is_empty() {
        return None;
    }
    let end = rest.iter().position(|&b| b == b'\n' || b == b'\r');
    let (line, tail) = rest.split_at(end.unwrap_or(rest.len()));
    *rest = tail.strip_prefix(b"\r\n").unwrap_or(tail.get(1..).unwrap_or_default());
    let code = line.split(|&b| b == b'#').next().unwrap_or_default();
    let code = code.trim_ascii_end();
    Some(match code.strip_suffix(b"\\") {
        Some(code) => (code, true),
        None => (code, false),
    })
}

fn words(code: &[u8]) -> impl Iterator<Item = &[u8]> {
    code.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}
