//! The rule that picks one of the candidate splits of a node.

use super::split_cost::SplitCost;
use super::sweep::{Split, Sweep};

/// The choice among a node's candidates. The division calls it once per node of three or more
/// objects, for parents before their children and for a left subtree before the right one.
pub trait SplitRule {
    /// Chooses a split of the node, one that a method of `node` returned.
    fn choose<C: SplitCost>(&mut self, node: &mut Sweep<'_, C>) -> Split;
}

/// The deterministic rule of Müller & Fellner: the best candidate.
#[derive(Clone, Copy, Debug, Default)]
pub struct TakeBest;

impl SplitRule for TakeBest {
    #[inline(always)]
    fn choose<C: SplitCost>(&mut self, node: &mut Sweep<'_, C>) -> Split {
        node.best()
    }
}
