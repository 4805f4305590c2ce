//! Simulated annealing of trees: one schedule for every kind of move.
//!
//! A `Mover` makes one Metropolis move (`metropolis`), which begins at a node drawn by
//! `node_sampler`. `subtrees` cuts the tree, so that several threads can move at once, and
//! `schedule` lowers the temperature. There are two kinds of moves, each a separate method: single
//! reinsertions, here, and [`ruin_recreate`].

pub(crate) mod layout;
mod metropolis;
mod node_sampler;
pub(crate) mod references;
pub mod ruin_recreate;
pub(crate) mod schedule;
mod side;
mod single;
mod subtrees;
#[cfg(test)]
mod tests;

pub(crate) use metropolis::cool;
pub use single::Config;
