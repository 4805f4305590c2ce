//! Finds the objects on a ray with any structure: a hierarchy, the wide layout, a KD-tree, or none.

mod accelerator;
mod kd_tree;
mod unpruned;

pub use accelerator::{Accelerator, Query, Structure};
pub use kd_tree::KdTree;
