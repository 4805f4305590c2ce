//! Lists, before the work begins, the steps that a scene does not need and that are skipped.

use crate::answer::Answer;
use bvh_build::BuildError;
use bvh_core::{Aabb, Primitives};
use bvh_scenes::Scene;
use bvh_search::shortcuts;

/// Lists the skipped steps of a scene, one line each.
pub fn explain(scene: &Scene, answer: &mut Answer) -> Result<(), BuildError> {
    let boxes = &scene.boxes;
    let kind = match scene.primitives {
        Primitives::Triangles(_) => "triangles",
        Primitives::Spheres(_) => "spheres",
    };
    let size = Aabb::union_of(boxes).extent().as_vec3();
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
    answer.say(&text);
    answer.record("explanation", text);
    Ok(())
}
