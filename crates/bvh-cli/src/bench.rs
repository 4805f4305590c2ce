//! `bvh bench`: how many rays a second a tree traces, against the greedy tree of its scene.

use crate::Error;
use crate::answer::{Answer, gain};
use crate::arguments::{greedy, scene_of};
use bvh_core::cost::call_in_turn;
use bvh_core::file::TreeFile;
use bvh_core::{Bvh, Coherence, DRay, DWideBvh, Hit, Primitives, Ray, Select, WideBvh};
use bvh_scenes::rays::{Camera, Kind, of_anything};
use bvh_scenes::render::framing;
use bvh_scenes::tree_file::{self, TreeFileError};
use bvh_scenes::{Scene, SceneError};
use clap::Args;
use glam::Vec3;
use serde_json::json;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Measure rays per second of a few kinds on one thread, through a tree and through the greedy tree
/// of its scene in turns. Per kind, prints the rays a second, and by how many per cent more they are
/// than through the greedy tree: the median over all rounds, and its 95 % interval. Where the
/// interval spans zero, which tree is faster is undecided.
///
/// Example: bvh bench house.bvh house.obj
#[derive(Args, Clone, Debug)]
pub struct BenchArgs {
    /// The tree file.
    #[arg(value_name = "FILE.bvh")]
    pub file: PathBuf,
    /// The tree's scene, by name or path of a mesh file.
    pub scene: String,
    /// How long to measure.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = humantime::parse_duration)]
    pub time: Duration,
}

/// The width and the height of the picture of primary rays.
const PIXELS: u32 = 256;
/// The rays of each family of [`of_anything`], of which each hit gives two more.
const COUNT: u32 = 20_000;
/// The least number of rounds, of which the first one only warms the memory.
const LEAST_ROUNDS: usize = 6;

/// Rays of one kind, and the seconds that they took in each round: through the tree, and through the
/// greedy one.
struct Measured {
    kind: Kind,
    rays: Vec<Ray>,
    seconds: Vec<[f64; 2]>,
}

/// Measures until the time is over, and prints one line per kind of rays.
pub fn bench(args: &BenchArgs, answer: &mut Answer) -> Result<(), Error> {
    let scene = scene_of(&args.file, &args.scene)?;
    let greedy = greedy(&scene)?;
    let layouts = [Layout::of_file(&args.file, &scene)?, Layout::new(&scene, &greedy, None)?];
    let mut kinds = rays(&scene, &greedy);
    let start = Instant::now();
    let mut round = 0;
    while round < LEAST_ROUNDS || start.elapsed() < args.time {
        for measured in &mut kinds {
            // What comes second finds its rays in the cache.
            let mut seconds = [0.0; 2];
            for which in [round % 2, 1 - round % 2] {
                seconds[which] = layouts[which].traced(measured.kind, &measured.rays);
            }
            measured.seconds.push(seconds);
        }
        round += 1;
    }
    for measured in &kinds {
        describe(measured, answer);
    }
    answer.record("scene", scene.name.as_str());
    answer.record("rounds", round - 1);
    answer.record("seconds", start.elapsed().as_secs_f64());
    Ok(())
}

/// A tree and its triangles in the wide layout.
pub enum Layout {
    Single(WideBvh),
    Double(Box<DWideBvh>),
}

impl Layout {
    /// Lays out a tree over a scene's triangles, as its search assumed if there are visits.
    fn new(scene: &Scene, tree: &Bvh, visits: Option<&[f32]>) -> Result<Self, Error> {
        let invalid = |error| SceneError::new(&scene.name, error);
        if let Primitives::Doubles(triangles) = &scene.primitives {
            let wide = DWideBvh::new(tree, triangles).map_err(invalid)?;
            return Ok(Self::Double(Box::new(wide)));
        }
        let triangles = scene.triangles()?;
        let wide = match visits {
            Some(visits) => WideBvh::for_rays(tree, triangles, visits),
            None => WideBvh::new(tree, triangles),
        };
        Ok(Self::Single(wide.map_err(invalid)?))
    }

    /// Lays out the tree in a file.
    pub fn of_file(path: &Path, scene: &Scene) -> Result<Self, Error> {
        let bytes = tree_file::read(path)?;
        let objects = Some(&scene.primitives);
        let read = || {
            let file = TreeFile::open(&bytes)?.for_objects(&scene.boxes, objects)?;
            let tree = file.tree_over(&scene.boxes, objects, &call_in_turn)?;
            Ok((tree, file.visits()?))
        };
        let (tree, visits) = read().map_err(TreeFileError::of(path))?;
        Self::new(scene, &tree, visits.as_deref())
    }

    /// Returns the seconds that rays take.
    fn traced(&self, kind: Kind, rays: &[Ray]) -> f64 {
        let coherence = match kind {
            Kind::Primary => Coherence::Coherent,
            _ => Coherence::Incoherent,
        };
        let is_any = kind == Kind::Shadow;
        let mut found = vec![false; rays.len()];
        match self {
            Self::Single(wide) => {
                let mut hits = vec![Hit::MISS; rays.len()];
                timed(|| match is_any {
                    true => wide.any_hits(rays, black_box(&mut found), coherence),
                    false => wide.nearest_hits(rays, black_box(&mut hits), coherence),
                })
            }
            Self::Double(wide) => {
                let mut hits = vec![None; rays.len()];
                let rays: Vec<DRay> = rays.iter().filter_map(double).collect();
                let (found, hits) = (&mut found[..rays.len()], &mut hits[..rays.len()]);
                let all = Select::default();
                timed(|| match is_any {
                    true => wide.any_hits(&rays, all, black_box(found), coherence),
                    false => wide.nearest_hits(&rays, all, black_box(hits), coherence),
                })
            }
        }
    }
}

fn double(ray: &Ray) -> Option<DRay> {
    let [origin, direction] = [ray.origin(), ray.direction()].map(Vec3::as_dvec3);
    DRay::new(origin, direction, ray.t_min().into(), ray.t_max().into()).ok()
}

fn timed(trace: impl FnOnce()) -> f64 {
    let start = Instant::now();
    trace();
    start.elapsed().as_secs_f64()
}

/// Returns rays of every kind: through a picture of the scene, row by row, and from anywhere.
fn rays(scene: &Scene, tree: &Bvh) -> Vec<Measured> {
    let camera = Camera::new(&framing::automatic(scene, 1.0), scene.up(), PIXELS, PIXELS);
    let pixels = (0..PIXELS * PIXELS).map(|pixel| [pixel % PIXELS, pixel / PIXELS].map(f64::from));
    let through = |[x, y]: [f64; 2]| {
        let direction = camera.direction(x + 0.5, y + 0.5).as_vec3();
        Ray::half_line(camera.origin.as_vec3(), direction).ok()
    };
    let primary = pixels.filter_map(through).collect();
    let mut kinds = vec![Measured { kind: Kind::Primary, rays: primary, seconds: Vec::new() }];
    let anywhere = of_anything(COUNT, &scene.primitives, tree, 1, &|| false);
    for kind in [Kind::Bounce, Kind::Shadow, Kind::Incoherent] {
        let of_kind = anywhere.iter().filter(|traced| traced.kind == kind);
        let rays = of_kind.map(|traced| traced.ray).collect();
        kinds.push(Measured { kind, rays, seconds: Vec::new() });
    }
    kinds.retain(|measured| !measured.rays.is_empty());
    kinds
}

/// Returns the median, and the ends of its 95 % interval, which are values themselves: another
/// program may slow down any round.
fn median(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_unstable_by(f64::total_cmp);
    let middle = 0.5 * (values.len() - 1) as f64;
    // As many values lie below the median as heads of so many coins fall.
    let half = 0.98 * (values.len() as f64).sqrt();
    [middle, middle - half, middle + half]
        .map(|place| values[(place.round().max(0.0) as usize).min(values.len() - 1)])
}

/// Prints the speed, and its ratio to the greedy tree's with its interval, over the rounds but the
/// first. The greedy tree's speed follows, so that it agrees with the ratio of each round.
fn describe(Measured { kind, rays, seconds }: &Measured, answer: &mut Answer) {
    let of_rounds = |value: fn(&[f64; 2]) -> f64| median(seconds[1..].iter().map(value).collect());
    let baked = rays.len() as f64 / of_rounds(|[baked, _]| *baked)[0];
    let [ratio, low, high] = of_rounds(|[baked, greedy]| greedy / baked);
    let greedy = baked / ratio;
    let undecided = if low <= 1.0 && high >= 1.0 { ", undecided" } else { "" };
    let name = kind.name();
    answer.say(&format!(
        "{name}: {:.2} million rays a second, {} against {:.2} of a greedy tree ({} to {}{undecided})",
        1e-6 * baked,
        gain(ratio, 1.0),
        1e-6 * greedy,
        gain(low, 1.0),
        gain(high, 1.0)
    ));
    answer.list(
        "kinds",
        json!({ "kind": name, "rays": rays.len(), "baked_per_second": baked,
            "greedy_per_second": greedy, "ratio": ratio, "ratio_interval": [low, high] }),
    );
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_median_and_its_interval_are_those_of_the_sign_test() {
        // The 95 % interval of the median of 100 values: the 41st to the 61st, or one nearer.
        let values = (1..=100u8).map(f64::from).rev().collect();
        assert_eq!(super::median(values), [51.0, 41.0, 60.0]);
        assert_eq!(super::median(vec![7.0]), [7.0; 3]);
        let [median, low, high] = super::median(vec![3.0, 1.0, 1e9, 2.0, 4.0, 5.0]);
        assert!(low == 1.0 && high == 1e9 && (3.0..=4.0).contains(&median));
    }
}
