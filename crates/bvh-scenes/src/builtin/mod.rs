//! Scenes that are generated in code, the same on every machine.

pub mod spheres;
pub mod stand_ins;
pub mod stiff;
