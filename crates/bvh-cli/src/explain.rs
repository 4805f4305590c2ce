//! Lists, before the work begins, the steps that a scene does not need and that are skipped.

use bvh_build::BuildError;
use bvh_core::{Aabb, Primitives};
use bvh_scenes::Scene;
use bvh_search::shortcuts;

/// Lists the skipped steps of a scene, one line each.
pub fn scene(scene: &Scene) -> Result<String, BuildError> {
    let boxes = &scene.boxes;
    let kind = match scene.primitives {
        Primitives::Triangles(_) => "triangles",
        Primitives::Spheres(_) => "spheres",
    };
    let bounds = Aabb::union_of(boxes);
    let size = bounds.max - bounds.min;
    let mut text =
        format!("{} ({}): {} {kind} within {size}\n", scene.name, scene.kind, boxes.len());
    if let Some(remark) = &scene.remark {
        text += &format!("  {remark}\n");
    }
    for (_, why) in shortcuts::of(boxes)? {
        text += &format!("  skipped: {why}\n");
    }
    text += &format!("  skipped: tests of other shapes: a traversal for {kind} exists\n");
    let repeated = boxes.windows(2).filter(|pair| pair[0] == pair[1]).count();
    if repeated > 0 {
        text += &format!(
            "  not skipped: {repeated} objects with the same box as the object before; \
             a split between them may be as good as any\n"
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_that_a_scene_does_not_need_are_listed() {
        for (name, parts) in [
            ("escher:12", ["12 triangles", "skipped: ", "a traversal for triangles exists"]),
            ("S34:50", ["50 triangles", "skipped: ", "45 objects with the same box as the object"]),
        ] {
            let text = scene(&Scene::load(name).unwrap()).unwrap();
            assert!(parts.iter().all(|part| text.contains(part)), "{name}: {text}");
        }
    }
}
