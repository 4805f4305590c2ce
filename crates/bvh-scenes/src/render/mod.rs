//! Pictures of scenes: a small Whitted ray tracer whose picture does not depend on its acceleration
//! structure.
//!
//! Whitted 1980, 'An improved illumination model for shaded display': point lights, a shadow ray to
//! each light, mirror reflection to a limited depth. Differs from the paper: each pixel has a fixed
//! grid of rays instead of an adaptive one, no light is refracted, the ambient light is a
//! hemisphere, and a scene that is seen from outside has a ground.
//!
//! Data flows one way: [`View`](crate::rays::View) → [`Camera`](crate::rays::Camera) → rays →
//! [`Accelerator`](crate::trace::Accelerator) → `Surface` → light → [`Film`]. All computations
//! except ray tests use f64, and `libm` where the platform's functions may differ. The same scene
//! therefore gives the same bytes on every machine.

mod draw;
pub mod framing;
pub mod heat;
pub mod image;
mod light;
mod surface;

pub use draw::render;
pub use image::{Film, Options};
