//! Rays per second, and tests per ray: every contender in turns, on one thread, with all answers compared.

use super::answers::{self, SOME_HIT};
use super::rays::{Kind, Viewpoint, rays};
use crate::run::rows::{TraceRow, TraceTimeRow};
use crate::scenes::Scene;
use crate::statistics::{median, minimum};
use bvh_build::{Accelerator, Query, Structure, config};
use bvh_core::cost::SahConstants;
use bvh_core::{Bvh, Coherence, Hit, InvalidBvh, Ray, TestCounts, WideBvh, collapse_leaves};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

config! {
    serde;
    /// Which rays are traced how often through which layouts, on scenes of triangles.
    pub struct Config {
        /// Rays of each kind.
        count: u32 = 1_000_000, in 1..=MOST_RAYS;
        /// Turns in which every contender traces all rays of a kind, after one that is not timed.
        rounds: u32 = 5, in 1..=1_000_000;
        /// Kinds of rays.
        rays: Vec<Kind> = vec![Kind::Incoherent, Kind::Primary, Kind::Bounce, Kind::Shadow];
        /// Layouts of our trees.
        layouts: Vec<Layout> = vec![Layout::Binary, Layout::BinaryLeaves, Layout::Wide, Layout::WidePortable];
        /// Cameras of primary rays by scene; for other scenes one outside the root's box.
        cameras: BTreeMap<String, Viewpoint>;
        /// The program of `scripts/ray-peers`, by which Embree and tinybvh trace too. All speeds go to `timing_rays.csv`.
        ray_peers: Option<PathBuf>;
    }
}

/// Most rays of a kind, all in memory at once.
const MOST_RAYS: u32 = 100_000_000;

/// A way to lay out one of our trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// The tree as it is.
    Binary,
    /// The tree with its leaves merged where the surface area heuristic, both constants 1, says so.
    BinaryLeaves,
    /// [`WideBvh`] with the best instructions of this machine.
    Wide,
    /// [`WideBvh`] with the best instructions of this machine, laid out once more: only noise tells its times from those
    /// of `Wide`.
    WideAgain,
    /// [`WideBvh`] that is handed batches of rays, which it traces in packets where they cohere, and else with
    /// many in flight.
    WideBatches,
    /// As `WideBatches`, laid out as if a block of triangles took half the time of a node.
    WideCheapBlocks,
    /// As `WideBatches`, laid out as if a block of triangles took twice the time of a node.
    WideDearBlocks,
    /// [`WideBvh`] with portable code.
    WidePortable,
}

impl Layout {
    /// Whether it is made for random lines alone, whatever rays the tree is for.
    pub fn is_for_lines(self) -> bool {
        matches!(self, Self::WideCheapBlocks | Self::WideDearBlocks)
    }
}

/// Rays that are traced together.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// What they ask.
    pub query: Query,
    /// Pixels per row of the picture that the rays go through, row by row from its upper left corner; 0 if they go through
    /// none.
    pub columns: u32,
    /// The rays.
    pub rays: &'a [Ray],
}

/// Answers rays, the distance and the object of a hit for each (any of both for an any-hit query), and returns the
/// seconds that each [`PART`] of the rays took. An error says why there are no answers.
pub type Trace<'a> = Box<dyn Fn(&Batch, &mut [Option<Hit>]) -> Result<Vec<f64>, String> + 'a>;

/// What traces the rays of a contender.
pub enum Tracer<'a> {
    /// One of ours. Its answers must be right bit by bit, and its tests are counted.
    Own(Accelerator<'a>),
    /// One of ours, batch by batch: packets share tests, which are not counted.
    Batches(WideBvh),
    /// Another library's.
    Other(Trace<'a>),
}

impl Tracer<'_> {
    /// Traces all rays; as [`Trace`].
    pub fn trace(&self, batch: &Batch, hits: &mut [Option<Hit>]) -> Result<Vec<f64>, String> {
        let rays = batch.rays;
        match (self, batch.query) {
            (Self::Other(trace), _) => trace(batch, hits),
            (Self::Own(own), Query::Any) => Ok(timed(rays, hits, |ray| own.any_hit(ray).then_some(SOME_HIT))),
            (Self::Own(own), _) => Ok(timed(rays, hits, |ray| own.nearest_hit(ray))),
            (Self::Batches(wide), query) => Ok(in_batches(wide, query, rays, hits)),
        }
    }
}

/// A structure that traces rays, and what it is called in tables.
pub struct Contender<'a> {
    /// Name of the layout.
    pub layout: String,
    /// The time it took to make the layout: of ours from a tree, of another library's from triangles.
    pub preparation_seconds: f64,
    /// What traces.
    pub tracer: Tracer<'a>,
}

/// Rays whose time is taken together. They are few, so that in some turn no other program interrupts them.
pub const PART: usize = 8192;

/// Answers every ray and returns the seconds that each part of them took.
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

/// Rays that the wide layout is handed at once: their answers stay in the first cache.
const BATCH: usize = 1024;

/// Answers every ray by batches and returns the seconds that each part of them took.
fn in_batches(wide: &WideBvh, query: Query, rays: &[Ray], hits: &mut [Option<Hit>]) -> Vec<f64> {
    let (mut nearest, mut any) = ([Hit::MISS; BATCH], [false; BATCH]);
    let mut batch = |(rays, hits): (&[Ray], &mut [Option<Hit>])| {
        let (nearest, any) = (&mut nearest[..rays.len()], &mut any[..rays.len()]);
        let start = Instant::now();
        if query == Query::Any {
            wide.any_hits(rays, any, Coherence::Coherent);
        } else {
            wide.nearest_hits(rays, nearest, Coherence::Coherent);
        }
        let seconds = start.elapsed().as_secs_f64();
        for ((hit, nearest), any) in hits.iter_mut().zip(nearest).zip(any) {
            let found = if query == Query::Any { any.then_some(SOME_HIT) } else { Some(*nearest) };
            *hit = found.filter(|hit| !hit.is_miss());
        }
        seconds
    };
    let part = |(rays, hits): (&[Ray], &mut [Option<Hit>])| {
        rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)).map(&mut batch).sum()
    };
    rays.chunks(PART).zip(hits.chunks_mut(PART)).map(part).collect()
}

/// One of our trees, valid over the scene, in each of these layouts; wide ones for rays that enter the tree's nodes as often as
/// `visits` says, if it does. An error says why there is no such layout.
pub fn own_contenders<'a>(
    layouts: &[Layout],
    scene: &'a Scene,
    tree: &'a Bvh,
    visits: Option<&[f32]>,
) -> Result<Vec<Contender<'a>>, String> {
    let contender = |&layout: &Layout| {
        let triangles = scene.triangles().map_err(|error| error.to_string())?;
        let accelerator = |structure| Tracer::Own(Accelerator::new(&scene.primitives, structure));
        let start = Instant::now();
        let made = |wide: Result<_, InvalidBvh>| wide.map_err(|error| error.to_string());
        let wide = || {
            made(match visits {
                Some(visits) => WideBvh::for_rays(tree, triangles, visits),
                None => WideBvh::new(tree, triangles),
            })
        };
        let blocks =
            |cost| Ok::<_, String>(Tracer::Batches(made(WideBvh::with_block_cost(tree, triangles, cost))?));
        let (name, tracer) = match layout {
            Layout::Binary => ("binary", accelerator(Structure::Tree(Cow::Borrowed(tree)))),
            Layout::BinaryLeaves => {
                let merged = collapse_leaves(tree, &SahConstants::default());
                ("binary, merged leaves", accelerator(Structure::Tree(Cow::Owned(merged))))
            }
            Layout::Wide => ("wide", accelerator(Structure::Wide(wide()?))),
            Layout::WideAgain => ("wide, again", accelerator(Structure::Wide(wide()?))),
            Layout::WideBatches => ("wide, batches", Tracer::Batches(wide()?)),
            Layout::WideCheapBlocks => ("wide, cheap blocks", blocks(0.5)?),
            Layout::WideDearBlocks => ("wide, dear blocks", blocks(2.0)?),
            Layout::WidePortable => ("wide, portable", accelerator(Structure::WidePortable(wide()?))),
        };
        Ok(Contender { layout: name.into(), preparation_seconds: start.elapsed().as_secs_f64(), tracer })
    };
    layouts.iter().map(contender).collect()
}

/// The rows of one scene.
pub type Rows = (Vec<TraceRow>, Vec<TraceTimeRow>);

/// Traces rays, the same for all, through the contenders of a scene, each with its method's label. `tree` is any valid
/// tree over the scene: the right answers, which are the same for every tree, come from it. `seed` draws the rays.
/// `None` as soon as `cancelled` says so. An error says which contender gave no answers.
pub fn measure(
    config: &Config,
    scene: &Scene,
    tree: &Bvh,
    contenders: &[(String, Contender)],
    seed: u64,
    cancelled: impl Fn() -> bool,
) -> Result<Option<Rows>, String> {
    let (mut rows, mut times) = Rows::default();
    let viewpoint = config.cameras.get(&scene.name).copied().unwrap_or_default();
    let reference = Tracer::Own(Accelerator::of_tree(&scene.primitives, tree));
    for &kind in &config.rays {
        let rays = rays(kind, config.count, scene, tree, &viewpoint, seed);
        let batch = Batch { query: kind.query(), columns: kind.columns(config.count), rays: &rays };
        let mut right = vec![None; rays.len()];
        reference.trace(&batch, &mut right)?;
        let of_kind = OfKind { scene, tree, kind, rays: &rays, right: &right };
        let mut hits = vec![None; rays.len()];
        // By contender, and by part of the rays, the seconds of each turn.
        let mut turns = vec![vec![Vec::new(); rays.len().div_ceil(PART)]; contenders.len()];
        for round in 0..=config.rounds {
            for ((method, contender), turns) in contenders.iter().zip(&mut turns) {
                if cancelled() {
                    return Ok(None);
                }
                hits.fill(None);
                let seconds = contender.tracer.trace(&batch, &mut hits)?;
                if round == 0 {
                    rows.push(of_kind.row(method, contender, &hits));
                } else {
                    turns.iter_mut().zip(seconds).for_each(|(turns, seconds)| turns.push(seconds));
                }
            }
        }
        for ((method, contender), parts) in contenders.iter().zip(&turns) {
            let sum = |of: fn(&[f64]) -> Option<f64>| parts.iter().filter_map(|turns| of(turns)).sum();
            times.push(TraceTimeRow {
                scene: scene.name.clone(),
                method: method.clone(),
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

/// The rays of one kind on one scene, and their right answers.
struct OfKind<'a> {
    scene: &'a Scene,
    tree: &'a Bvh,
    kind: Kind,
    rays: &'a [Ray],
    right: &'a [Option<Hit>],
}

impl OfKind<'_> {
    /// What a contender found, beside the right answers, and the tests that it took.
    fn row(&self, method: &str, contender: &Contender, hits: &[Option<Hit>]) -> TraceRow {
        let query = self.kind.query();
        let found = match (&contender.tracer, query) {
            (Tracer::Own(_) | Tracer::Batches(_), Query::Nearest) => {
                answers::exact_disagreements(self.right, hits)
            }
            _ => answers::disagreements(self.right, hits, self.tree, self.rays),
        };
        let counts = match &contender.tracer {
            Tracer::Own(own) => {
                let mut counts = TestCounts::default();
                self.rays.iter().for_each(|ray| _ = own.count(query, ray, &mut counts));
                Some(counts)
            }
            Tracer::Batches(_) | Tracer::Other(_) => None,
        };
        let per_ray = |tests: u64| tests as f64 / self.rays.len().max(1) as f64;
        TraceRow {
            scene: self.scene.name.clone(),
            method: method.into(),
            layout: contender.layout.clone(),
            rays: self.kind.name().into(),
            count: self.rays.len() as u64,
            hits: hits.iter().flatten().count() as u64,
            missed_hits: found.missed,
            false_hits: found.false_hits,
            other_hits: found.other,
            boxes_per_ray: counts.map(|counts| per_ray(counts.boxes)),
            objects_per_ray: counts.map(|counts| per_ray(counts.objects)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::ray_cost::TrainedOn;
    use bvh_build::{Builder, median_cut, muller_fellner};

    #[test]
    fn all_layouts_of_all_trees_answer_bit_by_bit_the_same() {
        let scene = Scene::load("escher:3000").unwrap();
        let good = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let bad = median_cut::Config::default().build(&scene.boxes).unwrap();
        let mut config: Config = toml::from_str("count = 5000\nrounds = 2").unwrap();
        config.layouts.push(Layout::WideBatches);
        let mut contenders = Vec::new();
        for (method, tree) in [("good", &good), ("bad", &bad)] {
            let own = own_contenders(&config.layouts, &scene, tree, None).unwrap();
            contenders.extend(own.into_iter().map(|contender| (method.to_owned(), contender)));
        }
        let (rows, times) = measure(&config, &scene, &good, &contenders, 1, || false).unwrap().unwrap();
        assert_eq!((rows.len(), times.len()), (40, 40));
        assert!(times.iter().all(|row| 0.0 < row.seconds && row.seconds <= row.median_seconds));
        for row in &rows {
            assert!(row.hits > 100 && row.hits < row.count, "{row:?}");
            assert_eq!((row.missed_hits, row.false_hits, row.other_hits), (0, 0, 0), "{row:?}");
        }
        let boxes = |method: &str, layout: &str| -> f64 {
            let own = rows.iter().filter(|row| row.method == method && row.layout == layout);
            own.filter_map(|row| row.boxes_per_ray).sum()
        };
        assert!(boxes("good", "binary") < boxes("bad", "binary"));
        assert!(boxes("good", "wide") < boxes("bad", "wide"));
        assert_eq!(boxes("good", "wide"), boxes("good", "wide, portable"));
    }

    #[test]
    fn a_tree_for_rays_is_traced_in_the_wide_layout_for_those_rays_and_answers_the_same() {
        let scene = Scene::load("escher:3000").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let trained = crate::measure::ray_cost::Config { trained: 5000, ..Default::default() };
        let visits = trained.density(TrainedOn::Camera, &scene, 2).unwrap().visits(&tree);
        let config: Config = toml::from_str("count = 5000\nrounds = 1\nrays = ['primary']").unwrap();
        let mut contenders = Vec::new();
        for (rays, visits) in [("lines", None), ("camera", Some(&visits[..]))] {
            let own = own_contenders(&config.layouts, &scene, &tree, visits).unwrap();
            contenders.extend(own.into_iter().map(|contender| (rays.to_owned(), contender)));
        }
        let (rows, _) = measure(&config, &scene, &tree, &contenders, 1, || false).unwrap().unwrap();
        assert!(rows.iter().all(|row| (row.missed_hits, row.false_hits, row.other_hits) == (0, 0, 0)));
        let tests = |rays: &str, layout: &str| {
            let row = rows.iter().find(|row| row.method == rays && row.layout == layout).unwrap();
            row.boxes_per_ray.unwrap() / 8.0 + row.objects_per_ray.unwrap() / 4.0
        };
        assert_eq!(tests("lines", "binary"), tests("camera", "binary"));
        assert!(tests("camera", "wide") < tests("lines", "wide"));
    }
}
