//! Scenes by name: procedural ones, meshes from OBJ, PLY, STL and glTF files, and subsets of all of them.

mod fnv;
pub(crate) mod gltf;
pub mod mesh;
pub mod obj;
pub mod open;
mod ply;
mod read;
mod scene;
pub mod spheres;
pub mod stand_ins;
pub mod stiff;
mod stl;
pub mod subset;

pub use fnv::fnv1a;
pub use read::ReadError;
pub use scene::{FETCHED, NoTriangles, SPHERES, Scene, SceneKind, fetched_path};
