//! Makes triangles from surfaces, swept profiles and placed copies, for the mesh stand-ins.
//!
//! All coordinates are f64 until [`MeshBuilder::finish`] rounds each of them to f32 once. Angles
//! are in turns, so that quarter turns are exact; sine and cosine come from `libm`, so that every
//! machine gets the same bytes.

use bvh_core::Triangle;
use glam::{BVec3, DAffine3, DMat3, DVec3, dvec3};

/// Triangles under construction, in the order in which they were added.
#[derive(Default)]
pub struct MeshBuilder {
    triangles: Vec<[DVec3; 3]>,
}

impl MeshBuilder {
    /// Returns what `draw` adds.
    pub fn of(draw: impl FnOnce(&mut Self)) -> Self {
        let mut mesh = Self::default();
        draw(&mut mesh);
        mesh
    }

    pub fn triangle(&mut self, a: DVec3, b: DVec3, c: DVec3) {
        self.triangles.push([a, b, c]);
    }

    /// Adds the quadrilateral `a b c d` as two triangles, split along `a c`.
    pub fn quad(&mut self, a: DVec3, b: DVec3, c: DVec3, d: DVec3) {
        self.triangle(a, b, c);
        self.triangle(a, c, d);
    }

    /// Adds a rectangle in the plane of this `y`, between two x and two z.
    pub fn wall(&mut self, from: f64, to: f64, y: f64, low: f64, high: f64) {
        let corners = [(from, low), (to, low), (to, high), (from, high)];
        let [a, b, c, d] = corners.map(|(x, z)| dvec3(x, y, z));
        self.quad(a, b, c, d);
    }

    /// Adds a convex polygon as a fan around its first corner; fewer than three corners add
    /// nothing.
    pub fn polygon(&mut self, corners: &[DVec3]) {
        for pair in corners.windows(2).skip(1) {
            self.triangle(corners[0], pair[0], pair[1]);
        }
    }

    /// Adds a surface of `columns` × `rows` quadrilaterals with the corners `point(i, j)`, `i <=
    /// columns`, `j <= rows`. Not generic, because every call would compile it again.
    pub fn grid(&mut self, columns: usize, rows: usize, point: &dyn Fn(usize, usize) -> DVec3) {
        let row = |j| (0..=columns).map(|i| point(i, j)).collect::<Vec<_>>();
        let mut low = row(0);
        for j in 1..=rows {
            let high = row(j);
            for i in 0..columns {
                self.quad(low[i], low[i + 1], high[i + 1], high[i]);
            }
            low = high;
        }
    }

    /// Adds the surface of revolution of a `(radius, z)` profile about the z axis, with `segments`
    /// sides.
    pub fn revolve(&mut self, profile: &[(f64, f64)], segments: usize) {
        self.grid(segments, profile.len().saturating_sub(1), &|i, j| {
            let (radius, z) = profile[j];
            on_circle(radius, fraction(i, segments), z)
        });
    }

    pub fn torus(&mut self, radius: f64, thickness: f64, segments: usize, sides: usize) {
        let profile = (0..=sides).map(|i| cos_sin(fraction(i % sides, sides)));
        let profile: Vec<_> =
            profile.map(|(c, s)| (radius + thickness * c, thickness * s)).collect();
        self.revolve(&profile, segments);
    }

    /// Sweeps a closed polygon along a path and closes both ends. The profile's first coordinate
    /// points along `side` × path, its second completes the frame; `side` must not be parallel to
    /// the path.
    pub fn sweep(&mut self, path: &[DVec3], side: DVec3, profile: &[(f64, f64)]) {
        self.taper(path, side, profile, &|_| 1.0);
    }

    /// Sweeps as [`sweep`](Self::sweep) does. The profile is multiplied by `scale(k)` at path point
    /// `k`.
    pub fn taper(
        &mut self,
        path: &[DVec3],
        side: DVec3,
        profile: &[(f64, f64)],
        scale: &dyn Fn(usize) -> f64,
    ) {
        let Some(last) = path.len().checked_sub(1) else {
            return;
        };
        let corner = |i: usize, k: usize| {
            let tangent = (path[(k + 1).min(last)] - path[k.saturating_sub(1)]).normalize();
            let across = side.cross(tangent).normalize();
            let (x, y) = profile[i % profile.len()];
            path[k] + (across * x + tangent.cross(across) * y) * scale(k)
        };
        self.grid(profile.len(), last, &corner);
        for k in [0, last] {
            let cap: Vec<_> = (0..profile.len()).map(|i| corner(i, k)).collect();
            self.polygon(&cap);
        }
    }

    /// Adds a straight round bar of `sides` sides between two points that differ in x or y.
    pub fn bar(&mut self, from: DVec3, to: DVec3, radius: f64, sides: usize) {
        self.sweep(&[from, to], DVec3::Z, &circle(radius, sides));
    }

    /// Adds the 12 triangles of a box parallel to the axes.
    pub fn cuboid(&mut self, min: DVec3, max: DVec3) {
        // The bits of a corner's number choose its side along each axis.
        let sides =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        for side in sides {
            let corner = |bits: u8| BVec3::new(bits & 1 > 0, bits & 2 > 0, bits & 4 > 0);
            let [a, b, c, d] = side.map(|bits| DVec3::select(corner(bits), max, min));
            self.quad(a, b, c, d);
        }
    }

    /// Adds a wall of the given thickness, pierced by a round arch that springs from z = 0 at x =
    /// ±`radius`: the two faces |x| <= `half_width`, z <= `top`, and the soffit between them, with
    /// `segments` steps around the arch.
    pub fn arch(
        &mut self,
        radius: f64,
        half_width: f64,
        top: f64,
        thickness: f64,
        segments: usize,
    ) {
        let front = |i: usize, y: f64| {
            let (c, s) = cos_sin(fraction(i, segments) * 0.5);
            dvec3(radius * c, y, radius * s)
        };
        for y in [-0.5 * thickness, 0.5 * thickness] {
            self.grid(segments, 1, &|i, j| {
                let arc = front(i, y);
                if j == 0 { arc } else { dvec3(arc.x, y, top) }
            });
            self.wall(radius, half_width, y, 0.0, top);
            self.wall(-half_width, -radius, y, 0.0, top);
        }
        self.grid(segments, 1, &|i, j| front(i, if j == 0 { -0.5 } else { 0.5 } * thickness));
    }

    /// Moves what `draw` adds by `placement`: a part is drawn in its own coordinates.
    pub fn part(&mut self, placement: &DAffine3, draw: impl FnOnce(&mut Self)) {
        let before = self.triangles.len();
        draw(self);
        for corner in self.triangles[before..].as_flattened_mut() {
            *corner = placement.transform_point3(*corner);
        }
    }

    /// Adds a moved copy of a part of which there are many.
    pub fn copy(&mut self, placement: &DAffine3, part: &Self) {
        self.part(placement, |mesh| mesh.triangles.extend(&part.triangles));
    }

    /// Multiplies by `unit`, adds `origin`, rounds to f32, and drops triangles without area, which
    /// quadrilaterals at a pole give.
    pub fn finish(self, unit: f64, origin: DVec3) -> Vec<Triangle> {
        self.triangles
            .into_iter()
            .map(|corners| corners.map(|corner| (corner * unit + origin).as_vec3()))
            .map(Triangle)
            .filter(|triangle| !triangle.is_degenerate())
            .collect()
    }
}

/// Returns cosine and sine of an angle in turns, which are exact at multiples of a quarter turn.
pub fn cos_sin(turns: f64) -> (f64, f64) {
    // Reduction to the first quarter leaves 0 there, of which both functions are exact.
    let within = turns - turns.floor();
    let quarters = (within * 4.0).floor();
    let angle = (within - quarters * 0.25) * std::f64::consts::TAU;
    let c = libm::cos(angle);
    let s = libm::sin(angle);
    match quarters as u32 {
        1 => (-s, c),
        2 => (-c, -s),
        3 => (s, -c),
        _ => (c, s),
    }
}

/// The point at height `z` and distance `radius` from the z axis, `turns` around it from the x
/// axis.
pub fn on_circle(radius: f64, turns: f64, z: f64) -> DVec3 {
    let (c, s) = cos_sin(turns);
    dvec3(radius * c, radius * s, z)
}

/// The points of a half circle from the x axis on in this number of steps, made of their cosine and
/// sine.
pub fn half_circle(steps: usize, point: impl Fn(f64, f64) -> DVec3) -> Vec<DVec3> {
    (0..=steps).map(|k| cos_sin(0.5 * fraction(k, steps))).map(|(c, s)| point(c, s)).collect()
}

/// A regular polygon of `sides` corners as a profile for [`MeshBuilder::sweep`].
pub fn circle(radius: f64, sides: usize) -> Vec<(f64, f64)> {
    (0..sides).map(|i| cos_sin(fraction(i, sides))).map(|(c, s)| (radius * c, radius * s)).collect()
}

pub fn fraction(i: usize, n: usize) -> f64 {
    i as f64 / n as f64
}

/// Rotation about the x axis by an angle in turns.
pub fn about_x(turns: f64) -> DMat3 {
    let (c, s) = cos_sin(turns);
    DMat3::from_cols(DVec3::X, dvec3(0.0, c, s), dvec3(0.0, -s, c))
}

pub fn about_y(turns: f64) -> DMat3 {
    let (c, s) = cos_sin(turns);
    DMat3::from_cols(dvec3(c, 0.0, -s), DVec3::Y, dvec3(s, 0.0, c))
}

pub fn about_z(turns: f64) -> DMat3 {
    let (c, s) = cos_sin(turns);
    DMat3::from_cols(dvec3(c, s, 0.0), dvec3(-s, c, 0.0), DVec3::Z)
}

/// The placement that turns a part by `rotation` and carries its origin to `origin`.
pub fn placed(rotation: DMat3, origin: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(rotation, origin)
}

/// The placement that turns a part by `turns` about the z axis and carries its origin to (x, y, z).
pub fn upright(turns: f64, x: f64, y: f64, z: f64) -> DAffine3 {
    placed(about_z(turns), dvec3(x, y, z))
}

/// A number in [-1, 1) that depends on its two arguments only: the finalizer of MurmurHash3 over
/// both, top 24 bits. Stand-ins use it where nature is irregular (scales, terrain, trees), nowhere
/// else.
pub fn jitter(stream: u32, index: usize) -> f64 {
    let mut bits = (index as u32).wrapping_mul(0x9e37_79b9) ^ stream.wrapping_mul(0x27d4_eb2f);
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    bits ^= bits >> 16;
    f64::from(bits >> 8) / f64::from(1_u32 << 23) - 1.0
}
