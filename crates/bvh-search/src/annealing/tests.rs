//! Laws of annealing with known answers: rates of acceptance, temperatures, shares of work, streams.

use super::metropolis::{self, Mover};
use super::node_sampler::{NodeSampler, weight};
use super::ruin_recreate::{RuinMover, Scale};
use super::schedule::{Schedule, anneal};
use super::single::SingleMover;
use super::subtrees::{self, Round};
use crate::local::reinsertion;
use crate::run::{Observer, Quota, Stream, stream};
use crate::scatter::{built, scatter};
use crate::tree::{ANCHOR, Metric, Working};
use crate::tuning::{MOVES_PER_WINDOW, WINDOW, WINDOW_OF_SHORT_RUNS};
use bvh_build::muller_fellner;
use bvh_core::Aabb;
use rand::RngExt;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

fn greedy(boxes: &[Aabb]) -> Working {
    built(&muller_fellner::Config::default(), boxes)
}

/// Every move of some movers: the number of the mover, the temperature, and a random number.
#[derive(Default)]
struct Log {
    movers: AtomicU64,
    moves: Mutex<Vec<(u64, f64, u64)>>,
    /// The number of every mover that began, and of the nodes near which its moves begin.
    begun: Mutex<Vec<(u64, usize)>>,
}

impl Log {
    fn mover(&self) -> Recorder<'_> {
        Recorder { log: self, number: self.movers.fetch_add(1, Relaxed), work: 0 }
    }

    fn temperatures(&self) -> Vec<f64> {
        self.moves.lock().unwrap().iter().map(|&(_, temperature, _)| temperature).collect()
    }

    /// All random numbers that differ.
    fn draws(&self) -> BTreeSet<u64> {
        self.moves.lock().unwrap().iter().map(|&(_, _, draw)| draw).collect()
    }

    /// The moves of each mover.
    fn counts(&self) -> BTreeMap<u64, u64> {
        let mut counts = BTreeMap::new();
        self.moves
            .lock()
            .unwrap()
            .iter()
            .for_each(|(mover, ..)| *counts.entry(*mover).or_default() += 1);
        counts
    }
}

/// Makes moves of one unit of work that change nothing.
struct Recorder<'a> {
    log: &'a Log,
    number: u64,
    work: u64,
}

impl Mover for Recorder<'_> {
    fn begin(&mut self, _: &Working<impl Metric>, near: Vec<u32>) {
        self.log.begun.lock().unwrap().push((self.number, near.len()));
    }
    fn step(&mut self, _: &mut Working<impl Metric>, temperature: f64, rng: &mut Stream) -> bool {
        self.work += 1;
        self.log.moves.lock().unwrap().push((self.number, temperature, rng.random()));
        false
    }
    fn work(&self) -> u64 {
        self.work
    }
}

#[test]
fn a_worse_position_is_accepted_at_the_rate_of_metropolis() {
    let boxes = [0.0, 2.0, 5.0f32].map(|x| Aabb::from(([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])));
    let tree = greedy(&boxes);
    for temperature in [0.1, 0.5, 3.0] {
        let mut expected = 0.0;
        let mut all = 0.0;
        for node in tree.preorder() {
            let weight = weight(&tree, node);
            all += weight;
            if tree.nodes[node as usize].parent == ANCHOR {
                continue;
            }
            let mut rest = tree.clone();
            let (saved, sibling, _) = rest.detach(node);
            let places = rest.preorder().into_iter().filter(|&place| place != sibling);
            let added = places.map(|place| rest.clone().attach(node, place).0).reduce(f64::min);
            let rate = |added: f64| ((1.0 - added / saved) / temperature).exp().min(1.0);
            expected += weight * added.map_or(0.0, rate);
        }
        let expected = expected / all;
        let mut mover = SingleMover::default();
        mover.begin(&tree, vec![]);
        let rng = &mut stream(5, 0);
        let times = 100_000;
        let accepted =
            (0..times).filter(|_| mover.step(&mut tree.clone(), temperature, rng)).count();
        let found = accepted as f64 / f64::from(times);
        let most = 5.0 * (expected * (1.0 - expected) / f64::from(times)).sqrt();
        assert!((found - expected).abs() < most, "{temperature}: {found}, {expected}");
    }
}

/// Makes moves of a tree at one temperature. Returns how many were accepted, and the rise of each.
fn rises(mut mover: impl Mover, temperature: f64, by_layout: bool) -> Vec<Option<f64>> {
    let mut tree = greedy(&scatter(60));
    let cost = |tree: &Working| if by_layout { tree.layout_cost() } else { tree.area() };
    let rng = &mut stream(3, 0);
    mover.begin(&tree, vec![]);
    let step = |_| {
        let before = cost(&tree);
        let is_accepted = mover.step(&mut tree, temperature, rng);
        is_accepted.then(|| cost(&tree) / before - 1.0)
    };
    (0..6000).map(step).collect()
}

#[test]
fn nothing_climbs_at_temperature_zero_and_every_ruin_is_accepted_at_a_high_one() {
    for scale in [Scale::Saved, Scale::Top] {
        for by_layout in [false, true] {
            let mover = || RuinMover::new(scale, 1000.0, by_layout);
            let frozen = rises(mover(), 0.0, by_layout);
            assert!(frozen.iter().flatten().all(|rise| *rise <= 1e-12));
            assert!(frozen.iter().flatten().any(|rise| *rise < -1e-6) && frozen.contains(&None));
            assert!(!rises(mover(), 1e12, by_layout).contains(&None));
        }
    }
    let frozen = rises(SingleMover::default(), 0.0, false);
    assert!(frozen.iter().flatten().all(|rise| *rise <= 1e-12) && frozen.contains(&None));
}

#[test]
fn rises_are_as_rare_as_metropolis_says() {
    // Of the area of the whole tree, of which the top of a move has a part at most.
    let temperature = 0.05;
    let found = rises(RuinMover::new(Scale::Top, 1000.0, false), temperature, false);
    let higher = |least: f64| found.iter().flatten().filter(|rise| **rise > least).count() as f64;
    assert!(higher(0.0) > 200.0, "{}", higher(0.0));
    for scales in [1.0, 2.0, 3.0] {
        let most = 6000.0 * f64::exp(-scales);
        assert!(higher(scales * temperature) <= most, "{scales}: {}", higher(scales * temperature));
    }
}

#[test]
fn a_series_of_moves_cools_geometrically_from_hot_to_cold_within_its_quota() {
    let log = Log::default();
    let mut tree = greedy(&scatter(10));
    let mut cool = |quota| {
        let heat = [0.5, 0.02];
        metropolis::cool(&mut log.mover(), &mut tree, vec![], heat, quota, &mut stream(1, 0), &())
    };
    let tally = cool(Quota { work: 6400, moves: u64::MAX });
    assert_eq!((tally.work, tally.moves, tally.kept), (6400, 6400, 0));
    let temperatures = log.temperatures();
    assert!(temperatures.is_sorted_by(|a, b| a >= b) && temperatures[0] == 0.5);
    assert!((temperatures[3200] - 0.1).abs() < 1e-12 && temperatures[6399] < 0.021);
    assert_eq!(cool(Quota { work: 6400, moves: 10 }).moves, 10);
}

/// Anneals a tree of ten objects. Returns the work of each round.
fn annealed(log: &Log, quota: Quota, is_last: bool, observer: &dyn Observer) -> Vec<u64> {
    let mut tree = greedy(&scatter(10));
    let schedule =
        Schedule { hot: 0.3, cold: 0.003, quota, end: 1.0, subtrees: 1, to_local_optimum: is_last };
    let mut rounds = vec![];
    anneal(|| log.mover(), &schedule, &mut tree, [1, 0], observer, &mut |_, tally| {
        rounds.push(tally.work);
    });
    let again = reinsertion::pass_by_area(&mut tree, Quota::ENDLESS, &());
    assert!(!is_last || again.kept == 0, "no local optimum");
    rounds
}

#[test]
fn the_rounds_of_a_run_share_its_work_out_whole_and_leave_a_part_to_the_last_passes() {
    // A round of ten objects has 640 to 2560 nodes of work, or a hundredth of all.
    for (work, expected) in
        [(12_800, 20), (13_056, 20), (13_184, 21), (128_000, 100), (512_000, 200)]
    {
        let log = Log::default();
        let rounds = annealed(&log, Quota { work, moves: u64::MAX }, false, &());
        assert_eq!((rounds.len(), rounds.iter().sum()), (expected, work), "{rounds:?}");
        let temperatures = log.temperatures();
        assert!(temperatures.is_sorted_by(|a, b| a >= b) && temperatures[0] == 0.3);
        // The last round may be half a round longer than the part that the temperature falls over.
        let last = *temperatures.last().unwrap();
        assert!((0.003..0.0035).contains(&last), "{last}");
        assert_eq!(log.draws().len() as u64, work, "every round draws other numbers");
    }
    for (work, last) in [(12_800, 1600), (128_000, 3000)] {
        let log = Log::default();
        annealed(&log, Quota { work, moves: u64::MAX }, true, &());
        assert_eq!(log.temperatures().len() as u64, work - last);
    }
    let log = Log::default();
    annealed(&log, Quota { work: 12_800, moves: 1000 }, true, &());
    assert_eq!(log.temperatures().len(), 1000);
}

#[test]
fn a_clock_ends_a_run_cold_and_before_the_time_of_its_last_passes() {
    /// Tells the part of so many moves that have been made.
    struct Clock<'a>(&'a Log, f64);
    impl Observer for Clock<'_> {
        fn progress(&self) -> Option<f64> {
            Some(self.0.moves.lock().unwrap().len() as f64 / self.1)
        }
    }
    let log = Log::default();
    let quota = Quota { work: u64::MAX / 1024, moves: u64::MAX };
    let rounds = annealed(&log, quota, true, &Clock(&log, 60_000.0));
    let temperatures = log.temperatures();
    // The last passes may take 300 nodes per object.
    assert!((56_000..59_000).contains(&temperatures.len()), "{}", temperatures.len());
    assert!(rounds[0] == 640 && rounds.iter().all(|work| *work <= 2560), "{rounds:?}");
    assert!(temperatures[0] > 0.299 && *temperatures.last().unwrap() < 0.0033);
}

#[test]
fn subtrees_share_a_round_out_whole_and_draw_from_streams_of_their_own() {
    let sorted = || {
        let mut tree = greedy(&scatter(2000));
        tree.sort_in_preorder();
        tree
    };
    let cool = |quota, count| {
        let log = Log::default();
        let round = Round { heat: [0.1; 2], quota, count, streams: [1, 7] };
        let mut whole = log.mover();
        let tally = subtrees::cool(&round, &|| log.mover(), &mut whole, &mut sorted(), &());
        (tally, log)
    };
    let (tally, log) = cool(Quota { work: 100_000, moves: u64::MAX }, 8);
    assert_eq!(tally.work, 100_000);
    let counts = log.counts();
    // The first mover moves on the whole tree.
    assert!(counts.len() > 8 && (5_000..=12_600).contains(&counts[&0]), "{counts:?}");
    assert!(counts.values().all(|work| *work < 25_000), "{counts:?}");
    assert_eq!(log.draws().len(), 100_000);
    // It begins near the borders of the subtrees, whose own movers begin anywhere in them.
    let begun = log.begun.into_inner().unwrap();
    assert!(begun.iter().all(|&(mover, near)| (mover == 0) == (1..3999).contains(&near)));
    let (tally, _) = cool(Quota { work: u64::MAX, moves: 9000 }, 8);
    assert_eq!(tally.moves, 9000);
    let (_, log) = cool(Quota { work: 1000, moves: u64::MAX }, 1);
    assert_eq!(log.counts(), BTreeMap::from([(0, 1000)]));
}

#[test]
fn moves_begin_near_each_other_in_long_runs_and_in_larger_windows_in_short_ones() {
    let mut tree = greedy(&scatter(40_000));
    tree.sort_in_preorder();
    for (length, reach) in [(63.9, WINDOW_OF_SHORT_RUNS * WINDOW), (64.0, WINDOW)] {
        let mut sampler = NodeSampler::for_work(length);
        sampler.begin(&tree, vec![]);
        let rng = &mut stream(9, 0);
        let mut firsts = BTreeSet::new();
        for _ in 0..20 {
            let window: Vec<u32> = (0..MOVES_PER_WINDOW).map(|_| sampler.draw(rng)).collect();
            let [first, last] = [window.iter().min(), window.iter().max()].map(|end| *end.unwrap());
            assert!((last - first) as usize <= 2 * reach, "{length}: {first} to {last}");
            firsts.insert(first as usize / reach);
        }
        assert!(firsts.len() > 8, "{length}: {firsts:?}");
    }
}
