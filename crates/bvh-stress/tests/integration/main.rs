//! All methods, traversals and readers on stiff and extreme input, in one program.

mod fuzz;
mod laws;
mod never_worse;
mod objectives;
mod suite;
mod tightness;
