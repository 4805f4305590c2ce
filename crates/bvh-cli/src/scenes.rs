//! `bvh scenes`: lists the scenes that need no path.

use crate::Error;
use crate::output::print_line;
use bvh_scenes::builtin::stand_ins::STAND_INS;
use bvh_scenes::{FETCHED, SPHERES, Scene, fetched_path};

/// Prints a table of the built-in scenes: their sizes, and the originals that they replace.
pub fn scenes() -> Result<(), Error> {
    let mut table = line("name", "objects", "kind", "description");
    for scene in STAND_INS {
        let kind = format!("stand-in for {}", scene.original);
        table += &line(scene.name, &scene.triangle_count.to_string(), &kind, scene.character);
    }
    for (name, count) in SPHERES {
        let origin = "Spheres, as in the second source document.";
        table += &line(name, &count.to_string(), "procedural", origin);
    }
    for (name, package) in FETCHED {
        // The size of a scene is known only after it has been fetched.
        let objects = match fetched_path(name) {
            Some(_) => Scene::load(name)?.boxes.len().to_string(),
            None => "not fetched".into(),
        };
        let origin = format!("From the Rust package {package}, by scripts/fetch-scenes.");
        table += &line(name, &objects, "file", &origin);
    }
    print_line(&format!("{table}\nAny OBJ, PLY, STL or glTF file can be named by its path."));
    Ok(())
}

fn line(name: &str, objects: &str, kind: &str, character: &str) -> String {
    format!("{name:<12}{objects:>11}  {kind:<24}{character}\n")
}
