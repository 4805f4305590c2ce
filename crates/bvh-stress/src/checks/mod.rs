//! The checks of single cases beyond the general promises.

pub mod files;
pub mod methods;
pub mod rays;
pub mod scenes;
