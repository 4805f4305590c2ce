//! Local search: passes over the nodes of a tree, each making the moves that pay, until a pass
//! makes none.

pub(crate) mod incumbent;
pub(crate) mod initial;
pub(crate) mod pass;
pub mod reinsertion;
