//! Rays per second and tests per ray: all contenders in interleaved rounds, on one thread, with all
//! answers compared.

use super::answers;
use super::contender::{Batch, Contender, PART, Tracer};
use super::layout::{Instructions, Layout};
use super::rays::{coherence, is_in_squares, query, rays};
use crate::rows::{TraceRow, TraceTimeRow};
use bvh_config::config;
use bvh_core::{Bvh, Hit, Ray, TestCounts};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Kind, Viewpoint};
use bvh_scenes::trace::{Accelerator, Query};
use harness::statistics::{median, median_interval, minimum};
use std::collections::BTreeMap;
use std::path::PathBuf;

config! {
    serde;
    /// The rays, layouts and rounds of a measurement, on scenes of triangles.
    pub struct Config {
        /// Rays of each kind.
        count: u32 = 1_000_000, in 1..=MOST_RAYS;
        /// Rounds in which every contender traces all rays of a kind, after one that is not timed.
        rounds: u32 = 5, in 1..=1_000_000;
        /// Kinds of rays.
        rays: Vec<Kind> = vec![Kind::Incoherent, Kind::Primary, Kind::Bounce, Kind::Shadow];
        /// Layouts of our trees.
        layouts: Vec<Layout> = default_layouts();
        /// Cameras of primary rays by scene; for other scenes a camera outside the root's box.
        cameras: BTreeMap<String, Viewpoint>;
        /// Instruction sets that the wide layouts are limited to, each in turn; sets that the
        /// processor lacks are skipped. None means the best set of the processor.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        instructions: Vec<Instructions>;
        /// The programs of `scripts/ray-peers`, which trace with Embree and tinybvh. All speeds go
        /// to `timing_rays.csv`.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        ray_peers: Vec<PathBuf>;
    }
}

/// The maximum number of rays of a kind, which are all in memory at once.
const MOST_RAYS: u32 = 100_000_000;

fn default_layouts() -> Vec<Layout> {
    vec![Layout::Binary, Layout::BinaryLeaves, Layout::Wide, Layout::WidePortable]
}

/// The row of one contender for rays of one kind on one scene, and the numbers that other libraries
/// are compared by.
pub struct Traced {
    /// Answers and tests.
    pub answers: TraceRow,
    /// Seconds.
    pub times: TraceTimeRow,
    /// The instruction set that the contender was limited to.
    pub instructions: String,
    /// The version of the contender's library.
    pub version: String,
    /// The seconds of each turn.
    pub turns: Vec<f64>,
}

/// Returns the seconds of each contender in each round, of which each begins with another contender.
pub fn in_turns(
    contenders: usize,
    rounds: usize,
    mut trace: impl FnMut(usize) -> f64,
) -> Vec<Vec<f64>> {
    let mut seconds = vec![Vec::with_capacity(rounds); contenders];
    for round in 0..rounds {
        for turn in 0..contenders {
            let at = (turn + round) % contenders;
            seconds[at].push(trace(at));
        }
    }
    seconds
}

/// Returns the median of the ratios of two contenders' seconds, round by round, and its interval.
///
/// # Panics
/// If there are no rounds.
pub fn ratio_of_rounds(over: &[f64], one: &[f64]) -> [f64; 3] {
    let ratios: Vec<f64> = over.iter().zip(one).map(|(over, one)| over / one).collect();
    let (low, high) = median_interval(&ratios).expect("rounds");
    [median(&ratios).expect("rounds"), low, high]
}

/// Traces the same rays through all contenders of a scene, each with its method's label.
///
/// The right answers come from `tree`; any valid tree over the scene gives the same. `seed` draws
/// the rays. Returns `None` once `cancelled` returns true.
///
/// # Errors
///
/// If a contender gives no answers; the message names it.
pub fn measure(
    config: &Config,
    scene: &Scene,
    tree: &Bvh,
    contenders: &[(String, Contender)],
    seed: u64,
    cancelled: impl Fn() -> bool,
) -> Result<Option<Vec<Traced>>, String> {
    let mut traced = Vec::new();
    let viewpoint = config.cameras.get(&scene.name).copied().unwrap_or_default();
    let reference = Tracer::Own(Accelerator::of_tree(&scene.primitives, tree));
    for &kind in &config.rays {
        let rays = rays(kind, config.count, scene, tree, &viewpoint, seed);
        let batch = Batch {
            query: query(kind),
            coherence: coherence(kind),
            in_squares: is_in_squares(kind, config.count),
            rays: &rays,
        };
        let mut right = vec![None; rays.len()];
        reference.trace(&batch, &mut right)?;
        let of_kind = OfKind { scene, tree, kind, rays: &rays, right: &right };
        let mut hits = vec![None; rays.len()];
        let mut answers = Vec::new();
        // The seconds of each part of the rays, by contender and round.
        let mut turns = vec![Vec::new(); contenders.len()];
        for round in 0..=config.rounds {
            for ((method, contender), turns) in contenders.iter().zip(&mut turns) {
                // A round takes seconds, so cancellation between rounds would be too late.
                if cancelled() {
                    return Ok(None);
                }
                // Answers of the contender before would hide rays that this one does not answer.
                hits.fill(None);
                let seconds = contender.tracer.trace(&batch, &mut hits)?;
                // The first round warms the caches up; its time does not count.
                if round == 0 {
                    answers.push(of_kind.row(method, contender, &hits));
                } else {
                    turns.push(seconds);
                }
            }
        }
        for (((_, contender), answers), turns) in contenders.iter().zip(answers).zip(&turns) {
            let by_part: Vec<Vec<f64>> = (0..rays.len().div_ceil(PART))
                .map(|part| turns.iter().map(|seconds| seconds[part]).collect())
                .collect();
            let fastest = by_part.iter().filter_map(|seconds| minimum(seconds.iter().copied()));
            let middle = by_part.iter().filter_map(|seconds| median(seconds));
            let times = TraceTimeRow {
                scene: answers.scene.clone(),
                method: answers.method.clone(),
                layout: answers.layout.clone(),
                rays: answers.rays.clone(),
                count: answers.count,
                rounds: config.rounds,
                preparation_seconds: contender.preparation_seconds,
                seconds: fastest.sum(),
                median_seconds: middle.sum(),
            };
            traced.push(Traced {
                answers,
                times,
                instructions: contender.instructions.clone(),
                version: contender.version.clone(),
                turns: turns.iter().map(|seconds| seconds.iter().sum()).collect(),
            });
        }
    }
    Ok(Some(traced))
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
    /// Compares a contender's answers with the right ones and counts its tests.
    fn row(&self, method: &str, contender: &Contender, hits: &[Option<Hit>]) -> TraceRow {
        let query = query(self.kind);
        let found = match (&contender.tracer, query) {
            (Tracer::Own(_) | Tracer::Batches(_), Query::Nearest) => {
                answers::exact_disagreements(self.right, hits)
            }
            // Other libraries round differently, and any-hit queries may find any object.
            _ => answers::disagreements(self.right, hits, self.tree, self.rays),
        };
        let counts = match &contender.tracer {
            Tracer::Own(accelerator) => {
                let mut counts = TestCounts::default();
                for ray in self.rays {
                    accelerator.count(query, ray, &mut counts);
                }
                Some(counts)
            }
            // Packets share tests, and other libraries do not count them.
            Tracer::Batches(_) | Tracer::Other(_) => None,
        };
        let rays = self.rays.len().max(1) as f64;
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
            boxes_per_ray: counts.map(|counts| counts.boxes as f64 / rays),
            objects_per_ray: counts.map(|counts| counts.objects as f64 / rays),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracing::layout::own_contenders;
    use bvh_build::{Builder, median_cut, muller_fellner};

    #[test]
    fn all_layouts_of_all_trees_answer_bit_by_bit_the_same() {
        let scene = Scene::load("escher:3000").unwrap();
        let good = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let bad = median_cut::Config::default().build(&scene.boxes).unwrap();
        let mut config: Config = toml::from_str("count = 5000\nrounds = 2").unwrap();
        config.layouts.push(Layout::WideBatches);
        let mut contenders = Vec::new();
        config.layouts.extend([Layout::WideDouble, Layout::WideBatchesDouble]);
        for (method, tree) in [("good", &good), ("bad", &bad)] {
            let own = own_contenders(&config.layouts, &[], &scene, tree, None).unwrap();
            contenders.extend(own.into_iter().map(|contender| (method.to_owned(), contender)));
        }
        let traced = measure(&config, &scene, &good, &contenders, 1, || false).unwrap().unwrap();
        assert_eq!(traced.len(), 56);
        for traced in &traced {
            let TraceTimeRow { seconds, median_seconds, .. } = traced.times;
            assert!(0.0 < seconds && seconds <= median_seconds);
            assert!(traced.turns.len() == 2 && traced.turns.iter().all(|turn| *turn >= seconds));
        }
        let rows: Vec<TraceRow> = traced.into_iter().map(|traced| traced.answers).collect();
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
}
