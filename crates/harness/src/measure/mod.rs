//! Rays through trees: what answers them, how many tests they take, how fast they are, and whether the answers are
//! right.

pub mod accelerator;
mod answers;
pub mod camera;
pub mod empirical_cost;
pub mod rays;
pub mod speed;

pub use accelerator::{Accelerator, Query, Structure};
pub use answers::disagreements;
