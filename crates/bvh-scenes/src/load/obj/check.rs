//! Checks the numbers of a `v` or `f` statement.

use super::error::{ObjError, Place};
use super::statements::{MOST_CORNERS, shown, vertex_index};
use std::str::FromStr;

/// Returns the words of a vertex without its colour: its coordinates, and its weight if it has one.
pub fn vertex<'a, 'b>(
    words: &'b [&'a [u8]],
    place: impl Fn() -> Place,
) -> Result<&'b [&'a [u8]], ObjError> {
    if !matches!(words.len(), 3 | 4 | 6 | 7) {
        return Err(ObjError::VertexLength { place: place(), found: words.len() });
    }
    let mut position = [0.0_f32; 3];
    for (coordinate, word) in position.iter_mut().zip(words) {
        *coordinate = number(word)
            .filter(|x: &f32| x.is_finite())
            .ok_or_else(|| ObjError::Coordinate { place: place(), found: shown(word) })?;
    }
    if let [_, _, _, word] = words {
        // `tobj` divides by the weight. The quotients reject the weight 0; an infinite weight needs
        // its own test, because x / ∞ is finite.
        number(word)
            .filter(|w: &f32| w.is_finite() && position.iter().all(|x| (x / w).is_finite()))
            .ok_or_else(|| ObjError::Weight { place: place(), found: shown(word) })?;
        return Ok(words);
    }
    Ok(&words[..3])
}

/// Returns the highest index of a face that counts from the start of the file, or 0 if all indices
/// count back from the face. `vertices` is the number of vertices above the face.
pub fn face(
    corners: &[&[u8]],
    vertices: usize,
    place: impl Fn() -> Place,
) -> Result<usize, ObjError> {
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
