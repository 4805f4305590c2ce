//! Local search: passes over the nodes of a tree, each making the moves that pay, until a pass
//! makes none.

pub(crate) mod incumbent;
pub mod reinsertion;

use bvh_build::muller_fellner;

/// The fraction of its cost that a move must save. It exceeds rounding errors, so no two moves undo
/// each other forever.
pub(crate) const TOLERANCE: f64 = 1e-12;

/// Returns the builder of the initial tree: Müller–Fellner with |L|^0.9. Local search from its trees
/// reaches lower costs than from trees of the original heuristic.
pub(crate) fn construction() -> muller_fellner::Config {
    let heuristic = muller_fellner::Heuristic::AreaTimesPower(0.9);
    muller_fellner::Config { heuristic, ..Default::default() }
}
