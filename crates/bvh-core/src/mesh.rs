//! Triangles from the arrays of an indexed mesh.

use crate::{MAX_OBJECTS, Triangle};
use glam::Vec3;

/// The reason why arrays are rejected as a mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // The messages explain the fields.
pub enum MeshError {
    /// A triangle refers to a position that does not exist.
    #[error("triangle {triangle} names position {index} of {positions}, counted from 0")]
    Index { triangle: usize, index: u32, positions: usize },
    /// A corner of a triangle has a NaN or infinite coordinate.
    #[error("position {index} of triangle {triangle} is {found}; accepted: finite coordinates")]
    NotFinite { triangle: usize, index: u32, found: Vec3 },
    /// There are more triangles than a tree can hold.
    #[error("the mesh has {0} triangles; accepted: at most {MAX_OBJECTS}")]
    TooMany(usize),
}

impl Triangle {
    /// Makes the triangles of an indexed mesh. Triangle `i` has the positions that `indices[i]`
    /// refers to. Triangles without area are kept, so that the object of a hit is the index of its
    /// triangle. O(triangles).
    ///
    /// Positions are `[f32; 3]` or vectors of `glam`. Flat arrays of positions or indices become
    /// arrays of three by `as_chunks().0`.
    ///
    /// ```
    /// use bvh_core::{MeshError, Triangle};
    /// let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0f32];
    /// let indices = [0, 1, 2u32];
    /// let triangles = Triangle::from_mesh(positions.as_chunks::<3>().0, indices.as_chunks().0)?;
    /// assert_eq!(triangles, [Triangle::from(positions)]);
    /// let error = Triangle::from_mesh(&[[0.0; 3]; 3], &[[0, 1, 3]]).unwrap_err();
    /// assert_eq!(error.to_string(), "triangle 0 names position 3 of 3, counted from 0");
    /// # Ok::<(), MeshError>(())
    /// ```
    pub fn from_mesh<P: Copy + Into<Vec3>>(
        positions: &[P],
        indices: &[[u32; 3]],
    ) -> Result<Vec<Self>, MeshError> {
        if indices.len() > MAX_OBJECTS {
            return Err(MeshError::TooMany(indices.len()));
        }
        let mut triangles = Vec::with_capacity(indices.len());
        for (triangle, corners) in indices.iter().enumerate() {
            let mut points = [Vec3::ZERO; 3];
            for (point, &index) in points.iter_mut().zip(corners) {
                let Some(&position) = positions.get(index as usize) else {
                    return Err(MeshError::Index { triangle, index, positions: positions.len() });
                };
                *point = position.into();
                // Only positions that a triangle uses must be finite: meshes may have unused ones.
                if !point.is_finite() {
                    return Err(MeshError::NotFinite { triangle, index, found: *point });
                }
            }
            triangles.push(Self(points));
        }
        Ok(triangles)
    }
}

impl From<[f32; 9]> for Triangle {
    /// Makes a triangle from the coordinates of its corners, one corner after the other.
    fn from([ax, ay, az, bx, by, bz, cx, cy, cz]: [f32; 9]) -> Self {
        Self::from([[ax, ay, az], [bx, by, bz], [cx, cy, cz]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_and_vectors_give_the_same_triangles_in_the_order_of_their_indices() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 2.0]];
        let indices = [[2, 1, 0], [1, 2, 3], [3, 3, 3]];
        let triangle = |corners: [u32; 3]| corners.map(|index| points[index as usize].into());
        let expected = indices.map(triangle).map(Triangle);
        assert_eq!(Triangle::from_mesh(&points, &indices).unwrap(), expected);
        assert_eq!(Triangle::from_mesh(&points.map(Vec3::from), &indices).unwrap(), expected);
        let (chunks, _) = points.as_flattened().as_chunks::<3>();
        assert_eq!(Triangle::from_mesh(chunks, &indices).unwrap(), expected);
        assert_eq!(Triangle::from_mesh::<[f32; 3]>(&[], &[]).unwrap(), []);
    }

    #[test]
    fn an_error_of_a_mesh_reports_the_triangle_and_the_position() {
        for y in [1.0, f32::NAN, f32::INFINITY] {
            let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, y, 0.0]];
            let index = if y.is_finite() { u32::MAX } else { 2 };
            let found = Triangle::from_mesh(&points, &[[0, 1, 0], [0, index, 1]]).unwrap_err();
            match found {
                MeshError::Index { triangle: 1, index: u32::MAX, positions: 3 } if y == 1.0 => {}
                MeshError::NotFinite { triangle: 1, index: 2, .. } if y != 1.0 => {}
                _ => panic!("{found}"),
            }
        }
    }
}
