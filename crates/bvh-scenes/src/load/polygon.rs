//! Polygons, split into triangles.

use super::ears::ears;
use super::mesh::{FromFile, UNUSED, counted};
use glam::{DVec2, DVec3};

/// The largest number of vertices of one polygon. The triangles of a larger one would need a hundred
/// bytes of memory for every two bytes of the file.
pub const MOST_CORNERS: usize = 1 << 16;

/// Returns the most steps of ear clipping of a polygon of `n` corners. The teeth of a comb take an
/// eighth; a polygon that takes more crosses itself.
fn most_steps(n: u64) -> u64 {
    8 * n * n + (1 << 16)
}

/// The steps of ear clipping of all polygons of a file: some seconds.
const MOST_STEPS: u64 = 1 << 30;

/// The steps per corner that do not count there: a microsecond.
const FREE_STEPS: u64 = 1 << 8;

/// The triangles of polygons between vertices, in the order in which the polygons were added.
pub struct Polygons<'a, T> {
    vertices: &'a [DVec3],
    /// Whether a polygon has the vertex.
    is_used: Vec<bool>,
    pub triangles: Vec<T>,
    /// The number of polygons with fewer than three corners, which have no triangle.
    pub short: usize,
    /// The number of polygons that no triangles between their corners cover.
    crossing: usize,
    /// The steps that remain of [`MOST_STEPS`].
    steps: u64,
    /// The corners of the polygon that is being added, and their projections.
    corners: Vec<DVec3>,
    flat: Vec<DVec2>,
}

impl<'a, T: FromFile> Polygons<'a, T> {
    pub fn new(vertices: &'a [DVec3]) -> Self {
        Self {
            vertices,
            is_used: vec![false; vertices.len()],
            triangles: Vec::new(),
            short: 0,
            crossing: 0,
            steps: MOST_STEPS,
            corners: Vec::new(),
            flat: Vec::new(),
        }
    }

    /// Adds the polygon with the vertices of these indices; a last one that repeats the first is no
    /// further corner. O(n) if the fan around the first corner covers the polygon, which it does if
    /// the polygon is convex. Rejects vertices that are missing or not finite, and polygons that
    /// would take too much memory or time.
    pub fn add(&mut self, indices: &[impl Copy + PartialEq + Into<i64>]) -> Result<(), String> {
        let indices = match indices {
            [open @ .., last] if open.len() > 2 && *last == open[0] => open,
            _ => indices,
        };
        if indices.len() > MOST_CORNERS {
            let found = indices.len();
            return Err(format!("{found} vertices; expected at most {MOST_CORNERS}"));
        }
        self.corners.clear();
        for &index in indices {
            let corner = self.vertex(index.into())?;
            self.corners.push(corner);
        }
        match self.corners[..] {
            [] | [_] | [_, _] => self.short += 1,
            [a, b, c] => self.triangles.push(T::of([a, b, c])),
            _ => self.split()?,
        }
        Ok(())
    }

    fn vertex(&mut self, index: i64) -> Result<DVec3, String> {
        let count = self.vertices.len();
        let place = usize::try_from(index).ok().filter(|place| *place < count);
        let place = place.ok_or_else(|| format!("vertex {index}; expected 0 to below {count}"))?;
        self.is_used[place] = true;
        match self.vertices[place] {
            point if point.is_finite() => Ok(point),
            point => {
                let point = point.as_vec3();
                Err(format!("vertex {index} at {point}; expected finite x, y and z"))
            }
        }
    }

    /// Returns the clauses about those of a file's vertices that no polygon has, and about polygons
    /// that do not become triangles as one expects.
    pub fn remarks(&self, vertices: usize) -> Vec<String> {
        let used = self.is_used.iter().filter(|is_used| **is_used).count();
        let fans = "faces that cross themselves, read as the fans around their first vertices";
        let remarks = [
            counted(UNUSED, vertices - used),
            counted("faces of fewer than three vertices skipped", self.short),
            counted(fans, self.crossing),
        ];
        remarks.into_iter().flatten().collect()
    }

    fn split(&mut self) -> Result<(), String> {
        self.flatten();
        let (corners, flat, last) = (&self.corners, &self.flat, self.corners.len() as u32 - 1);
        let at = |triangle: [u32; 3]| T::of(triangle.map(|corner| corners[corner as usize]));
        // Twice the signed area.
        let area = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| flat[corner as usize]);
            (b - a).perp_dot(c - a)
        };
        let fan = (1..last).map(|corner| [0, corner, corner + 1]);
        if fan.clone().all(|triangle| area(triangle) >= 0.0) {
            self.triangles.extend(fan.map(at));
            return Ok(());
        }
        let n = corners.len() as u64;
        let most = self.steps.min(most_steps(n));
        let mut left = most;
        let mut ears = ears(flat, &mut left);
        if left == 0 && most < most_steps(n) {
            return Err(format!(
                "{n} vertices that are not convex, too many after the faces before; expected fewer, \
                 or triangles"
            ));
        }
        self.steps -= (most - left).saturating_sub(n * FREE_STEPS);
        let whole: f64 = fan.clone().map(area).sum();
        let covered: f64 = ears.iter().map(|&ear| area(ear).abs()).sum();
        if left == 0 || (covered - whole).abs() > 1e-9 * whole {
            self.crossing += 1;
            self.triangles.extend(fan.map(at));
            return Ok(());
        }
        // What an edge encloses that runs out and back, or a corner that repeats another, has no area.
        ears.resize(last as usize - 1, [0; 3]);
        // One order, and the polygon's orientation, whatever ear was cut first.
        ears.iter_mut().for_each(|ear| ear.sort_unstable());
        ears.sort_unstable();
        self.triangles.extend(ears.into_iter().map(at));
        Ok(())
    }

    /// Projects the corners along the axis in which the polygon is thinnest, so that it runs
    /// counterclockwise.
    fn flatten(&mut self) {
        let corners = &self.corners;
        let from_first = |corner: &DVec3| *corner - corners[0];
        let normal: DVec3 =
            corners.windows(2).map(|pair| from_first(&pair[0]).cross(from_first(&pair[1]))).sum();
        let axis = normal.abs().max_position();
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        self.flat.clear();
        self.flat.extend(corners.iter().map(|corner| DVec2::new(corner[u], corner[v])));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::Triangle;

    #[test]
    fn polygons_that_take_too_many_steps_are_fans_until_all_together_take_too_long() {
        // It crosses itself everywhere.
        let zigzag =
            |i: u32| DVec3::new((i * 7919 % 65536).into(), (i * 10_473 % 65537).into(), 0.0);
        let vertices: Vec<DVec3> = (0..1 << 10).map(zigzag).collect();
        let corners: Vec<u32> = (0..1 << 10).collect();
        let most = most_steps(1 << 10);
        assert!(MOST_STEPS <= 128 * most);
        let mut polygons = Polygons::<Triangle> { steps: 3 * most, ..Polygons::new(&vertices) };
        let rejected = loop {
            if let Err(message) = polygons.add(&corners) {
                break message;
            }
        };
        assert!(rejected.starts_with("1024 vertices that are not convex"), "{rejected}");
        // No polygon takes more than its most steps.
        assert!((3..30).contains(&polygons.crossing), "{}", polygons.crossing);
        assert_eq!(polygons.triangles.len(), polygons.crossing * (corners.len() - 2));
    }
}
