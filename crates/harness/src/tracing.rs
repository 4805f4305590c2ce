//! Rays per second, and tests per ray: every tree in every layout, in turns, on one thread, answers compared.

use crate::peers::Peer;
use crate::rays::{Family, Query, random_ray};
use crate::record::{TraceRow, TraceTimeRow};
use crate::report::statistics::{median, minimum};
use crate::scene::{Primitives, Scene};
use bvh_core::cost::SahConstants;
use bvh_core::{Bvh, Hit, Ray, Shear, TestCounts, Triangle, WideBvh, any_hit, collapse_leaves, nearest_hit};
use bvh_search::Stream;
use glam::{DVec3, Vec3};
use rand::SeedableRng;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

/// What is traced, of scenes made of triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Rays of each kind, at least 1. Default a million.
    #[serde(default = "million")]
    pub count: u32,
    /// Turns in which every contender traces all rays of a kind, after one that is not timed. Default 5.
    #[serde(default = "five")]
    pub rounds: u32,
    /// Kinds of rays. Default all.
    #[serde(default = "every_kind")]
    pub rays: Vec<Kind>,
    /// Layouts of our trees. Default all.
    #[serde(default = "every_layout")]
    pub layouts: Vec<Layout>,
    /// Cameras of primary rays by scene. Default one outside the root's box.
    #[serde(default)]
    pub cameras: BTreeMap<String, Camera>,
}

fn million() -> u32 {
    1_000_000
}

fn five() -> u32 {
    5
}

fn every_kind() -> Vec<Kind> {
    vec![Kind::Incoherent, Kind::Primary, Kind::Shadow]
}

fn every_layout() -> Vec<Layout> {
    vec![Layout::Binary, Layout::BinaryLeaves, Layout::Wide, Layout::WidePortable]
}

/// A kind of rays. All directions are unit vectors and all rays begin at distance 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Origins uniform in the root's box, directions uniform; nearest hit.
    Incoherent,
    /// From a pinhole camera, row by row, its field of view 60 degrees wide; nearest hit.
    Primary,
    /// From what the primary rays hit, in turn, to a light under the middle of the box's upper side; any hit.
    Shadow,
}

impl Kind {
    /// What the rays ask.
    pub fn query(self) -> Query {
        if self == Self::Shadow { Query::Any } else { Query::Nearest }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Incoherent => "incoherent",
            Self::Primary => "primary",
            Self::Shadow => "shadow",
        }
    }
}

/// A way to lay out one of our trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// The tree as it is.
    Binary,
    /// The tree with its leaves merged where the surface area heuristic, both constants 1, says so.
    BinaryLeaves,
    /// [`WideBvh`] with the best instructions of this machine.
    Wide,
    /// [`WideBvh`] with portable code.
    WidePortable,
}

/// A pinhole camera, in fractions of the root's box: 0 is its lower corner, 1 the upper one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where it is.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
}

impl Default for Camera {
    fn default() -> Self {
        Self { eye: [1.9, 1.3, 2.2], target: [0.5; 3] }
    }
}

/// Answers rays, the distance and the object of a hit for each (any of both for an any-hit query), and returns the
/// seconds that took, part by part.
pub type Trace<'a> = Box<dyn Fn(Query, &[Ray], &mut [Option<Hit>]) -> Vec<f64> + 'a>;

/// Counts the tests of one ray.
pub type Count<'a> = Box<dyn Fn(Query, &Ray, &mut TestCounts) + 'a>;

/// A structure that traces rays, with its name.
pub struct Contender<'a> {
    /// Name of the layout.
    pub layout: String,
    /// Whether its answers must be ours, bit by bit.
    pub exact: bool,
    /// What it took to make the layout from a tree, for other libraries with the tree.
    pub preparation_seconds: f64,
    /// Traces.
    pub trace: Trace<'a>,
    /// Counts tests, the same on every machine; none where they cannot be counted.
    pub count: Option<Count<'a>>,
}

/// Rays whose time is taken together: few enough that some part of every turn is not interrupted by other programs.
const PART: usize = 4096;

/// Answers every ray and returns the seconds that took, part by part.
#[inline(always)]
pub fn timed<R>(rays: &[R], hits: &mut [Option<Hit>], mut answer: impl FnMut(&R) -> Option<Hit>) -> Vec<f64> {
    let part = |(rays, hits): (&[R], &mut [Option<Hit>])| {
        let start = Instant::now();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = answer(ray);
        }
        start.elapsed().as_secs_f64()
    };
    rays.chunks(PART).zip(hits.chunks_mut(PART)).map(part).collect()
}

/// A method's tree on a scene.
pub struct Entry<'a> {
    /// Label of the method.
    pub method: &'a str,
    /// Its tree, with one object per leaf.
    pub tree: &'a Bvh,
    /// The library that made it, if it is not ours.
    pub peer: Option<&'a Peer>,
}

/// The rows of one scene.
pub type Rows = (Vec<TraceRow>, Vec<TraceTimeRow>);

/// Traces rays, the same for all, through the trees of all methods on a scene. `seed` draws them. `None` as soon as
/// `cancelled` says so. An error says what cannot be traced.
pub fn measure(
    config: &Config,
    scene: &Scene,
    entries: &[Entry],
    seed: u64,
    cancelled: impl Fn() -> bool,
) -> Result<Option<Rows>, String> {
    let mut contenders = Vec::new();
    for entry in entries {
        let own = match entry.peer {
            Some(peer) => peer.contenders(scene)?,
            None => own_contenders(&config.layouts, scene, entry.tree)?,
        };
        contenders.extend(own.into_iter().map(|contender| (entry.method, contender)));
    }
    let (mut rows, mut times) = (Vec::new(), Vec::new());
    let Some(Entry { tree, .. }) = entries.first() else { return Ok(Some((rows, times))) };
    let camera = config.cameras.get(&scene.name).copied().unwrap_or_default();
    for &kind in &config.rays {
        let rays = rays(kind, config.count, scene, tree, &camera, seed);
        let right = reference(kind, &rays, scene, tree);
        let mut hits = vec![None; rays.len()];
        // By contender, and by part of the rays, the seconds of each turn.
        let mut turns = vec![vec![Vec::new(); rays.len().div_ceil(PART)]; contenders.len()];
        for round in 0..=config.rounds {
            for ((method, contender), turns) in contenders.iter().zip(&mut turns) {
                if cancelled() {
                    return Ok(None);
                }
                hits.fill(None);
                let seconds = (contender.trace)(kind.query(), &rays, &mut hits);
                if round == 0 {
                    rows.push(row(scene, method, contender, kind, &rays, &right, &hits, tree));
                } else {
                    turns.iter_mut().zip(seconds).for_each(|(turns, seconds)| turns.push(seconds));
                }
            }
        }
        for ((method, contender), parts) in contenders.iter().zip(&turns) {
            let sum = |of: fn(&[f64]) -> Option<f64>| parts.iter().filter_map(|turns| of(turns)).sum();
            times.push(TraceTimeRow {
                scene: scene.name.clone(),
                method: (*method).into(),
                layout: contender.layout.clone(),
                rays: kind.name().into(),
                count: rays.len() as u64,
                rounds: config.rounds,
                preparation_seconds: contender.preparation_seconds,
                seconds: sum(|turns| minimum(turns.iter().copied())),
                median_seconds: sum(median),
            });
        }
    }
    Ok(Some((rows, times)))
}

#[allow(clippy::too_many_arguments, reason = "all that a row is made of")]
fn row(
    scene: &Scene,
    method: &str,
    contender: &Contender,
    kind: Kind,
    rays: &[Ray],
    reference: &[Option<Hit>],
    hits: &[Option<Hit>],
    tree: &Bvh,
) -> TraceRow {
    let found = match (contender.exact, kind.query()) {
        (true, Query::Nearest) => exact_disagreements(reference, hits),
        _ => disagreements(reference, hits, tree, rays),
    };
    let counts = contender.count.as_ref().map(|count| {
        let mut counts = TestCounts::default();
        rays.iter().for_each(|ray| count(kind.query(), ray, &mut counts));
        counts
    });
    let per_ray =
        |tests: fn(&TestCounts) -> u64| Some(tests(counts.as_ref()?) as f64 / rays.len().max(1) as f64);
    TraceRow {
        scene: scene.name.clone(),
        method: method.into(),
        layout: contender.layout.clone(),
        rays: kind.name().into(),
        count: rays.len() as u64,
        hits: hits.iter().flatten().count() as u64,
        missed_hits: found.missed,
        false_hits: found.false_hits,
        other_hits: found.other,
        boxes_per_ray: per_ray(|counts| counts.boxes),
        objects_per_ray: per_ray(|counts| counts.objects),
    }
}

/// The scene's triangles as the core knows them.
fn triangles(scene: &Scene) -> Result<Vec<Triangle>, String> {
    match &scene.primitives {
        Primitives::Triangles(triangles) => Ok(triangles.iter().map(|&corners| Triangle(corners)).collect()),
        Primitives::Spheres(_) => Err(format!("{} is made of spheres; accepted: triangles", scene.name)),
    }
}

/// One of our trees in its layouts.
fn own_contenders<'a>(layouts: &[Layout], scene: &Scene, tree: &'a Bvh) -> Result<Vec<Contender<'a>>, String> {
    let mut contenders = Vec::new();
    for &layout in layouts {
        let triangles = triangles(scene)?;
        let start = Instant::now();
        contenders.push(match layout {
            Layout::Binary => binary("binary", Cow::Borrowed(tree), triangles, 0.0),
            Layout::BinaryLeaves => {
                let merged = collapse_leaves(tree, &SahConstants::default());
                let seconds = start.elapsed().as_secs_f64();
                binary("binary, merged leaves", Cow::Owned(merged), triangles, seconds)
            }
            Layout::Wide | Layout::WidePortable => {
                let wide = WideBvh::new(tree, &triangles).map_err(|error| error.to_string())?;
                self::wide(wide, layout, start.elapsed().as_secs_f64())
            }
        });
    }
    Ok(contenders)
}

fn binary<'a>(
    layout: &str,
    tree: Cow<'a, Bvh>,
    triangles: Vec<Triangle>,
    preparation_seconds: f64,
) -> Contender<'a> {
    let (counted_tree, counted) = (tree.clone(), triangles.clone());
    Contender {
        layout: layout.into(),
        exact: true,
        preparation_seconds,
        trace: Box::new(move |query, rays, hits| match query {
            Query::Any => timed(rays, hits, |ray| {
                let shear = Shear::new(ray);
                let test = |id: u32| triangles[id as usize].intersect(&shear, ray.t_max()).is_some();
                any_hit(&*tree, ray, test, &mut ()).then_some(SOME_HIT)
            }),
            _ => timed(rays, hits, |ray| {
                let shear = Shear::new(ray);
                nearest_hit(&*tree, ray, |id, t_max| triangles[id as usize].intersect(&shear, t_max), &mut ())
            }),
        }),
        count: Some(Box::new(move |query, ray, counts| {
            let shear = Shear::new(ray);
            let test = |id: u32, t_max| counted[id as usize].intersect(&shear, t_max);
            if query == Query::Any {
                any_hit(&*counted_tree, ray, |id| test(id, ray.t_max()).is_some(), counts);
            } else {
                nearest_hit(&*counted_tree, ray, test, counts);
            }
        })),
    }
}

fn wide(wide: WideBvh, layout: Layout, preparation_seconds: f64) -> Contender<'static> {
    let counted = wide.clone();
    let portable = layout == Layout::WidePortable;
    Contender {
        layout: if portable { "wide, portable" } else { "wide" }.into(),
        exact: true,
        preparation_seconds,
        trace: Box::new(move |query, rays, hits| match (query, portable) {
            (Query::Any, false) => timed(rays, hits, |ray| wide.any_hit(ray).then_some(SOME_HIT)),
            (Query::Any, true) => {
                timed(rays, hits, |ray| wide.view().any_hit_portable(ray).then_some(SOME_HIT))
            }
            (_, false) => timed(rays, hits, |ray| wide.nearest_hit(ray)),
            (_, true) => timed(rays, hits, |ray| wide.view().nearest_hit_portable(ray)),
        }),
        count: Some(Box::new(move |query, ray, counts| match query {
            Query::Any => drop(counted.view().any_hit_counted(ray, counts)),
            _ => drop(counted.view().nearest_hit_counted(ray, counts)),
        })),
    }
}

/// What any-hit queries answer for a hit.
const SOME_HIT: Hit = Hit { t: 0.0, object: 0 };

/// Rays of a kind: the same for the same scene and seed on every machine. Fewer than `count` only where there are none:
/// without a primary hit no shadow ray.
pub fn rays(kind: Kind, count: u32, scene: &Scene, tree: &Bvh, camera: &Camera, seed: u64) -> Vec<Ray> {
    let Some(root) = tree.root_aabb() else { return Vec::new() };
    match kind {
        Kind::Incoherent => {
            let mut rng = Stream::seed_from_u64(seed);
            (0..count).filter_map(|_| random_ray(Family::Inside, &root, &mut rng)).collect()
        }
        Kind::Primary => camera.rays(count, root.min.as_dvec3(), root.extent()),
        Kind::Shadow => {
            let primary = rays(Kind::Primary, count, scene, tree, camera, seed);
            let hits = reference(Kind::Primary, &primary, scene, tree);
            let point = |(ray, hit): (&Ray, &Option<Hit>)| hit.map(|hit| ray.at(hit.t));
            let points: Vec<Vec3> = primary.iter().zip(&hits).filter_map(point).collect();
            let light = root.min.as_dvec3() + DVec3::new(0.5, 0.95, 0.5) * root.extent();
            points.iter().cycle().take(count as usize).filter_map(|&point| shadow_ray(point, light)).collect()
        }
    }
}

/// From a thousandth of the way on, so that a library without a shortest distance does not hit the surface it starts
/// from, to the light.
fn shadow_ray(point: Vec3, light: DVec3) -> Option<Ray> {
    let way = light - point.as_dvec3();
    let origin = (point.as_dvec3() + 1e-3 * way).as_vec3();
    Ray::new(origin, way.normalize_or_zero().as_vec3(), 0.0, (0.998 * way.length()) as f32).ok()
}

impl Camera {
    /// Rays through the middles of square pixels, as many rows as columns.
    fn rays(&self, count: u32, low: DVec3, size: DVec3) -> Vec<Ray> {
        let [eye, target] = [self.eye, self.target].map(|at| low + DVec3::from(at) * size);
        let forwards = (target - eye).normalize_or_zero();
        let up = if forwards.x.abs().max(forwards.z.abs()) < 1e-3 { DVec3::X } else { DVec3::Y };
        // The tangent of 30 degrees.
        let right = forwards.cross(up).normalize_or_zero() * 0.577_350_269_189_625_8;
        let up = right.cross(forwards);
        let side = (1..=count).find(|side| side.saturating_mul(*side) >= count).unwrap_or(count);
        let middle = |pixel: u32| (2.0 * f64::from(pixel) + 1.0) / f64::from(side) - 1.0;
        let ray = |index: u32| {
            let (x, y) = (middle(index % side), -middle(index / side));
            Ray::half_line(eye.as_vec3(), (forwards + x * right + y * up).normalize_or_zero().as_vec3()).ok()
        };
        (0..count).filter_map(ray).collect()
    }
}

/// The right answers: those of our binary traversal, which are those of testing every triangle.
pub fn reference(kind: Kind, rays: &[Ray], scene: &Scene, tree: &Bvh) -> Vec<Option<Hit>> {
    let mut hits = vec![None; rays.len()];
    if let Ok(triangles) = triangles(scene) {
        (binary("binary", Cow::Borrowed(tree), triangles, 0.0).trace)(kind.query(), rays, &mut hits);
    }
    hits
}

/// How answers differ from the right ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Disagreements {
    /// Rays that should hit and do not.
    pub missed: u64,
    /// Rays that should not hit and do.
    pub false_hits: u64,
    /// Rays that hit, but elsewhere.
    pub other: u64,
}

/// By what distances may differ, in multiples of the root box's diagonal, before they are of different hits.
const TOLERANCE: f64 = 1e-4;

/// How answers of another library differ. Distances are compared, with a tolerance, and not objects: of two triangles
/// that share an edge either is right.
pub fn disagreements(right: &[Option<Hit>], found: &[Option<Hit>], tree: &Bvh, rays: &[Ray]) -> Disagreements {
    let diagonal = tree.root_aabb().map_or(0.0, |root| root.extent().length());
    compare(right, found, |index, right, found| {
        let length = rays.get(index).map_or(1.0, |ray| ray.direction().as_dvec3().length());
        // Any-hit queries have no distance.
        right == &SOME_HIT || (f64::from(right.t) - f64::from(found.t)).abs() * length <= TOLERANCE * diagonal
    })
}

/// How answers of ours differ: by any bit.
fn exact_disagreements(right: &[Option<Hit>], found: &[Option<Hit>]) -> Disagreements {
    compare(right, found, |_, right, found| right == found)
}

fn compare(
    right: &[Option<Hit>],
    found: &[Option<Hit>],
    same: impl Fn(usize, &Hit, &Hit) -> bool,
) -> Disagreements {
    let mut differ = Disagreements::default();
    for (index, pair) in right.iter().zip(found).enumerate() {
        match pair {
            (Some(_), None) => differ.missed += 1,
            (None, Some(_)) => differ.false_hits += 1,
            (Some(right), Some(found)) => differ.other += u64::from(!same(index, right, found)),
            (None, None) => {}
        }
    }
    differ
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, median_cut, muller_fellner};

    #[test]
    fn all_layouts_of_all_trees_answer_bit_by_bit_the_same() {
        let scene = Scene::load("escher:3000").unwrap();
        let good = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let bad = median_cut::Config::default().build(&scene.boxes).unwrap();
        let entry = |method, tree| Entry { method, tree, peer: None };
        let config: Config = toml::from_str("count = 5000\nrounds = 2").unwrap();
        let (rows, times) = measure(&config, &scene, &[entry("good", &good), entry("bad", &bad)], 1, || false)
            .unwrap()
            .unwrap();
        assert_eq!((rows.len(), times.len()), (24, 24));
        assert!(times.iter().all(|row| 0.0 < row.seconds && row.seconds <= row.median_seconds));
        for row in &rows {
            assert!(row.hits > 100 && row.hits < row.count, "{row:?}");
            assert_eq!((row.missed_hits, row.false_hits, row.other_hits), (0, 0, 0), "{row:?}");
        }
        let boxes = |method: &str, layout: &str| -> f64 {
            let own = rows.iter().filter(|row| row.method == method && row.layout == layout);
            own.filter_map(|row| row.boxes_per_ray).sum()
        };
        assert!(
            boxes("good", "binary") < boxes("bad", "binary") && boxes("good", "wide") < boxes("bad", "wide")
        );
        assert_eq!(boxes("good", "wide"), boxes("good", "wide, portable"));
    }

    #[test]
    fn answers_are_compared_by_place_and_not_by_object() {
        let scene = Scene::load("escher:100").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let rays = rays(Kind::Primary, 4, &scene, &tree, &Camera::default(), 1);
        let hit = |t, object| Some(Hit { t, object });
        let right = [hit(1.0, 1), hit(1.0, 1), None, hit(1.0, 1)];
        let found = [hit(1.0, 2), None, hit(1.0, 1), hit(2.0, 1)];
        let differ = disagreements(&right, &found, &tree, &rays);
        assert_eq!(differ, Disagreements { missed: 1, false_hits: 1, other: 1 });
        assert_eq!(exact_disagreements(&right, &found).other, 2);
    }
}
