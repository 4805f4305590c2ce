//! The rays of measurements and of renderers, their tests in a tree, their segments up to the hit,
//! and the density of these segments.

mod camera;
mod empirical_cost;
mod random;
mod segments;

pub use camera::{Camera, View, frame};
pub use empirical_cost::{EmpiricalCost, Mean, RandomRays, empirical_cost, tests_per_ray};
pub use random::{Family, Kind, Viewpoint, in_box, on_sphere, random_ray};
pub use segments::{
    OF_ANYTHING, RenderedRays, TRAINED, TracedRay, anywhere, check_count, density, of_anything,
    of_inside, of_renderer,
};
