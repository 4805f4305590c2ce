//! `harness scenes`: the scenes that can be named without a path.

use crate::Error;
use crate::cli::output::print_line;
use crate::scenes::stand_ins::STAND_INS;
use crate::scenes::{FETCHED, SPHERES, Scene, fetched_path};

/// Prints a table of the built-in scenes: their sizes, and what each stands in for.
pub fn scenes() -> Result<(), Error> {
    let mut table = comfy_table::Table::new();
    table.load_preset(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["name", "objects", "kind", "what it is"]);
    for scene in STAND_INS {
        let kind = format!("stand-in for {}", scene.original);
        table.add_row([scene.name, &scene.triangle_count.to_string(), &kind, scene.character]);
    }
    for (name, count) in SPHERES {
        table.add_row([name, &count.to_string(), "procedural", "Spheres, as in the second source document."]);
    }
    for (name, package) in FETCHED {
        let objects = match fetched_path(name) {
            Some(_) => Scene::load(name)?.boxes.len().to_string(),
            None => "not fetched".into(),
        };
        let origin = format!("From the Rust package {package}, by scripts/fetch-scenes.");
        table.add_row([name, &objects, "file", &origin]);
    }
    print_line(&format!("{table}\nAny OBJ, PLY, STL or glTF file can be named by its path."));
    Ok(())
}
