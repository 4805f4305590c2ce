//! Polygons, split into triangles.

use super::mesh::counted;
use bvh_core::Triangle;
use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// The largest number of vertices of one polygon. The triangles of a larger one would need a hundred
/// bytes of memory for every two bytes of the file.
pub const MOST_CORNERS: usize = 1 << 16;

/// The largest number of vertices of a polygon that needs more than a fan. The time of ear clipping
/// grows with the square.
const MOST_CLIPPED: usize = 1 << 13;

/// The largest sum of the squares of the numbers of corners, over all large polygons that ear
/// clipping fails to cover. Without it a forged file of a few megabytes would take an hour.
const MOST_FAILED: usize = 1 << 26;

/// Returns a polygon's vertices without the last one if it repeats the first.
pub fn open<T: PartialEq>(vertices: &[T]) -> &[T] {
    match vertices {
        [open @ .., last] if open.len() > 2 && *last == open[0] => open,
        _ => vertices,
    }
}

/// The triangles of polygons, in the order in which the polygons were added.
#[derive(Default)]
pub struct Polygons {
    pub triangles: Vec<Triangle>,
    /// The number of polygons with fewer than three corners, which have no triangle.
    pub short: usize,
    /// The number of polygons that no triangles between their corners cover.
    crossing: usize,
    /// The sum that [`MOST_FAILED`] limits.
    failed: usize,
    flat: Vec<DVec2>,
}

impl Polygons {
    /// Adds the polygon of these finite corners. O(n) if the fan
    /// around the first corner covers the polygon, which it does if the polygon is convex. Rejects
    /// polygons that would take too much memory or time.
    pub fn add(&mut self, corners: &[Vec3]) -> Result<(), String> {
        match *corners {
            [] | [_] | [_, _] => self.short += 1,
            [a, b, c] => self.triangles.push(Triangle([a, b, c])),
            _ if corners.len() > MOST_CORNERS => {
                let found = corners.len();
                return Err(format!("{found} vertices; expected at most {MOST_CORNERS}"));
            }
            _ => self.split(corners)?,
        }
        Ok(())
    }

    /// Returns the clauses about polygons that do not become triangles as one expects.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        let short = counted("faces of fewer than three vertices skipped", self.short);
        let fans = "faces that cross themselves, read as the fans around their first vertices";
        short.into_iter().chain(counted(fans, self.crossing))
    }

    fn split(&mut self, corners: &[Vec3]) -> Result<(), String> {
        self.flatten(corners);
        let (flat, last) = (&self.flat, corners.len() as u32 - 1);
        // Twice the signed area.
        let area = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| flat[corner as usize]);
            (b - a).perp_dot(c - a)
        };
        let fan = (1..last).map(|corner| [0, corner, corner + 1]);
        if fan.clone().all(|triangle| area(triangle) >= 0.0) {
            self.triangles.extend(fan.map(|triangle| at(corners, triangle)));
            return Ok(());
        }
        let n = corners.len();
        if n > MOST_CLIPPED || self.failed > MOST_FAILED {
            return Err(format!(
                "{n} vertices that are not convex; expected at most {MOST_CLIPPED}, and few faces \
                 of many vertices that cross themselves"
            ));
        }
        let mut indices: Vec<u32> = Vec::new();
        let points = flat.iter().map(|point| point.to_array());
        Earcut::new().earcut(points, &[0u32; 0], &mut indices);
        let mut ears = indices.as_chunks().0.to_vec();
        let whole: f64 = fan.clone().map(area).sum();
        let covered: f64 = ears.iter().map(|&ear| area(ear).abs()).sum();
        if (covered - whole).abs() > 1e-9 * whole {
            self.crossing += 1;
            self.failed += if n > 64 { n * n } else { 0 };
            self.triangles.extend(fan.map(|triangle| at(corners, triangle)));
            return Ok(());
        }
        // One order, and the polygon's orientation, whatever ear was cut first.
        ears.iter_mut().for_each(|ear| ear.sort_unstable());
        ears.sort_unstable();
        self.triangles.extend(ears.into_iter().map(|ear| at(corners, ear)));
        Ok(())
    }

    /// Projects the corners along the axis in which the polygon is thinnest, so that it runs
    /// counterclockwise.
    fn flatten(&mut self, corners: &[Vec3]) {
        let from_first = |corner: &Vec3| corner.as_dvec3() - corners[0].as_dvec3();
        let normal: DVec3 =
            corners.windows(2).map(|pair| from_first(&pair[0]).cross(from_first(&pair[1]))).sum();
        let axis = normal.abs().max_position();
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        self.flat.clear();
        self.flat.extend(corners.iter().map(|corner| {
            let corner = corner.as_dvec3();
            DVec2::new(corner[u], corner[v])
        }));
    }
}

fn at(corners: &[Vec3], triangle: [u32; 3]) -> Triangle {
    Triangle(triangle.map(|corner| corners[corner as usize]))
}
