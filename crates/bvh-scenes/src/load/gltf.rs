//! Triangles from glTF 2.0 files, JSON or GLB, with the transforms of their nodes applied.
//!
//! `gltf-json` declares the names and types of the format. This module checks references and ranges
//! itself, because the check in `gltf-json` and the readers in `gltf` panic on forged files.
//! Materials, cameras, animations and skins are ignored: nodes alone place the meshes.

mod buffers;
mod document;

use super::mesh::{Fault, MOST_TRIANGLES, Mesh, Place};
use buffers::Buffers;
use bvh_core::Triangle;
use document::document;
use glam::{DMat4, DQuat, DVec3, Vec3};
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::View;
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::root::Get;
use gltf_json::scene::Node;
use gltf_json::validation::Checked::Valid;
use gltf_json::{Accessor, Index, Root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The largest total size of all buffers: [`MOST_TRIANGLES`] with three positions and three indices
/// each.
const MOST_BYTES: u64 = 48 * MOST_TRIANGLES as u64;
/// The largest number of positions and indices: [`MOST_TRIANGLES`] that share no position.
const MOST_ITEMS: u64 = 6 * MOST_TRIANGLES as u64;

/// The treatment of buffers outside the file's folder. Reading them lets the author of the file
/// decide which files of the user are opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutsideFiles {
    /// The loader rejects them and names them.
    #[default]
    Rejected,
    /// The loader reads them.
    Allowed,
}

impl From<bool> for OutsideFiles {
    fn from(allowed: bool) -> Self {
        if allowed { Self::Allowed } else { Self::Rejected }
    }
}

/// Reads the bytes of a glTF or GLB file, and the buffers that its meshes refer to from the folder
/// of `path`.
pub fn parse(bytes: &[u8], path: &Path, outside: OutsideFiles) -> Result<Mesh, Fault> {
    let (root, chunk) = document(bytes, path)?;
    let mut loader = Loader::new(path, &root, Buffers::new(path, outside, chunk));
    let places = loader.places()?;
    check_size(&root, &places, path)?;
    for place in places {
        loader.place(&place, &place.transform)?;
    }
    match loader.triangles.is_empty() {
        true => Err(no_triangle(path)),
        false => Ok(Mesh::new(loader.triangles)),
    }
}

/// The meshes of a file, each once, and their places. The meshes in the order of the places, with
/// all transforms applied, are the triangles that [`parse`] returns.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Triangles in the mesh's own coordinates, by the mesh's number in the file. Contains only
    /// meshes with a place and at least one triangle.
    pub meshes: BTreeMap<usize, Vec<Triangle>>,
    /// The places of the meshes, in the order of the file's nodes.
    pub places: Vec<Placed>,
}

/// A mesh that a node places in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// The node's number in the file.
    pub node: usize,
    /// The mesh's number in the file.
    pub mesh: usize,
    /// The transform from the mesh's coordinates to the scene's.
    pub transform: DMat4,
}

/// Reads a file as [`parse`] does, but returns every mesh once.
pub fn parts(bytes: &[u8], path: &Path, outside: OutsideFiles) -> Result<Parts, Fault> {
    let (root, chunk) = document(bytes, path)?;
    let mut loader = Loader::new(path, &root, Buffers::new(path, outside, chunk));
    let mut places = loader.places()?;
    let mut placed = BTreeSet::new();
    let mut first_places = places.clone();
    first_places.retain(|place| placed.insert(place.mesh));
    check_size(&root, &first_places, path)?;
    let mut meshes = BTreeMap::new();
    for place in &first_places {
        loader.place(place, &DMat4::IDENTITY)?;
        meshes.insert(place.mesh, std::mem::take(&mut loader.triangles));
    }
    // A mesh of points or lines gives no triangles, and a tree needs at least one object.
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

/// A file while its nodes are followed.
struct Loader<'a> {
    path: &'a Path,
    root: &'a Root,
    buffers: Buffers<'a>,
    triangles: Vec<Triangle>,
    /// Positions and indices read so far.
    items: u64,
}

fn transform(node: &Node) -> DMat4 {
    // The format allows a matrix or its three parts, never both.
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    // Exporters round quaternions to f32, which would scale the mesh by a little.
    let rotation = node
        .rotation
        .map_or(DQuat::IDENTITY, |turn| DQuat::from_array(turn.0.map(f64::from)).normalize());
    DMat4::from_scale_rotation_translation(
        vector(node.scale, DVec3::ONE),
        rotation,
        vector(node.translation, DVec3::ZERO),
    )
}

fn vector(given: Option<[f32; 3]>, default: DVec3) -> DVec3 {
    given.map_or(default, |vector| DVec3::from(vector.map(f64::from)))
}

impl<'a> Loader<'a> {
    fn new(path: &'a Path, root: &'a Root, buffers: Buffers<'a>) -> Self {
        Self { path, root, buffers, triangles: Vec::new(), items: 0 }
    }

    fn get<T>(&self, index: Index<T>, name: &str) -> Result<&'a T, String>
    where
        Root: Get<T>,
    {
        self.root
            .get(index)
            .ok_or_else(|| format!("no {name}[{}]; expected one that exists", index.value()))
    }

    fn fault(&self, place: String, message: impl std::fmt::Display) -> Fault {
        Fault::new(self.path, Place::Element(place), message)
    }

    /// Follows the default scene, or the first one, from its roots. Rejects a node with two
    /// parents.
    fn places(&self) -> Result<Vec<Placed>, Fault> {
        let scene = match self.root.scene {
            Some(index) => Some(
                self.get(index, "scenes").map_err(|message| self.fault("scene".into(), message))?,
            ),
            None => self.root.scenes.first(),
        };
        let mut places = Vec::new();
        let mut reached = vec![false; self.root.nodes.len()];
        // Nodes are pushed in reverse, so that the stack returns them in the order of the file.
        let mut open: Vec<(Index<Node>, DMat4)> = Vec::new();
        open.extend(
            scene.iter().flat_map(|scene| &scene.nodes).rev().map(|&node| (node, DMat4::IDENTITY)),
        );
        while let Some((index, parent)) = open.pop() {
            let number = index.value();
            let node =
                self.get(index, "nodes").map_err(|message| self.fault("scene".into(), message))?;
            // A forged file could have a circle of nodes, which would never end.
            if std::mem::replace(&mut reached[number], true) {
                let message = "reached twice; expected a tree of nodes, each with one parent";
                return Err(self.fault(format!("nodes[{number}]"), message));
            }
            let transform = parent * transform(node);
            if let Some(mesh) = node.mesh {
                self.get(mesh, "meshes")
                    .map_err(|message| self.fault(format!("nodes[{number}]"), message))?;
                places.push(Placed { node: number, mesh: mesh.value(), transform });
            }
            open.extend(node.children.iter().flatten().rev().map(|&child| (child, transform)));
        }
        Ok(places)
    }

    fn place(&mut self, place: &Placed, transform: &DMat4) -> Result<(), Fault> {
        let Placed { node, mesh, .. } = *place;
        for (number, primitive) in self.root.meshes[mesh].primitives.iter().enumerate() {
            self.add(primitive, transform).map_err(|message| {
                let place = format!("meshes[{mesh}].primitives[{number}] at nodes[{node}]");
                self.fault(place, message)
            })?;
        }
        Ok(())
    }

    fn add(&mut self, primitive: &Primitive, transform: &DMat4) -> Result<(), String> {
        let Valid(mode) = primitive.mode else {
            return Err("an unknown mode; expected 0 to 6".into());
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
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
            let moved = transform.transform_point3(point.as_dvec3()).as_vec3();
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
                self.items(accessor, Type::Scalar, &types)?.map(little_endian).collect()
            }
        };
        // Checked before any use, because the indices come from the file.
        if let Some(index) = indices.iter().find(|&&index| index as usize >= points.len()) {
            return Err(format!("index {index}; expected 0 to below {}", points.len()));
        }
        let count = triangle_count(mode, indices.len());
        self.triangles.extend((0..count).map(|i| {
            let corners = match mode {
                Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
                Mode::TriangleFan => [0, i + 1, i + 2],
                // Every second triangle of a strip is turned, so that all have one orientation.
                _ => [i, i + 1 + i % 2, i + 2 - i % 2],
            };
            Triangle(corners.map(|corner| points[indices[corner] as usize]))
        }));
        Ok(())
    }

    fn items(
        &mut self,
        accessor: Index<Accessor>,
        type_: Type,
        components: &[ComponentType],
    ) -> Result<impl Iterator<Item = &[u8]>, String> {
        let place = format!("accessors[{}]", accessor.value());
        let accessor = self.get(accessor, "accessors")?;
        let component = components.iter().find(
            |&&wanted| matches!(accessor.component_type, Valid(component) if component.0 == wanted),
        );
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
        self.buffers.need(self.root, view.buffer.value())?;
        let size = component.size() * type_.multiplicity();
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        let buffer = self.buffers.bytes(view.buffer.value());
        let count = accessor.count.0;
        let bytes =
            buffer.and_then(|buffer| window(buffer, view, accessor, stride, size)).ok_or_else(
                || format!("{place} reaches beyond its buffer; expected {count} items in it"),
            )?;
        // A few accessors over the same bytes can stand for any number of items.
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

fn window<'a>(
    buffer: &'a [u8],
    view: &View,
    accessor: &Accessor,
    stride: usize,
    size: usize,
) -> Option<&'a [u8]> {
    if stride < size {
        return None;
    }
    // Every number comes from the file, so each step checks for overflow and for the buffer's end.
    let view_start = usize::try_from(view.byte_offset.map_or(0, |offset| offset.0)).ok()?;
    let view_length = usize::try_from(view.byte_length.0).ok()?;
    let start = usize::try_from(accessor.byte_offset.map_or(0, |offset| offset.0)).ok()?;
    let gaps = usize::try_from(accessor.count.0).ok()?.checked_sub(1)?;
    // The last item needs no padding after it.
    let length = stride.checked_mul(gaps)?.checked_add(size)?;
    let view_bytes = buffer.get(view_start..)?.get(..view_length)?;
    view_bytes.get(start..)?.get(..length)
}

fn little_endian(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte))
}

/// Rejects places that have more triangles together than a scene may have, before any of them takes
/// memory: a file of a few kilobytes can place one mesh any number of times. The meshes of all
/// places must exist.
fn check_size(root: &Root, places: &[Placed], path: &Path) -> Result<(), Fault> {
    let mut total = 0;
    for place in places {
        for primitive in &root.meshes[place.mesh].primitives {
            total += promised(root, primitive);
        }
        if total > MOST_TRIANGLES {
            return Err(Fault::new(
                path,
                Place::Element(format!("nodes[{}]", place.node)),
                format!("more than {MOST_TRIANGLES} triangles in all; expected no more"),
            ));
        }
    }
    Ok(())
}

/// Returns the number of triangles that the accessors of a primitive promise, at most one more than
/// a scene may have. A fault of the primitive is found when it is read.
fn promised(root: &Root, primitive: &Primitive) -> usize {
    let Valid(mode) = primitive.mode else { return 0 };
    let positions = primitive.attributes.get(&Valid(Semantic::Positions)).copied();
    let Some(accessor) = primitive.indices.or(positions).and_then(|accessor| root.get(accessor))
    else {
        return 0;
    };
    let items = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
    triangle_count(mode, items).min(MOST_TRIANGLES + 1)
}

fn triangle_count(mode: Mode, indices: usize) -> usize {
    match mode {
        Mode::Triangles => indices / 3,
        Mode::TriangleStrip | Mode::TriangleFan => indices.saturating_sub(2),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => 0,
    }
}
