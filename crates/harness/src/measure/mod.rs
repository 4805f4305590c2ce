//! Rays through trees: how many tests they take, how fast they are, and whether the answers are right.

mod answers;
pub mod contender;
pub mod empirical_cost;
pub mod layout;
pub mod picture;
pub mod ray_cost;
pub mod speed;

pub use answers::disagreements;
