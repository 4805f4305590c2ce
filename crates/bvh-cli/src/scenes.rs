//! `bvh scenes`: lists the scenes that need no path, and gives them to other programs.

use crate::Error;
use crate::answer::{Answer, Form, whole};
use crate::output::print_bytes;
use bvh_scenes::builtin::stand_ins::STAND_INS;
use bvh_scenes::{FETCHED, SPHERES, Scene, fetched_path};
use serde_json::json;
use std::fmt::Write;

/// List the built-in scenes, their sizes, and the originals that they replace.
#[derive(clap::Args, Clone, Debug)]
pub struct ScenesArgs {
    /// Print this scene's triangles as an OBJ file instead.
    #[arg(value_name = "SCENE", conflicts_with = "json")]
    pub scene: Option<String>,
    #[command(flatten)]
    pub form: Form,
}

/// Prints the table, or a scene.
pub fn scenes(args: &ScenesArgs) -> Result<(), Error> {
    match &args.scene {
        Some(name) => print_obj(&Scene::load(name)?),
        None => print_table(args.form),
    }
}

/// Prints corners in the fewest digits that are read back as the same bits.
fn print_obj(scene: &Scene) -> Result<(), Error> {
    let triangles = scene.triangles().map_err(|fault| Error::Usage(fault.to_string()))?;
    let mut file = String::new();
    for triangle in triangles {
        for corner in triangle.0 {
            let _ = writeln!(file, "v {} {} {}", corner.x, corner.y, corner.z);
        }
        file += "f -3 -2 -1\n";
    }
    print_bytes(file.as_bytes());
    Ok(())
}

fn print_table(form: Form) -> Result<(), Error> {
    let mut answer = Answer::new(form);
    answer.say(&line("name", "objects", "kind", "description"));
    let mut add = |name: &str, objects: Option<usize>, kind: &str, description: &str| {
        let count = objects.map_or_else(|| "not fetched".into(), whole);
        answer.say(&line(name, &count, kind, description));
        answer.list("scenes", json!({ "name": name, "objects": objects, "kind": kind }));
    };
    for scene in STAND_INS {
        let kind = format!("stand-in for {}", scene.original);
        add(scene.name, Some(scene.triangle_count), &kind, scene.character);
    }
    for (name, count) in SPHERES {
        let origin = "Spheres, as in the second source document.";
        add(name, Some(count), "procedural", origin);
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
    answer.end();
    Ok(())
}

fn line(name: &str, objects: &str, kind: &str, character: &str) -> String {
    format!("{name:<12}{objects:>11}  {kind:<24}{character}")
}
