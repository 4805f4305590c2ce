//! The number of triangles that a glTF file promises, before any of them takes memory. A file of a
//! few kilobytes can place one mesh any number of times.

use super::Placed;
use crate::load::mesh::{Fault, MOST_TRIANGLES, Place};
use gltf_json::Root;
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked::Valid;
use std::path::Path;

/// Rejects places that have more triangles together than a scene may have. The meshes of all places
/// must exist.
pub fn check(root: &Root, places: &[Placed], path: &Path) -> Result<(), Fault> {
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
    triangles(mode, items).min(MOST_TRIANGLES + 1)
}

/// Returns the number of triangles of a primitive with this many indices.
pub fn triangles(mode: Mode, indices: usize) -> usize {
    match mode {
        Mode::Triangles => indices / 3,
        Mode::TriangleStrip | Mode::TriangleFan => indices.saturating_sub(2),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => 0,
    }
}
