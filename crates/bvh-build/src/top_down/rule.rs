//! The rule that picks one of the candidate splits of a node.

use std::cmp::Ordering;

/// A candidate: the first `left` objects in the order of `axis` against the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// The cost by the builder's heuristic; lower is better.
    pub cost: f64,
    /// 0, 1 or 2.
    pub axis: u8,
    /// Number of objects on the left side, at least 1.
    pub left: u32,
    /// |objects left − objects right|.
    pub(super) imbalance: u32,
}

impl Split {
    pub(super) const NONE: Self =
        Self { cost: f64::INFINITY, axis: u8::MAX, left: 0, imbalance: u32::MAX };

    /// Orders candidates by cost, then by balance, then by axis, then by position. The order is
    /// total, so the result does not depend on the order of the scan, and input without area is
    /// halved.
    #[inline]
    pub(super) fn rank(&self, other: &Self) -> Ordering {
        self.cost.total_cmp(&other.cost).then_with(|| {
            (self.imbalance, self.axis, self.left).cmp(&(other.imbalance, other.axis, other.left))
        })
    }
}

/// The candidates of a node among which a rule chooses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shortlist {
    /// The best split of all axes.
    Best,
    /// The best split of one axis, 0, 1 or 2.
    AxisBest(u8),
    /// The best split of each of the three axes.
    AxisBests,
    /// The k best splits of all axes, or all if there are fewer.
    KBest(usize),
    /// The best split and all splits that cost less than (1 + α) times as much.
    Within(f64),
}

/// The choice among a node's candidates. The division calls it once per node of three or more
/// objects, for parents before their children and for a left subtree before the right one.
///
/// A rule sees no split cost, so the division is compiled once per cost and not once per rule.
pub trait SplitRule {
    /// Returns the candidates that the division shall find.
    fn shortlist(&mut self) -> Shortlist;

    /// Returns the index of the chosen split in a list of one or more, the best first. The division
    /// does not call it where the shortlist has a single split by definition.
    fn choose(&mut self, list: &[Split]) -> usize;
}

/// The deterministic rule of Müller & Fellner: the best candidate.
#[derive(Clone, Copy, Debug, Default)]
pub struct TakeBest;

impl SplitRule for TakeBest {
    fn shortlist(&mut self) -> Shortlist {
        Shortlist::Best
    }

    fn choose(&mut self, _list: &[Split]) -> usize {
        0
    }
}
