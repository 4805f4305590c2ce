//! Parts of triangles: convex planar polygons, cut by planes across the axes (Sutherland & Hodgman
//! 1974).

use glam::DVec3;

/// A triangle cut by up to six planes. Each cut of a convex polygon adds at most one corner.
#[derive(Clone, Copy)]
pub(crate) struct Polygon {
    corners: [DVec3; 9],
    len: usize,
}

/// A plane across an axis. The part above it is kept if `side` is 1, the part below it if `side` is
/// −1.
#[derive(Clone, Copy)]
pub(crate) struct Plane {
    pub axis: usize,
    pub position: f64,
    pub side: f64,
}

impl Plane {
    #[inline(always)]
    fn height(&self, point: DVec3) -> f64 {
        self.side * (point[self.axis] - self.position)
    }
}

impl Polygon {
    /// Creates a polygon with the corners of a triangle.
    #[inline]
    pub fn new([a, b, c]: [DVec3; 3]) -> Self {
        let mut corners = [DVec3::ZERO; 9];
        corners[..3].copy_from_slice(&[a, b, c]);
        Self { corners, len: 3 }
    }

    #[inline]
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..self.len]
    }

    /// Keeps the part on one side of a plane. `crossing` receives each new corner, and may correct
    /// its rounding errors.
    ///
    /// Rounding can make a polygon slightly concave, and a plane could then add more corners than
    /// there is room for. The polygon stays uncut in that case: too large by rounding errors, but
    /// never too small.
    #[inline(always)]
    pub fn cut(&mut self, plane: Plane, crossing: impl Fn(DVec3) -> DVec3) {
        let whole = *self;
        let mut kept = 0;
        let mut add = |corner: DVec3| {
            if let Some(place) = self.corners.get_mut(kept) {
                *place = corner;
            }
            kept += 1;
        };
        for (index, &from) in whole.corners().iter().enumerate() {
            let next = if index + 1 == whole.len { 0 } else { index + 1 };
            let to = whole.corners[next];
            let before = plane.height(from);
            let after = plane.height(to);
            if before >= 0.0 {
                add(from);
            }
            // A corner in the plane is kept above, and would be its own crossing.
            if (before < 0.0) != (after < 0.0) && before != 0.0 && after != 0.0 {
                add(crossing(from + (to - from) * (before / (before - after))));
            }
        }
        if kept <= self.corners.len() {
            self.len = kept;
        } else {
            *self = whole;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_without_room_for_its_corners_drops_none() {
        // Rounding never makes a polygon as concave as this zigzag, which crosses the plane at
        // every edge but one.
        let mut zigzag = Polygon { corners: [DVec3::ZERO; 9], len: 9 };
        for (index, corner) in zigzag.corners.iter_mut().enumerate() {
            let height = if index % 2 == 0 { 1.0 } else { -1.0 };
            *corner = DVec3::new(index as f64, height, 0.0);
        }
        let mut polygon = zigzag;
        polygon.cut(Plane { axis: 1, position: 0.0, side: 1.0 }, |corner| corner);
        assert_eq!(polygon.corners(), zigzag.corners());
    }

    #[test]
    fn a_cut_that_fills_the_room_is_made() {
        let octagon = [[3, 0], [2, 2], [0, 3], [-2, 2], [-3, 0], [-2, -2], [0, -3], [2, -2]]
            .map(|[x, y]| DVec3::new(f64::from(x), f64::from(y), 0.0));
        let mut polygon = Polygon { corners: [DVec3::ZERO; 9], len: 8 };
        polygon.corners[..8].copy_from_slice(&octagon);
        polygon.cut(Plane { axis: 0, position: 2.5, side: -1.0 }, |corner| corner);
        assert_eq!(polygon.corners().len(), 9);
        assert!(polygon.corners().iter().all(|corner| corner.x <= 2.5));
    }

    #[test]
    fn a_corner_in_the_plane_is_kept_once() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (position, side, expected) in [
            (0.0, 1.0, &corners[..]),
            (0.0, -1.0, &[DVec3::ZERO, DVec3::Y]),
            (1.0, 1.0, &[DVec3::X]),
        ] {
            let mut polygon = Polygon::new(corners);
            polygon.cut(Plane { axis: 0, position, side }, |corner| corner);
            assert_eq!(polygon.corners(), expected);
        }
        let mut polygon = Polygon::new(corners);
        polygon.cut(Plane { axis: 0, position: 0.25, side: 1.0 }, |corner| corner);
        let beyond = [DVec3::new(0.25, 0.0, 0.0), DVec3::X, DVec3::new(0.25, 0.75, 0.0)];
        assert_eq!(polygon.corners(), beyond);
    }
}
