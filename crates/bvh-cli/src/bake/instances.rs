//! `bvh bake --instances`: writes a tree for every mesh of a glTF file, and one tree over the
//! instances that its nodes place, into a folder.

use super::plan::{Found, Plan};
use super::watch::Watch;
use super::{BakeArgs, Effort};
use crate::Error;
use crate::answer::{Answer, gain, short, whole};
use crate::interrupt::is_interrupted;
use crate::output::{print_error, write_table};
use bvh_build::{Builder, median_cut};
use bvh_core::cost::Objective;
use bvh_core::{Instance, InvalidInstances, Primitives, Triangle, WideBvh};
use bvh_scenes::files;
use bvh_scenes::load::{Format, gltf};
use bvh_scenes::{Scene, SceneError, SceneKind};
use bvh_search::{Budget, Open};
use glam::Affine3A;
use serde_json::json;
use std::fs;
use std::path::Path;

/// The tree over the instances, whose ids are rows of [`INSTANCES`]. It is written last, so that a
/// folder with this file is complete.
const TOP: &str = "top.bvh";
/// The table of instances, one row each.
const INSTANCES: &str = "instances.csv";
/// The columns of [`INSTANCES`], which docs/TREE_FILES.md describes.
const COLUMNS: &str = "node,mesh,xx,xy,xz,yx,yy,yz,zx,zy,zz,tx,ty,tz";

/// Searches for one tree after the other until the budget is spent or the user interrupts, and
/// writes each tree as soon as its search ends. An interrupted bake still writes all files.
pub fn bake(args: &BakeArgs, answer: &mut Answer) -> Result<(), Error> {
    let out = args.out()?;
    new_folder(&out)?;
    let mut plan = args.plan()?;
    let path = Path::new(&args.scene);
    let parts = parts(path)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if !parts.remarks.is_empty() {
        print_error(&format!("scene {stem}: {}", parts.remarks.join("; ")));
    }
    let scene = |(mesh, triangles): (&usize, &Vec<Triangle>)| {
        let primitives = Primitives::Triangles(triangles.clone());
        Scene::new(&format!("{stem}, mesh {mesh}"), SceneKind::File, primitives)
    };
    let scenes: Vec<Scene> = parts.meshes.iter().map(scene).collect();
    let instance = |place: &gltf::Placed| Instance {
        // The rank of the mesh among those that are baked.
        part: parts.meshes.range(..place.mesh).count() as u32,
        transform: Affine3A::from_mat4(place.transform.as_mat4()),
    };
    let instances: Vec<Instance> = parts.places.iter().map(instance).collect();
    let top = top(&stem, &scenes, &instances, &parts)?;
    // Everything that can be invalid has been checked, so that a fault leaves no folder behind.
    fs::create_dir_all(&out).map_err(files::WriteError::of(&out, "create the folder"))?;
    let path = out.join(INSTANCES);
    let places = parts.places.iter().zip(&instances);
    let rows = places
        .map(|(place, instance)| (place.node, place.mesh, instance.transform.to_cols_array()));
    write_table(&path, COLUMNS, rows)?;
    let objects: usize = scenes.iter().chain([&top]).map(|scene| scene.boxes.len()).sum();
    let ample = Budget::of_objects(objects).max_work.unwrap_or(0);
    plan.effort.get_or_insert(Effort::Work(ample));
    // The top tree's objects are boxes, which cannot be divided, and no wide layout is made of it.
    let plan_of_top =
        Plan { references: 1.0, objective: Some(Objective::InternalArea), ..plan.clone() };
    let names = parts.meshes.keys().map(|mesh| format!("mesh_{mesh}.bvh")).chain([TOP.into()]);
    let given = scenes.iter().map(|scene| (scene, &plan)).chain([(&top, &plan_of_top)]);
    for (name, (scene, plan)) in names.zip(given) {
        // Every tree gets a share of the budget in proportion to its number of objects.
        let part = scene.boxes.len() as f64 / objects as f64;
        let plan = plan.share(part);
        let found = plan.search(scene, None, &Open::default(), Watch::new(plan.effort), answer)?;
        save_part(&found, &out.join(name), answer)?;
    }
    if is_interrupted() {
        return Err(Error::Interrupted(format!(
            "the best trees so far, of all meshes and over the instances, are in {}",
            out.display()
        )));
    }
    answer.say(&format!(
        "{}: {} instances of {} meshes",
        path.display(),
        whole(instances.len()),
        whole(scenes.len())
    ));
    answer.record("instances", instances.len());
    answer.record("meshes", scenes.len());
    answer.record("file", path.display().to_string());
    Ok(())
}

/// Writes the tree over a part of a scene.
pub(super) fn save_part(found: &Found, path: &Path, answer: &mut Answer) -> Result<(), Error> {
    found.save(path, files::Reserved::new(path, 0, false)?)?;
    let cost = found.baked.outcome.cost;
    let Some(base) = found.baked.greedy_cost else { return Ok(()) };
    let objects = found.scene.boxes.len();
    let file = path.display().to_string();
    answer.say(&format!(
        "{file}: {} objects, {} {}, {} against a greedy tree",
        whole(objects),
        found.unit().unwrap_or("total area of inner nodes"),
        short(cost),
        gain(cost, base)
    ));
    answer.list(
        "trees",
        json!({ "file": file, "objects": objects, "cost": cost, "greedy_cost": base }),
    );
    Ok(())
}

/// Rejects a folder with files, which would be replaced by the new files or mixed with them, and a
/// path at which no folder can be created.
fn new_folder(path: &Path) -> Result<(), Error> {
    // The nearest existing ancestor decides whether the rest of the path can be created.
    let above = path.ancestors().find(|above| above.exists()).filter(|above| !above.is_dir());
    let is_empty = fs::read_dir(path).map_or(true, |mut entries| entries.next().is_none());
    let found = match above {
        Some(above) => format!("{} is no folder", above.display()),
        None if !is_empty => format!("{} contains files", path.display()),
        None => return Ok(()),
    };
    Err(Error::Usage(format!("--out: {found}; accepted: the path of a new or empty folder")))
}

fn parts(path: &Path) -> Result<gltf::Parts, Error> {
    let bytes = files::read(path)?;
    let name = path.display().to_string();
    let format = Format::of(&bytes, path);
    if format != Format::Gltf {
        let message =
            format!("--instances with a file of the kind {format:?}; accepted: glTF or GLB");
        return Err(SceneError::new(&name, message).into());
    }
    Ok(gltf::parts(&bytes, path).map_err(|error| SceneError::new(&name, error))?)
}

/// Returns a scene of the boxes of all instances.
fn top(
    stem: &str,
    scenes: &[Scene],
    instances: &[Instance],
    parts: &gltf::Parts,
) -> Result<Scene, Error> {
    let mut layouts = Vec::new();
    for (scene, triangles) in scenes.iter().zip(parts.meshes.values()) {
        // A part has the same box in any tree, so that the fastest builder will do.
        let tree = median_cut::Config::default().build(&scene.boxes);
        let tree = tree.map_err(Error::search(&scene.name, "median_cut"))?;
        let layout = WideBvh::new(&tree, triangles);
        layouts.push(layout.map_err(Error::search(&scene.name, "median_cut"))?);
    }
    let name = format!("{stem}, instances");
    let boxes = Instance::boxes(instances, &layouts).map_err(|invalid| {
        let message = match invalid {
            InvalidInstances::Transform(index) => {
                let gltf::Placed { node, mesh, .. } = parts.places[index];
                let found = "its transform has no inverse, or its box is not finite";
                format!("nodes[{node}] places meshes[{mesh}]: {found}; expected an invertible one")
            }
            other => other.to_string(),
        };
        SceneError::new(&name, message)
    })?;
    // A scene needs objects, and the search reads only their boxes.
    let triangles = boxes.iter().map(|aabb| Triangle([aabb.min, aabb.max, aabb.min])).collect();
    Ok(Scene::new(&name, SceneKind::File, Primitives::Triangles(triangles)))
}
