//! Scenes, trees and rays for the tests of traversals.

pub mod layouts;
pub mod rational;

pub use bvh_core::boxes;
use bvh_core::{
    Aabb, Bvh, Hit, Node, PreparedRay, Ray, Triangle, any_hit_of_all, nearest_hit_of_all,
};
use glam::{Quat, Vec3};
use std::collections::VecDeque;

/// SplitMix64 (Steele, Lea & Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// Returns a uniform number in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Returns a uniform point in the cube from -1 to 1.
    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }
}

/// The shape of a test tree: inner nodes have 2 to `arity` children, and leaves have up to `leaf`
/// objects. `sorted` trees split by position, other trees at random.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub arity: usize,
    pub leaf: usize,
    pub sorted: bool,
}

pub const SHAPES: [Shape; 5] = [
    Shape { arity: 2, leaf: 1, sorted: true },
    Shape { arity: 2, leaf: 5, sorted: true },
    Shape { arity: 2, leaf: 1, sorted: false },
    Shape { arity: 7, leaf: 3, sorted: true },
    Shape { arity: 40, leaf: 2, sorted: false },
];

/// Builds a tree over the boxes.
pub fn tree(boxes: &[Aabb], shape: Shape, random: &mut Random) -> Bvh {
    let mut ids: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut tree = Bvh::default();
    let mut open = VecDeque::new();
    if !ids.is_empty() {
        tree.nodes.push(Node::leaf(Aabb::EMPTY, 0, 1));
        open.push_back((0, 0..ids.len()));
    }
    while let Some((node, range)) = open.pop_front() {
        if range.len() <= shape.leaf && (range.len() == 1 || random.below(4) > 0) {
            tree.nodes[node] = Node::leaf(Aabb::EMPTY, range.start as u32, range.len() as u32);
            continue;
        }
        if shape.sorted {
            let axis = random.below(3);
            let key = |id: &u32| boxes[*id as usize].doubled_centroid()[axis];
            ids[range.clone()].sort_by(|a, b| key(a).total_cmp(&key(b)));
        }
        let arity = (2 + random.below(shape.arity - 1)).min(range.len());
        let mut cuts: Vec<usize> = if shape.sorted {
            (1..arity).map(|i| range.start + i * range.len() / arity).collect()
        } else {
            (1..arity).map(|_| range.start + 1 + random.below(range.len() - 1)).collect()
        };
        cuts.extend([range.start, range.end]);
        cuts.sort_unstable();
        cuts.dedup();
        let first = tree.nodes.len();
        tree.nodes[node] = Node::inner(Aabb::EMPTY, first as u32, cuts.len() as u32 - 1);
        for (i, cut) in cuts.windows(2).enumerate() {
            tree.nodes.push(Node::leaf(Aabb::EMPTY, 0, 1));
            open.push_back((first + i, cut[0]..cut[1]));
        }
    }
    tree.prim_ids = ids;
    tree.refit(boxes);
    tree
}

/// Builds the deepest tree: every inner node has one leaf and the rest.
pub fn chain(boxes: &[Aabb]) -> Bvh {
    let n = boxes.len() as u32;
    let mut nodes = Vec::new();
    for i in 0..n - 1 {
        nodes.extend([Node::inner(Aabb::EMPTY, 2 * i + 1, 2), Node::leaf(Aabb::EMPTY, i, 1)]);
    }
    nodes.push(Node::leaf(Aabb::EMPTY, n - 1, 1));
    let mut tree = Bvh::new(nodes, (0..n).collect());
    tree.refit(boxes);
    tree
}

/// Returns small and large triangles, some of them degenerate, some twice.
pub fn soup(n: usize, random: &mut Random) -> Vec<Triangle> {
    let mut triangles: Vec<Triangle> = Vec::new();
    for i in 0..n {
        let a = random.point();
        let size = random.of(&[0.02, 0.1, 0.5]);
        let b = a + size * random.point();
        let c = a + size * random.point();
        triangles.push(match i % 10 {
            7 => Triangle([a, a, b]),
            8 => Triangle([a, a + Vec3::X, a + Vec3::X * 3.0]),
            9 => triangles[random.below(i)],
            _ => Triangle([a, b, c]),
        });
    }
    triangles
}

/// Returns a cube of side 2 whose faces are grids of axis-parallel triangles: everything is in a
/// face plane.
pub fn grid_box(cells: usize) -> Vec<Triangle> {
    let at = |i: usize| i as f32 * 2.0 / cells as f32 - 1.0;
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            for i in 0..cells {
                for j in 0..cells {
                    let p = |u: usize, v: usize| {
                        let mut p = Vec3::splat(side);
                        (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (at(u), at(v));
                        p
                    };
                    triangles.push(Triangle([p(i, j), p(i + 1, j), p(i, j + 1)]));
                    triangles.push(Triangle([p(i + 1, j + 1), p(i, j + 1), p(i + 1, j)]));
                }
            }
        }
    }
    triangles
}

/// Returns a closed sphere of radius 1: an octahedron whose faces are divided into four `levels`
/// times.
pub fn ball(levels: usize) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for x in [Vec3::X, -Vec3::X] {
        for y in [Vec3::Y, -Vec3::Y] {
            for z in [Vec3::Z, -Vec3::Z] {
                triangles.push(Triangle([x, y, z]));
            }
        }
    }
    for _ in 0..levels {
        triangles = (triangles.iter())
            .flat_map(|&Triangle([a, b, c])| {
                // The sum does not depend on the direction of the edge, so neighbours share the
                // corner exactly.
                let ab = (a + b).normalize();
                let bc = (b + c).normalize();
                let ca = (c + a).normalize();
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]].map(Triangle)
            })
            .collect();
    }
    triangles
}

/// Returns a closed torus whose tube has `sides` and is bent along `rings`.
fn torus(rings: usize, sides: usize) -> Vec<Triangle> {
    let at = |ring: usize, side: usize| {
        let turn = std::f32::consts::TAU;
        let (bent, along) = ((ring % rings) as f32 / rings as f32 * turn).sin_cos();
        let (up, out) = ((side % sides) as f32 / sides as f32 * turn).sin_cos();
        Vec3::new(along * (1.0 + 0.4 * out), bent * (1.0 + 0.4 * out), 0.4 * up)
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for side in 0..sides {
            let [a, b] = [at(ring, side), at(ring + 1, side)];
            let [c, d] = [at(ring + 1, side + 1), at(ring, side + 1)];
            triangles.extend([[a, b, c], [a, c, d]].map(Triangle));
        }
    }
    triangles
}

/// Returns a tetrahedron. One of its edges is divided on one side only, and a triangle without area
/// closes the gap.
pub fn junction() -> Vec<Triangle> {
    let [a, b, c, d] =
        [Vec3::ZERO, Vec3::new(2.0, 4.0, 6.0), 3.0 * Vec3::X, Vec3::new(0.3, 2.0, 0.1)];
    let middle = (a + b) / 2.0;
    [[a, b, c], [a, d, middle], [middle, d, b], [a, middle, b], [a, c, d], [b, d, c]]
        .map(Triangle)
        .to_vec()
}

/// Returns closed meshes, each with a point in its inside. The corners of most of them run in both
/// directions.
pub fn closed_meshes() -> Vec<(&'static str, Vec<Triangle>, Vec3)> {
    let turn = Quat::from_xyzw(0.1, 0.7, -0.3, 0.5).normalize();
    // Neighbours have the same corners, and the same operations move them.
    let turned = |triangles: Vec<Triangle>| mapped(&triangles, |corner| turn * corner);
    let nested = [scaled(&ball(2), 2.0), ball(2)].concat();
    let center = Vec3::new(0.013, -0.02, 0.017);
    let torus_inside = Vec3::new(0.99, 0.02, 0.03);
    vec![
        ("octahedron", ball(0), center),
        ("ball", ball(3), center),
        ("turned ball", turned(ball(2)), center),
        ("box", grid_box(1), center),
        ("grid box", grid_box(4), center),
        ("turned grid box", turned(grid_box(3)), center),
        ("torus", torus(12, 8), torus_inside),
        ("turned torus", turned(torus(9, 7)), turn * torus_inside),
        ("nested balls", nested, Vec3::new(1.5, 0.1, 0.1)),
        ("junction", junction(), Vec3::new(1.2, 1.3, 1.2)),
    ]
}

/// Returns the largest coordinate.
pub fn size(triangles: &[Triangle]) -> f32 {
    let sizes = triangles.iter().flat_map(|t| t.0).map(|p| p.abs().max_element());
    sizes.fold(0.0, f32::max)
}

pub fn mapped(triangles: &[Triangle], f: impl Fn(Vec3) -> Vec3) -> Vec<Triangle> {
    triangles.iter().map(|t| Triangle(t.0.map(&f))).collect()
}

pub fn scaled(triangles: &[Triangle], factor: f32) -> Vec<Triangle> {
    mapped(triangles, |p| p * factor)
}

/// Returns difficult rays: axis-parallel with both zeros, in face planes, along edges, through
/// vertices, edges and centres, from inside, from a corner, with short and with zero-length ranges.
pub fn rays(triangles: &[Triangle], n: usize, random: &mut Random) -> Vec<Ray> {
    let bounds = Aabb::union_of(&boxes(triangles));
    let size = bounds.extent().max_element() as f32;
    let unit = Vec3::splat(size);
    let mut rays = Vec::new();
    while rays.len() < n {
        let Triangle([a, b, c]) = random.of(triangles);
        let zero = random.of(&[0.0, -0.0]);
        let mut along_axis = Vec3::new(zero, random.of(&[0.0, -0.0]), zero);
        along_axis[random.below(3)] = random.of(&[1.0, -1.0, 3.0]);
        let target = match random.below(5) {
            0 => a,
            1 => (a + b) * 0.5,
            2 => a + (b - a) * random.unit(),
            3 => (a + b + c) / 3.0,
            _ => bounds.min + (bounds.max - bounds.min) * ((random.point() + 1.0) * 0.5),
        };
        let inside = bounds.min + (bounds.max - bounds.min) * ((random.point() + 1.0) * 0.5);
        let mut almost = along_axis;
        almost[random.below(3)] += random.of(&[1e-7, 1e-30, -1e-42, 1.0]);
        let (origin, direction) = match random.below(9) {
            0 => (target - along_axis * size, along_axis),
            1 => (target, along_axis),
            2 => (target + (b - a), (b - a) / size),
            3 => (a - (b - a), (b - a) / size),
            4 => (inside, (target - inside) / size),
            5 => (random.point() * unit * 2.0, Vec3::ZERO),
            6 => (random.point() * unit * 20.0, Vec3::ZERO),
            7 => (target - almost * size, almost),
            _ => (inside, random.point()),
        };
        let direction = if direction == Vec3::ZERO { (target - origin) / size } else { direction };
        let length = size * random.unit();
        let (t_min, t_max) = match random.below(8) {
            0 => (0.0, length),
            1 => (length, f32::INFINITY),
            2 => (length, length),
            3 => (size, length),
            _ => (0.0, f32::INFINITY),
        };
        rays.extend(Ray::new(origin, direction, t_min, t_max));
    }
    rays
}

/// Returns the answer of testing every triangle.
pub fn brute_force(triangles: &[Triangle], ray: &Ray) -> Option<Hit> {
    let prepared = PreparedRay::new(ray);
    let test = |id: u32, t_max| triangles[id as usize].intersect(&prepared, t_max);
    let objects = triangles.len() as u32;
    let nearest = nearest_hit_of_all(objects, ray, test, &mut ());
    let any = any_hit_of_all(objects, |id| test(id, ray.t_max()).is_some(), &mut ());
    assert_eq!(any, nearest.is_some());
    nearest
}

/// Returns all hits, the nearest first, by testing every triangle.
pub fn all_of(triangles: &[Triangle], ray: &Ray) -> Vec<Hit> {
    let mut hits: Vec<Hit> = (0..)
        .zip(triangles)
        .filter_map(|(object, triangle)| Some(Hit { t: triangle.crossing(ray)?, object }))
        .collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.object.cmp(&b.object)));
    hits
}

/// Returns an answer as bits, for exact comparison.
pub fn bits(hit: Option<Hit>) -> Option<(u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.object))
}
