//! `bvh scenes`: lists the scenes that need no path.

use crate::Error;
use crate::answer::{Answer, whole};
use bvh_scenes::builtin::stand_ins::STAND_INS;
use bvh_scenes::{FETCHED, SPHERES, Scene, fetched_path};
use serde_json::json;

pub fn scenes(answer: &mut Answer) -> Result<(), Error> {
    answer.say(&line("name", "objects", "kind", "description"));
    let mut add = |name: &str, objects: Option<usize>, kind: &str, description: &str| {
        let count = objects.map_or_else(|| "not fetched".into(), whole);
        answer.say(&line(name, &count, kind, description));
        answer.list("scenes", json!({ "name": name, "objects": objects, "kind": kind }));
    };
    for scene in STAND_INS {
        add(scene.name, Some((scene.triangles)().len()), "stand-in", scene.character);
    }
    for (name, count) in SPHERES {
        add(name, Some(count), "procedural", "Spheres, as in the second source document.");
    }
    for (name, package) in FETCHED {
        // The size of a scene is known only after it has been fetched.
        let objects = match fetched_path(name) {
            Some(_) => Some(Scene::load(name)?.boxes.len()),
            None => None,
        };
        let origin = format!("From the Rust package {package}, by scripts/fetch-scenes.");
        add(name, objects, "file", &origin);
    }
    answer.say("\nAny OBJ, PLY, STL or glTF file can be named by its path.");
    Ok(())
}

fn line(name: &str, objects: &str, kind: &str, character: &str) -> String {
    format!("{name:<12}{objects:>11}  {kind:<12}{character}")
}
