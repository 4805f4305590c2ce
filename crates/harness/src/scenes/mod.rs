//! Scenes by name: stand-ins made in code, spheres, meshes from files, and subsets of all of them.

pub mod obj;
mod scene;
pub mod standin;
pub mod subset;

pub use scene::{FETCHED, NoTriangles, Primitives, SPHERES, Scene, fetched_path, fnv1a};
