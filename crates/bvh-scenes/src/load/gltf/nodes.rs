//! The nodes of a glTF file, and the meshes that the nodes of its scene place.

use super::document::{Document, Node};
use super::{Fault, Placed, get};
use glam::{DMat4, DQuat, DVec3};

/// The most by which the elements of a matrix and those of its parts differ, as a fraction of the
/// largest, if both say the same.
const ROUNDING: f64 = 1e-6;

/// Returns the transform from a node's coordinates to its parent's.
fn local(node: &Node) -> Result<DMat4, String> {
    let has_parts = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
    let Some(matrix) = &node.matrix else { return of_parts(node) };
    if has_parts {
        let [one, other] = [*matrix, of_parts(node)?.to_cols_array()];
        let largest = one.iter().fold(0.0, |largest: f64, element| largest.max(element.abs()));
        if !one.iter().zip(other).all(|(a, b)| (a - b).abs() <= ROUNDING * largest) {
            let expected = "expected the matrix, or translation, rotation and scale";
            return Err(format!("a matrix and parts that differ from it; {expected}"));
        }
    }
    match [matrix[3], matrix[7], matrix[11], matrix[15]] {
        [0.0, 0.0, 0.0, 1.0] => Ok(DMat4::from_cols_array(matrix)),
        row => Err(format!("a matrix with the last row {row:?}; expected 0, 0, 0, 1")),
    }
}

fn of_parts(node: &Node) -> Result<DMat4, String> {
    let rotation = node.rotation().unwrap_or([0.0, 0.0, 0.0, 1.0]);
    // Exporters round quaternions, which would scale the mesh by a little.
    let turn = DQuat::from_array(rotation);
    if !(turn.length() > 0.0 && turn.length().is_finite()) {
        return Err(format!("rotation {rotation:?}; expected a quaternion of length 1"));
    }
    Ok(DMat4::from_scale_rotation_translation(
        DVec3::from(node.scale.unwrap_or([1.0; 3])),
        turn.normalize(),
        DVec3::from(node.translation.unwrap_or_default()),
    ))
}

/// Follows the default scene, or the first one, from its roots; a file without scenes is one scene.
/// Returns the places of meshes in the order of the file. O(nodes).
pub fn places(document: &Document) -> Result<Vec<Placed>, Fault> {
    let nodes = &document.nodes;
    let mut is_child = vec![false; nodes.len()];
    for &child in nodes.iter().flat_map(|node| &node.children) {
        if let Some(is_child) = is_child.get_mut(child) {
            *is_child = true;
        }
    }
    let in_scene = |message: String| Fault::of("scene", message);
    let roots = match (document.scene, &document.scenes[..]) {
        (Some(scene), scenes) => get(scenes, scene, "scenes").map_err(in_scene)?.nodes.clone(),
        (None, [first, ..]) => first.nodes.clone(),
        (None, []) => (0..nodes.len()).filter(|&node| !is_child[node]).collect(),
    };
    let tree = "expected a tree of nodes, each with one parent at most";
    // Nodes are pushed in reverse, so that the stack returns them in the order of the file.
    let mut open = Vec::new();
    for &root in roots.iter().rev() {
        get(nodes, root, "nodes").map_err(in_scene)?;
        // A root that is a child, too, is where its parent places it.
        if !is_child[root] {
            open.push((root, DMat4::IDENTITY));
        }
    }
    let mut places = Vec::new();
    let mut is_reached = vec![false; nodes.len()];
    while let Some((number, parent)) = open.pop() {
        let in_node = |message: String| Fault::of(&format!("nodes[{number}]"), message);
        if std::mem::replace(&mut is_reached[number], true) {
            return Err(in_node(format!("in its scene twice; {tree}")));
        }
        let node = &nodes[number];
        let transform = parent * local(node).map_err(in_node)?;
        for &child in node.children.iter().rev() {
            get(nodes, child, "nodes").map_err(in_node)?;
            open.push((child, transform));
        }
        if let Some(mesh) = node.mesh {
            get(&document.meshes, mesh, "meshes").map_err(in_node)?;
            places.push(Placed { node: number, mesh, transform });
        }
    }
    if let Some(root) = roots.iter().find(|&&root| !is_reached[root]) {
        return Err(in_scene(format!("nodes[{root}], the child of another; {tree}")));
    }
    Ok(places)
}
