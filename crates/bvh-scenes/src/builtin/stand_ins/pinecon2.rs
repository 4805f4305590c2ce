//! Stand-in for pinecon2: a fractal pine cone whose scales carry smaller scales.
//!
//! Scales follow the golden-angle spiral of Vogel (1979) up a bellied cone; each is a bent blade
//! that carries blades of its own, and each of those a thorn. Scales are irregular by a small
//! seeded jitter. World units are chosen so that the greedy MF tree costs about 1.4e6, as the
//! original's did.

use super::mesh_builder::{
    MeshBuilder, about_x, about_y, about_z, circle, cos_sin, fraction, jitter, placed,
};
use bvh_core::Triangle;
use glam::{DMat3, DVec3, dvec3};

/// World units per cone height.
const UNIT: f64 = 104.0;
/// Golden angle in turns: (3 − √5) / 2.
const GOLDEN: f64 = 0.381_966_011_250_105_1;
const SCALES: usize = 122;
const SUB_SCALES: usize = 6;

pub fn triangles() -> Vec<Triangle> {
    let mut cone = MeshBuilder::default();
    let core = [0.0, 0.0, 0.25, 0.5, 0.75, 1.0].map(|t| (0.6 * belly(t), 0.97 * t));
    let closed: Vec<_> = [(0.0, -0.04)].into_iter().chain(core).chain([(0.0, 1.0)]).collect();
    cone.revolve(&closed, 14);
    let stem: Vec<DVec3> =
        (0..=6).map(|k| fraction(k, 6)).map(|t| dvec3(0.07 * t * t, 0.02 * t, -0.25 * t)).collect();
    cone.taper(&stem, DVec3::Y, &circle(0.035, 8), &|k| 1.0 - 0.07 * k as f64);

    for i in 0..SCALES {
        // Scales are denser towards the tip, where they are smaller.
        let t = libm::pow(fraction(2 * i + 1, 2 * SCALES), 0.9);
        let size = 0.06 + 0.17 * belly(t) / 0.31 + 0.008 * jitter(1, i);
        let opening = 0.13 - 0.09 * t + 0.012 * jitter(2, i);
        let azimuth = i as f64 * GOLDEN + 0.004 * jitter(3, i);
        let rotation = about_z(azimuth) * about_y(opening) * about_x(0.01 * jitter(4, i));
        let root = about_z(azimuth) * dvec3(0.5 * belly(t), 0.0, 0.98 * t - 0.05);
        cone.part(&placed(rotation * DMat3::from_diagonal(DVec3::splat(size)), root), |mesh| {
            scale(mesh, i);
        });
    }
    cone.finish(UNIT, DVec3::ZERO)
}

/// Radius of the cone's core at height `t` in 0..=1.
fn belly(t: f64) -> f64 {
    0.05 + 0.26 * libm::sqrt(t + 0.12) * (1.0 - t) * 1.8
}

/// One scale of length 1 along z, its outer face towards +x, with its sub-scales.
fn scale(mesh: &mut MeshBuilder, index: usize) {
    blade(mesh, 5, 3, 0.0);
    blade(mesh, 2, 2, -0.06);
    for k in 0..SUB_SCALES {
        // The same spiral once more, on the upper half of the blade's face.
        let radius = 0.34 * libm::sqrt(fraction(2 * k + 1, 2 * SUB_SCALES));
        let (c, s) = cos_sin(k as f64 * GOLDEN + 0.5 * jitter(5, index));
        let u = radius * c;
        let v = 0.62 + radius * s;
        let tilt = about_y(0.1 + 0.02 * jitter(6, index * SUB_SCALES + k)) * about_x(-0.12 * u);
        let size = DMat3::from_diagonal(DVec3::splat(0.3 - 0.2 * radius));
        mesh.part(&placed(tilt * size, face(0.5 + u, v, 0.0)), |sub| {
            blade(sub, 2, 1, 0.0);
            let tip = face(0.5, 1.0, 0.0);
            sub.polygon(&[tip, face(0.3, 0.7, 0.0), face(0.5, 0.85, 0.3), face(0.7, 0.7, 0.0)]);
            sub.triangle(tip, face(0.7, 0.7, 0.0), face(0.3, 0.7, 0.0));
        });
    }
}

/// Adds a blade's face, `lift` above the middle surface.
fn blade(mesh: &mut MeshBuilder, columns: usize, rows: usize, lift: f64) {
    mesh.grid(columns, rows, &|i, j| face(fraction(i, columns), fraction(j, rows), lift));
}

/// The blade's surface: `u` across in 0..=1, `v` from root to tip; widest two thirds up, cupped and
/// bent outwards.
fn face(u: f64, v: f64, lift: f64) -> DVec3 {
    let across = 2.0 * u - 1.0;
    let width = 0.16 + 0.36 * cos_sin(0.25 * (1.0 - v) * (1.0 - v) * 1.6).0 - 0.22 * v * v * v;
    let bend = 0.22 * v * v - 0.12 * across * across + 0.05 * cos_sin(0.5 * v).1;
    dvec3(bend + lift, across * width, v - 0.12 * v * across * across)
}
