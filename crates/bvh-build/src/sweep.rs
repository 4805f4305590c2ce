//! The candidate splits of one node: every position along every axis, evaluated by two scans per axis.

use crate::evaluation::Evaluation;
use bvh_core::PackedAabb;
use std::cmp::Ordering;

/// A candidate: the first `left` objects in the order of `axis` against the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// By the node's [`Evaluation`]; lower is better.
    pub cost: f64,
    /// 0, 1 or 2.
    pub axis: u8,
    /// Number of objects on the left side, at least 1.
    pub left: u32,
    /// |objects left − objects right|.
    imbalance: u32,
}

impl Split {
    const NONE: Self = Self { cost: f64::INFINITY, axis: u8::MAX, left: 0, imbalance: u32::MAX };

    /// Cheaper first; of equal cost the more balanced, then the lower axis, then the lower position. A total
    /// order, so that ties never depend on the order of evaluation, and input without area is halved.
    #[inline]
    fn rank(&self, other: &Self) -> Ordering {
        self.cost.total_cmp(&other.cost).then_with(|| {
            (self.imbalance, self.axis, self.left).cmp(&(other.imbalance, other.axis, other.left))
        })
    }
}

/// How a builder picks one of a node's candidates. Asked once per node of three or more objects, parents first,
/// the left subtree before the right.
pub trait SplitRule {
    /// Picks a split of the node. The first question put to `node` must be one of its methods that scan.
    fn choose<E: Evaluation>(&mut self, node: &mut Sweep<'_, E>) -> Split;
}

/// The deterministic rule of Müller & Fellner: take the best.
#[derive(Clone, Copy, Debug, Default)]
pub struct TakeBest;

impl SplitRule for TakeBest {
    #[inline(always)]
    fn choose<E: Evaluation>(&mut self, node: &mut Sweep<'_, E>) -> Split {
        node.best()
    }
}

/// The objects of one node in the order of each axis, ready to be scanned. At least two objects.
#[derive(Debug)]
pub struct Sweep<'a, E> {
    pub(crate) boxes: &'a [PackedAabb],
    pub(crate) evaluation: &'a E,
    pub(crate) orders: [&'a [u32]; 3],
    /// Per axis, the lowest axis known to order the node's objects identically, usually itself.
    pub(crate) same_as: [u8; 3],
    /// Scratch of the node's length: entry j is the value of the right side that starts at position j.
    pub(crate) right: &'a mut [f64],
    /// The node's box, a by-product of the first scan.
    pub(crate) aabb: Option<PackedAabb>,
}

impl<E: Evaluation> Sweep<'_, E> {
    /// The best candidate of all axes. O(n); prunes exactly.
    #[inline(always)]
    pub fn best(&mut self) -> Split {
        let mut best = Split::NONE;
        for axis in self.distinct_axes() {
            best = self.improve(axis, best);
        }
        best
    }

    /// The best candidate of one axis. O(n).
    #[inline(always)]
    pub fn axis_best(&mut self, axis: u8) -> Split {
        self.improve(self.same_as[axis as usize], Split::NONE)
    }

    /// Replaces `best` by the best candidate of `axis` if that ranks before it.
    #[inline(always)]
    fn improve(&mut self, axis: u8, mut best: Split) -> Split {
        self.scan(axis, best.cost, |candidate| {
            if candidate.cost <= best.cost && candidate.rank(&best).is_lt() {
                best = candidate;
            }
            best.cost
        });
        best
    }

    /// The `k` best candidates of all axes into `list`, best first; fewer when there are fewer. Expected O(n)
    /// for small `k`, O(n·k) at worst.
    #[inline(always)]
    pub fn k_best(&mut self, k: usize, list: &mut Vec<Split>) {
        list.clear();
        for axis in self.distinct_axes() {
            // `list` is unordered while scanning; `worst` is its last-ranked entry once it is full.
            let mut worst = last_ranked(list, k);
            let bound = worst.map_or(f64::INFINITY, |at| list[at].cost);
            self.scan(axis, bound, |candidate| {
                match worst {
                    None => {
                        list.push(candidate);
                        worst = last_ranked(list, k);
                    }
                    Some(at) if candidate.cost <= list[at].cost && candidate.rank(&list[at]).is_lt() => {
                        list[at] = candidate;
                        worst = last_ranked(list, k);
                    }
                    Some(_) => {}
                }
                worst.map_or(f64::INFINITY, |at| list[at].cost)
            });
        }
        list.sort_unstable_by(Split::rank);
    }

    /// The best candidate and all others of cost below (1 + `alpha`) times the best into `list`, best first.
    /// O(n log n) at worst.
    #[inline(always)]
    pub fn within(&mut self, alpha: f64, list: &mut Vec<Split>) {
        list.clear();
        let best = self.best();
        let limit = best.cost * (1.0 + alpha);
        for axis in self.distinct_axes() {
            self.scan(axis, limit, |candidate| {
                if candidate.cost < limit {
                    list.push(candidate);
                }
                limit
            });
        }
        if !list.contains(&best) {
            list.push(best);
        }
        list.sort_unstable_by(Split::rank);
    }

    /// Number of objects in the node.
    #[inline(always)]
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.orders[0].len()
    }

    /// The axes that need scanning: identical orders have identical candidates, and the lower axis wins ties.
    #[inline(always)]
    fn distinct_axes(&self) -> impl Iterator<Item = u8> + use<E> {
        let same_as = self.same_as;
        (0..3).filter(move |&axis| same_as[axis as usize] == axis)
    }

    /// Evaluates the candidates of `axis` that can cost at most `bound`, by increasing position: one scan from
    /// the right values the right sides, one from the left the left sides. `visit` returns the bound from there
    /// on. Since a side only grows, each scan ends where its own side alone exceeds the bound.
    ///
    /// Source: Ng & Trifonov 2003, section 3.2. Differs from the paper: the pruning, which changes no result.
    #[inline(always)]
    fn scan(&mut self, axis: u8, mut bound: f64, mut visit: impl FnMut(Split) -> f64) {
        let order = self.orders[axis as usize];
        let n = order.len();
        let right = &mut self.right[..n];
        let candidate =
            |cost, left: usize| Split { cost, axis, left: left as u32, imbalance: n.abs_diff(2 * left) as u32 };

        let mut aabb = PackedAabb::EMPTY;
        let mut side = E::Side::default();
        let mut lowest = 1;
        for j in (1..n).rev() {
            aabb.grow(&self.boxes[order[j] as usize]);
            self.evaluation.add(&mut side, order[j]);
            let value = self.evaluation.side(aabb.half_area(), &side);
            right[j] = value;
            if self.evaluation.at_least(value) > bound {
                lowest = j + 1;
                break;
            }
        }
        let (first, last) = (&self.boxes[order[0] as usize], &self.boxes[order[n - 1] as usize]);
        let whole = *self.aabb.get_or_insert_with(|| aabb.union(first));
        let mut aabb = PackedAabb::EMPTY;
        let mut side = E::Side::default();
        if *first == whole && *last == whole {
            // Every side of every candidate has the node's box, so all cost the same but for rounding: halve.
            let area = whole.half_area();
            order[..n / 2].iter().for_each(|&object| self.evaluation.add(&mut side, object));
            let left = self.evaluation.side(area, &side);
            let mut side = E::Side::default();
            order[n / 2..].iter().for_each(|&object| self.evaluation.add(&mut side, object));
            visit(candidate(self.evaluation.join(left, self.evaluation.side(area, &side)), n / 2));
            return;
        }
        for &object in &order[..lowest - 1] {
            aabb.grow(&self.boxes[object as usize]);
            self.evaluation.add(&mut side, object);
        }
        for j in lowest..n {
            aabb.grow(&self.boxes[order[j - 1] as usize]);
            self.evaluation.add(&mut side, order[j - 1]);
            let value = self.evaluation.side(aabb.half_area(), &side);
            if self.evaluation.at_least(value) > bound {
                break;
            }
            bound = visit(candidate(self.evaluation.join(value, right[j]), j));
        }
    }
}

/// The position of the entry that ranks last, once `list` holds `k`.
#[inline(always)]
fn last_ranked(list: &[Split], k: usize) -> Option<usize> {
    if list.len() < k { None } else { (0..list.len()).max_by(|&a, &b| list[a].rank(&list[b])) }
}
