//! Measurements of rays through trees: the number of tests, the speed, and the correctness of
//! answers.

mod answers;
pub mod contender;
pub mod layout;
pub mod picture;
pub mod ray_cost;
pub mod speed;

pub use answers::disagreements;
