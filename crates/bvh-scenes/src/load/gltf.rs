//! Triangles from glTF 2.0 files, JSON or GLB, with the transforms of their nodes applied.
//!
//! `gltf-json` has the names and types of the format. References and ranges are checked here: its own check, and the readers of the
//! crate `gltf`, panic on files made for it. Materials, cameras, animations and skins are ignored: meshes stand as their nodes put them.

mod buffers;

use super::mesh::{Fault, MOST_TRIANGLES, Mesh, Place};
use buffers::Buffers;
use bvh_core::Triangle;
use glam::{DMat4, DQuat, DVec3, Vec3};
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::root::Get;
use gltf_json::scene::Node;
use gltf_json::validation::Checked::Valid;
use gltf_json::{Accessor, Index, Root};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

/// The most bytes of all buffers, and the most positions and indices: what [`MOST_TRIANGLES`] take without sharing any.
const MOST_BYTES: u64 = 48 * MOST_TRIANGLES as u64;
const MOST_ITEMS: u64 = 6 * MOST_TRIANGLES as u64;

/// Extensions that a file may require, because none of them changes its triangles: lights, materials, textures, metadata, and other types
/// of positions, which are refused where a mesh has them.
const HARMLESS: [&str; 25] = [
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_techniques_webgl",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

/// Whether a file may name buffers outside its own folder: somebody else's file then decides what is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutsideFiles {
    /// They are refused by name.
    #[default]
    Refused,
    /// They are read.
    Allowed,
}

impl From<bool> for OutsideFiles {
    /// Allowed if true.
    fn from(allowed: bool) -> Self {
        if allowed { Self::Allowed } else { Self::Refused }
    }
}

/// Reads the bytes of a glTF or GLB file, and the buffers that its meshes refer to, beside `path`.
pub fn parse(bytes: &[u8], path: &Path, outside: OutsideFiles) -> Result<Mesh, Fault> {
    let (root, chunk) = document(bytes, path)?;
    let mut scene = Scene::new(path, &root, Buffers::new(path, outside, chunk));
    for place in scene.places()? {
        scene.place(&place, &place.transform)?;
    }
    match scene.triangles.is_empty() {
        true => Err(no_triangle(path)),
        false => Ok(Mesh::new(scene.triangles)),
    }
}

/// The meshes of a file, each once, and where its nodes put them. In the order of both, with all transforms applied, they are what
/// [`parse`] gives.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Triangles in the mesh's own coordinates, by the mesh's number in the file: those meshes that have any and are placed.
    pub meshes: BTreeMap<usize, Vec<Triangle>>,
    /// Where they stand.
    pub places: Vec<Placed>,
}

/// A mesh, put somewhere by a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// The node's number in the file.
    pub node: usize,
    /// The mesh's number in the file.
    pub mesh: usize,
    /// From the mesh's coordinates to the scene's.
    pub transform: DMat4,
}

/// As [`parse`], with every mesh once.
pub fn parts(bytes: &[u8], path: &Path, outside: OutsideFiles) -> Result<Parts, Fault> {
    let (root, chunk) = document(bytes, path)?;
    let mut scene = Scene::new(path, &root, Buffers::new(path, outside, chunk));
    let mut places = scene.places()?;
    let mut meshes = BTreeMap::new();
    for place in &places {
        if let Entry::Vacant(first) = meshes.entry(place.mesh) {
            scene.place(place, &DMat4::IDENTITY)?;
            first.insert(std::mem::take(&mut scene.triangles));
        }
    }
    meshes.retain(|_, triangles| !triangles.is_empty());
    places.retain(|place| meshes.contains_key(&place.mesh));
    if places.is_empty() { Err(no_triangle(path)) } else { Ok(Parts { meshes, places }) }
}

fn no_triangle(path: &Path) -> Fault {
    Fault::new(
        path,
        Place::File,
        "no triangle in its scene; expected a glTF file with at least one",
    )
}

/// What a file says, and the bytes of the binary chunk of a GLB file.
fn document<'a>(bytes: &'a [u8], path: &Path) -> Result<(Root, Option<&'a [u8]>), Fault> {
    let fault = |message: String| Fault::new(path, Place::File, message);
    let (json, chunk) = match bytes.starts_with(b"glTF") {
        true => chunks(bytes).ok_or_else(|| {
            fault("no chunk of JSON in version 2; expected a GLB file, and whole".into())
        })?,
        false => (
            bytes
                .strip_prefix(b"\xef\xbb\xbf")
                .unwrap_or(bytes),
            None,
        ),
    };
    let root = Root::from_slice(json).map_err(|error| fault(error.to_string()))?;
    if let Some(unknown) = root
        .extensions_required
        .iter()
        .find(|name| !HARMLESS.contains(&name.as_str()))
    {
        let place = Place::Element("extensionsRequired".into());
        let message = format!(
            "`{unknown}`; expected none that changes triangles (compressed meshes cannot be read)"
        );
        return Err(Fault::new(path, place, message));
    }
    Ok((root, chunk))
}

/// The chunks of JSON and of binary data of a GLB file of version 2: each has its length and its kind before it.
fn chunks(bytes: &[u8]) -> Option<(&[u8], Option<&[u8]>)> {
    let chunk = |at: usize, kind: &[u8; 4]| {
        let head = bytes.get(at..)?.first_chunk::<8>()?;
        let length = u32::from_le_bytes(*head.first_chunk()?) as usize;
        (head[4..] == *kind)
            .then(|| bytes.get(at + 8..)?.get(..length))
            .flatten()
    };
    let json = (bytes.get(4..8)? == [2, 0, 0, 0])
        .then(|| chunk(12, b"JSON"))
        .flatten()?;
    Some((json, chunk(20 + json.len(), b"BIN\0")))
}

/// A file while its nodes are followed.
struct Scene<'a> {
    path: &'a Path,
    root: &'a Root,
    buffers: Buffers<'a>,
    triangles: Vec<Triangle>,
    /// Positions and indices read so far.
    items: u64,
}

/// The transform of a node into its parent's coordinates.
fn transform(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |of: Option<[f32; 3]>, or: DVec3| of.map_or(or, |v| DVec3::from(v.map(f64::from)));
    let turn = node
        .rotation
        .map_or(DQuat::IDENTITY, |turn| DQuat::from_array(turn.0.map(f64::from)).normalize());
    DMat4::from_scale_rotation_translation(
        vector(node.scale, DVec3::ONE),
        turn,
        vector(node.translation, DVec3::ZERO),
    )
}

impl<'a> Scene<'a> {
    fn new(path: &'a Path, root: &'a Root, buffers: Buffers<'a>) -> Self {
        Self { path, root, buffers, triangles: Vec::new(), items: 0 }
    }

    /// What an index refers to.
    fn get<T>(&self, index: Index<T>, name: &str) -> Result<&'a T, String>
    where
        Root: Get<T>,
    {
        self.root
            .get(index)
            .ok_or_else(|| format!("no {name}[{}]; expected one that exists", index.value()))
    }

    /// Follows the default scene, or the first one, from its roots. A node has one parent, so that none is reached twice.
    fn places(&self) -> Result<Vec<Placed>, Fault> {
        let path = self.path;
        let fault =
            |place: String, message: String| Fault::new(path, Place::Element(place), message);
        let scene = match self.root.scene {
            Some(index) => Some(
                self.get(index, "scenes")
                    .map_err(|message| fault("scene".into(), message))?,
            ),
            None => self.root.scenes.first(),
        };
        let mut places = Vec::new();
        let mut reached = vec![false; self.root.nodes.len()];
        let mut open: Vec<(Index<Node>, DMat4)> = Vec::new();
        open.extend(
            scene
                .iter()
                .flat_map(|scene| &scene.nodes)
                .rev()
                .map(|&node| (node, DMat4::IDENTITY)),
        );
        while let Some((index, parent)) = open.pop() {
            let place = || format!("nodes[{}]", index.value());
            let number = index.value();
            let node = self
                .get(index, "nodes")
                .map_err(|message| fault("scene".into(), message))?;
            if std::mem::replace(&mut reached[index.value()], true) {
                let message = "reached twice; expected a tree of nodes, each with one parent";
                return Err(fault(place(), message.into()));
            }
            let transform = parent * transform(node);
            if let Some(index) = node.mesh {
                self.get(index, "meshes")
                    .map_err(|message| fault(place(), message))?;
                places.push(Placed { node: number, mesh: index.value(), transform });
            }
            open.extend(
                node.children
                    .iter()
                    .flatten()
                    .rev()
                    .map(|&child| (child, transform)),
            );
        }
        Ok(places)
    }

    /// Adds the triangles of a node's mesh, moved.
    fn place(&mut self, place: &Placed, transform: &DMat4) -> Result<(), Fault> {
        let Placed { node, mesh, .. } = *place;
        for (number, primitive) in self.root.meshes[mesh]
            .primitives
            .iter()
            .enumerate()
        {
            self.add(primitive, transform)
                .map_err(|message| {
                    let place = format!("meshes[{mesh}].primitives[{number}] at nodes[{node}]");
                    Fault::new(self.path, Place::Element(place), message)
                })?;
        }
        Ok(())
    }

    /// Adds the triangles of a primitive; points and lines have none.
    fn add(&mut self, primitive: &Primitive, transform: &DMat4) -> Result<(), String> {
        let Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) =
            primitive.mode
        else {
            return Ok(());
        };
        let positions = *primitive
            .attributes
            .get(&Valid(Semantic::Positions))
            .ok_or("no POSITION; expected one")?;
        let mut points = Vec::new();
        for bytes in self.items(positions, Type::Vec3, &[ComponentType::F32])? {
            let point = bytes
                .as_chunks()
                .0
                .first_chunk()
                .map_or([f32::NAN; 3], |x| x.map(f32::from_le_bytes));
            let point = Vec3::from(point);
            let moved = transform
                .transform_point3(point.as_dvec3())
                .as_vec3();
            if !moved.is_finite() {
                return Err(format!(
                    "position {} is {point}, moved {moved}; expected finite numbers",
                    points.len()
                ));
            }
            points.push(moved);
        }
        let types = [ComponentType::U8, ComponentType::U16, ComponentType::U32];
        let indices: Vec<u32> = match primitive.indices {
            None => (0..points.len() as u32).collect(),
            Some(accessor) => {
                let index = |bytes: &[u8]| {
                    bytes
                        .iter()
                        .rev()
                        .fold(0, |index, &byte| index << 8 | u32::from(byte))
                };
                self.items(accessor, Type::Scalar, &types)?
                    .map(index)
                    .collect()
            }
        };
        if let Some(index) = indices
            .iter()
            .find(|&&index| index as usize >= points.len())
        {
            return Err(format!("index {index}; expected 0 to below {}", points.len()));
        }
        let count = if mode == Mode::Triangles {
            indices.len() / 3
        } else {
            indices.len().saturating_sub(2)
        };
        if self.triangles.len() + count > MOST_TRIANGLES {
            return Err(format!("more than {MOST_TRIANGLES} triangles in all; expected no more"));
        }
        self.triangles.extend((0..count).map(|at| {
            let corners = match mode {
                Mode::Triangles => [3 * at, 3 * at + 1, 3 * at + 2],
                Mode::TriangleFan => [0, at + 1, at + 2],
                // Every second triangle of a strip is turned.
                _ => [at, at + 1 + at % 2, at + 2 - at % 2],
            };
            Triangle(corners.map(|corner| points[indices[corner] as usize]))
        }));
        Ok(())
    }

    /// The bytes of every item of an accessor.
    fn items(
        &mut self,
        accessor: Index<Accessor>,
        type_: Type,
        components: &[ComponentType],
    ) -> Result<impl Iterator<Item = &[u8]>, String> {
        let place = format!("accessors[{}]", accessor.value());
        let accessor = self.get(accessor, "accessors")?;
        let component = components
            .iter()
            .find(|&&wanted| matches!(accessor.component_type, Valid(of) if of.0 == wanted));
        let (Some(component), true, None) =
            (component, accessor.type_ == Valid(type_), &accessor.sparse)
        else {
            let found = format!("{:?} of {:?}", accessor.type_, accessor.component_type);
            return Err(format!(
                "{place} is {found}, or sparse; expected {type_:?} of {components:?}"
            ));
        };
        let view = accessor.buffer_view.ok_or_else(|| {
            format!("{place} has no buffer view; expected one (compressed meshes cannot be read)")
        })?;
        let view = self.get(view, "bufferViews")?;
        self.buffers
            .need(self.root, view.buffer.value())?;
        let size = component.size() * type_.multiplicity();
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        let bytes = (|| {
            let number = |number: u64| usize::try_from(number).ok();
            let buffer = self.buffers.bytes(view.buffer.value())?;
            let bytes = buffer.get(number(view.byte_offset.map_or(0, |offset| offset.0))?..)?;
            let bytes = bytes.get(..number(view.byte_length.0)?)?;
            let bytes = bytes.get(number(accessor.byte_offset.map_or(0, |offset| offset.0))?..)?;
            let count = number(accessor.count.0)?;
            let need = stride
                .checked_mul(count.checked_sub(1)?)?
                .checked_add(size)?;
            (stride >= size)
                .then(|| bytes.get(..need))
                .flatten()
        })();
        let count = accessor.count.0;
        let bytes = bytes.ok_or_else(|| {
            format!("{place} reaches beyond its buffer; expected {count} items in it")
        })?;
        self.items += count;
        if self.items > MOST_ITEMS {
            return Err(format!(
                "{place} makes it {} positions and indices; expected at most {MOST_ITEMS}",
                self.items
            ));
        }
        Ok((0..count as usize).map(move |item| &bytes[item * stride..][..size]))
    }
}
