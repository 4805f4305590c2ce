//! Stand-in for konistil: a valley with town and railway, in millimetres on a map grid.
//!
//! Coordinates run into the millions and costs to 1e14, although some parts are only a few tens of
//! units thick: rails, wires and lattice masts are long and thin. The terrain is one coarse sheet
//! that is fine only under the town. Ground, houses and trees are irregular by a small seeded
//! jitter.

use super::mesh_builder::{
    MeshBuilder, about_z, circle, cos_sin, fraction, jitter, placed, upright,
};
use bvh_core::Triangle;
use glam::{DMat3, DVec3, dvec3};

/// World units per metre.
const UNIT: f64 = 1000.0;
/// The map grid's coordinates of the valley's corner, world units.
const ORIGIN: DVec3 = dvec3(5.2e5, 3.1e5, 4.0e4);
const SIZE: (f64, f64) = (2700.0, 2000.0);
const CELLS: (usize, usize) = (36, 27);
const TRACK: f64 = 78.0;

pub fn triangles() -> Vec<Triangle> {
    let mut valley = MeshBuilder::default();
    terrain(&mut valley);
    railway(&mut valley);
    viaduct(&mut valley);
    valley.part(&placed(aligned(1500.0), beside(1500.0, 0.0, TRACK)), station);
    town(&mut valley);
    power_line(&mut valley);
    forest(&mut valley);
    valley.finish(UNIT, ORIGIN)
}

/// Height of the ground in metres: two slopes, a hill, and three octaves of value noise.
fn ground(x: f64, y: f64) -> f64 {
    let across = (y - course(x)) / SIZE.1;
    let slope = 420.0 * across * across / (0.06 + across.abs());
    let mut noise = 0.0;
    for (octave, cell) in [400.0, 130.0, 45.0].into_iter().enumerate() {
        noise += 0.055 * cell * value_noise(octave as u32, x / cell, y / cell);
    }
    // The ground around station and town is level.
    let dx = (x - 1500.0) / 700.0;
    let dy = (y - course(x) - 190.0) / 260.0;
    let wild = 1.0 - 0.85 / (1.0 + dx * dx * dx * dx + dy * dy * dy * dy);
    60.0 + slope * wild + noise * wild
}

/// Smooth noise in [−1, 1): jittered values on the integer lattice, interpolated with a cubic ease.
fn value_noise(stream: u32, x: f64, y: f64) -> f64 {
    let i = x.floor();
    let j = y.floor();
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let u = ease(x - i);
    let v = ease(y - j);
    // The offset keeps the index of the jitter positive.
    let value = |a: f64, b: f64| jitter(stream, ((i + a + 64.0) * 512.0 + j + b + 64.0) as usize);
    let low = value(0.0, 0.0) * (1.0 - u) + value(1.0, 0.0) * u;
    let high = value(0.0, 1.0) * (1.0 - u) + value(1.0, 1.0) * u;
    low * (1.0 - v) + high * v
}

/// The line that valley and railway follow: y in metres at x, oblique to the map and slightly
/// curved.
fn course(x: f64) -> f64 {
    760.0 + 0.17 * x + 110.0 * cos_sin(x / 5200.0).1
}

/// A point on the railway, `aside` metres to its left.
fn beside(x: f64, aside: f64, z: f64) -> DVec3 {
    let along = heading(x);
    dvec3(x - along.y * aside, course(x) + along.x * aside, z)
}

/// Unit direction of the railway at x.
fn heading(x: f64) -> DVec3 {
    dvec3(20.0, course(x + 10.0) - course(x - 10.0), 0.0).normalize()
}

/// Rotation that carries the x axis to the railway's direction at x.
fn aligned(x: f64) -> DMat3 {
    let along = heading(x);
    DMat3::from_cols(along, DVec3::Z.cross(along), DVec3::Z)
}

/// The ground: two triangles per cell, 4 × 4 times as many within the town, without stitching.
fn terrain(mesh: &mut MeshBuilder) {
    for j in 0..CELLS.1 {
        for i in 0..CELLS.0 {
            let size = dvec3(SIZE.0 / CELLS.0 as f64, SIZE.1 / CELLS.1 as f64, 0.0);
            let corner = dvec3(i as f64, j as f64, 0.0) * size;
            let aside = corner.y - course(corner.x);
            let near = (corner.x - 1500.0).abs() < 620.0 && (-150.0..460.0).contains(&aside);
            let parts = if near { 4 } else { 1 };
            mesh.grid(parts, parts, &|a, b| {
                let x = corner.x + size.x * fraction(a, parts);
                let y = corner.y + size.y * fraction(b, parts);
                dvec3(x, y, ground(x, y))
            });
        }
    }
}

/// Two tracks on an embankment: rails, sleepers near the station, masts and contact wires.
fn railway(mesh: &mut MeshBuilder) {
    let steps = 64;
    let at = |k: usize| SIZE.0 * fraction(k, steps);
    let bed = [(-14.0, TRACK - 9.0), (-6.0, TRACK - 0.6), (6.0, TRACK - 0.6), (14.0, TRACK - 9.0)];
    mesh.grid(steps, bed.len() - 1, &|k, row| beside(at(k), bed[row].0, bed[row].1));
    let rail = [(0.035, 0.0), (0.035, 0.16), (-0.035, 0.16), (-0.035, 0.0)];
    for aside in [-2.8, -1.3, 1.3, 2.8] {
        let path: Vec<_> = (0..=steps).map(|k| beside(at(k), aside, TRACK)).collect();
        mesh.sweep(&path, DVec3::Z, &rail);
    }
    for k in 0..110 {
        let x = 1428.0 + 1.3 * k as f64;
        let track = if k % 2 == 0 { 2.05 } else { -2.05 };
        mesh.part(&placed(aligned(x), beside(x, track, TRACK)), |sleeper| {
            sleeper.cuboid(dvec3(-0.13, -1.3, -0.2), dvec3(0.13, 1.3, 0.0));
        });
    }
    let spans = 48;
    for k in 0..spans {
        let x = SIZE.0 * fraction(k, spans);
        let next = SIZE.0 * fraction(k + 1, spans);
        for side in [-1.0, 1.0] {
            let foot = beside(x, 4.6 * side, TRACK - 0.6);
            mesh.cuboid(foot - dvec3(0.15, 0.15, 0.0), foot + dvec3(0.15, 0.15, 8.0));
            let at = |x: f64, aside: f64, height: f64| beside(x, aside * side, TRACK + height);
            mesh.bar(at(x, 4.6, 6.4), at(x, 2.05, 6.0), 0.04, 4);
            mesh.bar(at(x, 2.05, 5.9), at(next, 2.05, 5.9), 0.012, 3);
        }
    }
}

/// A viaduct that crosses valley and main line: round arches on tall tapered piers.
fn viaduct(mesh: &mut MeshBuilder) {
    let spans = 28;
    let span = 24.0;
    let pier = [(5.6, -75.0), (5.2, -60.0), (4.2, -14.5), (4.6, -14.2), (4.6, -13.5)];
    for k in 0..spans {
        let place = placed(aligned(430.0) * about_z(0.231), beside(430.0, 0.0, 118.0))
            * upright(0.0, span * (k as f64 - 13.5), 0.0, 0.0);
        mesh.part(&place, |bay| {
            bay.part(&upright(0.0, 0.0, 0.0, -13.5), |arch| arch.arch(9.5, 12.0, 12.5, 7.0, 14));
            for y in [-3.6, 3.2] {
                bay.cuboid(dvec3(-12.0, y, -1.0), dvec3(12.0, y + 0.4, 0.9));
            }
        });
        mesh.part(&(place * upright(0.125, 12.0, 0.0, 0.0)), |mesh| mesh.revolve(&pier, 4));
    }
}

/// The station: a glazed barrel roof on ribs, platforms, a hall with a row of arches, a clock
/// tower.
fn station(station: &mut MeshBuilder) {
    let length = 140.0;
    let half = 19.0;
    let ribs = 15;
    let vault = |t: f64, x: f64, reach: f64| {
        let (c, s) = cos_sin(0.5 * t);
        dvec3(x, -reach * c, 7.0 + 0.62 * reach * s)
    };
    station.grid(24, ribs - 1, &|i, j| {
        vault(fraction(i, 24), length * (fraction(j, ribs - 1) - 0.5), half)
    });
    for j in 0..ribs {
        let x = length * (fraction(j, ribs - 1) - 0.5);
        let path: Vec<_> = (0..=18).map(|i| vault(fraction(i, 18), x, half - 0.3)).collect();
        station.sweep(&path, DVec3::X, &[(-0.2, -0.12), (0.2, -0.12), (0.2, 0.12), (-0.2, 0.12)]);
        for y in [-half, half] {
            station.part(&upright(0.02, x, y, 0.0), |post| {
                post.revolve(&[(0.45, 0.0), (0.25, 0.6), (0.2, 6.4), (0.5, 7.0)], 8);
            });
        }
    }
    for (low, high) in [(-12.0, -4.2), (4.2, 17.0)] {
        station.cuboid(dvec3(-0.7 * length, low, -0.6), dvec3(0.7 * length, high, 0.75));
    }
    for k in 0..14 {
        let bay = upright(0.0, 7.0 * (k as f64 - 6.5), 23.0, 4.0);
        station.part(&bay, |mesh| mesh.arch(2.6, 3.5, 4.2, 0.8, 12));
        let pier = 7.0 * (k as f64 - 7.0);
        station.cuboid(dvec3(pier - 0.9, 22.6, 0.0), dvec3(pier + 0.9, 23.4, 4.0));
    }
    station.part(&upright(0.0, 0.0, 31.0, 0.0), |hall| house(hall, 98.0, 14.0, 9.0, 5.0));
    station.cuboid(dvec3(50.0, 24.0, 0.0), dvec3(58.0, 32.0, 27.0));
    station.part(&upright(1.0 / 16.0, 54.0, 28.0, 0.0), |cap| {
        cap.revolve(&[(6.4, 27.0), (5.0, 31.0), (1.2, 34.0), (0.9, 38.0), (0.0, 41.0)], 8);
    });
}

/// A gabled house, `length` along x, with eaves, windows, a door and a chimney; stands on z = 0,
/// sunk a little.
fn house(house: &mut MeshBuilder, length: f64, width: f64, wall: f64, gable: f64) {
    let x = 0.5 * length;
    let y = 0.5 * width;
    for side in [-1.0, 1.0] {
        house.wall(-x, x, side * y, -4.0, wall);
        let end = |y: f64, z: f64| dvec3(side * x, y, z);
        let ridge = wall + gable;
        house.polygon(&[end(-y, -4.0), end(y, -4.0), end(y, wall), end(0.0, ridge), end(-y, wall)]);
        // The roof overhangs the walls on all sides.
        let low = |x: f64| dvec3(x, side * (y + 0.7), wall - 0.7 * gable / y);
        let high = |x: f64| dvec3(x, 0.0, ridge);
        house.quad(low(-x - 0.5), low(x + 0.5), high(x + 0.5), high(-x - 0.5));
        let windows = (length / 4.5) as usize;
        for k in 0..windows {
            let middle = length * (fraction(2 * k + 1, 2 * windows) - 0.5);
            house.wall(middle - 0.6, middle + 0.6, side * (y + 0.05), 1.2, 2.9);
        }
    }
    house.cuboid(
        dvec3(0.22 * x, 0.3 * y, wall),
        dvec3(0.22 * x + 0.9, 0.3 * y + 0.9, wall + gable + 0.8),
    );
}

/// Streets of houses, each turned its own way, around a church on the rise behind the station.
fn town(mesh: &mut MeshBuilder) {
    for street in 0..6 {
        for k in 0..40 {
            let index = street * 40 + k;
            let x = 1010.0 + 23.0 * k as f64 + 5.0 * jitter(20, index);
            let aside = 88.0 + 55.0 * street as f64 + 9.0 * jitter(21, index);
            let spot = beside(x, aside, 0.0);
            let yard = spot - beside(1560.0, 225.0, 0.0);
            if yard.length() < 52.0 {
                continue; // the churchyard
            }
            let length = 11.0 + 3.0 * jitter(22, index);
            let width = 8.5 + 1.5 * jitter(23, index);
            let wall = 6.0 + 2.0 * jitter(24, index);
            let turn = about_z(0.018 * jitter(25, index) + if index % 5 == 0 { 0.25 } else { 0.0 });
            let place = placed(aligned(x) * turn, spot + DVec3::Z * ground(spot.x, spot.y));
            mesh.part(&place, |mesh| house(mesh, length, width, wall, 0.42 * width));
        }
    }
    let spot = beside(1560.0, 225.0, 0.0);
    let rise = DVec3::Z * ground(spot.x, spot.y);
    mesh.part(&placed(aligned(1560.0) * about_z(0.043), spot + rise), church);
}

/// A church with nave, round apse and a tower with an octagonal spire.
fn church(church: &mut MeshBuilder) {
    house(church, 34.0, 14.0, 12.0, 8.0);
    church.part(&upright(0.0, 17.0, 0.0, 0.0), |apse| {
        apse.revolve(&[(5.5, -4.0), (5.5, 9.0), (5.9, 9.3), (0.0, 14.0)], 16);
    });
    church.cuboid(dvec3(-25.0, -4.0, -4.0), dvec3(-17.0, 4.0, 30.0));
    church.part(&upright(1.0 / 16.0, -21.0, 0.0, 0.0), |spire| {
        spire.revolve(&[(5.2, 29.5), (3.2, 34.0), (0.15, 62.0), (0.0, 64.0)], 8);
    });
}

/// A power line on lattice masts over the hills, its wires sagging between them.
fn power_line(mesh: &mut MeshBuilder) {
    let masts = 10;
    let foot = |k: usize| {
        let x = 70.0 + 255.0 * k as f64;
        let y = 220.0 + 26.0 * k as f64;
        dvec3(x, y, ground(x, y))
    };
    // The arms point across the line.
    let along = (foot(1) - foot(0)).with_z(0.0).normalize();
    let across = DMat3::from_cols(DVec3::Z.cross(along), -along, DVec3::Z);
    for k in 0..masts {
        mesh.part(&placed(across, foot(k)), mast);
        if k + 1 == masts {
            continue;
        }
        for (aside, height) in [(-8.0, 30.0), (8.0, 30.0), (-6.0, 38.0), (6.0, 38.0), (0.0, 46.0)] {
            let end = |k: usize| foot(k) + across * dvec3(aside, 0.0, height);
            let path: Vec<_> = (0..=8)
                .map(|i| fraction(i, 8))
                .map(|t| end(k).lerp(end(k + 1), t) - DVec3::Z * (36.0 * t * (1.0 - t)))
                .collect();
            mesh.sweep(&path, DVec3::Z, &circle(0.03, 3));
        }
    }
}

/// A lattice mast of thin bars: four legs, cross braces in every storey, two arms.
fn mast(mast: &mut MeshBuilder) {
    let storeys = 5;
    let corner = |k: usize, storey: usize| {
        let t = fraction(storey, storeys);
        let (c, s) = cos_sin(fraction(2 * k + 1, 8));
        dvec3(c, s, 0.0) * (4.2 * (1.0 - t) + 0.7) + DVec3::Z * (46.0 * t)
    };
    for k in 0..4 {
        mast.bar(corner(k, 0), corner(k, storeys), 0.11, 4);
        for storey in 0..storeys {
            mast.bar(corner(k, storey), corner(k + 1, storey + 1), 0.05, 3);
            mast.bar(corner(k + 1, storey), corner(k, storey + 1), 0.05, 3);
        }
    }
    for (reach, height) in [(8.0, 30.0), (6.0, 38.0)] {
        for y in [-0.6, 0.6] {
            for side in [-1.0, 1.0] {
                mast.bar(dvec3(0.0, y, height + 2.0), dvec3(side * reach, 0.0, height), 0.06, 4);
            }
        }
    }
}

/// Firs on the slopes: a pyramid on a thin trunk.
fn forest(mesh: &mut MeshBuilder) {
    for k in 0..520 {
        // The recurrence of the plastic number spreads the trees evenly.
        let [u, v] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2].map(|step| {
            let place = 0.5 + step * k as f64;
            place - place.floor()
        });
        let x = SIZE.0 * u;
        let y = SIZE.1 * v;
        // No tree grows on the town and on the railway.
        let aside = y - course(x);
        if (-120.0..420.0).contains(&aside) {
            continue;
        }
        let height = 17.0 + 6.0 * jitter(30, k);
        mesh.part(&upright(jitter(31, k), x, y, ground(x, y)), |fir| {
            fir.revolve(&[(0.3, -1.0), (0.3, 3.0)], 3);
            fir.revolve(&[(0.24 * height, 2.5), (0.0, height)], 6);
        });
    }
}
