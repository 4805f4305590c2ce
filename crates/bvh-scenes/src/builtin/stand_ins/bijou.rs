//! Stand-in for bijou: a ring with a brilliant-cut stone, shoulders of small stones, and a chain.
//!
//! Every stone of any size is a complete standard brilliant (table, stars, bezels, girdle,
//! pavilion). The shank, prongs and beads are smooth, and the cushion has a few large polygons. The
//! ring leans against the axes. World units are chosen so that the greedy MF tree costs about
//! 1.7e7, like the original's.

use super::mesh_builder::{
    MeshBuilder, about_x, about_y, about_z, circle, cos_sin, fraction, on_circle, placed, upright,
};
use bvh_core::Triangle;
use glam::{DAffine3, DMat3, DVec3, dvec3};

/// World units per inner radius of the shank.
const UNIT: f64 = 118.0;

/// Half the side of the cushion, in inner radii of the shank.
const CUSHION: f64 = 2.6;

pub fn triangles() -> Vec<Triangle> {
    let mut scene = MeshBuilder::default();
    let lean = about_z(0.09) * about_x(0.045) * about_y(-0.03);
    scene.part(&placed(lean, dvec3(0.0, 0.0, 1.12)), ring);
    chain(&mut scene, 44);
    cushion(&mut scene);
    for (x, y, size, turns) in
        [(2.1, -1.6, 0.22, 0.02), (0.4, -0.9, 0.17, 0.11), (-0.7, 1.0, 0.26, 0.07)]
    {
        // Loose stones rest on their pavilion: girdle and culet touch the cushion.
        let tilted = about_z(turns * 5.0) * about_y(0.39) * about_z(turns);
        scene.part(&placed(tilted * size, dvec3(x, y, padding(x, y) + 0.66 * size)), brilliant);
    }
    scene.finish(UNIT, DVec3::ZERO)
}

/// A brilliant of girdle radius 1, its girdle plane at z = 0, its table up: 110 triangles.
fn brilliant(stone: &mut MeshBuilder) {
    let eighth = |k: usize| fraction(k, 8);
    let table = |k: usize| on_circle(0.56, eighth(k), 0.33);
    let star = |k: usize| on_circle(0.78, eighth(k) + 1.0 / 16.0, 0.2);
    let girdle = |j: usize, z: f64| on_circle(1.0, fraction(j, 16), z);
    let pavilion = |k: usize| on_circle(0.3, eighth(k) + 1.0 / 16.0, -0.66);
    let upper = 0.02;
    let lower = -0.02;
    let culet = dvec3(0.0, 0.0, -0.88);
    let corners: Vec<_> = (0..8).map(table).collect();
    stone.polygon(&corners);
    for k in 0..8 {
        stone.triangle(table(k), star(k), table(k + 1));
        stone.quad(table(k), star(k + 7), girdle(2 * k, upper), star(k));
        for (j, end) in [(2 * k, 2 * k + 1), (2 * k + 1, 2 * k + 2)] {
            stone.triangle(star(k), girdle(j, upper), girdle(end, upper));
            stone.quad(girdle(j, upper), girdle(j, lower), girdle(end, lower), girdle(end, upper));
            stone.triangle(pavilion(k), girdle(end, lower), girdle(j, lower));
        }
        stone.quad(girdle(2 * k, lower), pavilion(k + 7), culet, pavilion(k));
    }
}

/// The ring, its finger hole along y, the main stone above on the z axis; inner radius 1.
fn ring(ring: &mut MeshBuilder) {
    shank(ring);
    let head = 1.62;
    let stone = MeshBuilder::of(brilliant);
    let bead = MeshBuilder::of(bead);
    ring.copy(&placed(about_z(0.013) * 0.52, DVec3::Z * head), &stone);

    // The setting has two gallery rails, a halo plate, and six prongs bent over the girdle.
    for (radius, z, thickness) in [(0.3, 1.22, 0.035), (0.46, 1.47, 0.04)] {
        ring.part(&upright(0.0, 0.0, 0.0, z), |rail| rail.torus(radius, thickness, 40, 7));
    }
    let halo = [(0.56, 1.5), (0.56, 1.54), (0.74, 1.54), (0.74, 1.48), (0.56, 1.5)];
    ring.revolve(&halo, 56);
    for k in 0..6 {
        let stem = [(0.2, 1.05), (0.34, 1.25), (0.48, 1.48), (0.545, 1.62)];
        let claw = [(0.54, 1.68), (0.5, 1.71), (0.43, 1.73)];
        let prong = stem.into_iter().chain(claw);
        let path: Vec<_> = prong.map(|(r, z)| on_circle(r, fraction(k, 6) + 0.02, z)).collect();
        let side = on_circle(1.0, fraction(k, 6) + 0.27, 0.0);
        ring.taper(&path, side, &circle(0.045, 9), &|i| 1.0 - 0.06 * i as f64);
    }

    // Halo stones in a circle, then pavé rows over both shoulders, beads between neighbours.
    for k in 0..24 {
        ring.copy(&(on_halo(fraction(k, 24), 1.58) * small(0.076)), &stone);
        for (shift, radial) in [(0.5, 0.075), (0.5, -0.075)] {
            let between = on_halo((k as f64 + shift) / 24.0, 1.55);
            ring.copy(&(between * upright(0.0, radial, 0.0, 0.0) * small(0.024)), &bead);
        }
    }
    for row in [-1.0, 0.0, 1.0] {
        for k in 0..34 {
            // Stones run from 0.09 to 0.25 turns away from the head, smaller as the shank tapers.
            let half = if k < 17 { 1.0 } else { -1.0 };
            let i = k % 17;
            let away = half * (0.082 + 0.0105 * i as f64 + 0.002 * row);
            let size = 0.042 - 0.0009 * i as f64;
            let lean = placed(about_x(-0.035 * row), DVec3::ZERO);
            ring.copy(&(seat(away, 0.105 * row) * lean * small(size)), &stone);
            for (along, across) in [(-0.0053, 0.052), (0.0053, -0.052)] {
                ring.copy(&(seat(away + along, 0.105 * row + across) * small(0.016)), &bead);
            }
        }
    }
}

fn on_halo(turns: f64, z: f64) -> DAffine3 {
    upright(turns, 0.0, 0.0, 0.0) * upright(0.0, 0.65, 0.0, z)
}

fn seat(away: f64, across: f64) -> DAffine3 {
    placed(about_y(away), DVec3::ZERO)
        * placed(DMat3::IDENTITY, dvec3(0.0, across, surface(away, across)))
}

/// Half the width of the shank, `away` turns from the head.
fn half_width(away: f64) -> f64 {
    0.21 - 0.22 * away.abs()
}

/// Radius of the shank's domed outer surface, `away` turns from the head and `across` from its
/// middle.
fn surface(away: f64, across: f64) -> f64 {
    let x = across / half_width(away);
    1.19 - 0.14 * away.abs() - 0.08 * x * x * x * x
}

/// The shank: flat inside, domed outside, wider at the head; finer towards the head than at the
/// back.
fn shank(mesh: &mut MeshBuilder) {
    let dome = 9;
    let steps = 72;
    mesh.grid(dome + 2, steps, &|i, j| {
        // The cubic spacing puts most of the steps near the head, where the shoulders are.
        let s = 2.0 * fraction(j, steps) - 1.0;
        let away = 0.5 * s * (0.45 + 0.55 * s * s);
        let width = half_width(away);
        let (across, radius) = match i % (dome + 2) {
            0 => (-width, 1.0),
            k if k <= dome => {
                let across = width * (2.0 * fraction(k - 1, dome - 1) - 1.0);
                (across, surface(away, across))
            }
            _ => (width, 1.0),
        };
        about_y(away) * dvec3(0.0, across, radius)
    });
}

fn small(size: f64) -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(size))
}

/// A grain of metal between two stones: a coarse dome of radius 1.
fn bead(bead: &mut MeshBuilder) {
    bead.revolve(&[(1.0, -0.5), (1.0, 0.3), (0.6, 0.85), (0.0, 1.0)], 6);
}

/// A chain of `links` oval links, alternately flat and on edge, laid in a wave around the ring.
fn chain(mesh: &mut MeshBuilder, links: usize) {
    let link = MeshBuilder::of(|link| link.torus(0.06, 0.016, 12, 6));
    for k in 0..links {
        let before = on_wave(fraction(k, links));
        let here = on_wave(fraction(2 * k + 1, 2 * links));
        let after = on_wave(fraction(k + 1, links));
        let along = (after - before).normalize();
        let across = DVec3::Z.cross(along).normalize();
        let heading = DMat3::from_cols(along, across, along.cross(across));
        let roll = if k % 2 == 0 { 0.02 } else { 0.23 };
        let stretch = DMat3::from_diagonal(dvec3(1.7, 1.0, 1.0));
        mesh.copy(&placed(heading * about_x(roll) * stretch, here), &link);
    }
}

fn on_wave(t: f64) -> DVec3 {
    let point = on_circle(1.75 + 0.22 * cos_sin(2.5 * t).0, 0.55 + 0.8 * t, 0.0);
    point.with_z(padding(point.x, point.y) + 0.05)
}

fn cushion(mesh: &mut MeshBuilder) {
    mesh.cuboid(dvec3(-CUSHION, -CUSHION, -0.9), dvec3(CUSHION, CUSHION, -0.35));
    mesh.grid(20, 20, &|i, j| {
        let x = CUSHION * (2.0 * fraction(i, 20) - 1.0);
        let y = CUSHION * (2.0 * fraction(j, 20) - 1.0);
        dvec3(x, y, padding(x, y))
    });
}

/// Height of the cushion's top; its middle, under the ring, is dented.
fn padding(x: f64, y: f64) -> f64 {
    let u = x * x / (CUSHION * CUSHION);
    let v = y * y / (CUSHION * CUSHION);
    0.36 * (1.0 - u * u) * (1.0 - v * v) - 0.35 - 0.12 / (1.0 + 12.0 * (u + v))
}
