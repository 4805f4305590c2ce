//! The choice of a [`Frame`]: the axes along which boxes around a scene's triangles are small.
//!
//! Walls and boards lie along a few directions, which their triangles tell: the normal, and a leg of
//! the angle nearest 90°. A rotation by 90° about an axis of the frame changes no box, so rotations
//! are compared up to the 24 rotations of a cube. Triangles that agree are one candidate. Of curved
//! scenes, the principal axes and random rotations are candidates too, and a local search turns the
//! best of all by smaller and smaller angles about their axes.
//!
//! The greedy trees over samples of the triangles rank the candidates. They see what boxes lose that
//! are no longer exactly flat; clusterings do not, and choose frames that cost a seventh more. Short
//! searches over a sample that says more decide.

use crate::parallel;
use crate::run::stream;
use crate::{Bake, Budget, Observer, Stream};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::internal_area;
use bvh_core::glam::{DMat3, DQuat, DVec3, Vec3};
use bvh_core::{Aabb, DTriangle, DWideBvh, Frame, InFrame, Primitives, Triangle};
use rand::RngExt;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_1_SQRT_2;

/// The share of the budget for the choice.
const SHARE: f64 = 0.1;
/// The work of a greedy tree per object, by its time.
const WORK_PER_OBJECT: f64 = 20.0;
/// The work per object of the short searches that decide. Greedy trees differ by up to 4 % where
/// searched ones do not. Three times the work, over a third of the triangles, errs twice as much.
const CONFIRMING: u64 = 20;
/// The work per object of the last sample, over which two or three frames are searched.
const LAST: f64 = 3.0 * CONFIRMING as f64;
/// The least gain by a short search.
const LEAST_GAIN: f64 = 0.01;
/// The nodes that a move visits, about.
const WORK_PER_MOVE: f64 = 64.0;
/// The least and the most triangles of the first sample.
const FIRST: [usize; 2] = [32, 4096];
/// The least within little work. Its last sample of 384 triangles still tells a fortieth of the area.
const LEAST: usize = 8;
/// By what the second sample and the last one are larger than the first.
const GROWTH: [usize; 2] = [4, 48];
/// The neighbours in the file that the last sample keeps together, as they are in most scenes: the
/// details that a small rotation spoils are lost where all around them is left out. Fewer in small
/// samples, which are to be from several parts, too.
const RUN: usize = 256;
/// The triangles whose price tells the time of others.
const CLOCKED: usize = 1024;
/// The largest sample that tells directions, and how much larger it is than the first.
const MOST_ASKED: usize = 1 << 14;
const ASKED: usize = 8;
/// Candidates of the local search: those that triangles tell, and those with random ones.
const TOLD: usize = 12;
const STARTS: usize = 17;
/// Candidates that survive a step of the local search.
const KEPT: usize = 6;
/// The largest rotations of the steps, as tangents of half of the angles: 33° to 0.7°.
const STEPS: [f64; 6] = [0.3, 0.14, 0.064, 0.029, 0.013, 0.006];
/// The share of one direction above which other candidates are not tried.
const CLEAR: f64 = 0.5;
/// The share above which a direction is no accident.
const HEAVY: f64 = 0.005;
/// What is added to the least gain for a sample of one triangle; for a sample of n, √n times less.
const DOUBT: f64 = 0.25;

/// Whether a bake of triangles chooses a [`Frame`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Frames {
    /// The [`Choice`] of the triangles.
    #[default]
    Auto,
    /// The file's axes, along which other tracers have their boxes.
    File,
}

/// The frame that was chosen for a scene, and why.
///
/// ```
/// use bvh_search::{Choice, prelude::*};
/// // Walls that stand at 30 degrees in their file.
/// let (sin, cos) = (0.5, 0.75f32.sqrt());
/// let at = |x: f32, y: f32, z: f32| [x * cos - y * sin, x * sin + y * cos, z];
/// let wall = |y: u8| [at(0.0, y.into(), 0.0), at(9.0, y.into(), 0.0), at(9.0, y.into(), 3.0)];
/// let triangles: Vec<Triangle> = (0..200).map(|y| wall(y).into()).collect();
/// let choice = Choice::of(&triangles, Budget::UNLIMITED, &());
/// assert!(choice.frame.is_some() && choice.gain > 0.1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The frame; `None` for the file's axes.
    pub frame: Option<Frame>,
    /// The fraction of area that a tree in the frame saves, by short searches over a sample of the
    /// triangles. The whole tree saves more where triangles are small.
    pub gain: f64,
    /// The share of the triangles that lie along one direction and its perpendicular ones, weighted
    /// by the roots of their areas.
    pub agreeing: f64,
    /// Whether the budget sufficed to try other axes.
    pub sufficed: bool,
}

impl Choice {
    /// The axes of the file, without a reason.
    pub const FILE: Self = Self { frame: None, gain: 0.0, agreeing: 0.0, sufficed: false };

    /// Chooses the frame for a search of triangles with this budget: the file's axes unless another
    /// frame certainly saves area. The choice takes at most a tenth of the work or of the time. It is
    /// the same on every machine for any number of threads, unless the observer has a clock.
    /// O(n + budget).
    pub fn of(triangles: &[Triangle], budget: Budget, observer: &dyn Observer) -> Self {
        let bounds = triangles.iter().fold(Aabb::EMPTY, |all, part| all.union(&part.aabb()));
        let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
        // Turned boxes could overflow. The search will reject what is no number.
        if farthest.is_nan() || farthest >= f32::MAX / 4.0 {
            return Self { sufficed: true, ..Self::FILE };
        }
        let began = observer.progress();
        let scene = Scene { triangles, centre: centre(&bounds), observer };
        let limit = |most: Option<u64>| most.map_or(f64::INFINITY, |most| SHARE * most as f64);
        let moves = WORK_PER_MOVE * limit(budget.max_evaluations);
        let mut work = limit(budget.max_work).min(moves);
        if let Some(began) = began {
            // The first price tells how long the others take, of which larger ones take longer, and
            // so do the greedy trees that short searches begin with, whose work does not count.
            let first = sample(triangles, CLOCKED, 1, 0);
            scene.price(&first, None);
            let took = 4.0 * (observer.progress().unwrap_or(1.0) - began);
            let price = took.max(f64::MIN_POSITIVE) / (WORK_PER_OBJECT * first.len() as f64);
            work = work.min(SHARE * (1.0 - began) / price);
        }
        // Within little work, only the heaviest direction is tried.
        let kinds = [(true, FIRST[0]), (false, LEAST)];
        let affordable = kinds.into_iter().find_map(|(searches, least)| {
            let mut size = FIRST[1];
            while size > 0 && scene.work(size, searches) > work {
                size = size * 7 / 8;
            }
            (size >= least.min(triangles.len())).then_some((size, searches))
        });
        let choice = affordable.and_then(|(size, searches)| scene.choose(size, searches));
        choice.unwrap_or(Self::FILE)
    }

    /// Chooses the frame of a bake over these shapes: the [best](Self::of) one of triangles, if they
    /// are free to choose, and one with its centre in their middle of those in f64. `None` for other
    /// shapes, and for triangles in f32 along the file's axes.
    pub fn of_shapes(
        shapes: &Primitives,
        frames: Frames,
        budget: Budget,
        observer: &dyn Observer,
    ) -> Option<Self> {
        match shapes {
            Primitives::Triangles(triangles) if frames == Frames::Auto => {
                Some(Self::of(triangles, budget, observer))
            }
            Primitives::Doubles(triangles) => {
                Some(Self::of_doubles(triangles, frames, budget, observer))
            }
            _ => None,
        }
    }

    fn of_doubles(
        triangles: &[DTriangle],
        frames: Frames,
        budget: Budget,
        observer: &dyn Observer,
    ) -> Self {
        let centred = DWideBvh::centred(triangles);
        if frames == Frames::File {
            return Self { frame: Some(centred), ..Self::FILE };
        }
        let single = |corner: DVec3| centred.point(corner).as_vec3();
        let rounded: Vec<Triangle> =
            triangles.iter().map(|triangle| Triangle(triangle.0.map(single))).collect();
        let choice = Self::of(&rounded, budget, observer);
        let turn = |frame: Frame| Frame::new(frame.rotation(), centred.centre()).ok();
        Self { frame: Some(choice.frame.and_then(turn).unwrap_or(centred)), ..choice }
    }
}

struct Scene<'a> {
    triangles: &'a [Triangle],
    /// The centre of every frame.
    centre: DVec3,
    observer: &'a dyn Observer,
}

impl Scene<'_> {
    fn work(&self, size: usize, searches: bool) -> f64 {
        let sample = |growth: usize| (growth * size).min(self.triangles.len());
        let search = (STARTS + 3 * KEPT * STEPS.len()) * sample(1) + KEPT * sample(GROWTH[0]);
        let rest = self.asked(size) + if searches { search } else { 0 };
        LAST * sample(GROWTH[1]) as f64 + WORK_PER_OBJECT * rest as f64
    }

    /// Returns the size of the sample that tells directions, which costs little.
    fn asked(&self, size: usize) -> usize {
        (ASKED * size.max(FIRST[0])).min(self.triangles.len())
    }

    /// Chooses with a first sample of this size. `None` if the observer cancels.
    fn choose(&self, size: usize, searches: bool) -> Option<Choice> {
        let asked = sample(self.triangles, self.asked(size).min(MOST_ASKED), 1, 1);
        let told = directions(&asked);
        let agreeing = told.first().map_or(0.0, |(_, share)| *share);
        let heaviest = told.first().filter(|(_, share)| *share >= HEAVY);
        let mut tried: Vec<DQuat> = heaviest.iter().map(|(rotation, _)| *rotation).collect();
        if searches && agreeing < CLEAR {
            let mut starts: Vec<DQuat> = told.iter().map(|(rotation, _)| *rotation).collect();
            starts.push(principal(&asked));
            tried.push(self.local_search(starts, size)?);
        }
        tried.retain(|rotation| agreement(*rotation, DQuat::IDENTITY) < SAME);
        let mut frames = vec![None];
        frames.extend(tried.into_iter().map(|rotation| self.frame(rotation)));
        if frames.len() == 1 {
            return Some(Choice { agreeing, sufficed: true, ..Choice::FILE });
        }
        let run = RUN.min(GROWTH[0] * size);
        let last = sample(self.triangles, GROWTH[1] * size, run, 4);
        let is_whole = last.len() == self.triangles.len();
        let doubt = if is_whole { 0.0 } else { DOUBT / (last.len() as f64).sqrt() };
        let areas = parallel::map(frames.clone(), |frame| searched(&last, frame.as_ref()));
        // The heaviest direction has to beat the file's axes, and the other frame both.
        let mut best = 0;
        for index in 1..areas.len() {
            if areas[index] < (1.0 - LEAST_GAIN - doubt) * areas[best] {
                best = index;
            }
        }
        let gain = saved(areas[best], areas[0]);
        let choice = Choice { frame: frames[best], gain, agreeing, sufficed: true };
        Some(if self.observer.cancelled() { Choice { agreeing, ..Choice::FILE } } else { choice })
    }

    /// Returns the best of some rotations, of random ones and of rotations near them. `None` if the
    /// observer cancels.
    fn local_search(&self, mut starts: Vec<DQuat>, size: usize) -> Option<DQuat> {
        let mut rng = stream(1, 0);
        starts.resize_with(STARTS, || random_rotation(&mut rng));
        let first = sample(self.triangles, size, 1, 2);
        let mut ranked = Vec::new();
        self.rank(&mut ranked, starts, &first)?;
        for step in STEPS {
            let mut near = Vec::new();
            for &(_, rotation) in &ranked {
                // A turn about one axis keeps a plane of symmetry.
                for axis in 0..3 {
                    let mut parts = [0.0, 0.0, 0.0, 1.0];
                    parts[axis] = step * (2.0 * rng.random::<f64>() - 1.0);
                    near.push((DQuat::from_array(parts) * rotation).normalize());
                }
            }
            self.rank(&mut ranked, near, &first)?;
        }
        let best = ranked.drain(..).map(|(_, rotation)| rotation).collect();
        self.rank(&mut ranked, best, &sample(self.triangles, GROWTH[0] * size, 1, 3))?;
        ranked.first().map(|(_, rotation)| *rotation)
    }

    /// Adds candidates, and keeps the cheapest. `None` if the observer cancels.
    fn rank(
        &self,
        ranked: &mut Vec<(f64, DQuat)>,
        candidates: Vec<DQuat>,
        sample: &[Triangle],
    ) -> Option<()> {
        let prices = parallel::map(candidates.clone(), |tried| self.price(sample, Some(tried)));
        if self.observer.cancelled() {
            return None;
        }
        ranked.extend(prices.into_iter().zip(candidates));
        ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        ranked.truncate(KEPT);
        Some(())
    }

    /// Returns the area of a greedy tree over some triangles, along the file's axes for `None`.
    fn price(&self, triangles: &[Triangle], rotation: Option<DQuat>) -> f64 {
        let frame = rotation.and_then(|rotation| self.frame(rotation));
        let boxes = InFrame { triangles, frame: frame.as_ref() }.boxes();
        let tree = muller_fellner::Config::default().build(&boxes);
        tree.map_or(f64::INFINITY, |tree| internal_area(&tree))
    }

    fn frame(&self, rotation: DQuat) -> Option<Frame> {
        Frame::new(DMat3::from_quat(smallest(rotation).normalize()), self.centre).ok()
    }
}

/// Returns the area of the tree of a short search over some triangles.
fn searched(triangles: &[Triangle], frame: Option<&Frame>) -> f64 {
    let boxes = InFrame { triangles, frame }.boxes();
    let max_work = Some(CONFIRMING * boxes.len() as u64);
    let bake = Bake { budget: Budget { max_work, ..Budget::UNLIMITED }, ..Bake::new(&boxes) };
    bake.search(None, &()).map_or(f64::INFINITY, |baked| baked.outcome.cost)
}

/// Returns about `count` triangles, or all, in runs of neighbours in the file from all of its parts.
fn sample(triangles: &[Triangle], count: usize, run: usize, index: u64) -> Vec<Triangle> {
    if count >= triangles.len() {
        return triangles.to_vec();
    }
    let mut rng = stream(1, index);
    let runs = triangles.len().div_ceil(run) as u64;
    let wanted = (count / run).max(1) as u64;
    let place = |part: u64| (part * runs / wanted) as usize;
    let mut chosen = Vec::with_capacity(count);
    for part in 0..wanted {
        let first = run * rng.random_range(place(part)..place(part + 1));
        chosen.extend_from_slice(&triangles[first..(first + run).min(triangles.len())]);
    }
    chosen
}

/// Returns the centre of frames: 0, unless the scene is far from it.
fn centre(bounds: &Aabb) -> DVec3 {
    let middle = 0.5 * bounds.doubled_centroid();
    let is_near = middle.abs().max_element() <= bounds.extent().max_element();
    if is_near { DVec3::ZERO } else { middle }
}

/// The tangent of half of the angle, 2.3°, that a cell of rotations spans.
const CELL: f64 = 0.02;
/// The cosines of half of 1.5°, 0.3°, 0.06° and 0.012°.
const CLOSE: [f64; 4] = [0.999_914_327, 0.999_996_573, 0.999_999_863, 0.999_999_994_5];
/// Rotations that agree so much are one.
const SAME: f64 = CLOSE[3];

/// Returns rotations by which many triangles lie along the axes, and their shares of all triangles
/// by size, the largest first.
fn directions(triangles: &[Triangle]) -> Vec<(DQuat, f64)> {
    let mut cells: BTreeMap<[i32; 3], Vec<(DQuat, f64)>> = BTreeMap::new();
    let mut all = 0.0;
    for (rotation, size) in triangles.iter().filter_map(told) {
        let cell = (rotation.xyz() / rotation.w / CELL).round().to_array().map(|x| x as i32);
        cells.entry(cell).or_default().push((rotation, size));
        all += size;
    }
    let mut means: Vec<(DQuat, f64)> = cells.values().map(|cell| mean(cell)).collect();
    means.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    let mut found: Vec<(DQuat, f64)> = Vec::new();
    for (mean, size) in means {
        // The same rotation may be in several cells, at the border of all smallest rotations.
        if found.iter().all(|(other, _)| agreement(mean, *other) < CLOSE[0]) {
            found.push((mean, size / all));
        }
        if found.len() == TOLD {
            break;
        }
    }
    found
}

/// Returns the mean of the rotations that agree most, and the size of all. Comes closer as long as
/// half of the size remains, because a few triangles that lie a little obliquely would tilt all
/// flat boxes.
fn mean(told: &[(DQuat, f64)]) -> (DQuat, f64) {
    let mut weight = 0.0;
    let mut mean = DQuat::IDENTITY;
    for close in [0.0].into_iter().chain(CLOSE) {
        let near = told.iter().filter(|(rotation, _)| rotation.dot(mean) >= close);
        let all: f64 = near.clone().map(|(_, size)| size).sum();
        if all < 0.5 * weight {
            break;
        }
        weight = all;
        let zero = DQuat::from_array([0.0; 4]);
        mean = near.fold(zero, |sum, (rotation, size)| sum + *rotation * (size / all)).normalize();
    }
    (mean, told.iter().map(|(_, size)| size).sum())
}

/// Returns the rotation to the axes of a triangle, and its size: the root of its area, so that one
/// large floor is not more than all that stands on it. `None` for needles, whose directions are
/// rounding errors.
fn told(triangle: &Triangle) -> Option<(DQuat, f64)> {
    let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
    let sides = [b - a, c - b, a - c];
    let normal = sides[0].cross(sides[1]);
    let area = normal.length();
    let longest = sides.map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
    if area.is_nan() || area <= 1e-4 * longest {
        return None;
    }
    let slant = |&corner: &usize| {
        let [leg, other] = [sides[corner], sides[(corner + 1) % 3]];
        leg.normalize().dot(other.normalize()).abs()
    };
    let right = [0, 1, 2].into_iter().min_by(|a, b| slant(a).total_cmp(&slant(b)))?;
    let [first, second] = [sides[right], sides[(right + 1) % 3]];
    let leg = if first.length_squared() < second.length_squared() { second } else { first };
    let (x, z) = (leg.normalize(), normal.normalize());
    let rows = DMat3::from_cols(x, z.cross(x), z);
    Some((smallest(DQuat::from_mat3(&rows.transpose()).normalize()), area.sqrt()))
}

/// Returns the rotation to the principal axes of the surface. Planes of symmetry are perpendicular
/// to them.
fn principal(triangles: &[Triangle]) -> DQuat {
    /// Rotations of Jacobi's method, more than it needs.
    const TURNS: usize = 16;
    let weighted = triangles.iter().map(|Triangle(corners)| {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        ((b - a).cross(c - a).length(), (a + b + c) / 3.0)
    });
    let all: f64 = weighted.clone().map(|(area, _)| area).sum();
    let mean: DVec3 = weighted.clone().map(|(area, point)| point * (area / all)).sum();
    let mut moments = DMat3::ZERO;
    for (area, point) in weighted {
        let (point, share) = (point - mean, area / all);
        moments += DMat3::from_cols(point * point.x, point * point.y, point * point.z) * share;
    }
    // Turns about an axis make the greatest mixed moment zero.
    let mut rotation = DQuat::IDENTITY;
    for _ in 0..TURNS {
        let turn = DMat3::from_quat(rotation);
        let turned = (turn * moments * turn.transpose()).to_cols_array_2d();
        let mixed = |axis: usize| turned[(axis + 1) % 3][(axis + 2) % 3];
        let greatest = |a: &usize, b: &usize| mixed(*a).abs().total_cmp(&mixed(*b).abs());
        let axis = [0, 1, 2].into_iter().max_by(greatest).unwrap_or(0);
        let [p, q] = [1, 2].map(|next| (axis + next) % 3);
        let ratio = (turned[p][p] - turned[q][q]) / (2.0 * mixed(axis));
        let tangent = 1.0f64.copysign(ratio) / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
        // Not a number without area, or without a mixed moment between equal ones.
        if tangent.is_nan() || tangent.abs() <= f64::EPSILON {
            break;
        }
        let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
        let half = (0.5 * (1.0 + cosine)).sqrt();
        let mut parts = [0.0, 0.0, 0.0, half];
        parts[axis] = -0.5 * tangent * cosine / half;
        rotation = (DQuat::from_array(parts) * rotation).normalize();
    }
    smallest(rotation)
}

/// Returns the smallest of the 24 rotations that give the same boxes.
fn smallest(rotation: DQuat) -> DQuat {
    let mut best = rotation;
    // The quaternions of the 24 rotations of a cube have parts of one size, one, two or four.
    for code in 0..81 {
        let digits = [code % 3, code / 3 % 3, code / 9 % 3, code / 27].map(|digit| digit - 1);
        let turn = DQuat::from_array(digits.map(f64::from));
        let parts = turn.length_squared();
        if parts == 0.0 || parts == 3.0 {
            continue;
        }
        let turned = turn * rotation * (1.0 / parts.sqrt());
        if turned.w > best.w {
            best = turned;
        }
    }
    best
}

/// Returns the cosine of half of the angle between two rotations, up to those of a cube.
fn agreement(a: DQuat, b: DQuat) -> f64 {
    let mut parts = (a * b.conjugate()).to_array().map(f64::abs);
    parts.sort_by(|a, b| b.total_cmp(a));
    let [first, second, third, fourth] = parts;
    first.max((first + second) * FRAC_1_SQRT_2).max(0.5 * (first + second + third + fourth))
}

/// Returns a rotation that is uniform, by arithmetic that is the same on every machine.
fn random_rotation(rng: &mut Stream) -> DQuat {
    loop {
        let parts: [f64; 4] = rng.random();
        let rotation = DQuat::from_array(parts.map(|part| 2.0 * part - 1.0));
        let squared = rotation.length_squared();
        if squared <= 1.0 && squared > 1e-3 {
            return smallest(rotation.normalize());
        }
    }
}

/// Returns the fraction by which a cost is below another one; 0 below a cost of 0.
pub(crate) fn saved(cost: f64, base: f64) -> f64 {
    if base > 0.0 { 1.0 - cost / base } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(axis: DVec3, degrees: f64) -> DQuat {
        DQuat::from_axis_angle(axis.normalize(), degrees.to_radians())
    }

    #[test]
    fn rotations_are_compared_up_to_those_of_a_cube() {
        let quarters = [turn(DVec3::X, 90.0), turn(DVec3::Z, 180.0), turn(DVec3::ONE, 120.0)];
        for (axis, degrees) in
            [(DVec3::X, 10.0), (DVec3::new(1.0, 2.0, 3.0), 20.0), (DVec3::Z, 45.0)]
        {
            let rotation = turn(axis, degrees);
            let half = (0.5 * degrees.to_radians()).cos();
            for quarter in [DQuat::IDENTITY].iter().chain(&quarters) {
                assert!((agreement(*quarter * rotation, DQuat::IDENTITY) - half).abs() < 1e-12);
                assert!((smallest(*quarter * rotation).w - half).abs() < 1e-12, "{degrees}");
            }
        }
        // No rotation is farther than 62.8 degrees.
        let mut rng = stream(1, 0);
        let least = (0.5f64 * 62.9).to_radians().cos();
        assert!((0..1000).all(|_| random_rotation(&mut rng).w > least));
    }

    #[test]
    fn triangles_tell_the_axes_of_their_right_angles_and_the_roots_of_their_areas() {
        let oblique = turn(DVec3::new(1.0, -2.0, 0.5), 25.0);
        let at = |corner: [f64; 3]| (oblique * DVec3::from(corner)).as_vec3();
        let wall = Triangle([[0.0; 3], [4.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(at));
        let (rotation, size) = told(&wall).unwrap();
        let is_told = agreement(rotation, oblique.conjugate()) > 1.0 - 1e-12;
        assert!(is_told && (size - 2.0).abs() < 1e-6);
        let needle = Triangle([[0.0; 3], [4.0, 0.0, 0.0], [2.0, 1e-4, 0.0]].map(at));
        assert_eq!(told(&needle), None);
        // Three walls of a room, and a smaller oblique one.
        let room = [[0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
        let room = [wall, Triangle([[0.0; 3], room[0], room[1]].map(at))];
        let other = Triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.8, 0.6]].map(Vec3::from));
        let found = directions(&[room[0], room[1], other]);
        let share = (2.0 + 4.0) / (2.0 + 4.0 + 1.0);
        assert!((found[0].1 - share).abs() < 1e-6 && found.len() == 2, "{found:?}");
        assert!(agreement(found[0].0, oblique.conjugate()) > 1.0 - 1e-9);
    }

    #[test]
    fn the_mean_is_that_of_the_closest_and_counts_all() {
        let [straight, tilted] = [0.0, 1.0].map(|degrees| turn(DVec3::X, degrees));
        let (rotation, size) = mean(&[(straight, 3.0), (tilted, 1.0)]);
        assert!(agreement(rotation, straight) > 1.0 - 1e-12 && size == 4.0, "{rotation} {size}");
    }

    #[test]
    fn a_local_search_without_a_start_finds_better_axes_than_the_file_has() {
        let oblique = turn(DVec3::new(1.0, 2.0, -0.5), 35.0);
        let at = |corner: [u8; 3]| (oblique * DVec3::from(corner.map(f64::from))).as_vec3();
        let wall = |y: u8| Triangle([[0, y, 0], [9, y, 0], [9, y, 9]].map(at));
        let walls: Vec<Triangle> = (0..100).map(wall).collect();
        let scene = Scene { triangles: &walls, centre: DVec3::ZERO, observer: &() };
        let found = scene.local_search(vec![], 100);
        let [found, file] = [found, None].map(|rotation| scene.price(&walls, rotation));
        assert!(found < 0.8 * file, "{found} {file}");
    }

    #[test]
    fn the_axes_of_a_surface_are_its_principal_ones() {
        let oblique = turn(DVec3::new(0.3, 1.0, -0.4), 40.0);
        // An ellipsoid of three different radii.
        let at = |around: usize, up: usize| {
            let [u, v] = [around, up].map(|part| std::f64::consts::TAU * part as f64 / 24.0);
            let point = DVec3::new(3.0 * u.cos() * v.sin(), 2.0 * u.sin() * v.sin(), v.cos());
            (oblique * point).as_vec3()
        };
        let quads = (0..24).flat_map(|around| (0..12).map(move |up| (around, up)));
        let surface: Vec<Triangle> = quads
            .flat_map(|(a, b)| {
                let [p, q, r, s] = [at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)];
                [Triangle([p, q, r]), Triangle([p, r, s])]
            })
            .collect();
        assert!(agreement(principal(&surface), oblique.conjugate()) > 1.0 - 1e-6);
    }

    #[test]
    fn samples_are_runs_from_all_parts_and_frames_far_away_have_a_centre() {
        let triangle = |x: usize| Triangle::from([[x as f32, 0.0, 0.0]; 3]);
        let triangles: Vec<Triangle> = (0..1000).map(triangle).collect();
        assert_eq!(sample(&triangles, 1000, 1, 0).len(), 1000);
        for (count, run) in [(100, 1), (100, 10), (60, 20)] {
            let places: Vec<f32> =
                sample(&triangles, count, run, 0).iter().map(|triangle| triangle.0[0].x).collect();
            assert_eq!(places.len(), count);
            let part = (1000 * run) as f32 / count as f32;
            for (number, run) in places.chunks(run).enumerate() {
                assert!(run.windows(2).all(|pair| pair[1] == pair[0] + 1.0));
                let begin = number as f32 * part;
                assert!(run[0] % run.len() as f32 == 0.0 && run[0] >= begin - 20.0);
                assert!(run[0] < begin + part + 20.0, "{number}: {run:?}");
            }
        }
        let bounds = |low: f32| Aabb::from(([low; 3], [low + 2.0; 3]));
        assert_eq!([1.0, 1.5].map(|low| centre(&bounds(low))), [DVec3::ZERO, DVec3::splat(2.5)]);
    }
}
