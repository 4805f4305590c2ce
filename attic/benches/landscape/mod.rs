//! Landscapes of any size: what lies outside of rooms, for measurements on many triangles.
//!
//! `y` is up, and one unit is about a metre. Every call gives the same bytes on every machine.

use bvh_core::{Primitives, Triangle};
use bvh_scenes::builtin::stand_ins::{cos_sin, jitter};
use bvh_scenes::{Scene, SceneError, SceneKind};
use glam::{DVec3, Vec3};

/// The number of triangles of a tree: the trunk and the leaves.
const TREE: usize = 2 * TRUNK_SIDES + 380;
/// The number of sides of a trunk.
const TRUNK_SIDES: usize = 10;
/// The edge of the square of ground that one tree has.
const GLADE: f64 = 6.0;
/// The edge of the square of ground that one building has.
const PLOT: f64 = 40.0;

/// Generates a landscape of `N` triangles by its name, `city:N` or `forest:N`, or loads any other
/// scene.
pub fn load(name: &str) -> Result<Scene, SceneError> {
    let (kind, count) = name.split_once(':').unwrap_or((name, ""));
    let generator = match kind {
        "city" => city,
        "forest" => forest,
        _ => return Scene::load(name),
    };
    let Ok(count) = count.parse() else { return Scene::load(name) };
    Ok(Scene::new(name, SceneKind::Procedural, Primitives::Triangles(generator(count))))
}

/// Hills and valleys with ridges down to a metre: a square grid of `count` triangles, whose last
/// row may be incomplete.
fn terrain(count: usize) -> Vec<Triangle> {
    let columns = (count as f64 / 2.0).sqrt().ceil() as usize;
    let row = |z: usize| -> Vec<Vec3> {
        (0..=columns)
            .map(|x| {
                let x = x as f64;
                let z = z as f64;
                DVec3::new(x, height(x, z), z).as_vec3()
            })
            .collect()
    };
    let mut triangles = Vec::with_capacity(count + 2 * columns);
    let mut near = row(0);
    let mut rows = 1..;
    while triangles.len() < count {
        let far = row(rows.next().unwrap_or_default());
        for (a, b) in near.windows(2).zip(far.windows(2)) {
            triangles.push(Triangle([a[0], b[0], a[1]]));
            triangles.push(Triangle([a[1], b[0], b[1]]));
        }
        near = far;
    }
    triangles.truncate(count);
    triangles
}

/// Trees with slender leaves on a square of hills. One triangle in nine is ground.
fn forest(count: usize) -> Vec<Triangle> {
    let trees = (count - count / 9).div_ceil(TREE);
    let columns = (trees as f64).sqrt().ceil().max(1.0) as usize;
    let ground = count / 9;
    // The terrain is scaled to the square that the trees fill.
    let cells = (ground as f64 / 2.0).sqrt().ceil().max(1.0);
    let scale = (columns as f64 * GLADE / cells) as f32;
    let mut triangles = Vec::with_capacity(count);
    triangles.extend(
        terrain(ground)
            .iter()
            .map(|Triangle(corners)| Triangle(corners.map(|corner| corner * scale))),
    );
    for tree in 0..trees {
        let shift = |stream| 0.5 + 0.35 * jitter(stream, tree);
        let x = ((tree % columns) as f64 + shift(31)) * GLADE;
        let z = ((tree / columns) as f64 + shift(32)) * GLADE;
        let scale = f64::from(scale);
        let foot = DVec3::new(x, scale * height(x / scale, z / scale) - 0.5, z);
        plant(&mut triangles, tree, foot);
    }
    triangles.truncate(count);
    triangles
}

fn plant(triangles: &mut Vec<Triangle>, tree: usize, foot: DVec3) {
    let tall = 9.0 + 4.0 * jitter(33, tree);
    let top = foot + DVec3::new(jitter(34, tree), tall, jitter(35, tree));
    let around = |center: DVec3, radius: f64, side: usize| {
        let (c, s) = cos_sin(side as f64 / TRUNK_SIDES as f64);
        center + DVec3::new(radius * c, 0.0, radius * s)
    };
    for side in 0..TRUNK_SIDES {
        let [a, b] = [side, side + 1].map(|side| around(foot, 0.35, side));
        let [c, d] = [side, side + 1].map(|side| around(top, 0.08, side));
        triangles.push(Triangle([a, c, b].map(|corner| corner.as_vec3())));
        triangles.push(Triangle([b, c, d].map(|corner| corner.as_vec3())));
    }
    for leaf in 0..TREE - 2 * TRUNK_SIDES {
        let draw = |stream| jitter(stream, tree * TREE + leaf);
        // Most leaves are at the surface of the crown.
        let up = draw(36);
        let (c, s) = cos_sin(draw(37));
        let reach = 0.35 * tall * (0.6 + 0.4 * draw(38).abs());
        let flat = (1.0 - up * up).sqrt() * reach;
        let center = foot + DVec3::new(flat * c, tall * 0.7 + up * reach, flat * s);
        let along = DVec3::new(draw(39), draw(40) - 0.5, draw(41)) * 0.5;
        let across = DVec3::new(draw(42), draw(43), draw(44)) * 0.06;
        let corners = [center - along, center + along, center + across];
        triangles.push(Triangle(corners.map(|corner| corner.as_vec3())));
    }
}

/// Streets between buildings of 3 to 40 floors, each wall a grid of panes.
fn city(count: usize) -> Vec<Triangle> {
    let mut triangles = Vec::with_capacity(count + (1 << 14));
    // Buildings follow a spiral of squares, so that every size is a compact city.
    let mut place = [0i64; 2];
    let mut step = [1i64, 0];
    let mut left = 1;
    let mut length = 1;
    for building in 0.. {
        if triangles.len() >= count {
            break;
        }
        build(&mut triangles, building, place);
        place = [place[0] + step[0], place[1] + step[1]];
        left -= 1;
        if left == 0 {
            // Every second turn lengthens the sides.
            length += i64::from(step[0] == 0);
            step = [-step[1], step[0]];
            left = length;
        }
    }
    triangles.truncate(count);
    triangles
}

/// Adds the building of this number on its plot, with the street around it.
fn build(triangles: &mut Vec<Triangle>, building: usize, place: [i64; 2]) {
    let draw = |stream| 0.5 + 0.5 * jitter(stream, building);
    let floors = 3 + (37.0 * draw(51) * draw(52)) as usize;
    let size = [52, 53].map(|stream| 12.0 + 20.0 * draw(stream + 2));
    let origin = DVec3::new(place[0] as f64 * PLOT, 0.0, place[1] as f64 * PLOT);
    let tall = 3.2 * floors as f64;
    let inset = |axis: usize| (PLOT - size[axis]) / 2.0;
    let low = origin + DVec3::new(inset(0), 0.0, inset(1));
    let [x, y, z] = [DVec3::X * size[0], DVec3::Y * tall, DVec3::Z * size[1]];
    let [along_x, along_z] = size.map(|size| (size / 2.5) as usize);
    quads(triangles, low, [x, y], [along_x, floors]);
    quads(triangles, low + z, [x, y], [along_x, floors]);
    quads(triangles, low, [z, y], [along_z, floors]);
    quads(triangles, low + x, [z, y], [along_z, floors]);
    quads(triangles, low + y, [x, z], [2, 2]);
    quads(triangles, origin, [DVec3::X * PLOT, DVec3::Z * PLOT], [4, 4]);
}

/// Adds a parallelogram of this many quads along its two edges.
fn quads(triangles: &mut Vec<Triangle>, corner: DVec3, edges: [DVec3; 2], counts: [usize; 2]) {
    let point = |i: usize, j: usize| {
        let [u, v] = [i as f64 / counts[0] as f64, j as f64 / counts[1] as f64];
        (corner + edges[0] * u + edges[1] * v).as_vec3()
    };
    for j in 0..counts[1] {
        for i in 0..counts[0] {
            let [a, b] = [point(i, j), point(i + 1, j)];
            let [c, d] = [point(i, j + 1), point(i + 1, j + 1)];
            triangles.push(Triangle([a, b, c]));
            triangles.push(Triangle([c, b, d]));
        }
    }
}

/// Returns the height of the ground: value noise whose waves are 512 to 2 units long.
fn height(x: f64, z: f64) -> f64 {
    let mut sum = 0.0;
    for octave in 1..=9 {
        let length = f64::from(1 << octave);
        let [u, v] = [x / length, z / length];
        let [left, near] = [u.floor(), v.floor()];
        let [s, t] = [u - left, v - near].map(|w| w * w * (3.0 - 2.0 * w));
        let at = |right: usize, far: usize| {
            jitter(20 + octave, (left as usize + right) + (near as usize + far) * 65_537)
        };
        let low = at(0, 0) + (at(1, 0) - at(0, 0)) * s;
        let high = at(0, 1) + (at(1, 1) - at(0, 1)) * s;
        sum += (low + (high - low) * t) * 0.12 * length;
    }
    sum
}
