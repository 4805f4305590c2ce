//! Measurements of trees: the tests of rays, and pictures.

pub mod picture;
pub mod ray_cost;
