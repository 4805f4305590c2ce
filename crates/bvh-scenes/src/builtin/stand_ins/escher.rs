//! Stand-in for escher: staircases that interlock under three directions of gravity.
//!
//! The model is the print 'Relativity'. Each gravity has its own flights, landings, arcade and
//! balustrades in one room. The flights differ in length, place and bearing, so that no symmetry of
//! the axes decides a split. Walls and floors are a few large polygons. World units are chosen so
//! that the greedy MF tree costs about 4.8e5, like the original's.

use super::mesh_builder::{
    MeshBuilder, about_z, circle, cos_sin, fraction, half_circle, on_circle, placed, upright,
};
use bvh_core::Triangle;
use glam::{DMat3, DVec3, dvec3};

/// World units per tread depth.
const UNIT: f64 = 2.17;
/// Height of a step, in tread depths.
const RISE: f64 = 0.62;
/// Height of a handrail, in tread depths.
const RAIL: f64 = 2.6;
/// Side of the room, in tread depths.
const ROOM: f64 = 30.0;

pub fn triangles() -> Vec<Triangle> {
    let mut room = MeshBuilder::default();
    // Each cyclic permutation of the axes sends 'up' to a different axis.
    let gravities = [
        DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::Z),
        DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
        DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y),
    ];
    let plans = [
        Plan { steps: [13, 9], width: 3.6, at: [3.0, 4.5], turn: 0.038, bays: 3, beneath: true },
        Plan { steps: [10, 11], width: 3.0, at: [7.0, 9.0], turn: -0.061, bays: 2, beneath: false },
        Plan { steps: [15, 7], width: 2.6, at: [2.0, 14.0], turn: 0.094, bays: 4, beneath: true },
    ];
    for (gravity, plan) in gravities.into_iter().zip(&plans) {
        room.part(&placed(gravity, DVec3::ZERO), |mesh| storey(mesh, plan));
    }
    room.part(&upright(0.11, 26.0, 25.5, 0.0), |mesh| spiral(mesh, 22));
    room.finish(UNIT, DVec3::ZERO)
}

struct Plan {
    /// The steps of the first and the second flight.
    steps: [usize; 2],
    width: f64,
    at: [f64; 2],
    /// The bearing of the oblique flight, in turns.
    turn: f64,
    bays: usize,
    /// Whether the undersides of flights are stairs too.
    beneath: bool,
}

/// One gravity's floor, flights, landings and arcade; up is z.
fn storey(storey: &mut MeshBuilder, plan: &Plan) {
    storey.grid(3, 2, &|i, j| dvec3(fraction(i, 3), fraction(j, 2), 0.0) * ROOM);

    // The first flight leads along x to a landing, the second along y to a gallery, and the third
    // down at an oblique angle.
    let &Plan { steps: [first, second], width, at: [x, y], turn, bays, beneath } = plan;
    let deep = width + 1.0;
    let low = first as f64 * RISE;
    let high = (first + second) as f64 * RISE;
    let corner = x + first as f64;
    storey.part(&upright(0.0, x, y, 0.0), |mesh| flight(mesh, first, width, beneath));
    landing(storey, dvec3(corner, y, low), deep, width);
    let second_foot = upright(0.25, corner + deep, y + width, low);
    storey.part(&second_foot, |mesh| flight(mesh, second, width, false));
    let gallery = y + width + second as f64;
    landing(storey, dvec3(corner, gallery, high), deep, deep);
    let down = high - 8.0 * RISE;
    let (c, s) = cos_sin(0.5 + turn);
    // The descending flight is an ascending flight that begins at its foot.
    let foot = dvec3(corner + 8.0 * c, gallery + 8.0 * s + width, down);
    let third_foot = upright(turn, foot.x, foot.y - width, foot.z);
    storey.part(&third_foot, |mesh| flight(mesh, 8, width, beneath));
    landing(storey, foot + dvec3(-3.0, -width, 0.0), 3.0, width);

    // The arcade that carries the gallery, a doorway in the back wall, and a free-standing oblique
    // gate.
    for bay in 0..bays {
        let x = corner + deep - 2.2 - 4.4 * bay as f64;
        let place = upright(0.0, x, gallery + deep, 0.0);
        storey.part(&place, |mesh| gate(mesh, 1.7, 2.2, high - 3.3, 9));
    }
    storey.part(&upright(0.25, ROOM - 0.5, y + 11.0, 0.0), |mesh| gate(mesh, 1.9, 4.0, 4.2, 14));
    let oblique = upright(2.6 * turn, x + 6.0, y + 9.0, 0.0);
    storey.part(&oblique, |mesh| gate(mesh, 1.4, 2.0, 3.1, 10));
}

/// A flight of `steps` along x with balustrades on both sides; its underside is a slope or, upside
/// down, stairs too.
fn flight(flight: &mut MeshBuilder, steps: usize, width: f64, beneath: bool) {
    let run = steps as f64;
    let at = |x: f64, y: f64, z: f64| dvec3(x, y, z * RISE);
    let depth = 2.5;
    // Across the flight, between two points in its side.
    let across = |flight: &mut MeshBuilder, [x0, z0]: [f64; 2], [x1, z1]: [f64; 2]| {
        flight.quad(at(x0, 0.0, z0), at(x0, width, z0), at(x1, width, z1), at(x1, 0.0, z1));
    };
    for k in 0..steps {
        let x = k as f64;
        let next = x + 1.0;
        across(flight, [x, x], [x, next]);
        across(flight, [x, next], [next, next]);
        if beneath {
            across(flight, [x, x - depth], [next, x - depth]);
            across(flight, [next, x - depth], [next, next - depth]);
        }
        for y in [0.0, width] {
            flight.triangle(at(x, y, x), at(next, y, next), at(x, y, next));
            if beneath {
                let low = at(x, y, x - depth);
                flight.triangle(low, at(next, y, x - depth), at(next, y, next - depth));
            }
        }
    }
    for y in [0.0, width] {
        flight.quad(at(0.0, y, 0.0), at(run, y, run), at(run, y, run - depth), at(0.0, y, -depth));
    }
    if !beneath {
        across(flight, [0.0, -depth], [run, run - depth]);
    }
    for y in [0.15, width - 0.15] {
        let feet: Vec<_> = (0..steps).map(|k| at(k as f64 + 0.5, y, k as f64 + 1.0)).collect();
        balustrade(flight, &feet);
    }
}

/// A slab with its near corner at `corner`, its top at that height, and a balustrade along its far
/// side.
fn landing(mesh: &mut MeshBuilder, corner: DVec3, length: f64, width: f64) {
    mesh.cuboid(corner - DVec3::Z * 0.8, corner + dvec3(length, width, 0.0));
    let posts = (length / 0.9) as usize;
    let feet: Vec<_> = (0..=posts)
        .map(|k| corner + dvec3(0.2 + fraction(k, posts) * (length - 0.4), 0.2, 0.0))
        .collect();
    balustrade(mesh, &feet);
}

/// Square balusters set on the diagonal at `feet`, a handrail over them, and a turned newel at
/// either end.
fn balustrade(mesh: &mut MeshBuilder, feet: &[DVec3]) {
    let up = DVec3::Z * RAIL;
    for &foot in feet {
        mesh.part(&upright(0.0, foot.x, foot.y, foot.z), |baluster| {
            baluster.revolve(&[(0.08, 0.0), (0.08, RAIL)], 4);
        });
    }
    let [first, .., last] = *feet else { return };
    let rail =
        [(0.16, -0.08), (0.16, 0.06), (0.07, 0.14), (-0.07, 0.14), (-0.16, 0.06), (-0.16, -0.08)];
    mesh.sweep(&[first + up, last + up], DVec3::Z, &rail);
    let newel = [(0.2, -0.4), (0.2, 2.2), (0.13, 2.4), (0.13, 2.8), (0.24, 3.0), (0.0, 3.3)];
    for (end, turns) in [(first, 0.03), (last, 0.07)] {
        mesh.part(&upright(turns, end.x, end.y, end.z), |mesh| mesh.revolve(&newel, 5));
    }
}

/// An arch on two square piers of height `pier`, with a moulding around it; stands on z = 0, passes
/// along y.
fn gate(gate: &mut MeshBuilder, radius: f64, half_width: f64, pier: f64, segments: usize) {
    gate.part(&placed(DMat3::IDENTITY, DVec3::Z * pier), |arch| {
        arch.arch(radius, half_width, radius + 0.8, 1.0, segments);
        let path = half_circle(segments, |c, s| dvec3(radius * c, -0.5, radius * s));
        arch.sweep(&path, DVec3::Y, &[(0.0, 0.0), (0.0, -0.12), (-0.12, -0.2), (-0.24, 0.0)]);
    });
    for (low, high) in [(-half_width, -radius), (radius, half_width)] {
        gate.cuboid(dvec3(low, -0.5, 0.0), dvec3(high, 0.5, pier - 0.2));
        gate.cuboid(dvec3(low - 0.1, -0.6, pier - 0.2), dvec3(high + 0.1, 0.6, pier));
    }
}

/// A spiral stair of `steps` wedges about a column, with a winding handrail.
fn spiral(spiral: &mut MeshBuilder, steps: usize) {
    let per_step = 0.062;
    let rise = 0.9;
    let radius = 3.4;
    let height = steps as f64 * rise;
    let foot = [(0.7, 0.0), (0.7, 0.3), (0.45, 0.6)];
    let head = [(0.45, height), (0.6, height + 0.3), (0.0, height + 1.2)];
    spiral.revolve(&[foot, head].concat(), 12);
    for k in 0..steps {
        let z = (k + 1) as f64 * rise;
        let mut wedge = |drop: f64| {
            let edge = |r: f64, end: usize| on_circle(r, (k + end) as f64 * per_step, z - drop);
            let corners = [edge(0.4, 0), edge(radius, 0), edge(radius, 1), edge(0.4, 1)];
            spiral.polygon(&corners);
            corners
        };
        let top = wedge(0.0);
        let bottom = wedge(0.25);
        for (i, j) in [(0, 1), (1, 2), (2, 3)] {
            spiral.quad(top[i], top[j], bottom[j], bottom[i]);
        }
    }
    let rail: Vec<_> = (0..=steps)
        .map(|k| {
            on_circle(radius - 0.2, (k as f64 + 0.5) * per_step, k as f64 * rise + rise + RAIL)
        })
        .collect();
    for (k, &top) in rail.iter().enumerate().take(steps) {
        spiral.part(&placed(about_z(k as f64 * per_step), top), |rod| {
            rod.revolve(&[(0.06, -RAIL), (0.06, 0.0)], 5);
        });
    }
    spiral.sweep(&rail, DVec3::Z, &circle(0.14, 7));
}
