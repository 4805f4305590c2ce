//! Scenes read from files, in one program, which links the library once.

mod damaged_meshes;
mod dialects;
mod glb;
mod gltf;
mod meshes;
mod orient;
mod polygons;
mod samples;
