//! Checks of the readers of OBJ files and tree files.

use crate::{Verdict, tracing};
use anyhow::{bail, ensure};
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, PreparedRay, Primitives, Triangle, file};
use bvh_scenes::builtin::stiff;
use bvh_scenes::load::{self, MeshError, mesh::Mesh};
use std::path::Path;

/// S17: degenerate triangles are never hit, and the reader counts them.
pub fn degenerate_are_counted() -> Verdict {
    let triangles = stiff::degenerate(60);
    let degenerate = triangles.iter().filter(|triangle| triangle.is_degenerate()).count();
    ensure!(degenerate == 30, "{degenerate} of 60 are degenerate");
    for ray in tracing::rays(&triangles, 2000, 17) {
        let prepared = PreparedRay::new(&ray);
        let hit = triangles
            .iter()
            .find(|t| t.is_degenerate() && t.intersect(&prepared, f32::MAX).is_some());
        ensure!(hit.is_none(), "{ray:?} hits {hit:?}");
    }
    let mesh = read(&to_obj(&triangles))?;
    let counted = mesh.remarks.iter().any(|remark| remark == "triangles without area: 30");
    ensure!(mesh.triangles.len() == 60 && counted, "the reader remarks {:?}", mesh.remarks);
    Ok(format!("{degenerate} kept, none hit"))
}

fn to_obj(triangles: &[Triangle]) -> String {
    let mut text = String::new();
    for triangle in triangles {
        for corner in &triangle.0 {
            text += &format!("v {} {} {}\n", corner.x, corner.y, corner.z);
        }
        text += "f -3 -2 -1\n";
    }
    text
}

fn read(text: &str) -> Result<Mesh, MeshError> {
    load::parse(text.as_bytes(), Path::new("scene.obj"))
}

/// Returns the message that rejects the text, which must name this line.
fn refused_in_line(text: &str, line: usize) -> Verdict {
    let Err(error) = read(text) else { bail!("the file is accepted") };
    let message = error.to_string();
    ensure!(
        message.contains(&format!("scene.obj:{line}: ")),
        "the error names no line {line}: {message}"
    );
    Ok(message)
}

/// S18: the word `nan` is rejected, and the error names its line.
pub fn nan_in_a_file() -> Verdict {
    refused_in_line("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", 2)
}

/// S19: infinities are rejected in every notation, and the error names their line.
pub fn infinity_in_a_file() -> Verdict {
    refused_in_line("v 0 0 0\nv 1 0 0\nv 0 -inf 0\nf 1 2 3\n", 3)?;
    refused_in_line("v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 1)
}

/// S35: unused vertices do not count, relative indices and polygons are resolved, files without
/// faces are rejected.
pub fn files_as_people_write_them() -> Verdict {
    let mesh = read("v 9e9 0 0\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n")?;
    let counted = mesh.remarks.iter().any(|remark| remark == "vertices that no face uses: 1");
    ensure!(mesh.triangles.len() == 2 && counted, "{mesh:?}");
    let boxes = Primitives::Triangles(mesh.triangles).boxes();
    let bounds = Aabb::union_of(&boxes);
    ensure!(
        bounds == Aabb::from(([0.0; 3], [1.0, 1.0, 0.0])),
        "an unused vertex counts: {bounds:?}"
    );
    ensure!(read("v 0 0 0\nv 1 0 0\n").is_err(), "a file without faces is accepted");
    refused_in_line("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", 4)?;
    refused_in_line("v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\n", 2)
}

/// S38: a tree file is rejected if a bit is flipped, if it is truncated, or if it has another
/// version, endianness or scene.
pub fn damaged_tree_files() -> Verdict {
    let boxes = stiff::boxes(&stiff::uniform(12));
    let tree = muller_fellner::Config::default().build(&boxes)?;
    let whole = file::save(&tree, &boxes, &file::Origin::default())?;
    let is_rejected = |bytes: &[u8]| file::load(bytes, &boxes).is_err();
    ensure!(
        file::load(&whole, &boxes).ok() == Some(tree),
        "an undamaged file is not the tree saved"
    );
    // Every bit is tried: an unchecked field would accept some flips.
    for bit in 0..8 * whole.len() {
        let mut damaged = whole.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        ensure!(is_rejected(&damaged), "bit {bit} can be flipped");
    }
    for length in 0..whole.len() {
        ensure!(is_rejected(&whole[..length]), "{length} bytes are enough");
    }
    let reversed: Vec<u8> = whole.chunks(4).flat_map(|word| word.iter().rev()).copied().collect();
    ensure!(is_rejected(&reversed), "another endianness is accepted");
    let mut others = boxes.clone();
    others[3].max.x = others[3].max.x.next_up();
    ensure!(file::load(&whole, &others).is_err(), "the tree of another scene is accepted");
    Ok(format!("{} damages refused", 9 * whole.len() + 2))
}
