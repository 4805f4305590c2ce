//! `bvh orient`: turns meshes so that boxes along their axes are small.

use crate::Error;
use crate::answer::{Answer, gain, whole};
use crate::arguments::output_file;
use crate::output::print_error;
use bvh_core::Triangle;
use bvh_scenes::load::Format;
use bvh_scenes::{SceneError, files};
use bvh_search::{Budget, Choice};
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

/// Turn each mesh of a file so that the boxes of any tracer are small, and its nodes back. The world
/// stays the same but for rounding turned vertices once, by up to half a unit in the last place.
///
/// A glTF file becomes a GLB file, whose nodes have the inverse rotations. An OBJ file has the
/// inverse matrix in a comment in its first line. A mesh with a skin, with quantised vertices or with
/// an extension that may depend on them is left as it is, with a remark.
///
/// Example: bvh orient house.gltf --out house.glb --report
#[derive(Args, Clone, Debug)]
pub struct OrientArgs {
    /// The path of an OBJ, glTF or GLB file.
    #[arg(value_name = "FILE")]
    pub scene: PathBuf,
    /// The file to write, replaced when it is complete. If the scene names other files, in the same
    /// folder.
    #[arg(short, long, value_name = "FILE.glb|.obj")]
    pub out: PathBuf,
    /// Print for every turned mesh the number of triangles, and the area that a tree saves, by short
    /// searches over a sample of large meshes.
    #[arg(long)]
    pub report: bool,
}

/// Writes the file, and prints how many meshes it turned.
pub fn orient(args: &OrientArgs, answer: &mut Answer) -> Result<(), Error> {
    let OrientArgs { scene: path, out, report } = args;
    let bytes = files::read(path)?;
    match Format::of(&bytes, path) {
        Format::Gltf => output_file("--out", out, "glb")?,
        Format::Obj => output_file("--out", out, "obj")?,
        // No name of a new file would be right, and the writer names the kind.
        _ => {}
    }
    if fs::canonicalize(out).is_ok_and(|out| fs::canonicalize(path).is_ok_and(|path| path == out)) {
        let message = format!("--out: {} is the scene; accepted: another name", out.display());
        return Err(Error::Usage(message));
    }
    /// The work of a search whose tenth chooses the axes: a second or two.
    const WORK: u64 = 300_000_000;
    let budget = Budget { max_work: Some(WORK), ..Budget::UNLIMITED };
    let mut gains = BTreeMap::new();
    let find = &mut |mesh: usize, triangles: &[Triangle]| {
        let choice = Choice::of(triangles, budget, &());
        gains.insert(mesh, (triangles.len(), choice.gain));
        choice.frame.map(|frame| frame.rotation())
    };
    let oriented = bvh_scenes::load::orient(&bytes, path, out, find)
        .map_err(|error| SceneError::new(&path.display().to_string(), error))?;
    const MOST_REMARKS: usize = 10;
    for remark in oriented.remarks.iter().take(MOST_REMARKS) {
        print_error(&format!("{}: {remark}", path.display()));
    }
    if oriented.remarks.len() > MOST_REMARKS {
        print_error(&format!("and {} more", whole(oriented.remarks.len() - MOST_REMARKS)));
    }
    files::write(out, &oriented.bytes)?;
    for mesh in oriented.turned.iter().filter(|_| *report) {
        let (triangles, saved) = gains[mesh];
        let gain = gain(1.0 - saved, 1.0);
        answer.say(&format!("mesh {mesh}: {} triangles, {gain} area", whole(triangles)));
        answer.list("meshes", json!({ "mesh": mesh, "triangles": triangles, "saved": saved }));
    }
    let turned = oriented.turned.len();
    let what = match turned {
        0 => "nothing to gain, and nothing turned".into(),
        _ => format!(
            "{} of {} meshes turned; vertices rounded once",
            whole(turned),
            whole(gains.len())
        ),
    };
    answer.say(&format!("{}: {what}", out.display()));
    answer.record("turned", turned);
    answer.record("file", out.display().to_string());
    Ok(())
}
