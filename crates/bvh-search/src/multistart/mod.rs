//! Searches that lead many trees to a local optimum each: constructed at random, perturbed, or rebuilt in part.

pub mod grasp;
pub mod iterated;
pub mod rebuild;
