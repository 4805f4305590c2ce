//! Scenes read from files, in one program, which links the library once.

mod base_cost;
mod damaged_meshes;
mod glb;
mod gltf;
mod meshes;
mod obj;
mod samples;
