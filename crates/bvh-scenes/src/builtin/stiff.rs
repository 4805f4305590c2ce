//! The stiff and extreme scenes. Each is a function of the number of objects, with the identifier
//! of its case.
//!
//! All scenes consist of triangles, so that rays can be traced; a scene of boxes has in each box
//! the triangle over its diagonal. The same number gives the same scene on every machine.

pub use bvh_core::boxes;
use bvh_core::{Aabb, Triangle};
use glam::Vec3;
use rand::rngs::ChaCha8Rng;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};

/// Generates a scene with this number of triangles, or with about this number if that is
/// impossible.
pub type Generator = fn(usize) -> Vec<Triangle>;

/// Every stiff scene by the identifier of the case that builds and traces it. Several cases may
/// have the same scene. Cases that are not listed test rays, errors, files or threads.
pub const STIFF: [(&str, Generator); 31] = [
    ("S01", uniform),
    ("S02", uniform),
    ("S03", uniform),
    ("S04", identical_boxes),
    ("S05", identical_points),
    ("S06", concentric),
    ("S07", identical_boxes),
    ("S08", collinear_centres),
    ("S09", planar_grid),
    ("S10", on_a_line),
    ("S11", facets),
    ("S12", closed_box),
    ("S13", closed_box),
    ("S14", closed_box),
    ("S17", degenerate),
    ("S21", uniform),
    ("S22", denormal),
    ("S23", enormous),
    ("S24", far_away),
    ("S25", powers_of_two),
    ("S26", sorted),
    ("S27", teapot_in_a_stadium),
    ("S28", giant_over_small),
    ("S29", slivers),
    ("S30", overlapping),
    ("S31", two_densities),
    ("S32", symmetric),
    ("S33", uniform),
    ("S34", tenfold),
    ("S36", uniform),
    ("S45", two_cubes),
];

/// Returns the generator of the case `id`, such as `S34`.
pub fn by_id(id: &str) -> Option<Generator> {
    STIFF.iter().find(|(known, _)| *known == id).map(|(_, generator)| *generator)
}

fn diagonal(Aabb { min, max }: Aabb) -> Triangle {
    Triangle([min, max, Vec3::new(max.x, min.y, max.z)])
}

fn cube(min: Vec3, size: f32) -> Triangle {
    diagonal(Aabb { min, max: min + size })
}

/// Draws a uniform point in the cube from 0 to `size`.
fn point(rng: &mut ChaCha8Rng, size: f32) -> Vec3 {
    Vec3::from([(); 3].map(|()| rng.random::<f32>())) * size
}

/// Draws a triangle with this corner and edges of at most `size` along every axis.
fn around(rng: &mut ChaCha8Rng, corner: Vec3, size: f32) -> Triangle {
    Triangle([corner, corner + point(rng, size), corner + point(rng, size)])
}

fn many(
    n: usize,
    salt: u64,
    mut make: impl FnMut(&mut ChaCha8Rng, usize) -> Triangle,
) -> Vec<Triangle> {
    let mut rng = ChaCha8Rng::seed_from_u64(salt);
    (0..n).map(|i| make(&mut rng, i)).collect()
}

fn shuffled(n: usize, salt: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(salt));
    order
}

fn moved(triangles: Vec<Triangle>, place: impl Fn(Vec3) -> Vec3) -> Vec<Triangle> {
    triangles.into_iter().map(|t| Triangle(t.0.map(&place))).collect()
}

/// Small triangles at uniform positions. All coordinates are within 1 to 18.
pub fn uniform(n: usize) -> Vec<Triangle> {
    many(n, 1, |rng, _| {
        let corner = point(rng, 16.0) + 1.0;
        around(rng, corner, 0.5)
    })
}

/// S04, S07: the same box n times.
pub fn identical_boxes(n: usize) -> Vec<Triangle> {
    vec![cube(Vec3::splat(0.1), 1.0); n]
}

/// S05: the same point n times.
pub fn identical_points(n: usize) -> Vec<Triangle> {
    vec![cube(Vec3::splat(0.1), 0.0); n]
}

/// S06: boxes around one centre, each larger than the one before.
pub fn concentric(n: usize) -> Vec<Triangle> {
    (1..=n).map(|i| cube(Vec3::splat(-(i as f32)), 2.0 * i as f32)).collect()
}

/// S08: boxes of sizes 1 to 9 with centres on the x axis, in random order.
pub fn collinear_centres(n: usize) -> Vec<Triangle> {
    let make = |i: usize| {
        let half = Vec3::new(1.0, (1 + i % 5) as f32, (1 + i % 9) as f32) / 2.0;
        let center = Vec3::X * (3 * i) as f32;
        diagonal(Aabb { min: center - half, max: center + half })
    };
    shuffled(n, 8).into_iter().map(make).collect()
}

/// S09: one triangle in every cell of a square grid in a plane, row by row.
pub fn planar_grid(n: usize) -> Vec<Triangle> {
    let side = n.isqrt().max(1);
    (0..n)
        .map(|i| Vec3::new((i % side) as f32, (i / side) as f32, 0.0))
        .map(|corner| Triangle([corner, corner + Vec3::X, corner + Vec3::Y]))
        .collect()
}

/// S10: segments on the x axis, in random order.
pub fn on_a_line(n: usize) -> Vec<Triangle> {
    shuffled(n, 10)
        .into_iter()
        .map(|i| Triangle([0.0, 1.0, 0.5].map(|x| Vec3::X * (2.0 * i as f32 + x))))
        .collect()
}

/// S11: facets parallel to the three coordinate planes.
pub fn facets(n: usize) -> Vec<Triangle> {
    many(n, 11, |rng, i| {
        let corner = point(rng, 16.0);
        let (a, b) = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)][i % 3];
        Triangle([corner, corner + a, corner + b])
    })
}

/// S12 to S16: the surface of the cube from -1 to 1: six faces of equal squares with two triangles
/// each, and at least 12 triangles.
pub fn closed_box(n: usize) -> Vec<Triangle> {
    let cells = (n / 12).isqrt().max(1);
    let mut triangles = Vec::new();
    for face in 0..6 {
        let corner = |column: usize, row: usize| {
            let u = 2.0 * column as f32 / cells as f32 - 1.0;
            let v = 2.0 * row as f32 / cells as f32 - 1.0;
            let w = if face < 3 { -1.0 } else { 1.0 };
            [Vec3::new(w, u, v), Vec3::new(v, w, u), Vec3::new(u, v, w)][face % 3]
        };
        for (u, v) in (0..cells * cells).map(|i| (i % cells, i / cells)) {
            let a = corner(u, v);
            let b = corner(u + 1, v);
            let c = corner(u + 1, v + 1);
            let d = corner(u, v + 1);
            triangles.extend([Triangle([a, b, c]), Triangle([a, c, d])]);
        }
    }
    triangles
}

/// S17: every second triangle has three equal, two equal or collinear corners.
pub fn degenerate(n: usize) -> Vec<Triangle> {
    many(n, 17, |rng, i| {
        // Multiples of eighths are exact, so that the corners are truly collinear.
        let [a, b, c] = [(); 3].map(|()| point(rng, 64.0).round() / 8.0);
        match i % 6 {
            1 => Triangle([a; 3]),
            3 => Triangle([a, b, a]),
            5 => Triangle([a, a + (b - a) * 2.0, b]),
            _ => Triangle([a, a + (b - a) / 8.0, a + (c - a) / 8.0]),
        }
    })
}

/// S22: every coordinate is denormal.
pub fn denormal(n: usize) -> Vec<Triangle> {
    moved(uniform(n), |p| (p * 64.0).round() * f32::from_bits(1))
}

/// S23: coordinates up to ±3e38.
pub fn enormous(n: usize) -> Vec<Triangle> {
    moved(uniform(n), |p| (p - 9.5) * (3e38 / 8.5))
}

/// S24: details of size 1 at the offset 1e6, where they are coarse, and at 1e8, where they vanish.
pub fn far_away(n: usize) -> Vec<Triangle> {
    let offsets = [1e6_f32, 1e8].into_iter().cycle();
    uniform(n).iter().zip(offsets).map(|(t, offset)| Triangle(t.0.map(|p| p + offset))).collect()
}

/// S25: cubes at 2^k with sides of 2^k / 4, from small to large. At most 250 objects are distinct.
pub fn powers_of_two(n: usize) -> Vec<Triangle> {
    let low = -(n as i32) / 2;
    (0..n as i32)
        .map(|i| 2f32.powi((low + i).clamp(-124, 125)))
        .map(|x| cube(Vec3::splat(x), x / 4.0))
        .collect()
}

/// S26: the uniform scene, sorted along x.
pub fn sorted(n: usize) -> Vec<Triangle> {
    let mut triangles = uniform(n);
    triangles.sort_by(|a, b| a.0[0].x.total_cmp(&b.0[0].x));
    triangles
}

/// Triangles of the stadium.
pub const STADIUM: usize = 48;

/// S27: a ball of small triangles on the floor of a box that is a million times larger. The
/// triangles of the box come first.
pub fn teapot_in_a_stadium(n: usize) -> Vec<Triangle> {
    // The ball is at the origin, where it keeps its detail, and not at the middle of the floor.
    let mut triangles = moved(closed_box(STADIUM), |p| (p + Vec3::new(0.37, -0.21, 1.0)) * 5e5);
    triangles.extend(many(n.saturating_sub(STADIUM), 27, |rng, _| {
        let corner = (point(rng, 2.0) - 1.0).normalize_or(Vec3::X) * 0.5 + Vec3::Z * 0.5;
        around(rng, corner, 0.05)
    }));
    triangles.truncate(n);
    triangles
}

/// S28: one triangle over all other triangles.
pub fn giant_over_small(n: usize) -> Vec<Triangle> {
    let mut triangles = uniform(n);
    if let Some(first) = triangles.first_mut() {
        *first = Triangle([Vec3::ZERO, Vec3::new(40.0, 0.0, 20.0), Vec3::new(0.0, 40.0, 40.0)]);
    }
    triangles
}

/// S29: triangles in all directions whose length is a million times their width.
pub fn slivers(n: usize) -> Vec<Triangle> {
    many(n, 29, |rng, _| {
        let a = point(rng, 100.0);
        let along = point(rng, 2.0) - 1.0;
        let across = point(rng, 2.0) - 1.0;
        let length = 100.0;
        Triangle([
            a,
            a + along.normalize_or(Vec3::X) * length,
            a + across.normalize_or(Vec3::Y) * length * 1e-6,
        ])
    })
}

/// S30: triangles with corners anywhere in the scene, so that most triangles overlap.
pub fn overlapping(n: usize) -> Vec<Triangle> {
    many(n, 30, |rng, _| Triangle([(); 3].map(|()| point(rng, 16.0))))
}

/// S31: half of the objects in a cube of side 0.001, half in one of side 1000.
pub fn two_densities(n: usize) -> Vec<Triangle> {
    many(n, 31, |rng, i| {
        let size = if i % 2 == 0 { 1e-3 } else { 1e3 };
        let corner = point(rng, size) + size;
        around(rng, corner, size / 50.0)
    })
}

/// S32: every second box is the reflection of the previous box in the origin. No two boxes have the
/// same centre along any axis.
pub fn symmetric(n: usize) -> Vec<Triangle> {
    let half = uniform(n.div_ceil(2));
    let all = half.iter().flat_map(|t| [*t, Triangle(t.0.map(|p| -p))]);
    all.take(n).collect()
}

/// S34: the uniform scene with every triangle ten times in succession.
pub fn tenfold(n: usize) -> Vec<Triangle> {
    uniform(n.div_ceil(10)).into_iter().flat_map(|t| [t; 10]).take(n).collect()
}

/// S45: two unit cubes whose centres are two apart.
pub fn two_cubes(n: usize) -> Vec<Triangle> {
    [0.0, 2.0].map(|x| cube(Vec3::X * x, 1.0)).into_iter().take(n).collect()
}
