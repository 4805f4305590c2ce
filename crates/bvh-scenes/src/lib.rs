//! Scenes for bounding volume hierarchies, loaded by name or from a mesh file, with rays and
//! pictures.
//!
//! ```
//! let scene = bvh_scenes::Scene::load("escher:100").unwrap();
//! assert_eq!(scene.boxes.len(), 100);
//! ```
//!
//! [`load`] reads OBJ, PLY, STL and glTF files, and [`builtin`] generates scenes in code; a
//! [`Scene`] is either, or a [`subset`] of one. [`trace`] finds the objects on a ray with any
//! acceleration structure, [`rays`] generates rays for measurements and renderers and estimates
//! their density, and [`render`] draws a picture. [`files`] reads regular files only and replaces
//! files as a whole; [`tree_file`] reads the trees of scenes.

pub mod builtin;
pub mod files;
mod fnv;
pub mod load;
pub mod rays;
#[cfg(feature = "render")]
pub mod render;
mod scene;
pub mod subset;
pub mod trace;
pub mod tree_file;

pub use fnv::fnv1a;
pub use scene::{FETCHED, Precision, SPHERES, Scene, SceneError, SceneKind, fetched_path};
