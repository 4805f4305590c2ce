// The crate's front page is its README.
#![doc = include_str!("../README.md")]

pub mod annealing;
mod bake;
mod baselines;
pub mod best;
mod candidates;
mod choose;
pub mod exact;
mod frames;
pub mod grasp;
mod local;
pub mod lower_bound;
mod optimize;
mod orders;
mod owned;
mod parallel;
pub mod prelude;
mod rays;
mod reason;
#[cfg(feature = "serde")]
mod registry;
mod run;
#[cfg(test)]
mod scatter;
pub mod shortcuts;
#[cfg(feature = "std")]
mod timed;
mod tree;
mod tuning;

pub use annealing::ruin_recreate;
pub use bake::{Bake, BakeError, Baked, Division};
pub use baselines::{rebuild, rotation, treelet};
pub use bvh_build;
pub use bvh_core;
pub use choose::{Chosen, MadeDensity, MadeRays, Open};
pub use frames::{Choice, Frames};
pub use local::reinsertion;
pub use optimize::optimize;
pub use orders::{genetic, random_orders};
pub use owned::{Anywhere, Objects, Options, OwnedTree};
pub use rays::ray_density;
pub use reason::{More, Reason, Tried};
#[cfg(feature = "serde")]
pub use registry::Method;
#[cfg(feature = "std")]
pub use run::Deadline;
pub use run::{
    Budget, Event, Judge, Kept, Observer, Outcome, Problem, Quota, Run, Search, SearchError,
    Shortcut, Splits, StopReason, Stream, Tally, solve, solve_or_keep,
};
#[cfg(feature = "std")]
pub use timed::{bake, bake_for_rays, improve};

/// The example of the project's README, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
