//! Which points are inside of a mesh, and signed distances.
//!
//! A mesh is *closed* if each of its edges runs as often in one direction as in the other, counting
//! edges between equal positions. Its winding number at a point is an integer, and the sum of the
//! signs of the crossings along any half line: +1 where the half line leaves through the side from
//! which the corners run counterclockwise. The crossings are exact, see
//! [`WideBvh::all_hits`], and so is their sum.
//!
//! [`winding`](crate::winding) finds the winding numbers of meshes that are not closed.

use crate::exact::normal_sign;
use crate::wide::Beams;
use crate::winding::{Open, Winding};
use crate::{Aabb, BvhView, Closest, Corners, DRay, DWideBvh, Ray, WideBvh};
use core::cmp::Ordering;
use glam::{DVec3, Vec3};

/// The rule by which a point is inside of a mesh.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum InsideRule {
    /// By parity where every edge belongs to two triangles, but in the same direction for some of
    /// them; otherwise by the winding number.
    #[default]
    Auto,
    /// A half line from the point crosses the mesh an odd number of times. The direction of the
    /// corners does not matter. Right for meshes without holes that do not overlap themselves.
    Parity,
    /// The size of the generalised winding number exceeds one half. Right for meshes that overlap
    /// themselves or have holes, if the corners of all triangles run in the same direction.
    Winding,
}

/// What is needed to tell the inside of a mesh from its outside.
///
/// A point on the surface of a mesh without holes counts as one a little below it in x, far less
/// above it in y, and again less in z: where meshes share faces, it is in one of them. On other
/// surfaces it may count as either. A point that is not finite is outside.
///
/// ```
/// use bvh_core::{Aabb, Bvh, InsideRule, Node, Solid, Triangle, WideBvh};
/// let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let triangles = Triangle::from_mesh(&corners, &faces)?;
/// let leaf = Node::leaf(Aabb::from([[0.0; 3], [1.0; 3]]), 0, 4);
/// let tree = Bvh::new(vec![leaf], vec![0, 1, 2, 3]);
/// let wide = WideBvh::new(&tree, &triangles)?;
/// let solid = Solid::new(&tree, &triangles);
/// let points = [[0.2, 0.2, 0.2], [0.5, 0.5, 0.5]].map(Into::into);
/// let mut inside = [false; 2];
/// solid.contains(&wide, &points, InsideRule::Auto, &mut inside);
/// assert_eq!((solid.is_watertight(), inside), (true, [true, false]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solid {
    /// Whether every edge belongs to two triangles.
    is_paired: bool,
    turns: Turns,
}

/// How winding numbers are found.
#[derive(Clone, Debug)]
enum Turns {
    /// By the signs of crossings; a sign for every triangle.
    Signs(Vec<i8>),
    /// By the sum of solid angles.
    Angles(Winding),
}

impl Solid {
    /// Examines the edges of all triangles. `tree` is a valid tree over the triangles. O(n log n)
    /// time, O(n) memory.
    pub fn new<'t, T: Corners>(tree: impl Into<BvhView<'t>>, triangles: &[T]) -> Self {
        let triangles: Vec<[DVec3; 3]> = triangles.iter().map(Corners::corners).collect();
        let triangles = &triangles[..];
        let edges = sorted_edges(triangles);
        let groups = || edges.chunk_by(|a, b| a.0 == b.0);
        let is_closed = groups().all(|group| group.iter().map(|edge| edge.1).sum::<i64>() == 0);
        let is_paired = groups().all(|group| group.len() == 2);
        let turns = if is_closed {
            let sign = |triangle: &[DVec3; 3]| normal_sign(triangle, 0) as i8;
            Turns::Signs(triangles.iter().map(sign).collect())
        } else {
            Turns::Angles(Winding::new(tree.into(), triangles))
        };
        Self { is_paired, turns }
    }

    /// Returns whether the mesh has no holes: every edge runs as often in one direction as in the
    /// other, or belongs to two triangles.
    pub fn is_watertight(&self) -> bool {
        self.is_paired || matches!(self.turns, Turns::Signs(_))
    }

    /// Writes whether every point is inside of the mesh. `wide` is a layout of the same triangles.
    ///
    /// The answer of [`Winding`](InsideRule::Winding) is exact for meshes that are closed, and
    /// otherwise that of a sum over all triangles in f64; the answer of
    /// [`Parity`](InsideRule::Parity) is exact.
    ///
    /// A point takes the time of a ray. In a mesh of n triangles with holes it takes the more, the
    /// nearer its winding number is to one half, up to O(n): just above and below an open terrain
    /// the number is nearly one half everywhere.
    ///
    /// # Panics
    /// Panics if `points` and `inside` are not equally many.
    pub fn contains<L: Traced>(
        &self,
        wide: &L,
        points: &[L::Point],
        rule: InsideRule,
        inside: &mut [bool],
    ) {
        assert_eq!(points.len(), inside.len(), "an answer for every point");
        let is_by_parity = match rule {
            InsideRule::Auto => self.is_paired && matches!(self.turns, Turns::Angles(_)),
            InsideRule::Parity => true,
            InsideRule::Winding => false,
        };
        match &self.turns {
            _ if is_by_parity => by_crossings(wide, points, inside, |ids| ids.len() % 2 == 1),
            Turns::Signs(signs) => by_crossings(wide, points, inside, |ids| {
                ids.iter().map(|&id| i64::from(signs[id as usize])).sum::<i64>() != 0
            }),
            Turns::Angles(winding) => {
                let mut open = Open::default();
                for (point, inside) in points.iter().zip(inside) {
                    let point: DVec3 = (*point).into();
                    *inside = point.is_finite() && winding.is_inside(point, &mut open);
                }
            }
        }
    }

    /// Writes the distance of every point from the [closest point](WideBvh::closest_point) of the
    /// triangles, negative if the mesh [contains](Self::contains) the point. Infinite where there
    /// is no closest point.
    ///
    /// # Panics
    /// Panics if `points` and `distances` are not equally many.
    pub fn signed_distances<L: Traced>(
        &self,
        wide: &L,
        points: &[L::Point],
        rule: InsideRule,
        distances: &mut [f64],
    ) {
        assert_eq!(points.len(), distances.len(), "a distance for every point");
        let mut inside = vec![false; points.len()];
        self.contains(wide, points, rule, &mut inside);
        let mut closest = vec![None; points.len()];
        wide.closest_to(points, &mut closest);
        for ((closest, inside), distance) in closest.iter().zip(inside).zip(distances) {
            let size = closest.map_or(f64::INFINITY, |closest| closest.distance);
            *distance = if inside { -size } else { size };
        }
    }
}

/// An edge between positions, the lower one first, and its direction: 1 upwards, −1 downwards.
type Edge = ([[u64; 3]; 2], i64);

/// Returns the edges of all triangles; equal edges are adjacent. Edges without length are omitted.
fn sorted_edges(triangles: &[[DVec3; 3]]) -> Vec<Edge> {
    // The sum turns −0 into 0.
    let bits = |corner: DVec3| (corner + 0.0).to_array().map(f64::to_bits);
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
    for triangle in triangles {
        let [a, b, c] = triangle.map(bits);
        for [from, to] in [[a, b], [b, c], [c, a]] {
            match from.cmp(&to) {
                Ordering::Less => edges.push(([from, to], 1)),
                Ordering::Equal => {}
                Ordering::Greater => edges.push(([to, from], -1)),
            }
        }
    }
    edges.sort_unstable();
    edges
}

/// A layout in f32 or in f64.
pub trait Traced {
    /// A point. In f64, coordinates count as those of a [ray](DRay::new).
    type Point: Copy + Into<DVec3>;

    /// Returns the triangles that the half line from every point along +x crosses, point after
    /// point, and writes how many there are of each.
    fn crossed(&self, points: &[Self::Point], counts: &mut [u32]) -> Vec<u32>;

    /// Writes the closest point of every point.
    fn closest_to(&self, points: &[Self::Point], closest: &mut [Option<Closest>]);

    /// Returns directions and a range of distances as rays have them.
    #[doc(hidden)]
    fn as_of_rays(directions: &[DVec3], range: [f64; 2]) -> (Vec<DVec3>, [f64; 2]);

    /// Passes for each of these directions its number and a bit for each of at most 128 points from
    /// which it is free over a range, and above the surface if there are normals; for some of the
    /// points at a time.
    #[doc(hidden)]
    fn look(
        &self,
        points: &[Self::Point],
        normals: Option<&[Self::Point]>,
        directions: &[DVec3],
        range: [f64; 2],
        free: &mut dyn FnMut(usize, u128),
    );
}

impl Traced for WideBvh {
    type Point = Vec3;

    fn crossed(&self, points: &[Vec3], counts: &mut [u32]) -> Vec<u32> {
        // The half line must not end before a far wall: a mesh may be twice as wide as the largest
        // f32.
        let is_wide = self.bounds.max.x - self.bounds.min.x > f32::MAX;
        let direction = if is_wide { 2.0 * Vec3::X } else { Vec3::X };
        // A point outside the box is outside the mesh: its range is empty. NaN fails every
        // comparison.
        let half_line = |&point: &Vec3| {
            let is_within = self.bounds.contains(&Aabb { min: point, max: point });
            Ray::assume_valid(point, direction, 0.0, if is_within { f32::MAX } else { -1.0 })
        };
        let rays: Vec<Ray> = points.iter().map(half_line).collect();
        let mut hits = Vec::new();
        self.all_hits_of(&rays, &mut hits, counts);
        hits.iter().map(|hit| hit.object).collect()
    }

    fn closest_to(&self, points: &[Vec3], closest: &mut [Option<Closest>]) {
        self.closest_points(points, closest);
    }

    fn as_of_rays(directions: &[DVec3], range: [f64; 2]) -> (Vec<DVec3>, [f64; 2]) {
        let directions = directions.iter().map(|direction| direction.as_vec3().into()).collect();
        // A ray ends at the greatest number at the latest, and a distance beyond it is no hit.
        let [begin, end] = range.map(|t| f64::from(t as f32));
        (directions, [begin, end.min(f64::from(f32::MAX))])
    }

    fn look(
        &self,
        points: &[Vec3],
        normals: Option<&[Vec3]>,
        directions: &[DVec3],
        range: [f64; 2],
        free: &mut dyn FnMut(usize, u128),
    ) {
        Beams { obstacles: self, points, normals, directions, range }.trace(free);
    }
}

impl Traced for DWideBvh {
    type Point = DVec3;

    fn crossed(&self, points: &[DVec3], counts: &mut [u32]) -> Vec<u32> {
        let half_line = |&point: &DVec3| {
            // A point beyond the range of all coordinates is outside: its range is empty.
            let ray = DRay::half_line(point, DVec3::X);
            ray.or_else(|_| DRay::new(DVec3::ZERO, DVec3::X, 1.0, 0.0)).expect("a valid ray")
        };
        let rays: Vec<DRay> = points.iter().map(half_line).collect();
        let mut hits = Vec::new();
        self.all_hits_of(&rays, &mut hits, counts);
        hits.iter().map(|hit| hit.object).collect()
    }

    fn closest_to(&self, points: &[DVec3], closest: &mut [Option<Closest>]) {
        self.closest_points(points, closest);
    }

    fn as_of_rays(directions: &[DVec3], range: [f64; 2]) -> (Vec<DVec3>, [f64; 2]) {
        (directions.iter().map(|&direction| DRay::exact(direction)).collect(), range)
    }

    fn look(
        &self,
        points: &[DVec3],
        normals: Option<&[DVec3]>,
        directions: &[DVec3],
        range: [f64; 2],
        free: &mut dyn FnMut(usize, u128),
    ) {
        Beams { obstacles: self, points, normals, directions, range }.trace(free);
    }
}

/// Writes whether `is_inside` holds for the triangles that the half line from every point crosses.
fn by_crossings<L: Traced>(
    wide: &L,
    points: &[L::Point],
    inside: &mut [bool],
    is_inside: impl Fn(&[u32]) -> bool,
) {
    let mut counts = vec![0; points.len()];
    let crossed = wide.crossed(points, &mut counts);
    let mut crossed = &crossed[..];
    for (inside, count) in inside.iter_mut().zip(counts) {
        let of_point;
        (of_point, crossed) = crossed.split_at(count as usize);
        *inside = is_inside(of_point);
    }
}
