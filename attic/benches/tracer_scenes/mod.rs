//! The scenes in which other tracers are measured.

use bvh_core::{Primitives, Triangle};
use bvh_scenes::rays::Viewpoint;
use bvh_scenes::{Scene, SceneKind};
use glam::{DVec3, Vec3, dvec3};
use libm::{cos, sin};
use std::f64::consts::PI;

const OUTSIDE: [[f64; 3]; 2] = [[1.9, 1.3, 2.2], [0.5; 3]];
/// The scenes, and what is seen in fractions of their boxes, as in experiments/peers.toml.
const SCENES: [(&str, [[f64; 3]; 2]); 7] = [
    ("sponza", [[0.15, 0.25, 0.5], [0.9, 0.35, 0.5]]),
    ("kitchen", [[0.5, 0.6, 0.5], [0.9, 0.4, 0.9]]),
    ("cloister", [[0.2, 0.3, 0.3], [0.8, 0.4, 0.6]]),
    ("escher", OUTSIDE),
    ("spot", OUTSIDE),
    ("knot", OUTSIDE),
    ("pebble", OUTSIDE),
];

/// Returns the scenes of these names, or all, with their views.
pub fn scenes(only: &[String]) -> impl Iterator<Item = (Scene, Viewpoint)> {
    let known = SCENES.map(|(name, _)| name);
    assert!(only.iter().all(|name| known.contains(&&**name)), "{only:?}; accepted: {known:?}");
    let is_asked = |(name, _): &(&str, _)| only.is_empty() || only.iter().any(|one| one == name);
    SCENES
        .into_iter()
        .filter(is_asked)
        .map(|(name, [eye, target])| (scene(name), Viewpoint { eye, target }))
}

fn scene(name: &str) -> Scene {
    let triangles = match name {
        "knot" => knot(),
        "pebble" => pebble(),
        name => return Scene::load(name).unwrap_or_else(|error| panic!("{error}")),
    };
    Scene::new(name, SceneKind::Procedural, Primitives::Triangles(triangles))
}

/// A tube around a curve that winds three times around a torus while it goes round twice.
fn knot() -> Vec<Triangle> {
    let on_curve = |turn: f64| {
        let radius = 2.0 + cos(1.5 * turn);
        0.5 * dvec3(radius * cos(turn), radius * sin(turn), sin(1.5 * turn))
    };
    surface([1250, 40], |[around, across]| {
        let (turn, angle) = (4.0 * PI * around, 2.0 * PI * across);
        let point = on_curve(turn);
        let ahead = on_curve(turn + 0.01);
        let side = (ahead - point).cross(ahead + point).normalize();
        let up = side.cross(ahead - point).normalize();
        point + 0.35 * (cos(angle) * up + sin(angle) * side)
    })
}

/// A smooth closed surface of bumps, over a sphere.
fn pebble() -> Vec<Triangle> {
    surface([350, 175], |[around, down]| {
        let (azimuth, polar) = (2.0 * PI * around, PI * down);
        let point = dvec3(sin(polar) * cos(azimuth), cos(polar), sin(polar) * sin(azimuth));
        let DVec3 { x, y, z } = point;
        let coarse = sin(5.0 * x + 1.0) * sin(6.0 * y);
        let fine = sin(17.0 * z + 3.0 * x) * sin(13.0 * y + 2.0);
        (1.0 + 0.12 * coarse + 0.05 * fine) * point
    })
}

/// Triangles over a grid of parameters from 0 to 1, without those that have no area.
fn surface([columns, rows]: [u32; 2], point: impl Fn([f64; 2]) -> DVec3) -> Vec<Triangle> {
    let corner = |column: u32, row: u32| -> Vec3 {
        let fraction = |place: u32, of: u32| f64::from(place % of) / f64::from(of);
        // A row may end at 1, where a sphere has a pole.
        let down = if row == rows { 1.0 } else { fraction(row, rows) };
        point([fraction(column, columns), down]).as_vec3()
    };
    let mut triangles = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let [a, b] = [corner(column, row), corner(column + 1, row)];
        let [c, d] = [corner(column, row + 1), corner(column + 1, row + 1)];
        triangles.extend([Triangle([a, b, c]), Triangle([b, d, c])]);
    }
    triangles.retain(|Triangle([a, b, c])| (b - a).cross(c - a).length_squared() > 1e-16);
    triangles
}
