//! The laws of the searches, in one program, which links the library once.

mod bake;
mod cancellation;
mod local_search;
mod measure;
mod shortcuts;
