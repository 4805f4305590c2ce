//! Local search: passes over the nodes of a tree, each making the moves that pay, until a pass
//! makes none.

pub(crate) mod incumbent;
pub(crate) mod initial;
pub mod reinsertion;

/// The fraction of its cost that a move must save. It exceeds rounding errors, so no two moves undo
/// each other forever.
pub(crate) const TOLERANCE: f64 = 1e-12;
