//! Stand-in for Cloister: an arcaded courtyard with vaulted walks, tiled roofs and a well.
//!
//! Twin columns with base, leaved capital and abacus carry moulded round arches; behind them groin
//! vaults with ribs; outside, walls of a few large polygons. Shafts, ribs and tiles are long and
//! thin. Nothing is irregular, but the walks differ in length, columns stand turned, and the gate,
//! the well and the garden are oblique. World units are chosen so that the greedy MF tree costs
//! about 1.8e9, like the original's.

use super::mesh_builder::{
    MeshBuilder, about_y, about_z, circle, cos_sin, fraction, half_circle, on_circle, placed,
    upright,
};
use bvh_core::Triangle;
use glam::{DMat3, DVec3, dvec3};
use std::f64::consts::SQRT_2;

/// World units per metre.
const UNIT: f64 = 138.0;
/// Width of a bay and depth of the walk, metres.
const BAY: f64 = 3.6;
/// Height of the parapet on which the columns stand, metres.
const PARAPET: f64 = 0.7;
/// Height of the arches' springing, metres.
const SPRING: f64 = 3.0;
/// Height of wall plate and eaves, metres.
const EAVES: f64 = 5.4;

pub fn triangles() -> Vec<Triangle> {
    let mut cloister = MeshBuilder::default();
    // The court's sides in bays: the long walks run along x, the short ones along y.
    let long = 9;
    let short = 7;
    let half = dvec3(long as f64, short as f64, 0.0) * (0.5 * BAY);
    for (turns, bays, offset) in
        [(0.0, long, half.y), (0.25, short, half.x), (0.5, long, half.y), (0.75, short, half.x)]
    {
        // Each walk is built along +x with the court on its +y side, its corner vault at its far
        // end.
        let place = upright(turns, 0.0, 0.0, 0.0) * upright(0.0, 0.0, -offset, 0.0);
        cloister.part(&place, |mesh| walk(mesh, bays));
    }
    court(&mut cloister, half);
    cloister.part(&upright(0.037, 2.1, -1.4, 0.0), well);
    cloister.finish(UNIT, dvec3(1250.0, -430.0, 75.0))
}

/// A barrel tile of length 1 down the slope, slightly conical.
fn tile(tile: &mut MeshBuilder) {
    tile.grid(3, 1, &|i, j| {
        let (c, s) = cos_sin(0.5 * fraction(i, 3));
        let width = 0.15 - 0.02 * j as f64;
        dvec3(width * c, j as f64 * 1.06, width * s)
    });
}

/// One column on z = 0, 2.3 m high.
fn column(column: &mut MeshBuilder) {
    square(column, 0.17, 0.0, 0.12);
    // Attic base: torus, scotia, torus; then one long quad per side of the shaft, a necking, and
    // the bell.
    let torus = [(0.17, 0.12), (0.175, 0.15), (0.165, 0.18), (0.135, 0.2)];
    let scotia = [(0.13, 0.22), (0.145, 0.25), (0.12, 0.28)];
    let bell = [(0.1, 1.8), (0.115, 1.83), (0.1, 1.86), (0.105, 2.0), (0.13, 2.1), (0.18, 2.18)];
    column.revolve(&[&torus[..], &scotia, &bell].concat(), 12);
    square(column, 0.19, 2.18, 2.24);
    square(column, 0.22, 2.24, 2.3);
    for k in 0..8 {
        // Leaves in two rows, curling outwards at the tip.
        let (low, tall) = if k % 2 == 0 { (1.87, 0.22) } else { (1.93, 0.24) };
        let leaf = |i: usize, j: usize| {
            let u = fraction(i, 2) - 0.5;
            let v = fraction(j, 4);
            let width = 0.085 * (1.0 - v * v * v) + 0.012;
            let out = 0.108 + 0.085 * v * v * v + 0.01 * (1.0 - 4.0 * u * u);
            dvec3(out, u * width, low + tall * (v - 0.35 * v * v * v))
        };
        let around = upright(fraction(k, 8) + 0.021, 0.0, 0.0, 0.0);
        column.part(&around, |mesh| mesh.grid(2, 4, &leaf));
    }
}

/// Adds a square plate of this half width around the z axis.
fn square(mesh: &mut MeshBuilder, half: f64, low: f64, high: f64) {
    mesh.cuboid(dvec3(-half, -half, low), dvec3(half, half, high));
}

/// The arch over one bay with its moulding on both faces; springs at z = 0, centred on x = 0.
fn arcade_arch(arch: &mut MeshBuilder) {
    let radius = 0.5 * BAY - 0.42;
    arch.arch(radius, 0.5 * BAY, EAVES - SPRING, 0.5, 14);
    for face in [-0.25, 0.25] {
        let path = half_circle(14, |c, s| dvec3(radius * c, face, radius * s));
        let profile =
            [(0.0, 0.0), (0.0, 0.05), (-0.07, 0.09), (-0.12, 0.05), (-0.2, 0.07), (-0.24, 0.0)];
        let outwards = profile.map(|(x, y)| (x, if face > 0.0 { -y } else { y }));
        arch.sweep(&path, DVec3::Y, &outwards);
    }
}

/// A groin vault over one square bay, centred on the z axis, springing at z = 0: the lower envelope
/// of two barrels is left open, so four webs meet in the groins; diagonal ribs run below these.
fn vault(vault: &mut MeshBuilder) {
    let half = 0.5 * BAY;
    for k in 0..4 {
        // One web: from the groin (|y| = x) to the wall arch at x = half, courses parallel to y.
        let web = |i: usize, j: usize| {
            let (c, s) = cos_sin(0.25 * fraction(j, 6));
            let reach = half * c;
            dvec3(reach, (2.0 * fraction(i, 6) - 1.0) * reach, half * s)
        };
        vault.part(&upright(0.25 * k as f64, 0.0, 0.0, 0.0), |mesh| mesh.grid(6, 6, &web));
    }
    for turns in [0.125, 0.375] {
        let path =
            half_circle(14, |c, s| about_z(turns) * dvec3(half * SQRT_2 * c, 0.0, half * s - 0.02));
        let rib = [(0.05, -0.07), (0.09, 0.0), (0.05, 0.07), (-0.03, 0.07), (-0.03, -0.07)];
        vault.sweep(&path, about_z(turns) * DVec3::Y, &rib);
    }
    // The keystone where the ribs cross.
    let boss = [(0.0, 0.0), (0.1, 0.02), (0.18, 0.08), (0.2, 0.16), (0.17, 0.2)];
    vault.part(&upright(0.05, 0.0, 0.0, half - 0.2), |mesh| mesh.revolve(&boss, 10));
}

/// A walk of `bays` bays along x, centred, its arcade in the plane y = 0 and its back wall at y =
/// −`BAY`.
fn walk(walk: &mut MeshBuilder, bays: usize) {
    let start = -0.5 * BAY * bays as f64;
    let end = -start;
    let back = -BAY - 0.25;
    let parts: [fn(&mut MeshBuilder); 3] = [vault, column, arcade_arch];
    let [vault, column, arch] = parts.map(MeshBuilder::of);
    walk.cuboid(dvec3(start, -0.3, 0.0), dvec3(end, 0.3, PARAPET));
    walk.sweep(
        &[dvec3(start, 0.0, PARAPET), dvec3(end, 0.0, PARAPET)],
        DVec3::Z,
        &[(0.36, 0.0), (0.36, 0.06), (0.31, 0.1), (-0.31, 0.1), (-0.36, 0.06), (-0.36, 0.0)],
    );
    for bay in 0..=bays {
        let x = start + BAY * bay as f64;
        // Bays continue into the corner, which has a shared vault and no arch.
        let middle = x + 0.5 * BAY;
        walk.copy(&upright(0.0, middle, -0.5 * BAY - 0.1, SPRING), &vault);
        if bay < bays {
            for (turns, y) in [(0.003 * bay as f64, -0.18), (0.002 * bay as f64 - 0.01, 0.18)] {
                walk.copy(&upright(turns, x, y, PARAPET), &column);
            }
            walk.copy(&upright(0.0, middle, 0.0, SPRING), &arch);
            buttress(walk, x);
        }
        paving(walk, x, bay);
    }
    let outer = end - back;
    let bed = [(start, 0.0), (end, 0.0), (outer, back), (-outer, back)];
    let [a, b, c, d] = bed.map(|(x, y)| dvec3(x, y, -0.02));
    walk.quad(a, b, c, d);
    // The back wall has three polygons around a doorway, whose arch closes it above.
    let door = start + BAY * (0.5 + (bays / 2) as f64);
    for (from, to, low, high) in [
        (-outer, door - 1.0, 0.0, 6.9),
        (door + 1.0, outer, 0.0, 6.9),
        (door - 1.0, door + 1.0, 4.2, 6.9),
    ] {
        walk.wall(from, to, back, low, high);
    }
    walk.part(&upright(0.0, door, back, 2.5), |doorway| {
        doorway.arch(0.8, 1.0, 1.7, 0.4, 18);
        for x in [-1.0, 0.8] {
            doorway.cuboid(dvec3(x, -0.2, -2.5), dvec3(x + 0.2, 0.2, 0.0));
        }
        // The door leaf is ajar.
        doorway.part(&upright(0.079, -0.78, 0.1, -2.5), |leaf| {
            leaf.cuboid(DVec3::ZERO, dvec3(1.5, 0.06, 2.4));
            for z in [0.4, 1.2, 2.0] {
                leaf.cuboid(dvec3(0.0, -0.02, z), dvec3(1.1, 0.08, z + 0.06));
            }
        });
    });
    roof(walk, end);
}

/// A slender stepped pier against the arcade's court side.
fn buttress(mesh: &mut MeshBuilder, x: f64) {
    let at = |dx: f64, y: f64, z: f64| dvec3(x + dx, y, z);
    for (depth, low, high) in [(0.52, 3.1, 3.9), (0.42, 3.9, 4.9)] {
        mesh.cuboid(at(-0.14, 0.25, low), at(0.14, depth, high));
    }
    mesh.quad(at(-0.14, 0.42, 4.9), at(0.14, 0.42, 4.9), at(0.14, 0.25, 5.2), at(-0.14, 0.25, 5.2));
}

/// The floor of one bay: a border of long slabs around a lozenge of square tiles, whose size
/// changes from bay to bay.
fn paving(mesh: &mut MeshBuilder, x: f64, bay: usize) {
    let tiles = 3 + bay % 3;
    let middle = dvec3(x + 0.5 * BAY, -0.5 * BAY - 0.1, 0.0);
    let half = 0.5 * BAY - 0.3;
    for k in 0..4 {
        let corner =
            |i: usize, reach: f64| middle + on_circle(reach * SQRT_2, fraction(2 * i + 1, 8), 0.0);
        mesh.quad(
            corner(k, half),
            corner(k, half + 0.3),
            corner(k + 1, half + 0.3),
            corner(k + 1, half),
        );
        let tip = middle + on_circle(half, fraction(k, 4), 0.0);
        let next = middle + on_circle(half, fraction(k + 1, 4), 0.0);
        mesh.triangle(tip, corner(k, half), next);
    }
    mesh.grid(tiles, tiles, &|i, j| {
        let u = fraction(i, tiles) - 0.5;
        let v = fraction(j, tiles) - 0.5;
        middle + dvec3((u - v) * half, (u + v) * half, 0.0)
    });
}

/// The lean-to roof over a walk, `half` its arcade's half length: rafters below, boarding in five
/// panels, rows of barrel tiles above; mitred at both corners.
fn roof(mesh: &mut MeshBuilder, half: f64) {
    let eaves = dvec3(0.0, 0.7, EAVES);
    let ridge = dvec3(0.0, -BAY - 0.25, EAVES + 1.5);
    let slope = (ridge - eaves).length();
    let up = (ridge - eaves) / slope;
    let normal = up.cross(DVec3::X);
    let along = |x: f64| DVec3::X * x;
    let low = half - eaves.y;
    let high = half - ridge.y;
    mesh.grid(5, 1, &|i, j| {
        let side = 2.0 * fraction(i, 5) - 1.0;
        if j == 0 { eaves + along(side * low) } else { ridge + along(side * high) }
    });
    let rafters = (2.0 * low / 0.9) as usize;
    let beam = [(0.05, -0.12), (0.05, -0.02), (-0.05, -0.02), (-0.05, -0.12)];
    for k in 0..rafters {
        let foot = eaves + along(low * (2.0 * fraction(2 * k + 1, 2 * rafters) - 1.0));
        mesh.sweep(&[foot, foot + up * (slope - 0.1)], normal, &beam);
    }
    let rows = 6;
    let columns = (2.0 * high / 0.5) as usize;
    let length = slope / rows as f64;
    let frame = DMat3::from_cols(DVec3::X, up * length, normal);
    let tile = MeshBuilder::of(tile);
    for i in 0..columns {
        let x = high * (2.0 * fraction(2 * i + 1, 2 * columns) - 1.0);
        for j in 0..rows {
            let limit = low + (high - low) * fraction(2 * j + 1, 2 * rows);
            if x.abs() < limit {
                let foot = eaves + along(x) + up * (length * j as f64) + normal * 0.02;
                mesh.copy(&placed(frame, foot), &tile);
            }
        }
    }
}

/// The garden: paths that cross obliquely over one lawn, and hedges of plain boxes.
fn court(mesh: &mut MeshBuilder, half: DVec3) {
    let inner = half - dvec3(0.25, 0.25, 0.0);
    mesh.grid(3, 2, &|i, j| {
        dvec3(inner.x * (2.0 * fraction(i, 3) - 1.0), inner.y * (j as f64 - 1.0), -0.1)
    });
    for (turns, length) in [(0.037, 14.0), (0.287, 11.0)] {
        mesh.part(&upright(turns, 2.1, -1.4, 0.0), |garden| {
            let stones = 18;
            garden.grid(stones, 2, &|i, j| {
                dvec3((2.0 * fraction(i, stones) - 1.0) * length, 0.7 * (j as f64 - 1.0), -0.06)
            });
            for (x, y) in [(3.0, 1.0), (3.0, -1.6), (-9.0, 1.0), (-9.0, -1.6)] {
                garden.cuboid(dvec3(x, y, -0.1), dvec3(x + 6.0, y + 0.6, 0.55));
            }
        });
    }
}

/// The well: three octagonal steps, a carved round kerb, an iron yoke with chain and bucket.
fn well(well: &mut MeshBuilder) {
    well.revolve(
        &[(2.0, -0.1), (2.0, 0.1), (1.65, 0.1), (1.65, 0.3), (1.3, 0.3), (1.3, 0.5), (0.7, 0.5)],
        8,
    );
    let kerb = [(0.95, 0.5), (0.98, 0.6), (0.88, 0.68), (0.84, 1.1), (0.92, 1.2), (0.98, 1.28)];
    let shaft = [(0.95, 1.36), (0.7, 1.36), (0.7, -2.5)];
    well.revolve(&[&kerb[..], &shaft].concat(), 36);
    for k in 0..12 {
        // Blind arches around the kerb.
        let niche = upright(fraction(k, 12), 0.0, 0.0, 0.0) * upright(0.25, 0.88, 0.0, 0.88);
        well.part(&niche, |mesh| mesh.arch(0.13, 0.2, 0.19, 0.05, 8));
    }
    let yoke = half_circle(20, |c, s| dvec3(0.83 * c, 0.0, 1.36 + 1.9 * libm::sqrt(s)));
    well.sweep(&yoke, DVec3::Y, &circle(0.035, 7));
    let link = MeshBuilder::of(|link| link.torus(0.03, 0.012, 9, 6));
    for k in 0..18 {
        let turned = about_z(if k % 2 == 0 { 0.02 } else { 0.27 }) * about_y(0.25);
        well.copy(&placed(turned, dvec3(0.0, 0.0, 3.2 - 0.05 * k as f64)), &link);
    }
    // A wooden bucket, hoops included: its outside, then its inside.
    let outside =
        [(0.0, 0.0), (0.16, 0.0), (0.165, 0.08), (0.175, 0.08), (0.175, 0.12), (0.19, 0.36)];
    let inside = [(0.175, 0.36), (0.15, 0.03), (0.0, 0.03)];
    let bucket = [&outside[..], &inside].concat();
    well.part(&upright(0.06, 0.0, 0.0, 1.95), |mesh| mesh.revolve(&bucket, 14));
}
