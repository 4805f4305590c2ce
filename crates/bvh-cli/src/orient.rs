//! `bvh orient`: turns meshes so that boxes along their axes are small.

use crate::Error;
use crate::answer::{Answer, gain, short, whole};
use crate::arguments::output_file;
use crate::output::print_error;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::internal_area;
use bvh_core::{Aabb, Frame, Triangle};
use bvh_scenes::load::Format;
use bvh_scenes::{SceneError, files};
use bvh_search::{Budget, Choice};
use clap::Args;
use glam::{DMat3, DVec3};
use serde_json::json;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

/// Turn each mesh of a file so that the boxes of any tracer are small, and its nodes back. The world
/// stays the same but for rounding turned vertices once, by up to half a unit in the last place.
///
/// A glTF file becomes a GLB file, whose nodes have the inverse rotations. A mesh with a skin, with
/// quantised vertices or with an extension that may depend on them is left as it is, with a remark.
///
/// Example: bvh orient house.gltf --out house.glb --report
#[derive(Args, Clone, Debug)]
pub struct OrientArgs {
    /// The path of a glTF or GLB file.
    #[arg(value_name = "FILE")]
    pub scene: PathBuf,
    /// The file to write, replaced when it is complete. If the scene names other files, in the same
    /// folder.
    #[arg(long, value_name = "FILE.glb")]
    pub out: PathBuf,
    /// Print for every turned mesh the number of triangles, and the area of a greedy tree's inner
    /// nodes before and after.
    #[arg(long)]
    pub report: bool,
}

/// Writes the file, and prints how many meshes it turned.
pub fn orient(args: &OrientArgs, answer: &mut Answer) -> Result<(), Error> {
    let OrientArgs { scene: path, out, report } = args;
    let bytes = files::read(path)?;
    // Of another kind no name would be right, and the writer names the kind.
    if Format::of(&bytes, path) == Format::Gltf {
        output_file("--out", out, "glb")?;
    }
    if fs::canonicalize(out).is_ok_and(|out| fs::canonicalize(path).is_ok_and(|path| path == out)) {
        let message = format!("--out: {} is the scene; accepted: another name", out.display());
        return Err(Error::Usage(message));
    }
    let (mut count, mut reports) = (0, BTreeMap::new());
    let find = &mut |mesh: usize, triangles: &[Triangle]| {
        count += 1;
        let rotation = rotation_of(triangles)?;
        if *report {
            let areas = [DMat3::IDENTITY, rotation].map(|rotation| area(triangles, rotation));
            reports.insert(mesh, (triangles.len(), areas));
        }
        Some(rotation)
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
    for mesh in &oriented.turned {
        let Some(&(triangles, [before, after])) = reports.get(mesh) else { continue };
        let [objects, gain] = [whole(triangles), gain(after, before)];
        let areas = [before, after].map(short).join(" to ");
        answer.say(&format!("mesh {mesh}: {objects} triangles, area {areas}, {gain}"));
        let facts = json!({ "mesh": mesh, "triangles": triangles, "greedy_area_before": before,
            "greedy_area_after": after });
        answer.list("meshes", facts);
    }
    let turned = oriented.turned.len();
    let what = match turned {
        0 => "nothing to gain, and nothing turned".into(),
        _ => format!("{} of {} meshes turned; vertices rounded once", whole(turned), whole(count)),
    };
    answer.say(&format!("{}: {what}", out.display()));
    answer.record("turned", turned);
    Ok(())
}

/// Returns the area of a greedy tree in these axes.
fn area(triangles: &[Triangle], rotation: DMat3) -> f64 {
    let boxes: Vec<Aabb> = match Frame::new(rotation, DVec3::ZERO) {
        Ok(frame) => frame.boxes(triangles),
        Err(_) => triangles.iter().map(Triangle::aabb).collect(),
    };
    let tree = muller_fellner::Config::default().build(&boxes);
    tree.map_or(f64::INFINITY, |tree| internal_area(&tree))
}

/// Returns the rotation from the file's axes to better ones of a mesh.
fn rotation_of(triangles: &[Triangle]) -> Option<DMat3> {
    /// The work of a search whose tenth chooses the axes: a second or two.
    const WORK: u64 = 300_000_000;
    let budget = Budget { max_work: Some(WORK), ..Budget::UNLIMITED };
    Choice::of(triangles, budget, &()).frame.map(|frame| frame.rotation())
}
