//! `bvh bake --instances`: a tree for every mesh of a glTF file and one over the places where its nodes put them, in a folder.

use super::BakeArgs;
use super::plan::Plan;
use super::watch::gain;
use crate::Error;
use crate::csv;
use bvh_build::{Builder, median_cut};
use bvh_core::cost::Objective;
use bvh_core::{Instance, InvalidInstances, Primitives, Triangle, WideBvh};
use bvh_scenes::load::mesh::Fault;
use bvh_scenes::load::{Format, OutsideFiles, gltf};
use bvh_scenes::tree_file::TreeFileError;
use bvh_scenes::{Scene, SceneError, SceneKind, read};
use bvh_terminal::arguments::output_folder;
use bvh_terminal::files;
use bvh_terminal::output::print_line;
use glam::Affine3A;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The tree over the instances, whose ids are rows of [`INSTANCES`]. It is written last: where it is, the folder is complete.
const TOP: &str = "top.bvh";
/// The instances, a row each.
const INSTANCES: &str = "instances.csv";
/// Its columns, which docs/TREE_FILES.md describes.
const COLUMNS: &str = "node,mesh,xx,xy,xz,yx,yy,yz,zx,zy,zz,tx,ty,tz";

/// Searches for one tree after the other until the budget is spent or `interrupted` becomes true, and keeps each as soon as it is
/// found. If it is interrupted, the folder gets all its files all the same.
pub fn bake(args: &BakeArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    new_folder(&args.out)?;
    args.jobs.apply()?;
    let plan = args.plan()?;
    let path = Path::new(&args.scene);
    let parts = parts(path, args.files.outside())?;
    let stem = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let part = |(mesh, triangles): (&usize, &Vec<Triangle>)| {
        let name = format!("{stem}, mesh {mesh}");
        Scene::new(&name, SceneKind::File, Primitives::Triangles(triangles.clone()))
    };
    let scenes: Vec<Scene> = parts.meshes.iter().map(part).collect();
    let instances = instances(&parts);
    let top = top(&stem, &scenes, &instances, &parts)?;
    fs::create_dir_all(&args.out).map_err(Error::io(&args.out, "create the folder"))?;
    files::write(&args.out.join(INSTANCES), table(&instances, &parts).as_bytes())?;

    let objects: usize = scenes
        .iter()
        .chain([&top])
        .map(|scene| scene.boxes.len())
        .sum();
    // Every leaf of the top tree is a box and whole, and the tree is not laid out.
    let plan_of_top = Plan { references: 1.0, objective: Objective::InternalArea, ..plan.clone() };
    let names = parts
        .meshes
        .keys()
        .map(|mesh| format!("mesh_{mesh}.bvh"))
        .chain([TOP.into()]);
    let given = scenes
        .iter()
        .map(|scene| (scene, &plan))
        .chain([(&top, &plan_of_top)]);
    for (name, (scene, plan)) in names.zip(given) {
        let part = scene.boxes.len() as f64 / objects as f64;
        let plan = Plan { effort: plan.effort.share(part), ..plan.clone() };
        bake_part(&plan, scene, &args.out.join(name), interrupted)?;
    }
    if interrupted.load(Relaxed) {
        return Err(Error::StoppedInstances { path: args.out.clone() });
    }
    let places = instances.len();
    let path = args.out.join(INSTANCES);
    print_line(&format!("{}: {places} instances of {} meshes", path.display(), scenes.len()));
    Ok(())
}

/// Searches for the tree over one mesh or over the instances, and keeps it.
fn bake_part(
    plan: &Plan,
    scene: &Scene,
    path: &Path,
    interrupted: &AtomicBool,
) -> Result<(), Error> {
    let bake = plan.begin(scene, None, interrupted)?;
    let baked = bake.search(interrupted)?;
    let bytes = bake
        .file(&baked)
        .map_err(TreeFileError::of(path))?;
    files::write(path, &bytes)?;
    let count = scene.boxes.len();
    let cost = baked.outcome.cost;
    let gain = gain(cost, baked.base);
    print_line(&format!(
        "{}: {count} objects, cost {cost}, {gain} Müller–Fellner's",
        path.display()
    ));
    Ok(())
}

/// Refuses a folder in which something is: nobody's files are replaced or mixed with these.
fn new_folder(path: &Path) -> Result<(), Error> {
    output_folder("--out", path)?;
    let is_empty = fs::read_dir(path).map_or(true, |mut entries| entries.next().is_none());
    let refused = || {
        Error::Usage(format!(
            "--out: {}: a folder with files; accepted: a new or empty one",
            path.display()
        ))
    };
    if is_empty { Ok(()) } else { Err(refused()) }
}

fn parts(path: &Path, outside: OutsideFiles) -> Result<gltf::Parts, Error> {
    let bytes = read(path)?;
    let name = || path.display().to_string();
    match Format::of(&bytes, path) {
        Format::Gltf => {
            let refused = |fault: Fault| SceneError { name: name(), message: fault.to_string() };
            Ok(gltf::parts(&bytes, path, outside).map_err(refused)?)
        }
        format => Err(SceneError {
            name: name(),
            message: format!(
                "--instances with a file of the kind {format:?}; accepted: glTF or GLB, whose nodes place meshes"
            ),
        }
        .into()),
    }
}

/// The instances, of parts by their order among the meshes that are baked.
fn instances(parts: &gltf::Parts) -> Vec<Instance> {
    let instance = |place: &gltf::Placed| Instance {
        part: parts.meshes.range(..place.mesh).count() as u32,
        transform: Affine3A::from_mat4(place.transform.as_mat4()),
    };
    parts.places.iter().map(instance).collect()
}

/// The boxes of all instances, as a scene.
fn top(
    stem: &str,
    scenes: &[Scene],
    instances: &[Instance],
    parts: &gltf::Parts,
) -> Result<Scene, Error> {
    let name = format!("{stem}, instances");
    let failed = |message: String| Error::from(SceneError { name: name.clone(), message });
    let layout = |scene: &Scene| {
        let triangles = scene
            .triangles()
            .map_err(|error| failed(error.to_string()))?;
        let tree = median_cut::Config::default().build(&scene.boxes);
        let tree = tree.map_err(|error| failed(error.to_string()))?;
        WideBvh::new(&tree, triangles).map_err(|error| failed(error.to_string()))
    };
    // The box of a part is the same in any tree.
    let layouts = scenes
        .iter()
        .map(layout)
        .collect::<Result<Vec<_>, Error>>()?;
    let boxes = Instance::boxes(instances, &layouts).map_err(|invalid| match invalid {
        InvalidInstances::Transform(at) => {
            let node = parts.places[at].node;
            let mesh = parts.places[at].mesh;
            let found = "its transform has no inverse, or its box is not finite";
            failed(format!(
                "nodes[{node}] places meshes[{mesh}]: {found}; expected an invertible one"
            ))
        }
        other => failed(other.to_string()),
    })?;
    // Triangles with these boxes: only boxes are looked at.
    let triangles = boxes
        .iter()
        .map(|aabb| Triangle([aabb.min, aabb.max, aabb.min]))
        .collect();
    Ok(Scene::new(&name, SceneKind::File, Primitives::Triangles(triangles)))
}

/// Returns the text of [`INSTANCES`]: where each node of the scene places which mesh.
fn table(instances: &[Instance], parts: &gltf::Parts) -> String {
    let mut table = csv::Table::new(COLUMNS);
    for (place, instance) in parts.places.iter().zip(instances) {
        table.cell(place.node);
        table.cell(place.mesh);
        table.numbers(&instance.transform.to_cols_array());
        table.end_row();
    }
    table.text().to_owned()
}
