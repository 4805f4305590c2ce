//! The rule that picks one of the candidate splits of a node.

use super::sweep::Split;

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
