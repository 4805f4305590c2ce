//! The nodes of a glTF file, and the meshes that the nodes of its scene place.

use super::accessors::{F32, I8, I16};
use super::document::{Document, Instances, Node};
use super::{Fault, HIDDEN, Loader, MOST_TRIANGLES, Placed, get};
use glam::{DMat4, DQuat, DVec3};

/// The nodes of a file.
#[derive(Debug, Default)]
pub struct Nodes {
    /// The transforms to the coordinates of the scene, by the node's number.
    pub transforms: Vec<DMat4>,
    /// The nodes without a parent.
    pub roots: Vec<usize>,
}

impl Nodes {
    /// Multiplies the transforms from the roots down. An error names the node. O(nodes).
    fn new(document: &Document) -> Result<Self, (usize, String)> {
        let nodes = &document.nodes;
        let tree = "expected a tree of nodes, each with one parent at most";
        let mut has_parent = vec![false; nodes.len()];
        for (number, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                get(nodes, child, "nodes").map_err(|message| (number, message))?;
                if std::mem::replace(&mut has_parent[child], true) {
                    return Err((child, format!("the child of two; {tree}")));
                }
            }
        }
        let roots: Vec<usize> = (0..nodes.len()).filter(|&node| !has_parent[node]).collect();
        let mut transforms: Vec<Option<DMat4>> = vec![None; nodes.len()];
        let mut open: Vec<(usize, DMat4)> =
            roots.iter().map(|&root| (root, DMat4::IDENTITY)).collect();
        while let Some((number, parent)) = open.pop() {
            let transform = parent * local(&nodes[number]).map_err(|message| (number, message))?;
            transforms[number] = Some(transform);
            open.extend(nodes[number].children.iter().map(|&child| (child, transform)));
        }
        // A forged file could have a circle of nodes, which no root reaches.
        if let Some(number) = transforms.iter().position(Option::is_none) {
            return Err((number, format!("its own ancestor; {tree}")));
        }
        Ok(Self { transforms: transforms.into_iter().flatten().collect(), roots })
    }
}

/// Returns the transform from a node's coordinates to its parent's.
fn local(node: &Node) -> Result<DMat4, String> {
    let has_parts = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
    let Some(matrix) = &node.matrix else {
        let [x, y, z] = node.scale.unwrap_or([1.0; 3]);
        let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        return from_parts(node.translation.unwrap_or_default(), rotation, [x, y, z]);
    };
    if has_parts {
        return Err(
            "a matrix and its parts; expected the matrix, or translation, rotation and scale"
                .into(),
        );
    }
    match [matrix[3], matrix[7], matrix[11], matrix[15]] {
        [0.0, 0.0, 0.0, 1.0] => Ok(DMat4::from_cols_array(matrix)),
        row => Err(format!("a matrix with the last row {row:?}; expected 0, 0, 0, 1")),
    }
}

fn from_parts(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> Result<DMat4, String> {
    // Exporters round quaternions, which would scale the mesh by a little.
    let turn = DQuat::from_array(rotation);
    match turn.length() {
        length if length > 0.0 && length.is_finite() => {}
        _ => return Err(format!("rotation {rotation:?}; expected a quaternion of length 1")),
    }
    Ok(DMat4::from_scale_rotation_translation(
        DVec3::from(scale),
        turn.normalize(),
        DVec3::from(translation),
    ))
}

impl Loader<'_> {
    /// Follows the default scene, or the first one, from its roots; a file without scenes is one
    /// scene. Returns the places of meshes in the order of the file.
    pub fn places(&mut self) -> Result<Vec<Placed>, Fault> {
        let document = self.document;
        self.nodes = Nodes::new(document)
            .map_err(|(node, message)| Fault::of(&format!("nodes[{node}]"), message))?;
        let in_scene = |message: String| Fault::of("scene", message);
        let roots = match (document.scene, &document.scenes[..]) {
            (Some(scene), scenes) => &get(scenes, scene, "scenes").map_err(in_scene)?.nodes,
            (None, [first, ..]) => &first.nodes,
            (None, []) => &self.nodes.roots,
        };
        let mut places = Vec::new();
        let mut reached = vec![false; document.nodes.len()];
        // Nodes are pushed in reverse, so that the stack returns them in the order of the file.
        let mut open: Vec<usize> = roots.iter().rev().copied().collect();
        while let Some(number) = open.pop() {
            let node = get(&document.nodes, number, "nodes").map_err(in_scene)?;
            let in_node = |message: String| Fault::of(&format!("nodes[{number}]"), message);
            if std::mem::replace(&mut reached[number], true) {
                return Err(in_node("in its scene twice; expected each node once".to_owned()));
            }
            if !node.extensions.visibility.visible {
                self.leave_out(HIDDEN);
                continue;
            }
            open.extend(node.children.iter().rev());
            let Some(mesh) = node.mesh else { continue };
            get(&document.meshes, mesh, "meshes").map_err(in_node)?;
            let transform = self.nodes.transforms[number];
            let place = |transform| Placed { node: number, mesh, transform };
            match &node.extensions.instances {
                None => places.push(place(transform)),
                Some(_) if node.skin.is_some() => {
                    return Err(in_node(
                        "instances of a mesh with a skin; expected either".to_owned(),
                    ));
                }
                Some(instances) => {
                    let transforms = self.instances(instances).map_err(in_node)?;
                    places.extend(transforms.into_iter().map(|t| place(transform * t)));
                }
            }
            if places.len() > MOST_TRIANGLES {
                let found = format!("more than {MOST_TRIANGLES} meshes placed");
                return Err(in_node(format!("{found}; expected no more")));
            }
        }
        Ok(places)
    }

    fn instances(&mut self, instances: &Instances) -> Result<Vec<DMat4>, String> {
        let named = |name| instances.attributes.get(name).copied();
        let mut translations = Vec::new();
        let mut rotations = Vec::new();
        let mut scales = Vec::new();
        if let Some(accessor) = named("TRANSLATION") {
            translations = self.accessors.read::<3>(accessor, &[F32])?;
        }
        if let Some(accessor) = named("ROTATION") {
            rotations = self.accessors.read::<4>(accessor, &[F32, I8, I16])?;
        }
        if let Some(accessor) = named("SCALE") {
            scales = self.accessors.read::<3>(accessor, &[F32])?;
        }
        let count = translations.len().max(rotations.len()).max(scales.len());
        for (name, found) in [
            ("TRANSLATION", translations.len()),
            ("ROTATION", rotations.len()),
            ("SCALE", scales.len()),
        ] {
            if count == 0 || named(name).is_some() && found != count {
                return Err(format!(
                    "instances with {found} items of {name}; expected {count}, as in the other attributes"
                ));
            }
        }
        (0..count)
            .map(|i| {
                let translation = translations.get(i).copied().unwrap_or_default();
                let rotation = rotations.get(i).copied().unwrap_or([0.0, 0.0, 0.0, 1.0]);
                from_parts(translation, rotation, scales.get(i).copied().unwrap_or([1.0; 3]))
            })
            .collect()
    }
}
