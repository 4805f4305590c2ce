//! Triangles from glTF 2.0 files, JSON or GLB, where the nodes place them.
//!
//! Reads the transforms of nodes, and quantised positions. Remarks name what else would move a
//! vertex: skins, morph targets, animations and other extensions. Each of these modules checks every
//! reference and range of the file itself.

mod accessors;
mod buffers;
mod document;
mod nodes;
mod orient;

use super::mesh::{Fault, FromFile, MOST_TRIANGLES, Mesh, Rounding, counted};
use accessors::{F32, I8, I16, U8, U16, U32};
use buffers::Buffers;
use document::{DECOMPRESS, Document, Primitive, document, is_covered};
use glam::{DMat4, DVec3};
use nodes::places;
pub use orient::glb;
pub(super) use orient::orient;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

/// The largest total size of all buffers: [`MOST_TRIANGLES`] with three positions and three indices
/// each.
const MOST_BYTES: u64 = 48 * MOST_TRIANGLES as u64;
/// The largest number of positions and indices: [`MOST_TRIANGLES`] that share no position.
const MOST_ITEMS: u64 = 6 * MOST_TRIANGLES as u64;

/// The meshes of a file, each once, and their places.
struct Parts<T> {
    /// Triangles in the mesh's own coordinates, by the mesh's number in the file. Contains only
    /// meshes with a place and at least one triangle.
    meshes: BTreeMap<usize, Vec<T>>,
    /// The places of the meshes, in the order of the file's nodes, except those in which no triangle
    /// has an area.
    places: Vec<Placed>,
    /// The file's contents besides plain triangles, one clause for each kind.
    remarks: Vec<String>,
}

/// A mesh that a node places in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// The node's number in the file.
    pub node: usize,
    /// The mesh's number in the file.
    pub mesh: usize,
    /// The transform from the mesh's coordinates to the scene's.
    pub transform: DMat4,
}

/// Reads the bytes of a glTF or GLB file, and the buffers that its meshes refer to from the folder
/// of `path`. Returns the meshes at their places.
pub fn parse<T: FromFile>(bytes: &[u8], path: &Path) -> Result<Mesh<T>, Fault> {
    let (document, chunk) = document(bytes)?;
    let Parts { mut meshes, places, mut remarks } = read::<T>(&document, chunk, path)?;
    let mut rounding = Rounding::<T>::default();
    // A file of a few kilobytes can place one mesh any number of times.
    let total = places.iter().map(|place| meshes[&place.mesh].len()).sum();
    check_total(total).map_err(Fault::of_file)?;
    let mut triangles = Vec::with_capacity(total);
    let last_nodes: BTreeMap<usize, usize> =
        places.iter().map(|place| (place.mesh, place.node)).collect();
    for Placed { node, mesh, transform } in places {
        for triangle in &meshes[&mesh] {
            let moved = triangle
                .corners()
                .map(|corner| transform.transform_point3(corner).map(|x| rounding.round(x)));
            if let Some(far) = moved.iter().find(|corner| !corner.is_finite()) {
                let message =
                    format!("a vertex of meshes[{mesh}] at {far}; expected finite numbers");
                return Err(Fault::of(&format!("nodes[{node}]"), message));
            }
            triangles.push(T::of(moved));
        }
        // Otherwise a file of meshes with one place each would take twice its memory.
        if last_nodes[&mesh] == node {
            meshes.remove(&mesh);
        }
    }
    remarks.extend(rounding.remark(&triangles));
    Ok(Mesh::new(triangles, remarks))
}

fn read<T: FromFile>(
    document: &Document,
    chunk: Option<&[u8]>,
    path: &Path,
) -> Result<Parts<T>, Fault> {
    let buffers = Buffers::new(document, path, chunk);
    let mut loader = Loader { buffers, total: 0, left_out: BTreeMap::new() };
    let mut places = places(document)?;
    let all = places.len();
    places.retain(|place| has_area(&place.transform));
    loader.left_out.insert(FLAT, all - places.len());
    let mut meshes = BTreeMap::new();
    for &Placed { node, mesh, .. } in &places {
        let own = &document.nodes[node];
        let weights = [&own.weights, &document.meshes[mesh].weights];
        let weights = weights.into_iter().find(|weights| !weights.is_empty());
        if own.skin.is_some() || weights.is_some_and(|w| w.iter().any(|weight| *weight != 0.0)) {
            loader.leave_out(UNBENT);
        }
        if let Entry::Vacant(entry) = meshes.entry(mesh) {
            let mut triangles = Vec::new();
            for (number, primitive) in document.meshes[mesh].primitives.iter().enumerate() {
                loader.add(primitive, &mut triangles).map_err(|message| {
                    Fault::of(&format!("meshes[{mesh}].primitives[{number}]"), message)
                })?;
            }
            entry.insert(triangles);
        }
    }
    // A mesh of points or lines gives no triangles, and a tree needs at least one object.
    meshes.retain(|_, triangles| !triangles.is_empty());
    places.retain(|place| meshes.contains_key(&place.mesh));
    let left_out = loader.left_out.iter().filter_map(|(things, &count)| counted(things, count));
    let remarks: Vec<String> = remarks(document).into_iter().chain(left_out).collect();
    if places.is_empty() {
        let found = [&["no triangle in its scene".into()], &remarks[..]].concat().join("; ");
        return Err(Fault::of_file(format!("{found}; expected a glTF file with at least one")));
    }
    Ok(Parts { meshes, places, remarks })
}

/// Returns whether a triangle can have an area after this transform.
fn has_area(transform: &DMat4) -> bool {
    let [x, y, z] = [transform.x_axis, transform.y_axis, transform.z_axis].map(|a| a.truncate());
    [x.cross(y), y.cross(z), z.cross(x)].iter().any(|normal| *normal != DVec3::ZERO)
}

fn check_total(triangles: usize) -> Result<(), String> {
    match triangles > MOST_TRIANGLES {
        true => Err(format!("more than {MOST_TRIANGLES} triangles in all; expected no more")),
        false => Ok(()),
    }
}

fn get<'a, T>(list: &'a [T], index: usize, name: &str) -> Result<&'a T, String> {
    list.get(index).ok_or_else(|| format!("no {name}[{index}]; expected one that exists"))
}

/// Returns the clauses about everything in the file that moves or adds a triangle and was not read,
/// or that the reader had to choose.
fn remarks(document: &Document) -> Vec<String> {
    let extensions = document.extensions_used.iter().filter(|name| !is_covered(name));
    let extensions = extensions.map(|name| format!("the extension {name} was ignored"));
    let scenes = document.scenes.len();
    let scene = document.scene.unwrap_or(0);
    let other_scenes = (scenes > 1).then(|| format!("scenes[{scene}] of {scenes} was read"));
    let animations = counted("animations ignored", document.animations.len());
    extensions.chain(other_scenes).chain(animations).collect()
}

struct Loader<'a> {
    buffers: Buffers<'a>,
    /// The number of triangles so far.
    total: usize,
    /// The numbers of nodes and of primitives that are not read, by kind.
    left_out: BTreeMap<&'static str, usize>,
}

const FLAT: &str = "meshes without area in their places left out";
const UNBENT: &str = "meshes read without what bends them, a skin or morph targets";
const WITHOUT_TRIANGLES: &str = "primitives of points, of lines or without positions left out";
const INCOMPLETE: &str = "primitives that end in an incomplete triangle";

/// Positions are floats, or integers by `KHR_mesh_quantization`.
const POSITIONS: [u32; 5] = [F32, I8, U8, I16, U16];

impl Loader<'_> {
    fn leave_out(&mut self, part: &'static str) {
        *self.left_out.entry(part).or_default() += 1;
    }

    fn add<T: FromFile>(
        &mut self,
        primitive: &Primitive,
        triangles: &mut Vec<T>,
    ) -> Result<(), String> {
        let mode = primitive.mode.unwrap_or(4);
        if mode > 6 {
            return Err(format!("mode {mode}; expected 0 to 6"));
        }
        let points = match primitive.attributes.get("POSITION").filter(|_| mode >= 4) {
            Some(&accessor) => {
                self.buffers.accessor::<3>(accessor, &POSITIONS).map_err(|message| {
                    let is_draco = primitive.extensions.contains_key("KHR_draco_mesh_compression");
                    if is_draco { format!("{message}{DECOMPRESS}") } else { message }
                })?
            }
            None => Vec::new(),
        };
        if points.is_empty() {
            self.leave_out(WITHOUT_TRIANGLES);
            return Ok(());
        }
        let points: Vec<DVec3> =
            points.into_iter().map(|point| DVec3::from(point).map(T::round)).collect();
        let indices: Vec<usize> = match primitive.indices {
            None => (0..points.len()).collect(),
            Some(accessor) => {
                let indices = self.buffers.accessor::<1>(accessor, &[U8, U16, U32])?;
                indices.into_iter().map(|[index]| index as usize).collect()
            }
        };
        for &index in &indices {
            match points.get(index) {
                Some(point) if point.is_finite() => {}
                Some(point) => {
                    return Err(format!("position {index} at {point}; expected finite numbers"));
                }
                None => {
                    return Err(format!("index {index}; expected 0 to below {}", points.len()));
                }
            }
        }
        let n = indices.len();
        let (count, is_incomplete) = match mode {
            4 => (n / 3, !n.is_multiple_of(3)),
            _ => (n.saturating_sub(2), matches!(n, 1 | 2)),
        };
        if is_incomplete {
            self.leave_out(INCOMPLETE);
        }
        self.total += count;
        check_total(self.total)?;
        triangles.extend((0..count).map(|i| {
            let corners = match mode {
                4 => [3 * i, 3 * i + 1, 3 * i + 2],
                // Every second triangle of a strip is turned, so that all have one orientation.
                5 => [i, i + 1 + i % 2, i + 2 - i % 2],
                _ => [0, i + 1, i + 2],
            };
            T::of(corners.map(|corner| points[indices[corner]]))
        }));
        Ok(())
    }
}
