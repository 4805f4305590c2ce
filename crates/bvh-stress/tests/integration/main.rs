//! All methods, traversals and readers on stiff and extreme input, in one program.

mod any_bits;
mod fuzz;
mod hard_rays;
mod laws;
mod never_worse;
mod objectives;
mod orientation;
mod particles;
#[cfg(target_arch = "x86_64")]
mod subnormals;
mod suite;
mod tightness;
