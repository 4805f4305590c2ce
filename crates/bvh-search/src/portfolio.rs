//! `best`: the methods that pay, in the order that pays, for any budget.
//!
//! 0. If the budget is small, milliseconds, unless a start is named: clustering, reinsertion, and no more
//!    if these take it all.
//! 1. Greedy division with |L|^0.9.
//! 2. If the end is known, from the budget's work or the observer's [progress](crate::Observer::progress): one long
//!    descent of the temperature of annealed ruin and recreate. It starts at once, since what a local search had found
//!    would be forgotten; and at equal work it ends lower than several equal ones, one after another or side by side
//!    and fused. If there is much to be done, several short descents from a lower temperature follow it: each loosens
//!    everything but the top of the tree, finds other optima here better and there worse, and fusing keeps the better
//!    ones.
//! 3. If it is not: reinsertion to a local optimum, then generations, each annealed from the incumbent and longer than
//!    the one before.
//!
//! What a descent ends with is fused with the incumbent, unless the end is known and it is the first, and better: that
//! keeps every part that became better and drops every part that became worse. If the first is worse under a clock,
//! there was no time to do anything, nor is there for fusing.

use crate::cooling::{Cooling, anneal, cool};
use crate::error::require;
use crate::fusing::fuse;
use crate::incumbent::Incumbent;
use crate::quick::{self, Quick};
use crate::ruin_recreate::{Mover, Ruin, Scale};
use crate::start::Start;
use crate::stream::{Stream, stream};
use crate::working::Working;
use crate::{Observer, Problem, Quota, Run, Search, SearchError, Tally, exact, reinsertion};
use bvh_core::Bvh;

/// How long the generations are and how hot.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Work per object of the first generation if the end is not known, at least 1. Default 1500.
    pub first: f64,
    /// How many times longer every generation is than the one before, at least 1, if the end is not known. Default 2.
    pub growth: f64,
    /// Most work per object of a generation if the end is known, at least 1, but at most 200 per object for each other
    /// object; more is divided equally. Default 100 000.
    pub longest: f64,
    /// Work per object of all generations together, unless the budget has less. Default 1 000 000.
    pub work_per_object: u64,
    /// First temperature per 1000 nodes of a generation's work per object, above 0. Default 0.02.
    pub heat: f64,
    /// Highest temperature, above 0. Default 0.2.
    pub hottest: f64,
    /// Last temperature, above 0. Default 0.003.
    pub cold: f64,
    /// First temperature of the descents after a long one, above 0. Default 0.07.
    pub reheat: f64,
    /// Their number, 0 to 1000. Default 6.
    pub reheats: u32,
    /// The part of the work or time that is kept for them, above 0 and below 1. Default 0.3.
    pub reheated: f64,
    /// A descent is long, and there are others after it, from this work per object on, above 0. Default 7000.
    pub reheats_from: f64,
    /// Disjoint pieces of the tree that are annealed at once, 0 to 4096; so many threads can help. The default, 0, is
    /// the whole tree, which is a little better at equal work; but four per thread if the time is known and there are
    /// several threads.
    pub pieces: u32,
    /// Work per object of a descent from which on its temperatures are relative to [the top](Scale::Top) whatever the
    /// move says, above 0: longer ones end lower then, shorter ones higher. Default 20 000.
    pub top_from: f64,
    /// The move.
    pub ruin: Ruin,
    /// The builder of the start. By default that of least cost for the budget: agglomerative clustering if it is
    /// small, else division with |L|^0.9.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub start: Option<Start>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            first: 1500.0,
            growth: 2.0,
            longest: 100_000.0,
            work_per_object: 1_000_000,
            heat: 0.02,
            hottest: 0.2,
            cold: 0.003,
            reheat: 0.07,
            reheats: 6,
            reheated: 0.3,
            reheats_from: 7000.0,
            pieces: 0,
            top_from: 20_000.0,
            ruin: Ruin::default(),
            start: None,
        }
    }
}

impl Config {
    pub(crate) fn check(&self) -> Result<(), SearchError> {
        for (name, found) in [("first", self.first), ("growth", self.growth), ("longest", self.longest)] {
            require(found >= 1.0 && found.is_finite(), name, found, "1 or more")?;
        }
        for (name, found) in
            [("heat", self.heat), ("hottest", self.hottest), ("cold", self.cold), ("reheat", self.reheat)]
        {
            require(found > 0.0 && found.is_finite(), name, found, "above 0")?;
        }
        require(self.reheats_from > 0.0, "reheats_from", self.reheats_from, "above 0")?;
        require(self.top_from > 0.0, "top_from", self.top_from, "above 0")?;
        let part = self.reheated;
        require(part > 0.0 && part < 1.0, "reheated", part, "above 0, below 1")?;
        require(self.reheats <= 1000, "reheats", self.reheats.into(), "0 to 1000")?;
        require(self.pieces <= 4096, "pieces", self.pieces.into(), "0 to 4096")?;
        self.ruin.check()
    }

    /// Improves the incumbent until the work is done or the time is over.
    pub(crate) fn improve(&self, tree: &mut Working, seed: u64, best: &mut Incumbent, run: &mut Run) {
        let n = tree.objects() as u64;
        if n < 3 {
            return;
        }
        let (own, observer) = (self.work_per_object.saturating_mul(n), run.observer());
        let timed = observer.progress().is_some();
        let known = timed || run.left().work <= own;
        let mut left = own.min(run.left().work);
        if known {
            let mut length = left as f64 / n as f64;
            // When to be done, with what is converted at the end still to come.
            let mut end_of_all = 1.0;
            if timed {
                let quota = run.left().at_most(left.min(PROBE * n));
                let (tally, in_time) = self.probe(tree, stream(seed, 0), quota, observer);
                left = left.saturating_sub(tally.work);
                run.count(tally);
                let now = observer.progress().unwrap_or(1.0);
                end_of_all = 1.0 - (1.0 - now) * (FINISH * n as f64 / in_time).min(0.5);
                length = length.min(in_time / n as f64);
            }
            let (all, began) = (left, observer.progress().unwrap_or(0.0));
            let (plan, each) = self.plan(length, n);
            for (number, Planned { hot, until }) in (0..).zip(plan) {
                let due = (until * all as f64) as u64;
                let work = if timed { left } else { left.min(due.saturating_sub(all - left)) };
                let end = began + (end_of_all - began) * until;
                if observer.progress().is_some_and(|now| now >= end) {
                    continue;
                }
                let cooling = self.cooling(hot, work, end, length, run);
                let done = self.descend(tree, [seed, number], (&cooling, each), number == 0, best, run);
                left = left.saturating_sub(done);
            }
        } else {
            best.descend(tree, u32::MAX, run, |tree, _, quota, observer| {
                reinsertion::sweep_by_area(tree, quota, observer)
            });
            let mut length = self.first;
            for number in 0..MOST_GENERATIONS {
                let work = left.min((length * n as f64) as u64);
                let cooling = self.cooling(self.hot(length), work, 1.0, length, run);
                let done = self.descend(tree, [seed, number], (&cooling, length), false, best, run);
                left = left.saturating_sub(done);
                length *= self.growth;
            }
        }
    }

    /// The descents of so much work per object, and that of each long one.
    fn plan(&self, length: f64, n: u64) -> (Vec<Planned>, f64) {
        let longest = self.longest.min(WORK_PER_PAIR * n as f64);
        let equal = (length / longest).ceil().clamp(1.0, MOST_GENERATIONS as f64);
        let length = length / equal;
        let hot = self.hot(length);
        let reheats = if length < self.reheats_from { 0 } else { self.reheats };
        let kept = if reheats == 0 { 0.0 } else { self.reheated };
        let mut plan = Vec::new();
        for number in 0..equal as u64 {
            for reheat in 0..=reheats {
                let hot = if reheat == 0 { hot } else { hot.min(self.reheat) };
                let part = 1.0 - kept + kept * f64::from(reheat) / f64::from(reheats.max(1));
                plan.push(Planned { hot, until: (number as f64 + part) / equal });
            }
        }
        (plan, length)
    }

    /// The move of a descent of so much work per object.
    fn ruin_of(&self, length: f64) -> Ruin {
        let scale = if length < self.top_from { self.ruin.scale } else { Scale::Top };
        Ruin { scale, ..self.ruin.clone() }
    }

    /// First temperature of a descent of so much work per object, unless the last one is higher.
    fn hot(&self, length: f64) -> f64 {
        (self.heat * length / 1000.0).min(self.hottest)
    }

    fn cooling(&self, hot: f64, work: u64, end: f64, length: f64, run: &Run) -> Cooling {
        let quota = run.left().at_most(work);
        let pieces = self.pieces(run.observer().progress().is_some(), length);
        Cooling { hot: hot.max(self.cold), cold: self.cold, quota, end, pieces }
    }

    /// One descent from the incumbent. What it ends with is fused with that; but if it is the first, taken when better,
    /// and dropped when not and there is a clock. Returns its work.
    fn descend(
        &self,
        tree: &mut Working,
        [seed, number]: [u64; 2],
        (cooling, length): (&Cooling, f64),
        first: bool,
        best: &mut Incumbent,
        run: &mut Run,
    ) -> u64 {
        if run.stopped().is_some() || cooling.quota.work == 0 {
            return 0;
        }
        let observer: &dyn Observer = &Until { observer: run.observer(), end: cooling.end };
        let (mut annealed, mut done) = (tree.clone(), Tally::default());
        let streams = [seed, 1 + (number << 40)];
        let ruin = self.ruin_of(length);
        anneal(|| Mover::new(&ruin, length), cooling, &mut annealed, streams, observer, &mut |tree, tally| {
            done += tally;
            run.count(tally);
            if tree.area() < best.area() * (1.0 - WORTH_AN_EVENT) {
                best.offer(tree, run);
            }
        });
        if first && annealed.area() < tree.area() {
            *tree = annealed;
        } else if !first || observer.progress().is_none() {
            *tree = fuse(&[tree, &annealed]);
        }
        best.offer(tree, run);
        done.work
    }

    /// Moves at the lowest temperature. Also returns the work for which the rest of the time is enough at this rate.
    fn probe(
        &self,
        tree: &mut Working,
        mut rng: Stream,
        quota: Quota,
        observer: &dyn Observer,
    ) -> (Tally, f64) {
        let began = observer.progress();
        let tally =
            cool(&mut Mover::new(&self.ruin, PROBE as f64), tree, [self.cold; 2], quota, &mut rng, observer);
        let in_time = match (began, observer.progress()) {
            (Some(began), Some(now)) => tally.work as f64 * (1.0 - now).max(0.0) / (now - began).max(1e-9),
            _ => f64::INFINITY,
        };
        (tally, in_time)
    }

    /// How many pieces to anneal at once, with so much work per object.
    fn pieces(&self, timed: bool, length: f64) -> u32 {
        #[cfg(feature = "rayon")]
        if self.pieces == 0 && timed && length >= WORTH_PIECES && rayon::current_num_threads() > 1 {
            return 4 * rayon::current_num_threads().min(1024) as u32;
        }
        let _ = (timed, length);
        self.pieces.max(1)
    }
}

/// An observer who has a search return at `end`, if that is before all the time has passed.
struct Until<'a> {
    observer: &'a dyn Observer,
    end: f64,
}

impl Observer for Until<'_> {
    fn cancelled(&self) -> bool {
        self.observer.cancelled() || self.progress().is_some_and(|now| now >= self.end)
    }

    fn progress(&self) -> Option<f64> {
        self.observer.progress()
    }
}

/// A descent of the temperature, as planned.
struct Planned {
    /// Its first temperature.
    hot: f64,
    /// The part of all work, or time, that is over when it ends.
    until: f64,
}

/// What the incumbent must gain in a round to be converted and reported before the end of a generation.
const WORTH_AN_EVENT: f64 = 1e-3;

/// Work per pair of objects above which two descents end lower than one: so for the smallest scenes.
const WORK_PER_PAIR: f64 = 200.0;

/// Work per object that takes as long as what comes after the last move: a tree is sorted, converted and valued.
const FINISH: f64 = 10.0;

/// Work per object of all descents from which on pieces pay, if there are threads for them: less is not enough for the
/// rounds in which they are cut.
#[cfg(feature = "rayon")]
const WORTH_PIECES: f64 = 256.0;

/// Work per object after which the rate of work is known.
const PROBE: u64 = 4;

/// Ends the schedule when generations do not grow.
const MOST_GENERATIONS: u64 = 10_000;

impl Search for Config {
    /// Pieces, if there are several, are annealed in parallel, each with a stream of its own.
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        self.check()?;
        let own = self.work_per_object.saturating_mul(problem.boxes.len() as u64);
        if let Some(optimum) = exact::instead(problem, own, run)? {
            return Ok(optimum);
        }
        let quick = if self.start.is_none() { quick::search(problem, run)? } else { None };
        let (mut best, mut tree) = match quick {
            Some(Quick::Tree(tree)) => return Ok(tree),
            Some(Quick::Optimum(best, tree)) => (best, tree),
            None => Incumbent::build(&self.start.clone().unwrap_or_default(), problem, run)?,
        };
        self.improve(&mut tree, seed, &mut best, run);
        Ok(best.tree)
    }
}
