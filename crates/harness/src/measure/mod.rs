//! Rays through trees: how many tests they take, how fast they are, and whether the answers are right.

mod answers;
pub mod camera;
pub mod empirical_cost;
pub mod ray_cost;
pub mod rays;
pub mod segments;
pub mod speed;

pub use answers::disagreements;
