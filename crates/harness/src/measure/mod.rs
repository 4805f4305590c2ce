//! Rays per second, and tests per ray: every tree in every layout, in turns, on one thread, answers compared.

mod answers;
mod cameras;
mod contenders;
pub mod rays;

use crate::measure::rays::Query;
use crate::peers::Peer;
use crate::report::statistics::{median, minimum};
use crate::run::rows::{TraceRow, TraceTimeRow};
use crate::scenes::Scene;
pub use answers::disagreements;
use answers::exact_disagreements;
use bvh_core::{Bvh, Hit, Ray, TestCounts};
pub use cameras::{Camera, rays};
pub use contenders::{Contender, timed};
use contenders::{PART, binary, own_contenders};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

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
    /// [`WideBvh`](bvh_core::WideBvh) with the best instructions of this machine.
    Wide,
    /// [`WideBvh`](bvh_core::WideBvh) with portable code.
    WidePortable,
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

/// The right answers: those of our binary traversal, which are those of testing every triangle.
pub fn reference(kind: Kind, rays: &[Ray], scene: &Scene, tree: &Bvh) -> Vec<Option<Hit>> {
    let mut hits = vec![None; rays.len()];
    if let Ok(triangles) = scene.triangles() {
        (binary("binary", Cow::Borrowed(tree), triangles, 0.0).trace)(kind.query(), rays, &mut hits);
    }
    hits
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
}
