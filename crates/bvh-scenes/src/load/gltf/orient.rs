//! Turns the meshes of glTF files, and their nodes back.
//!
//! Turned vertices are appended to the first buffer. The old ones stay there, because other meshes
//! and extensions may use them.

use super::accessors::F32;
use super::buffers::Buffers;
use super::document::{Document, document, is_covered, text};
use super::{Fault, get, read};
use crate::files::folder_of;
use crate::load::{Find, Oriented};
use bvh_core::Triangle;
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// The attributes of vertices and of morph targets that turn with a mesh.
const TURNING: [&str; 3] = ["NORMAL", "POSITION", "TANGENT"];
/// The members of a node that only its mesh depends on.
const OWN: [&str; 7] = ["extras", "mesh", "name", "rotation", "scale", "translation", "weights"];
/// The number of meshes that may on average use the same vertices.
const MOST_USES: usize = 4;

/// Does for a glTF or GLB file what [`orient`](crate::load::orient) does.
pub fn orient(bytes: &[u8], path: &Path, out: &Path, find: Find) -> Result<Oriented, Fault> {
    let (document, chunk) = document(bytes)?;
    let (text, _, further) = text(bytes)?;
    let meshes = read::<Triangle>(&document, chunk, path)?.meshes;
    let mut json: Value = serde_json::from_slice(text).map_err(Fault::of_file)?;
    for list in ["accessors", "bufferViews", "buffers", "meshes", "nodes"] {
        let elements = json[list].as_array();
        if !elements.is_some_and(|elements| elements.iter().all(Value::is_object)) {
            return Err(Fault::of(list, "something else; expected a list of objects"));
        }
    }
    json["buffers"][0].as_object_mut().map(|buffer| buffer.remove("uri"));
    check_references(&json, path, out)?;
    let mut buffers = Buffers::new(&document, path, chunk);
    let binary = buffers.bytes(0).map_err(Fault::of_file)?.to_vec();
    let items = document.accessors.iter().fold(0usize, |sum, a| sum.saturating_add(a.count));
    let most = binary.len().saturating_add(items.saturating_mul(16 * MOST_USES));
    let mut file = File { json, document: &document, buffers, binary, children: BTreeMap::new() };
    let mut nodes: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (number, node) in document.nodes.iter().enumerate() {
        nodes.entry(node.mesh.unwrap_or(usize::MAX)).or_default().push(number);
    }
    let unread = |name: &&String| !is_covered(name) || *name == "KHR_animation_pointer";
    let unread = document.extensions_used.iter().filter(unread);
    let unread = unread.map(|name| format!("the extension {name} was kept unread"));
    let mut oriented = Oriented { remarks: unread.collect(), ..Oriented::default() };
    for (&mesh, triangles) in &meshes {
        let turned = match file.vectors(mesh, &nodes[&mesh]) {
            _ if file.binary.len() > most => Err("its vertices are those of many meshes".into()),
            Ok(vectors) => find(mesh, triangles)
                .map(|rotation| file.turn(&nodes[&mesh], vectors, &rotation))
                .transpose(),
            Err(reason) => Err(reason),
        };
        match turned {
            Ok(turned) => oriented.turned.extend(turned.map(|()| mesh)),
            Err(why) => oriented.remarks.push(format!("meshes[{mesh}] left as it is: {why}")),
        }
    }
    oriented.bytes = match oriented.turned.is_empty() && bytes.starts_with(b"glTF") {
        true => bytes.to_vec(),
        false => file.write(further)?,
    };
    Ok(oriented)
}

/// Rejects a folder in which the files that a file names are not.
fn check_references(json: &Value, path: &Path, out: &Path) -> Result<(), Fault> {
    let lists = ["buffers", "images"].map(|list| json[list].as_array());
    let mut uris = lists.into_iter().flatten().flatten().filter_map(|item| item["uri"].as_str());
    let beside = uris.find(|uri| !uri.starts_with("data:") && !uri.contains("://"));
    let [old, new] = [path, out].map(|path| fs::canonicalize(folder_of(path)).ok());
    beside.filter(|_| old != new).map_or(Ok(()), |uri| {
        let message = format!("`{uri}` is not beside {}; expected the same folder", out.display());
        Err(Fault::of_file(message))
    })
}

/// Numbers by their accessor, with the length of a vector, and the place of a reference to each.
type Vectors = (BTreeMap<usize, (usize, Vec<f32>)>, Vec<(String, usize)>);

struct File<'a> {
    json: Value,
    document: &'a Document,
    buffers: Buffers<'a>,
    /// The contents of the first buffer.
    binary: Vec<u8>,
    /// The nodes that have got a child for their mesh, and the child.
    children: BTreeMap<usize, usize>,
}

impl File<'_> {
    fn push(&mut self, list: &str, element: Value) -> usize {
        let elements = self.json[list].as_array_mut();
        elements.map_or(0, |elements| {
            elements.push(element);
            elements.len() - 1
        })
    }

    /// Returns all vectors that turn with a mesh, or the reason why it cannot be turned.
    fn vectors(&mut self, mesh: usize, nodes: &[usize]) -> Result<Vectors, String> {
        let own = &self.json["meshes"][mesh];
        let primitives = own["primitives"].as_array().into_iter().flatten();
        let users = nodes.iter().map(|&node| &self.json["nodes"][node]);
        for element in users.chain([own]).chain(primitives) {
            let mut extensions = element["extensions"].as_object().into_iter().flatten();
            if let Some((name, _)) = extensions.find(|(name, _)| !is_covered(name)) {
                return Err(format!("the extension {name}"));
            }
            if element.get("skin").is_some() {
                return Err("a skin".into());
            }
        }
        let (mut numbers, mut places) = (BTreeMap::new(), Vec::new());
        for (number, primitive) in self.document.meshes[mesh].primitives.iter().enumerate() {
            let targets = primitive.targets.iter().enumerate();
            let targets = targets.map(|(number, target)| (format!("targets/{number}"), target));
            for (list, names) in targets.chain([("attributes".into(), &primitive.attributes)]) {
                for (name, &index) in names.iter().filter(|(n, _)| TURNING.contains(&n.as_str())) {
                    let accessor = get(&self.document.accessors, index, "accessors")?;
                    if accessor.count == 0 {
                        continue;
                    }
                    let place = format!("/meshes/{mesh}/primitives/{number}/{list}/{name}");
                    places.push((place, index));
                    let (width, items) = match &accessor.type_[..] {
                        "VEC4" => (4, self.buffers.accessor::<4>(index, &[F32])?.into_flattened()),
                        _ => (3, self.buffers.accessor::<3>(index, &[F32])?.into_flattened()),
                    };
                    let items = items.into_iter().map(|number| number as f32).collect();
                    numbers.insert(index, (width, items));
                }
            }
        }
        Ok((numbers, places))
    }

    /// Turns a mesh by nearly this rotation, and its nodes back.
    ///
    /// # Errors
    ///
    /// The reason why the mesh cannot be turned. Nothing has changed then.
    fn turn(
        &mut self,
        nodes: &[usize],
        (mut vectors, places): Vectors,
        rotation: &DMat3,
    ) -> Result<(), String> {
        // Programs read nodes in single precision, in which only such rotations have an inverse.
        let rotation = DQuat::from_mat3(rotation).as_quat().as_dquat();
        let turn = rotation.normalize();
        for (accessor, (width, numbers)) in &mut vectors {
            for vector in numbers.chunks_exact_mut(*width) {
                let turned = turn * DVec3::from([0, 1, 2].map(|axis| f64::from(vector[axis])));
                vector[..3].copy_from_slice(&turned.as_vec3().to_array());
            }
            if !numbers.iter().all(|number| number.is_finite()) {
                return Err(format!("accessors[{accessor}] would not contain finite numbers"));
            }
        }
        let mut accessors = BTreeMap::new();
        for (old, (width, numbers)) in vectors {
            self.binary.resize(self.binary.len().next_multiple_of(4), 0);
            let (start, length) = (self.binary.len(), 4 * numbers.len());
            self.binary.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length,
                "target": 34962 });
            let mut accessor = self.json["accessors"][old].clone();
            accessor["byteOffset"] = 0.into();
            accessor["bufferView"] = self.push("bufferViews", view).into();
            for (name, pick) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
                let axis = |axis| numbers.iter().skip(axis).step_by(width).copied().reduce(pick);
                accessor[name] = (0..width).map(axis).collect();
            }
            accessors.insert(old, self.push("accessors", accessor));
        }
        for (place, old) in places {
            if let Some(accessor) = self.json.pointer_mut(&place) {
                *accessor = accessors[&old].into();
            }
        }
        nodes.iter().for_each(|&node| self.turn_back(node, rotation.conjugate()));
        Ok(())
    }

    /// Turns the mesh of a node by a rotation, with the node or in a child.
    fn turn_back(&mut self, number: usize, back: DQuat) {
        let old = &self.document.nodes[number];
        // Joints of skins and animated nodes are not told from others.
        let is_still = self.document.animations.is_empty() && self.json.get("skins").is_none();
        let is_uniform = old.scale.is_none_or(|[x, y, z]| x == y && y == z);
        let node = &mut self.json["nodes"][number];
        let mut names = node.as_object().into_iter().flatten().map(|(name, _)| name.as_str());
        if is_still && is_uniform && names.all(|name| OWN.contains(&name)) {
            let turn = old.rotation().map(|turn| DQuat::from_array(turn).normalize());
            let turn = turn.map_or(back, |turn| turn * back.normalize());
            node["rotation"] = json!(turn.to_array());
            return;
        }
        let mut moved = json!({ "rotation": back.to_array() });
        for key in ["mesh", "weights"] {
            if let Some(value) = node.as_object_mut().and_then(|node| node.remove(key)) {
                moved[key] = value;
            }
        }
        // The triangles keep their order, in which a node's mesh is before its children's.
        let child = self.document.nodes.len() + self.children.len();
        node["children"] = [child].iter().chain(&old.children).copied().collect();
        self.push("nodes", moved);
        self.children.insert(number, child);
    }

    /// Returns the bytes of a GLB file that ends with the `further` chunks.
    fn write(mut self, further: &[u8]) -> Result<Vec<u8>, Fault> {
        // Animated weights of morph targets follow them to a child.
        let animations = self.json.get_mut("animations").and_then(Value::as_array_mut);
        let channels = animations.into_iter().flatten().filter_map(|a| a.get_mut("channels"));
        for channel in channels.filter_map(Value::as_array_mut).flatten() {
            let Some(target) = channel.get_mut("target") else { continue };
            let child = target["node"].as_u64().and_then(|n| self.children.get(&(n as usize)));
            if let Some(&child) = child.filter(|_| target["path"] == "weights") {
                target["node"] = child.into();
            }
        }
        glb(self.json, self.binary, further)
    }
}

/// Returns the bytes of a GLB file of this document, whose first buffer is `binary`, and which ends
/// with the `further` chunks.
///
/// # Errors
/// 4 GB or more.
pub fn glb(mut json: Value, mut binary: Vec<u8>, further: &[u8]) -> Result<Vec<u8>, Fault> {
    binary.resize(binary.len().next_multiple_of(4), 0);
    json["buffers"][0]["byteLength"] = binary.len().into();
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let size = 28 + json.len() + binary.len() + further.len();
    if u32::try_from(size).is_err() {
        return Err(Fault::of_file(format!("{size} bytes of GLB; expected less than 4 GB")));
    }
    let word = |number: usize| (number as u32).to_le_bytes();
    let head = [*b"glTF", word(2), word(size), word(json.len()), *b"JSON"].concat();
    let middle = [word(binary.len()), *b"BIN\0"].concat();
    Ok([&head, &json, &middle, &binary, further].concat())
}
