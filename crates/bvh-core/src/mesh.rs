//! Triangles from the arrays that meshes are kept in.

use crate::{MAX_OBJECTS, Triangle};
use alloc::vec::Vec;
use glam::Vec3;

/// Why arrays are no mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A triangle names a position that does not exist.
    #[error("triangle {triangle} names position {index} of {positions}, counted from 0")]
    Index {
        /// The triangle.
        triangle: usize,
        /// The index found.
        index: u32,
        /// The number of positions.
        positions: usize,
    },
    /// A position that a triangle names is NaN or infinite.
    #[error("position {index} of triangle {triangle} is {found}; accepted: finite coordinates")]
    NotFinite {
        /// The triangle.
        triangle: usize,
        /// The index of the position.
        index: u32,
        /// The position.
        found: Vec3,
    },
    /// More triangles than a tree may hold.
    #[error("the mesh has {0} triangles; accepted: at most {MAX_OBJECTS}")]
    TooMany(usize),
}

impl Triangle {
    /// The triangles of an indexed mesh, in its order, triangle `i` of `indices[i]`. Positions are `[f32; 3]` or vectors of
    /// `glam`; of a flat array, `as_chunks().0`, and likewise of indices. Triangles without area are kept, so that a
    /// hit's object is the triangle's index. O(triangles).
    ///
    /// ```
    /// use bvh_core::{MeshError, Triangle};
    /// let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0f32];
    /// let indices = [0, 1, 2u32];
    /// let triangles = Triangle::from_mesh(positions.as_chunks::<3>().0, indices.as_chunks().0)?;
    /// assert_eq!(triangles, [Triangle::from(positions)]);
    /// let refused = Triangle::from_mesh(&[[0.0; 3]; 3], &[[0, 1, 3]]).unwrap_err();
    /// assert_eq!(refused.to_string(), "triangle 0 names position 3 of 3, counted from 0");
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
                let missing = MeshError::Index { triangle, index, positions: positions.len() };
                *point = (*positions.get(index as usize).ok_or(missing)?).into();
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
    /// From the coordinates of three corners, one corner after the other.
    fn from([ax, ay, az, bx, by, bz, cx, cy, cz]: [f32; 9]) -> Self {
        Self::from([[ax, ay, az], [bx, by, bz], [cx, cy, cz]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn arrays_and_vectors_give_the_same_triangles_in_the_order_of_their_indices() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 2.0]];
        let indices = [[2, 1, 0], [1, 2, 3], [3, 3, 3]];
        let expected = indices.map(|corners: [u32; 3]| Triangle(corners.map(|at| points[at as usize].into())));
        assert_eq!(Triangle::from_mesh(&points, &indices).unwrap(), expected);
        assert_eq!(Triangle::from_mesh(&points.map(Vec3::from), &indices).unwrap(), expected);
        assert_eq!(Triangle::from_mesh(points.as_flattened().as_chunks::<3>().0, &indices).unwrap(), expected);
        assert_eq!(Triangle::from_mesh::<[f32; 3]>(&[], &[]).unwrap(), []);
    }

    #[test]
    fn a_mesh_that_leads_astray_is_refused_by_its_triangle_and_position() {
        let refusal = |points: [[f32; 3]; 3], indices: [[u32; 3]; 2]| {
            Triangle::from_mesh(&points, &indices).unwrap_err().to_string()
        };
        let good = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!(
            refusal(good, [[0, 1, 2], [0, u32::MAX, 1]]).starts_with("triangle 1 names position 4294967295")
        );
        for bad in [f32::NAN, f32::INFINITY] {
            let message = refusal([good[0], good[1], [0.0, bad, 0.0]], [[0, 1, 0], [0, 1, 2]]);
            assert!(message.starts_with("position 2 of triangle 1 is"), "{message}");
        }
    }
}
