//! Runs an experiment: jobs in, rows out, none of them lost.

pub mod archive;
pub mod check;
mod clocked;
pub mod columns;
pub mod execute;
pub mod finish;
mod job;
mod judge;
pub mod merge;
pub mod provenance;
mod ray_cost;
pub mod reference;
pub mod resolved;
pub mod rows;
pub mod shard;
pub mod store;
pub mod target;
mod trace;
