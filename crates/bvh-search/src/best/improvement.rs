//! A search in progress, and one annealing run of it, recombined with the tree from before.

use super::config::Config;
use super::recombine::recombine;
use crate::annealing::references::Divider;
use crate::annealing::ruin_recreate::RuinMover;
use crate::annealing::schedule::{Schedule, anneal};
use crate::local::incumbent::Incumbent;
use crate::run::{Observer, Run, StopReason, Tally, stream};
use crate::tree::{Metric, Shape, Working};
use crate::tuning::{RECOMBINED_AT_ONCE, ROUNDS_PER_LOOK, WORK_ON_REFERENCES, WORTH_AN_EVENT};
use bvh_core::{Aabb, Bvh};

/// The number of the first trial run. Trial runs decide between two starts, and their numbers
/// follow the numbers of all other runs, so that no random stream is used twice.
pub(super) const TRIALS: u64 = 1 << 20;

/// An annealing run to make, with its schedule.
pub(super) struct ScheduledRun {
    /// Number of the run, which selects its random streams.
    pub number: u64,
    pub schedule: Schedule,
    /// Work per object, by which the moves are chosen: the work of a long run of the plan with its
    /// short runs, or of the generation.
    pub length: f64,
    /// True if the run replaces the tree where it ends better, instead of being recombined.
    pub is_first: bool,
}

/// The tree from before an annealing run.
enum Before {
    /// The incumbent is no worse.
    Incumbent,
    Shape(Shape),
    /// The tree with its area; leaves may hold parts of objects.
    Flat(Bvh, f64),
}

impl Before {
    /// Makes `tree` the tree from before the run again.
    fn restore(self, tree: &mut Working<impl Metric>, best: &Incumbent, boxes: &[Aabb]) {
        // A binary tree stays binary, so that no conversion fails.
        match self {
            Self::Shape(shape) => tree.reshape(&shape, boxes),
            Self::Flat(flat, area) => _ = tree.refill(&flat, area),
            Self::Incumbent => _ = best.refill(tree),
        }
    }
}

/// A search in progress.
pub(super) struct Improvement<'a, 'p, 'r, 's> {
    pub config: &'a Config,
    pub boxes: &'a [Aabb],
    pub seed: u64,
    /// Number of objects.
    pub n: u64,
    /// The remaining work.
    pub left: u64,
    /// True if the objective is the cost of the wide layout, not the area.
    pub by_layout: bool,
    /// Divides and reunites references, if they may change.
    pub divider: Option<Divider<'s>>,
    pub best: &'a mut Incumbent<'p>,
    pub run: &'a mut Run<'r>,
    /// True if the incumbent is at least as good as a local optimum of reinsertion.
    pub is_secured: bool,
}

impl Improvement<'_, '_, '_, '_> {
    /// Makes one annealing run from `tree` and recombines the tree with the result. The first run
    /// of a plan replaces the tree instead, if it ends better. If it does not and time is limited,
    /// the time was too short for annealing, and recombination is skipped, too.
    pub(super) fn anneal(&mut self, tree: &mut Working<impl Metric>, planned: &ScheduledRun) {
        let ScheduledRun { number, ref schedule, length, is_first } = *planned;
        if self.run.stopped().is_some() || schedule.quota.work == 0 {
            return;
        }
        let observer: &dyn Observer = &Until { observer: self.run.observer(), end: schedule.end };
        let mut done = Tally::default();
        let mut rounds = 0;
        // Every run has room for 2⁴⁰ random streams, enough for 2¹⁶ rounds. Stream 0 belongs to the
        // probe, the last streams to the divider.
        let streams = [self.seed, 1 + (number << 40)];
        let mut division = stream(self.seed, (1 << 63) + number);
        let ruin = self.config.ruin(length);
        let best = &mut *self.best;
        let run = &mut *self.run;
        let by_layout = self.by_layout;
        // Trees with different references cannot be recombined. Only the first run, which is not
        // recombined, may change references between its rounds; the other runs change them before
        // they begin.
        if let Some(divider) = self.divider.as_mut().filter(|_| !is_first) {
            tree.sort_in_preorder();
            let work = (schedule.quota.work as f64 * WORK_ON_REFERENCES) as u64;
            let tally = divider.pass(tree, run.left().at_most(work), &mut division, observer);
            run.count(tally);
            done += tally;
            best.offer(tree, run);
        }
        let metric = tree.metric();
        let cost_before = cost(tree, by_layout);
        let area_before = tree.area();
        let is_timed = observer.progress().is_some();
        // Recombination needs both trees, and a run that ends worse is discarded. A first run under
        // a time limit is not recombined, so that the incumbent can take the place of the tree,
        // unless a divider changes references or a trial compares two trees.
        let discards_to_incumbent =
            is_first && is_timed && !by_layout && self.divider.is_none() && number < TRIALS;
        let before = if discards_to_incumbent {
            best.offer(tree, run);
            Before::Incumbent
        } else if self.divider.is_some() {
            Before::Flat(tree.to_bvh(), area_before)
        } else {
            Before::Shape(tree.shape())
        };
        let mut divider = self.divider.as_mut().filter(|_| is_first);
        anneal(
            || RuinMover::new(&ruin, length, by_layout),
            schedule,
            tree,
            streams,
            observer,
            &mut |tree, tally| {
                done += tally;
                run.count(tally);
                if let Some(divider) = divider.as_mut().filter(|_| !observer.cancelled()) {
                    let work = (tally.work as f64 * WORK_ON_REFERENCES) as u64;
                    let tally =
                        divider.pass(tree, run.left().at_most(work), &mut division, observer);
                    done += tally;
                    run.count(tally);
                }
                rounds += 1;
                // A cancelled search offers its tree below, once.
                let is_cancelled = run.stopped() == Some(StopReason::Cancelled);
                if by_layout && rounds % ROUNDS_PER_LOOK == 0 && !is_cancelled
                    || !by_layout && tree.area() < best.area() * (1.0 - WORTH_AN_EVENT)
                {
                    best.offer(tree, run);
                }
            },
        );
        // The tree has been offered before, so that a cancelled search need not compare the two.
        // Nobody continues from the tree then, and a large one takes seconds to restore.
        if run.stopped() == Some(StopReason::Cancelled)
            && (by_layout || tree.objects() > RECOMBINED_AT_ONCE)
        {
            if done.kept > 0 {
                best.offer(tree, run);
            }
            return;
        }
        // The cost of a layout is no sum over clades, so such trees cannot be recombined.
        let is_better = cost(tree, by_layout) < cost_before;
        let is_recombined = !by_layout && !(is_first && (is_better || is_timed));
        if is_recombined || !is_better {
            // Recombination needs both trees.
            let annealed = is_recombined.then(|| std::mem::take(&mut tree.nodes));
            before.restore(tree, best, self.boxes);
            if let Some(annealed) = annealed {
                let annealed = Working::from_nodes(annealed, metric);
                *tree = recombine(&[&*tree, &annealed]);
            }
        }
        best.offer(tree, run);
        self.left = self.left.saturating_sub(done.work);
    }
}

/// Returns the cost of a tree. O(n).
pub(super) fn cost(tree: &Working<impl Metric>, by_layout: bool) -> f64 {
    if by_layout { tree.layout_cost() } else { tree.area() }
}

/// An observer that also cancels when the progress reaches `end`.
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
