//! Finds the first fault of an OBJ file, by its line.

use super::error::{ObjError, Place};
use super::geometry::MOST_CORNERS;
use super::statements::{Keyword, Statements, shown, vertex_index};
use std::path::Path;
use std::str::FromStr;

/// Checks every number of every `v` and `f` statement. O(bytes).
///
/// # Errors
///
/// The first fault in the order of the file. An index above the number of vertices can be told only at the end of the
/// file, since faces may name vertices below them, and comes last.
pub fn explain(bytes: &[u8], path: &Path) -> Result<(), ObjError> {
    let place = |line| Place { path: path.to_path_buf(), line };
    let mut statements = Statements::new(bytes);
    let mut words = Vec::new();
    let mut vertices = 0;
    // The highest index, and the first line that names it.
    let mut highest = (0, 0);
    while let Some((keyword, line)) = statements.next(&mut words, MOST_CORNERS + 1) {
        match keyword {
            Keyword::Vertex => {
                vertex(&words, || place(line))?;
                vertices += 1;
            }
            Keyword::Face => {
                let index = face(&words, vertices, || place(line))?;
                if index > highest.0 {
                    highest = (index, line);
                }
            }
        }
    }
    let (index, line) = highest;
    if index > vertices { Err(ObjError::IndexAbove { place: place(line), index, vertices }) } else { Ok(()) }
}

fn vertex(words: &[&[u8]], place: impl Fn() -> Place) -> Result<(), ObjError> {
    if !matches!(words.len(), 3 | 4 | 6 | 7) {
        return Err(ObjError::VertexLength { place: place(), found: words.len() });
    }
    let mut position = [0.0_f32; 3];
    for (coordinate, word) in position.iter_mut().zip(words) {
        *coordinate = number(word)
            .filter(|x: &f32| x.is_finite())
            .ok_or_else(|| ObjError::Coordinate { place: place(), found: shown(word) })?;
    }
    if let [.., word] = words
        && words.len() == 4
    {
        // tobj divides by the weight: x / 0 is never finite, x / infinity always is.
        number(word)
            .filter(|w: &f32| w.is_finite() && position.iter().all(|x| (x / w).is_finite()))
            .ok_or_else(|| ObjError::Weight { place: place(), found: shown(word) })?;
    }
    Ok(())
}

/// The highest index of a face that counts from the start of the file, or 0; `vertices` of them lie above the face.
fn face(corners: &[&[u8]], vertices: usize, place: impl Fn() -> Place) -> Result<usize, ObjError> {
    if corners.len() > MOST_CORNERS {
        return Err(ObjError::LongFace { place: place() });
    }
    let mut highest = 0;
    for corner in corners {
        let index: isize = number(vertex_index(corner))
            .filter(|&index| index != 0)
            .ok_or_else(|| ObjError::Index { place: place(), found: shown(corner) })?;
        if index > 0 {
            highest = highest.max(index.unsigned_abs());
        } else if index.unsigned_abs() > vertices {
            return Err(ObjError::IndexBelow { place: place(), index, vertices });
        }
    }
    Ok(highest)
}

fn number<T: FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}
