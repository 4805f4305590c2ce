//! `harness bake --instances`: a tree for every mesh of a glTF file and one over the places where its nodes put them, in a folder.

use crate::Error;
use crate::cli::arguments::output_folder;
use crate::cli::bake::{BakeArgs, BakeCost, Baked, check_references, gain, method, search};
use crate::cli::effort::Effort;
use crate::cli::output::print_line;
use crate::files;
use crate::run::columns::{Columns, to_bytes};
use crate::scenes::{Scene, SceneKind, gltf, open::Format};
use bvh_build::{Builder, median_cut};
use bvh_core::{Instance, InvalidInstances, Primitives, Triangle, WideBvh};
use glam::Affine3A;
use schemars::JsonSchema;
use serde::Serialize;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The tree over the instances, whose ids are rows of [`INSTANCES`]. It is written last: where it is, the folder is complete.
const TOP: &str = "top.bvh";
/// The instances, an [`InstanceRow`] each.
const INSTANCES: &str = "instances.csv";

/// Searches for one tree after the other until the budget is spent or `interrupted` becomes true, and keeps each as soon as it is
/// found. If it is interrupted, the folder gets all its files all the same.
pub fn bake(args: &BakeArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    new_folder(&args.out)?;
    args.jobs.apply()?;
    let method = method(args)?;
    check_references(args, &method)?;
    let path = Path::new(&args.scene);
    let parts = read(path)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let part = |(mesh, triangles): (&usize, &Vec<Triangle>)| {
        let name = format!("{stem}, mesh {mesh}");
        Scene::new(&name, SceneKind::File, Primitives::Triangles(triangles.clone()))
    };
    let scenes: Vec<Scene> = parts.meshes.iter().map(part).collect();
    let instances = instances(&parts);
    let top = top(&stem, &scenes, &instances, &parts)?;
    fs::create_dir_all(&args.out).map_err(Error::io(&args.out, "create the folder"))?;
    let table = args.out.join(INSTANCES);
    files::write(&table, &to_bytes(&rows(&instances, &parts), &table)?)?;

    let objects = |scene: &Scene| scene.boxes.len();
    let all = (scenes.iter().map(objects).sum::<usize>() + objects(&top)) as f64;
    // Of the top tree every leaf is a box and whole, and it is not laid out.
    let of_top = BakeArgs { references: 1.0, cost: Some(BakeCost::Area), ..args.clone() };
    let names = parts.meshes.keys().map(|mesh| format!("mesh_{mesh}.bvh")).chain([TOP.into()]);
    let given = scenes.iter().map(|scene| (scene, args)).chain([(&top, &of_top)]);
    for (name, (scene, args)) in names.zip(given) {
        let effort = share(args.budget, objects(scene) as f64 / all);
        let Baked { outcome, bytes, base, .. } = search(args, &method, scene, effort, None, None, interrupted)?;
        let path = args.out.join(name);
        files::write(&path, &bytes)?;
        let (count, gain) = (objects(scene), gain(outcome.cost, base));
        print_line(&format!(
            "{}: {count} objects, cost {}, {gain} Müller–Fellner's",
            path.display(),
            outcome.cost
        ));
    }
    if interrupted.load(Relaxed) {
        return Err(Error::StoppedInstances { path: args.out.clone() });
    }
    let (places, path) = (instances.len(), args.out.join(INSTANCES));
    print_line(&format!("{}: {places} instances of {} meshes", path.display(), scenes.len()));
    Ok(())
}

/// Refuses a folder in which something is: nobody's files are replaced or mixed with these.
fn new_folder(path: &Path) -> Result<(), Error> {
    output_folder("--out", path)?;
    let is_empty = fs::read_dir(path).map_or(true, |mut entries| entries.next().is_none());
    let refused = || {
        Error::Usage(format!("--out: {}: a folder with files; accepted: a new or empty one", path.display()))
    };
    if is_empty { Ok(()) } else { Err(refused()) }
}

fn read(path: &Path) -> Result<gltf::Parts, Error> {
    let bytes = files::read(path)?;
    let name = || path.display().to_string();
    match Format::of(&bytes, path) {
        Format::Gltf => {
            gltf::parts(&bytes, path).map_err(|fault| Error::Scene { name: name(), message: fault.to_string() })
        }
        format => Err(Error::Scene {
            name: name(),
            message: format!(
                "--instances with a file of the kind {format:?}; accepted: glTF or GLB, whose nodes place meshes"
            ),
        }),
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
fn top(stem: &str, scenes: &[Scene], instances: &[Instance], parts: &gltf::Parts) -> Result<Scene, Error> {
    let name = format!("{stem}, instances");
    let failed = |message: String| Error::Scene { name: name.clone(), message };
    let layout = |scene: &Scene| {
        let triangles = scene.triangles().map_err(|error| failed(error.to_string()))?;
        let tree = median_cut::Config::default().build(&scene.boxes);
        let tree = tree.map_err(|error| failed(error.to_string()))?;
        WideBvh::new(&tree, triangles).map_err(|error| failed(error.to_string()))
    };
    // The box of a part is the same in any tree.
    let layouts = scenes.iter().map(layout).collect::<Result<Vec<_>, Error>>()?;
    let boxes = Instance::boxes(instances, &layouts).map_err(|invalid| match invalid {
        InvalidInstances::Transform(at) => {
            let (node, mesh) = (parts.places[at].node, parts.places[at].mesh);
            let found = "its transform has no inverse, or its box is not finite";
            failed(format!("nodes[{node}] places meshes[{mesh}]: {found}; expected an invertible one"))
        }
        other => failed(other.to_string()),
    })?;
    // Triangles with these boxes: only boxes are looked at.
    let triangles = boxes.iter().map(|aabb| Triangle([aabb.min, aabb.max, aabb.min])).collect();
    Ok(Scene::new(&name, SceneKind::File, Primitives::Triangles(triangles)))
}

/// One row of `instances.csv` of `harness bake --instances`: where a node of the scene places a mesh.
#[derive(Serialize, JsonSchema)]
struct InstanceRow {
    /// Number of the node in the file.
    node: usize,
    /// Number of the mesh in the file, whose tree is in `mesh_NUMBER.bvh`.
    mesh: usize,
    /// Where the transform takes the mesh's x axis, in world units: x.
    xx: f32,
    /// Likewise y.
    xy: f32,
    /// Likewise z.
    xz: f32,
    /// Where it takes the y axis: x.
    yx: f32,
    /// Likewise y.
    yy: f32,
    /// Likewise z.
    yz: f32,
    /// Where it takes the z axis: x.
    zx: f32,
    /// Likewise y.
    zy: f32,
    /// Likewise z.
    zz: f32,
    /// Where it takes the mesh's origin: x.
    tx: f32,
    /// Likewise y.
    ty: f32,
    /// Likewise z.
    tz: f32,
}

/// The columns of `instances.csv`.
pub fn columns() -> Columns {
    Columns::of::<InstanceRow>()
}

fn rows(instances: &[Instance], parts: &gltf::Parts) -> Vec<InstanceRow> {
    let row = |(place, instance): (&gltf::Placed, &Instance)| {
        let [xx, xy, xz, yx, yy, yz, zx, zy, zz, tx, ty, tz] = instance.transform.to_cols_array();
        InstanceRow { node: place.node, mesh: place.mesh, xx, xy, xz, yx, yy, yz, zx, zy, zz, tx, ty, tz }
    };
    parts.places.iter().zip(instances).map(row).collect()
}

/// A part of a budget.
fn share(effort: Effort, part: f64) -> Effort {
    match effort {
        Effort::Time(time) => Effort::Time(time.mul_f64(part)),
        Effort::Work(work) => Effort::Work((work as f64 * part) as u64),
    }
}
