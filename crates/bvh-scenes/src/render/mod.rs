//! Pictures of scenes: a small Whitted ray tracer whose picture does not depend on the structure it traces with.
//!
//! Whitted 1980, 'An improved illumination model for shaded display': point lights, a shadow ray to each, mirror
//! reflection to a limited depth. Differs from the paper: a fixed grid of rays per pixel in place of adaptive ones; no
//! refraction; a hemisphere of ambient light, and a ground where the scene is seen from outside.
//!
//! Data flows one way: [`View`](crate::rays::View) → [`Camera`](crate::rays::Camera) → rays →
//! [`Accelerator`](crate::trace::Accelerator) → `Surface` → light → [`Film`]. Everything but ray tests is in f64,
//! with `libm` where the platform's functions may differ, so the same scene gives the same bytes on every machine.

mod draw;
mod film;
pub mod framing;
pub mod heat;
pub mod image;
mod key;
mod light;
pub mod structure;
mod surface;

pub use draw::{Options, render, tiles};
pub use film::Film;
pub use structure::StructureError;
