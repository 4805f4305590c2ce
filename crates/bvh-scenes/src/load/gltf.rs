//! Triangles from glTF 2.0 files, JSON or GLB, where the nodes place them.
//!
//! Reads what the standard says about the places of vertices: transforms, morph targets with their
//! default weights, skins, and the instances, visibility and quantised positions of three
//! extensions. Animations are ignored, so that a scene is as at rest; materials and cameras change
//! no triangle. Each of these modules checks every reference and range of the file itself.

mod accessors;
mod buffers;
mod document;
mod nodes;

use super::MeshError;
use super::mesh::{Fault, MOST_TRIANGLES, Mesh, counted};
use accessors::{Accessors, F32, I8, I16, U8, U16, U32};
use buffers::Buffers;
use bvh_core::Triangle;
use document::{Document, Primitive, document, is_covered};
use glam::{DMat4, DVec3, Vec3};
use nodes::Nodes;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The largest total size of all buffers: [`MOST_TRIANGLES`] with three positions and three indices
/// each.
const MOST_BYTES: u64 = 48 * MOST_TRIANGLES as u64;
/// The largest number of positions and indices: [`MOST_TRIANGLES`] that share no position.
const MOST_ITEMS: u64 = 6 * MOST_TRIANGLES as u64;

/// Reads the bytes of a glTF or GLB file, and the buffers that its meshes refer to from the folder
/// of `path`.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Fault> {
    let (document, chunk) = document(bytes)?;
    let buffers = Buffers::new(path, chunk);
    let mut loader = Loader::new(&document, buffers, bytes.len());
    let places = loader.places()?;
    check_size(&document, &places)?;
    for place in &places {
        loader.add_mesh(place, &place.transform)?;
    }
    match loader.triangles.is_empty() {
        true => Err(no_triangle()),
        false => Ok(Mesh::new(std::mem::take(&mut loader.triangles), loader.remarks())),
    }
}

/// The meshes of a file, each once, and their places. The meshes in the order of the places, with
/// all transforms applied, are the triangles that [`parse`] returns, but for those without area.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Triangles in the mesh's own coordinates, by the mesh's number in the file. Contains only
    /// meshes with a place and at least one triangle.
    pub meshes: BTreeMap<usize, Vec<Triangle>>,
    /// The places of the meshes, in the order of the file's nodes.
    pub places: Vec<Placed>,
    /// The file's contents besides plain triangles, in one sentence.
    pub remark: Option<String>,
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

/// Reads a file as [`parse`] does, but returns every mesh once. Rejects a node that gives its mesh
/// a shape of its own. Leaves out places in which no triangle has an area.
pub fn parts(bytes: &[u8], path: &Path) -> Result<Parts, MeshError> {
    read_parts(bytes, path).map_err(MeshError::of(path))
}

fn read_parts(bytes: &[u8], path: &Path) -> Result<Parts, Fault> {
    let (document, chunk) = document(bytes)?;
    let buffers = Buffers::new(path, chunk);
    let mut loader = Loader::new(&document, buffers, bytes.len());
    let mut places = loader.places()?;
    for Placed { node, mesh, .. } in &places {
        let own = &document.nodes[*node];
        let bends = own.weights.as_ref().is_some_and(|own| *own != document.meshes[*mesh].weights);
        if own.skin.is_some() || bends {
            let cause = if bends { "weights" } else { "a skin" };
            let message = format!("{cause}; expected none, so that every instance has one shape");
            return Err(Fault::of(&format!("nodes[{node}]"), message));
        }
    }
    let all = places.len();
    places.retain(|place| has_area(&place.transform));
    let flat = counted("instances without area left out", all - places.len());
    let mut placed = BTreeSet::new();
    let mut first_places = places.clone();
    first_places.retain(|place| placed.insert(place.mesh));
    check_size(&document, &first_places)?;
    let mut meshes = BTreeMap::new();
    for place in &first_places {
        loader.add_mesh(place, &DMat4::IDENTITY)?;
        meshes.insert(place.mesh, std::mem::take(&mut loader.triangles));
    }
    // A mesh of points or lines gives no triangles, and a tree needs at least one object.
    meshes.retain(|_, triangles| !triangles.is_empty());
    places.retain(|place| meshes.contains_key(&place.mesh));
    if places.is_empty() {
        return Err(no_triangle());
    }
    let remarks: Vec<String> = loader.remarks().into_iter().chain(flat).collect();
    let remark = (!remarks.is_empty()).then(|| remarks.join("; "));
    Ok(Parts { meshes, places, remark })
}

/// Returns whether a triangle can have an area after this transform.
fn has_area(transform: &DMat4) -> bool {
    let [x, y, z] = [transform.x_axis, transform.y_axis, transform.z_axis].map(|a| a.truncate());
    [x.cross(y), y.cross(z), z.cross(x)].iter().any(|normal| *normal != DVec3::ZERO)
}

fn no_triangle() -> Fault {
    let message = "no triangle in its scene; expected a glTF file with at least one";
    Fault::of_file(message)
}

fn get<'a, T>(list: &'a [T], index: usize, name: &str) -> Result<&'a T, String> {
    list.get(index).ok_or_else(|| format!("no {name}[{index}]; expected one that exists"))
}

struct Loader<'a> {
    document: &'a Document,
    accessors: Accessors<'a>,
    nodes: Nodes,
    triangles: Vec<Triangle>,
    /// The numbers of nodes and of primitives that are not read, by kind.
    left_out: BTreeMap<&'static str, usize>,
}

const HIDDEN: &str = "invisible nodes left out with their children";
const LINES: &str = "primitives of points or lines left out";
const WITHOUT_POSITIONS: &str = "primitives without positions left out";
const INCOMPLETE: &str = "primitives that end in an incomplete triangle";

/// Positions are floats, or integers by `KHR_mesh_quantization`.
const POSITIONS: [u32; 5] = [F32, I8, U8, I16, U16];

impl<'a> Loader<'a> {
    fn new(document: &'a Document, buffers: Buffers<'a>, length: usize) -> Self {
        Self {
            document,
            accessors: Accessors::new(document, buffers, length),
            nodes: Nodes::default(),
            triangles: Vec::new(),
            left_out: BTreeMap::new(),
        }
    }

    fn leave_out(&mut self, part: &'static str) {
        *self.left_out.entry(part).or_default() += 1;
    }

    /// Returns the clauses about everything in the file that moves or adds a triangle and was not
    /// read, or that the reader had to choose.
    fn remarks(&self) -> Vec<String> {
        let document = self.document;
        let extensions = document.extensions_used.iter().filter(|name| !is_covered(name));
        let extensions = extensions.map(|name| format!("the extension {name} was ignored"));
        let scenes = document.scenes.len();
        let scene = document.scene.unwrap_or(0);
        let other_scenes = (scenes > 1).then(|| format!("scenes[{scene}] of {scenes} was read"));
        let animations = counted("animations ignored", document.animations.len());
        let left_out = self.left_out.iter().filter_map(|(things, &count)| counted(things, count));
        extensions.chain(other_scenes).chain(animations).chain(left_out).collect()
    }

    fn add_mesh(&mut self, place: &Placed, transform: &DMat4) -> Result<(), Fault> {
        let Placed { node, mesh, .. } = *place;
        let joints = match self.document.nodes[node].skin {
            Some(skin) => Some(self.joints(skin).map_err(|message| {
                Fault::of(&format!("skins[{skin}] at nodes[{node}]"), message)
            })?),
            None => None,
        };
        for (number, primitive) in self.document.meshes[mesh].primitives.iter().enumerate() {
            self.add(place, primitive, transform, joints.as_deref()).map_err(|message| {
                let place = format!("meshes[{mesh}].primitives[{number}] at nodes[{node}]");
                Fault::of(&place, message)
            })?;
        }
        Ok(())
    }

    /// Returns the transforms of a skin's joints, from the mesh's coordinates to the scene's.
    fn joints(&mut self, skin: usize) -> Result<Vec<DMat4>, String> {
        let skin = get(&self.document.skins, skin, "skins")?;
        let binds = match skin.inverse_bind_matrices {
            Some(accessor) => self.accessors.read::<16>(accessor, &[F32])?,
            None => vec![DMat4::IDENTITY.to_cols_array(); skin.joints.len()],
        };
        if binds.len() < skin.joints.len() {
            let (binds, joints) = (binds.len(), skin.joints.len());
            return Err(format!("{binds} inverse bind matrices; expected {joints}, one per joint"));
        }
        let joints = skin.joints.iter().zip(binds).map(|(&joint, bind)| {
            Ok(*get(&self.nodes.transforms, joint, "nodes")? * DMat4::from_cols_array(&bind))
        });
        joints.collect()
    }

    fn add(
        &mut self,
        place: &Placed,
        primitive: &Primitive,
        transform: &DMat4,
        joints: Option<&[DMat4]>,
    ) -> Result<(), String> {
        match primitive.mode {
            0..4 => {
                self.leave_out(LINES);
                return Ok(());
            }
            4..7 => {}
            mode => return Err(format!("mode {mode}; expected 0 to 6")),
        }
        let points = match primitive.attributes.get("POSITION") {
            Some(&accessor) => self.positions(place, primitive, accessor)?,
            None => Vec::new(),
        };
        if points.is_empty() {
            self.leave_out(WITHOUT_POSITIONS);
            return Ok(());
        }
        let moved: Vec<Vec3> = match joints {
            None => {
                points.iter().map(|point| transform.transform_point3(*point).as_vec3()).collect()
            }
            Some(joints) => self.skinned(primitive, &points, joints)?,
        };
        let indices: Vec<usize> = match primitive.indices {
            None => (0..points.len()).collect(),
            Some(accessor) => {
                let indices = self.accessors.read::<1>(accessor, &[U8, U16, U32])?;
                indices.into_iter().map(|[index]| index as usize).collect()
            }
        };
        for &index in &indices {
            let point = points
                .get(index)
                .ok_or_else(|| format!("index {index}; expected 0 to below {}", points.len()))?;
            if !moved[index].is_finite() {
                let found = format!("position {index} is {point}, moved {}", moved[index]);
                return Err(format!("{found}; expected finite numbers"));
            }
        }
        let count = triangle_count(primitive.mode, indices.len());
        let is_incomplete = match primitive.mode {
            4 => !indices.len().is_multiple_of(3),
            _ => matches!(indices.len(), 1 | 2),
        };
        if is_incomplete {
            self.leave_out(INCOMPLETE);
        }
        self.triangles.extend((0..count).map(|i| {
            let corners = match primitive.mode {
                4 => [3 * i, 3 * i + 1, 3 * i + 2],
                // Every second triangle of a strip is turned, so that all have one orientation.
                5 => [i, i + 1 + i % 2, i + 2 - i % 2],
                _ => [0, i + 1, i + 2],
            };
            Triangle(corners.map(|corner| moved[indices[corner]]))
        }));
        Ok(())
    }

    /// Returns the positions of a primitive with its morph targets added, before any transform.
    fn positions(
        &mut self,
        place: &Placed,
        primitive: &Primitive,
        accessor: usize,
    ) -> Result<Vec<DVec3>, String> {
        let draco = "KHR_draco_mesh_compression";
        let in_view =
            self.document.accessors.get(accessor).is_some_and(|a| a.buffer_view.is_some());
        if primitive.extensions.contains_key(draco) && !in_view {
            return Err(format!("positions in {draco} alone; expected them without compression"));
        }
        let points = self.accessors.read::<3>(accessor, &POSITIONS)?;
        let mut points: Vec<DVec3> = points.into_iter().map(DVec3::from).collect();
        let own = self.document.nodes[place.node].weights.as_ref();
        let weights = own.unwrap_or(&self.document.meshes[place.mesh].weights);
        if !weights.is_empty() && weights.len() != primitive.targets.len() {
            let (weights, targets) = (weights.len(), primitive.targets.len());
            return Err(format!("{weights} weights; expected {targets}, one per morph target"));
        }
        for (&weight, target) in weights.iter().zip(&primitive.targets) {
            let Some(&accessor) = target.get("POSITION").filter(|_| weight != 0.0) else {
                continue;
            };
            let moves = self.accessors.read::<3>(accessor, &POSITIONS)?;
            same_length(moves.len(), points.len(), "positions of a morph target")?;
            for (point, by) in points.iter_mut().zip(moves) {
                *point += weight * DVec3::from(by);
            }
        }
        Ok(points)
    }

    /// Returns the positions moved by the joints of a skin, each by its weights.
    fn skinned(
        &mut self,
        primitive: &Primitive,
        points: &[DVec3],
        joints: &[DMat4],
    ) -> Result<Vec<Vec3>, String> {
        let mut sums = vec![(DVec3::ZERO, 0.0); points.len()];
        for set in 0.. {
            let named = |name| primitive.attributes.get(&format!("{name}_{set}"));
            let (numbers, weights) = match (named("JOINTS"), named("WEIGHTS")) {
                (Some(&numbers), Some(&weights)) => (numbers, weights),
                (None, None) if set > 0 => break,
                _ => return Err(format!("a skin; expected JOINTS_{set} and WEIGHTS_{set}")),
            };
            let numbers = self.accessors.read::<4>(numbers, &[U8, U16])?;
            let weights = self.accessors.read::<4>(weights, &[F32, U8, U16])?;
            same_length(numbers.len(), points.len(), &format!("items of JOINTS_{set}"))?;
            same_length(weights.len(), points.len(), &format!("items of WEIGHTS_{set}"))?;
            for (i, (numbers, weights)) in numbers.into_iter().zip(weights).enumerate() {
                for (number, weight) in numbers.into_iter().zip(weights) {
                    if weight != 0.0 {
                        let joint = get(joints, number as usize, "joints")?;
                        sums[i].0 += weight * joint.transform_point3(points[i]);
                        sums[i].1 += weight;
                    }
                }
            }
        }
        // Exporters round the weights, whose sum the standard wants to be one.
        let means = sums.into_iter().enumerate().map(|(i, (sum, weight))| match weight > 0.0 {
            true => Ok((sum / weight).as_vec3()),
            false => Err(format!("weights of position {i} with sum {weight}; expected 1")),
        });
        means.collect()
    }
}

fn same_length(found: usize, expected: usize, name: &str) -> Result<(), String> {
    match found == expected {
        true => Ok(()),
        false => Err(format!("{found} {name}; expected {expected}, one per position")),
    }
}

/// Rejects places that have more triangles together than a scene may have, before any of them takes
/// memory: a file of a few kilobytes can place one mesh any number of times. The meshes of all
/// places must exist.
fn check_size(document: &Document, places: &[Placed]) -> Result<(), Fault> {
    let mut total = 0;
    for place in places {
        for primitive in &document.meshes[place.mesh].primitives {
            total += promised(document, primitive);
        }
        if total > MOST_TRIANGLES {
            let message = format!("more than {MOST_TRIANGLES} triangles in all; expected no more");
            return Err(Fault::of(&format!("nodes[{}]", place.node), message));
        }
    }
    Ok(())
}

/// Returns the number of triangles that the accessors of a primitive promise, at most one more than
/// a scene may have. A fault of the primitive is found when it is read.
fn promised(document: &Document, primitive: &Primitive) -> usize {
    let positions = primitive.attributes.get("POSITION").copied();
    let items = primitive.indices.or(positions).and_then(|index| document.accessors.get(index));
    let items = items.map_or(0, |accessor| accessor.count);
    triangle_count(primitive.mode, items).min(MOST_TRIANGLES + 1)
}

fn triangle_count(mode: u32, indices: usize) -> usize {
    match mode {
        4 => indices / 3,
        5 | 6 => indices.saturating_sub(2),
        _ => 0,
    }
}
