// The crate's front page is its README.
#![doc = include_str!("../README.md")]

pub mod annealing;
#[cfg(feature = "std")]
mod bake;
mod baselines;
pub mod best;
mod candidates;
pub mod exact;
pub mod grasp;
mod local;
pub mod lower_bound;
mod optimize;
mod orders;
mod owned;
mod parallel;
pub mod prelude;
mod rays;
#[cfg(feature = "serde")]
mod registry;
mod run;
#[cfg(test)]
mod scatter;
pub mod shortcuts;
mod tree;
mod tuning;

pub use annealing::ruin_recreate;
#[cfg(feature = "std")]
pub use bake::{bake, bake_instances, improve};
pub use baselines::{LocalSearch, iterated, rebuild, rotation, treelet};
pub use bvh_build;
pub use bvh_core;
pub use local::initial::Start;
pub use local::reinsertion;
pub use optimize::optimize;
pub use orders::{genetic, random_orders};
pub use owned::{Improvement, Objects, Options, OwnedTree};
#[cfg(feature = "std")]
pub use rays::bake_for_rays;
pub use rays::{FindError, ray_density, ray_density_through};
#[cfg(feature = "serde")]
pub use registry::Method;
pub use run::{
    Budget, Event, Judge, Kept, Observer, Outcome, Problem, Quota, Run, Search, SearchError,
    Shortcut, Splits, StopReason, Stream, Tally, solve, solve_or_keep,
};
#[cfg(feature = "std")]
pub use run::{Deadline, Watched};
