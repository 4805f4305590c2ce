//! Annealing on copies of a tree, one per thread, with the same result on any number of threads.
//!
//! Most moves leave the tree as it is, so any copy can try them. In a *turn*, every copy makes moves
//! alone and notes the accepted ones. Afterwards, the copies become equal again: one copy, another in
//! every turn, *leads*. The others take back their own moves and repeat the leader's; then all
//! repeat the moves of the others in one order:
//!
//! ```text
//!   leader │ moves, accepts a b │                          repeats c d │ moves, ...
//!   copy   │ moves, accepts c d │ takes back d c, repeats a b, repeats c d │ moves, ...
//! ```
//! A move that no longer fits after the others, or now adds too much area, is dropped. Unlike
//! [subtrees](super::subtrees), copies have no borders that hold moves back. But every copy needs
//! memory, and repeats as many moves as there are copies.

use super::metropolis::{self, Mover};
use super::subtrees::Round;
use crate::parallel;
use crate::run::{Observer, Quota, Stream, Tally, stream};
use crate::tree::{ANCHOR, Checkpoint, Metric, Working};
use crate::tuning::WORK_PER_TURN;
use bvh_core::with_vector_instructions;

/// The change of the area, relative to the whole, that may be a sum of rounding errors.
const ROUNDING: f64 = 1e-12;

/// The copies beside the tree itself, each with its mover.
pub(crate) struct Copies<M, A> {
    others: Vec<(Working<A>, M)>,
}

/// A copy during a round.
struct Copy<'a, M, A> {
    tree: &'a mut Working<A>,
    mover: &'a mut M,
    rng: Stream,
    /// Where the moves of a turn began.
    checkpoint: Checkpoint,
    /// True if this copy led the last turn.
    has_led: bool,
}

/// The accepted moves of one copy in one turn.
#[derive(Default)]
struct Accepted {
    moves: Vec<AcceptedMove>,
    /// The roots of the subtrees that the moves removed, move by move.
    removed: Vec<u32>,
    /// The roots with their new siblings, move by move.
    inserted: Vec<[u32; 2]>,
}

/// One accepted move.
struct AcceptedMove {
    /// Number of entries in `removed`.
    removed: usize,
    /// Number of entries in `inserted`.
    inserted: usize,
    /// The area that the move may add.
    limit: f64,
}

impl<M: Mover, A: Metric> Copies<M, A> {
    /// Makes no copies yet.
    pub fn new() -> Self {
        Self { others: Vec::new() }
    }

    /// Makes one round of annealing on as many copies as the round counts, at least one. The `tree`
    /// is in preorder before, and after unless the observer cancels. Nothing else may change it
    /// between two rounds. The first round copies the tree, O(n) memory per copy.
    pub fn cool(
        &mut self,
        round: &Round,
        mover: &impl Fn() -> M,
        whole: &mut M,
        tree: &mut Working<A>,
        observer: &dyn Observer,
    ) -> Tally {
        let Round { heat: [hot, cold], quota, count, streams: [seed, first] } = *round;
        self.others.resize_with(count as usize - 1, || (tree.clone(), mover()));
        let others = self.others.iter_mut().map(|(tree, mover)| (tree, mover));
        let mut copies: Vec<Copy<M, A>> = std::iter::once((tree, whole))
            .chain(others)
            .zip(first + 1..)
            .map(|((tree, mover), number)| Copy {
                tree,
                mover,
                rng: stream(seed, number),
                checkpoint: Checkpoint::default(),
                has_led: false,
            })
            .collect();
        on_each(&mut copies, |copy| copy.mover.begin(copy.tree, Vec::new()));
        let mut done = Tally::default();
        // The moves of the last turn, the leader's first.
        let mut accepted = Vec::new();
        let mut leader = 0;
        let factor = cold / hot;
        let temperature = |work: u64| {
            let fraction = work as f64 / quota.work as f64;
            hot * libm::pow(factor, fraction.min(1.0))
        };
        while !quota.is_reached(&done) && !observer.cancelled() {
            let left = quota.less(&done);
            let share = Quota {
                work: WORK_PER_TURN.min(left.work.div_ceil(u64::from(count))),
                moves: left.moves.div_ceil(u64::from(count)),
            };
            let end = done.work + share.work * u64::from(count);
            let heat = [done.work, end].map(temperature);
            let turns = on_each(&mut copies, |copy| turn(copy, &accepted, heat, share, observer));
            accepted.clear();
            for (tally, moves) in turns {
                done += tally;
                accepted.push(moves);
            }
            for (number, copy) in copies.iter_mut().enumerate() {
                copy.has_led = number == leader;
            }
            accepted.rotate_left(leader);
            leader = (leader + 1) % copies.len();
        }
        on_each(&mut copies, |copy| {
            copy.catch_up(&accepted);
            // A cancelled search must return soon, and every later round would sort first.
            if !observer.cancelled() {
                copy.tree.sort_in_preorder();
            }
        });
        done
    }
}

/// Calls a function with every copy, on all threads.
fn on_each<M: Mover, A: Metric, T: Send>(
    copies: &mut [Copy<M, A>],
    function: impl Fn(&mut Copy<M, A>) -> T + Sync,
) -> Vec<T> {
    parallel::map(copies.iter_mut().collect(), function)
}

with_vector_instructions! {
    /// Makes a copy equal to the others, then makes moves within a quota. Returns those accepted.
    turn = turn_plain<M: Mover, A: Metric>(
        copy: &mut Copy<M, A>, accepted: &[Accepted], heat: [f64; 2], quota: Quota, observer: &dyn Observer)
        -> (Tally, Accepted)
}

#[inline(always)]
fn turn_plain<M: Mover, A: Metric>(
    copy: &mut Copy<M, A>,
    accepted: &[Accepted],
    heat: [f64; 2],
    quota: Quota,
    observer: &dyn Observer,
) -> (Tally, Accepted) {
    let repeated = Tally { work: copy.catch_up(accepted), ..Tally::default() };
    let Copy { tree, mover, rng, checkpoint, .. } = copy;
    let mut own = Accepted::default();
    tree.begin_checkpoint(checkpoint);
    let mut tally = metropolis::moves(
        *mover,
        tree,
        heat,
        quota.less(&repeated),
        rng,
        observer,
        |mover, tree| {
            // Most accepted moves put every subtree back. Repeating them would take most of the
            // time.
            if tree.added().abs() > ROUNDING * tree.area() && own.note(mover) {
                tree.record(checkpoint);
            } else {
                tree.undo();
            }
        },
    );
    tally += repeated;
    (tally, own)
}

impl<M: Mover, A: Metric> Copy<'_, M, A> {
    /// Makes the copy equal to the others. `accepted` are the moves of all copies in the last turn,
    /// the leader's first. Returns the number of nodes visited.
    #[inline(always)]
    fn catch_up(&mut self, accepted: &[Accepted]) -> u64 {
        let Some((leading, others)) = accepted.split_first() else { return 0 };
        let mut visits = 0;
        if !self.has_led {
            self.tree.take_back(&mut self.checkpoint);
            // The leader keeps these moves without a test, which rounding could decide otherwise.
            visits += repeat_all(self.tree, leading, |_| f64::INFINITY);
        }
        for accepted in others {
            visits += repeat_all(self.tree, accepted, |one| one.limit);
        }
        visits
    }
}

impl Accepted {
    /// Notes the last move, and returns true. Returns false if it cannot be repeated.
    fn note(&mut self, mover: &impl Mover) -> bool {
        let Some(last) = mover.last_move() else { return false };
        self.removed.extend_from_slice(last.removed);
        self.inserted.extend_from_slice(last.inserted);
        self.moves.push(AcceptedMove {
            removed: last.removed.len(),
            inserted: last.inserted.len(),
            limit: last.limit,
        });
        true
    }
}

/// Repeats those accepted moves that still fit within their `limit`. Returns the number of nodes
/// visited.
#[inline(always)]
fn repeat_all(
    tree: &mut Working<impl Metric>,
    accepted: &Accepted,
    limit: impl Fn(&AcceptedMove) -> f64,
) -> u64 {
    let mut visits = 0;
    let mut removed = &accepted.removed[..];
    let mut inserted = &accepted.inserted[..];
    for one in &accepted.moves {
        let (removed_here, removed_later) = removed.split_at(one.removed);
        let (inserted_here, inserted_later) = inserted.split_at(one.inserted);
        if !repeat(tree, removed_here, inserted_here, limit(one), &mut visits) {
            tree.undo();
        }
        removed = removed_later;
        inserted = inserted_later;
    }
    visits
}

/// Repeats a move on a tree that other moves may have changed. Returns whether it adds at most
/// `limit` to the area; if it does not, or has no place any more, the tree is to be undone.
#[inline(always)]
fn repeat(
    tree: &mut Working<impl Metric>,
    removed: &[u32],
    inserted: &[[u32; 2]],
    limit: f64,
    visits: &mut u64,
) -> bool {
    tree.begin();
    for (number, &node) in removed.iter().enumerate() {
        let is_root = tree.nodes[node as usize].parent == ANCHOR;
        if is_root || !tree.is_attached(node, removed[..number].iter().copied()) {
            return false;
        }
        *visits += tree.detach(node).2;
    }
    for (number, &[node, sibling]) in inserted.iter().enumerate() {
        let detached = inserted[number..].iter().map(|&[node, _]| node);
        if !tree.is_attached(sibling, detached) {
            return false;
        }
        *visits += tree.attach(node, sibling).1;
    }
    tree.added() <= limit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::annealing::ruin_recreate::{Ruin, RuinMover};
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;

    /// Makes one round on three copies of a tree of 2000 objects. Returns the tree and its copies.
    fn cooled() -> Vec<Working> {
        let ruin = Ruin::default();
        let mover = || RuinMover::new(&ruin, 1000.0, false);
        let mut tree = built(&muller_fellner::Config::default(), &scatter(2000));
        tree.sort_in_preorder();
        let quota = Quota { work: 3_000_000, moves: u64::MAX };
        let round = Round { heat: [0.03, 0.003], quota, count: 3, streams: [1, 0] };
        let mut copies = Copies::new();
        let tally = copies.cool(&round, &mover, &mut mover(), &mut tree, &());
        assert!(tally.kept > 1000 && tally.work < 3_010_000, "{tally:?}");
        let others = copies.others.into_iter().map(|(copy, _)| copy);
        std::iter::once(tree).chain(others).collect()
    }

    #[test]
    fn copies_are_equal_and_valid_after_a_round() {
        let before = built(&muller_fellner::Config::default(), &scatter(2000));
        let trees = cooled();
        assert_eq!(trees.len(), 3);
        for tree in &trees {
            bvh_core::validate(&tree.to_bvh(), &scatter(2000)).unwrap();
            assert_eq!(tree.to_bvh(), trees[0].to_bvh());
            assert!((tree.area() - tree.internal_area()).abs() <= 1e-12 * tree.area());
            assert!(tree.area() < 0.99 * before.area());
        }
    }

    #[test]
    fn a_move_that_has_no_place_any_more_is_undone() {
        let mut tree = built(&muller_fellner::Config::default(), &scatter(50));
        tree.sort_in_preorder();
        let before = tree.to_bvh();
        let root = tree.root().unwrap();
        let [child, other] = tree.nodes[root as usize].children;
        let [below, _] = tree.nodes[child as usize].children;
        let moves = [
            // The root, a node removed with its parent, a place in the removed subtree, too dear.
            (vec![root], vec![[root, other]]),
            (vec![child, below], vec![[below, other], [child, other]]),
            (vec![child], vec![[child, below]]),
            (vec![below], vec![[below, other]]),
        ];
        for (removed, inserted) in moves {
            let one =
                AcceptedMove { removed: removed.len(), inserted: inserted.len(), limit: -1e9 };
            let accepted = Accepted { moves: vec![one], removed, inserted };
            repeat_all(&mut tree, &accepted, |one| one.limit);
            assert_eq!(tree.to_bvh(), before);
        }
    }
}
