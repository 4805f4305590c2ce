//! What the cases ask besides the general promises.

pub mod files;
pub mod methods;
pub mod rays;
pub mod scenes;
