//! Runs an experiment: jobs in, rows out, none lost.

pub mod archive;
pub mod check;
pub mod execute;
pub mod finish;
mod job;
mod judge;
mod perform;
pub mod provenance;
mod ray_cost;
pub mod reference;
pub mod resolved;
mod runs;
pub mod selection;
mod solved;
pub mod target;
mod trace;
mod work;
