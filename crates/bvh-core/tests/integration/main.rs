//! The laws of trees, files and rays, in one program, which links the library once.

mod all_hits;
mod closest;
mod double;
mod exact;
mod export;
mod file;
mod instances;
mod ray_density;
mod references;
mod sky;
mod solid;
mod support;
mod traversal;
mod validate;
mod wide;
