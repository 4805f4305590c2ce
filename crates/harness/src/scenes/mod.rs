//! Scenes by name: procedural ones, meshes from OBJ files, and subsets of all of them.

mod fnv;
pub mod obj;
mod scene;
pub mod spheres;
pub mod stand_ins;
pub mod stiff;
pub mod subset;

pub use fnv::fnv1a;
pub use scene::{FETCHED, NoTriangles, SPHERES, Scene, SceneKind, fetched_path};
