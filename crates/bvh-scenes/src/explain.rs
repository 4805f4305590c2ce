//! Lists, before the work, what a scene does not need, which is left out.

use crate::Scene;
use bvh_build::BuildError;
use bvh_core::Primitives;
use bvh_search::shortcuts::Facts;

/// What is left out of a scene, one line each.
pub fn scene(scene: &Scene) -> Result<String, BuildError> {
    let facts = Facts::of(&scene.boxes)?;
    let kind = match scene.primitives {
        Primitives::Triangles(_) => "triangles",
        Primitives::Spheres(_) => "spheres",
    };
    let size = facts.bounds.max - facts.bounds.min;
    let mut text =
        format!("{} ({}): {} {kind} within {size}\n", scene.name, scene.kind, facts.objects);
    if let Some(remark) = &scene.remark {
        text += &format!("  {remark}\n");
    }
    for (_, why) in facts.shortcuts() {
        text += &format!("  left out: {why}\n");
    }
    text += &format!(
        "  left out: tests of anything but {kind}: there is a traversal for these alone\n"
    );
    if facts.repeated > 0 {
        text += &format!(
            "  not left out: {} objects with the box of the one before; between them a split may be as good as any\n",
            facts.repeated
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn explained(name: &str) -> String {
        scene(&Scene::load(name).unwrap()).unwrap()
    }

    #[test]
    fn every_scene_is_told_what_it_does_not_need() {
        for (name, parts) in [
            ("escher:12", &["12 triangles", "the optimum takes no more", "no tree has less"][..]),
            ("spheres75", &["75 spheres", "tests of anything but spheres"]),
            (
                "S08:50",
                &[
                    "sorting along y",
                    "sorting along z",
                    "splits along z: the order is that along y",
                ],
            ),
            ("S10:50", &["splits along y and z", "an internal area of 0"]),
            ("S34:50", &["45 objects with the box of the one before"]),
        ] {
            let text = explained(name);
            assert!(parts.iter().all(|part| text.contains(part)), "{name}: {text}");
        }
        let escher = explained("escher");
        assert!(!escher.contains("splits along") && !escher.contains("the optimum"), "{escher}");
    }
}
