//! `bvh sky`: what each point of a scene sees of the sky, or of the sun.

mod directions;
mod points;
mod write;

use crate::Error;
use crate::answer::{Answer, short, whole};
use crate::arguments::{input_file, load_scene, named, output_file};
use crate::bench::Layout;
use crate::output::Progress;
use crate::render::CameraArgs;
use bvh_core::{Aabb, Sky, View, WideBvh, neighbours};
use bvh_scenes::rays::Camera;
use bvh_scenes::{Precision, Scene, SceneError, SceneKind};
use bvh_search::{BakeError, Deadline, Objects, Options, OwnedTree};
use clap::Args;
use directions::{Date, Looks};
use glam::{DMat3, DVec3, Vec3};
use points::Points;
use rayon::prelude::*;
use solar_positioning::Location;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use write::Legend;

/// Compute what each point of a scene sees of the sky: its sky view factor, hours of sun, or sums of
/// weights of directions. Only directions on the side of a point's normal count.
///
/// Examples:
///
/// bvh sky city.glb --out views.csv
///
/// bvh sky city.obj --sun 47.4,8.5 --dates 2026-03-20,2026-06-21 --out hours.png
#[derive(Args, Clone, Debug)]
pub struct SkyArgs {
    /// Name of a scene, or path of a mesh file.
    pub scene: String,
    /// The file to write, replaced when it is complete: `.csv` with a line for each point; `.ply` or
    /// `.glb` with colours; or a `.png` picture, which has a point in each pixel, on the side
    /// towards the eye.
    #[arg(short, long, value_name = "FILE.csv|.ply|.glb|.png")]
    pub out: PathBuf,
    /// Where the points are: in the middle of each triangle, or at each vertex, with the mean of the
    /// normals by area.
    #[arg(long, value_name = "triangle|vertex", default_value = "triangle")]
    #[arg(value_parser = ["triangle", "vertex"], hide_possible_values = true)]
    pub per: String,
    /// Points of a file: `x,y,z`, or `x,y,z,nx,ny,nz` with normals. Without normals all directions
    /// count, and a sky view factor is that of a horizontal surface.
    #[arg(long, value_name = "FILE.csv|.npy", conflicts_with = "per")]
    pub points: Option<PathBuf>,
    /// Let the side of each point count that sees more, for meshes whose triangles do not all turn
    /// their front outwards. Takes twice the time.
    #[arg(long)]
    pub two_sided: bool,
    /// How far points are moved along their normals, so that their own surface does not hide the
    /// sky. The default is the largest coordinate of the scene over 2²¹: half a millimetre in a
    /// kilometre.
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    pub offset: Option<f64>,
    /// The directions of the sky: the 145 patches of Tregenza, the 577 of Reinhart, or N directions
    /// of equal solid angle. Their value is the sky view factor: 1 on a free horizontal surface.
    #[arg(long, value_name = "tregenza|reinhart|uniform:N", default_value = "tregenza")]
    #[arg(value_parser = directions::built_in)]
    pub sky: Sky,
    /// Directions of a file, in the axes of the scene, as lines `x,y,z` and any weights. The names
    /// in a header become the names of the columns.
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["sky", "sun"])]
    pub directions: Option<PathBuf>,
    /// Count the hours of sun at a place, in degrees north and east.
    #[arg(long, value_name = "LATITUDE,LONGITUDE", requires = "dates", conflicts_with = "sky")]
    #[arg(value_parser = directions::place, allow_hyphen_values = true)]
    pub sun: Option<Location>,
    /// The days of the sun, each from midnight to midnight of the mean solar time.
    #[arg(long, value_name = "DATE,...", requires = "sun", value_delimiter = ',')]
    #[arg(value_parser = directions::date)]
    pub dates: Vec<Date>,
    /// The minutes between positions of the sun.
    #[arg(long, value_name = "MINUTES", default_value = "30", value_parser = directions::step)]
    pub step: u32,
    /// The axis that is up: y in glTF, and z in other files and in built-in scenes.
    #[arg(long, value_name = "x|y|z", hide_possible_values = true)]
    #[arg(value_parser = named([("x", 0usize), ("y", 1), ("z", 2)]))]
    pub up: Option<usize>,
    /// Degrees from the scene's north over east to the true north. North is y where z is up, −z
    /// where y is up, and z where x is up.
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = degrees)]
    pub north: f64,
    /// The column that colours show. The default is the first one.
    #[arg(long, value_name = "NAME")]
    pub column: Option<String>,
    /// A saved tree of the scene. Otherwise a search takes a twentieth of the time that the rays
    /// will take, five seconds at most. It changes only the time.
    #[arg(long, value_name = "FILE.bvh")]
    pub tree: Option<PathBuf>,
    #[command(flatten)]
    pub camera: CameraArgs,
}

fn degrees(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|degrees| (0.0..=360.0).contains(degrees));
    degrees.ok_or_else(|| "accepted: 0 to 360".into())
}

/// Writes the values of all points, and prints their mean and the speed.
pub fn sky(args: &SkyArgs, answer: &mut Answer) -> Result<(), Error> {
    let kind = args.check()?;
    let scene = load_scene(&args.scene, Precision::Single)?;
    let up = args.up.unwrap_or_else(|| up(args, &scene));
    let upright = upright(up);
    // East, north and up of the compass.
    let (sine, cosine) = libm::sincos(args.north.to_radians());
    let [east, north] = [DVec3::new(cosine, -sine, 0.0), DVec3::new(sine, cosine, 0.0)];
    let axes = upright * DMat3::from_cols(east, north, DVec3::Z);
    let looks = Looks::new(args, &axes)?;
    let legend = Legend::of(args.column.as_deref(), &looks.columns).map_err(Error::Usage)?;
    let triangles = scene.triangles()?;
    let offset = args.offset(&scene)?;
    let (width, height) = args.camera.size;
    let (what, made) = match (kind, &args.points) {
        ("png", _) => ("pixels", None),
        (_, Some(path)) => ("points", Some(Points::of_file(path)?)),
        _ if args.per == "vertex" => ("vertices", Some(Points::of_vertices(triangles))),
        _ => ("triangles", Some(Points::of_triangles(triangles))),
    };
    let pixels = u64::from(width) * u64::from(height);
    let count = made.as_ref().map_or(pixels, |points| points.at.len() as u64);
    let directions = looks.sky.directions().len();
    let start = Instant::now();
    let wide = args.layout(&scene, count * directions as u64)?;
    let seconds_to_build = start.elapsed().as_secs_f64();
    let points = made.unwrap_or_else(|| {
        let camera =
            Camera::new(&args.camera.view(&scene, axes.z_axis), axes.z_axis, width, height);
        Points::of_pixels(&wide, triangles, &camera, args.camera.size)
    });
    let start = Instant::now();
    let values = seen(args, &looks, &wide, &points, offset, axes.z_axis.as_vec3());
    let seconds = start.elapsed().as_secs_f64();
    let legend = legend.over(&values);
    write::write(args, kind, &points, triangles, &legend, &looks.columns, &values, &upright)?;

    let count = points.at.len();
    let rays = count as f64 * directions as f64 * if args.two_sided { 2.0 } else { 1.0 };
    let mean = legend.of_points(&values).sum::<f64>() / count.max(1) as f64;
    let name = legend.name.replace('_', " ");
    answer.say(&format!(
        "{}: mean {name} {} over {} {what}, {} directions, {} up; {} rays a second, {:.1} s in all",
        scene.name,
        short(mean),
        whole(count),
        whole(directions),
        ["x", "y", "z"][up],
        short(rays / seconds.max(f64::MIN_POSITIVE)),
        seconds_to_build + seconds
    ));
    answer.say(&format!(
        "{name}: {}",
        legend.line(kind, if args.sun.is_some() { " hours" } else { "" })
    ));
    answer.say(&args.out.display().to_string());
    answer.record("mean", mean);
    answer.record("minimum", legend.least);
    answer.record("maximum", legend.most);
    answer.record("offset", offset);
    answer.record("seconds_to_build", seconds_to_build);
    answer.record("seconds", seconds);
    answer.record("points", count);
    answer.record("directions", directions);
    answer.record("columns", looks.columns);
    answer.record("file", args.out.display().to_string());
    Ok(())
}

/// Returns the number of the axis that is up in a scene.
fn up(args: &SkyArgs, scene: &Scene) -> usize {
    // A subset may follow the extension.
    let extension = Path::new(&args.scene).extension().unwrap_or_default().to_ascii_lowercase();
    let is_gltf = extension.to_string_lossy().starts_with("gl");
    if scene.kind == SceneKind::File && is_gltf { 1 } else { 2 }
}

/// Returns east, north and up where this axis is up.
fn upright(up: usize) -> DMat3 {
    match up {
        0 => DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
        1 => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        _ => DMat3::IDENTITY,
    }
}

/// Returns a row of values for each point.
fn seen(
    args: &SkyArgs,
    looks: &Looks,
    wide: &WideBvh,
    points: &Points,
    offset: f64,
    up: Vec3,
) -> Vec<f64> {
    let normals = match &points.normals {
        None if looks.by_cosine => Some(vec![up; points.at.len()]),
        normals => normals.clone(),
    };
    let sides: &[f64] = if args.two_sided { &[1.0, -1.0] } else { &[1.0] };
    let progress = Progress::new((points.at.len() * sides.len()) as u64, "points");
    let from_side = |&side: &f64| {
        let at = points.above(side * offset);
        let turned =
            |normals: &Vec<Vec3>| normals.iter().map(|normal| normal * side as f32).collect();
        let normals: Option<Vec<Vec3>> = normals.as_ref().map(turned);
        let view = View { points: &at, normals: normals.as_deref() };
        seen_from(&looks.sky, wide, view, looks.by_cosine, &|count| progress.add(count))
    };
    let larger = |one: Vec<f64>, other: Vec<f64>| {
        one.iter().zip(other).map(|(one, other)| one.max(other)).collect()
    };
    let values = sides.iter().map(from_side).reduce(larger).unwrap_or_default();
    progress.end();
    values
}

/// Returns the sums of weights for each point, on all threads.
fn seen_from(
    sky: &Sky,
    wide: &WideBvh,
    view: View<Vec3>,
    by_cosine: bool,
    done: &(dyn Fn(u64) + Sync),
) -> Vec<f64> {
    /// Points of a task.
    const PART: usize = 1024;
    let order = neighbours(view.points);
    let parts: Vec<Vec<f64>> = order
        .par_chunks(PART)
        .map(|order| {
            let normals = view.normals.filter(|_| by_cosine);
            let mut sums = Vec::new();
            sky.visible(wide, view, order, |point, row| {
                sums.extend(sky.sums(row, normals.map(|normals| normals[point].as_dvec3())));
            });
            done(order.len() as u64);
            sums
        })
        .collect();
    let columns = sky.columns();
    let mut values = vec![0.0; order.len() * columns];
    let rows = parts.iter().flat_map(|part| part.chunks_exact(columns));
    for (row, point) in rows.zip(order) {
        values[point as usize * columns..][..columns].copy_from_slice(row);
    }
    values
}

impl SkyArgs {
    /// Checks the paths, and returns the kind of file to write.
    fn check(&self) -> Result<&'static str, Error> {
        let kinds = ["csv", "ply", "glb", "png"];
        let is = |kind: &&str| self.out.extension().is_some_and(|e| e.eq_ignore_ascii_case(kind));
        let Some(kind) = kinds.into_iter().find(is) else {
            return Err(Error::Usage(format!(
                "--out: {}; accepted: a name that ends with .csv, .ply, .glb or .png",
                self.out.display()
            )));
        };
        output_file("--out", &self.out, kind)?;
        let inputs = [
            ("--points", &self.points),
            ("--directions", &self.directions),
            ("--tree", &self.tree),
        ];
        for (flag, path) in inputs {
            path.as_ref().map_or(Ok(()), |path| input_file(flag, path))?;
        }
        let out = fs::canonicalize(&self.out).ok();
        let named = inputs.iter().filter_map(|(_, path)| path.as_deref());
        let mut named = named.chain([Path::new(&self.scene)]);
        if out.is_some() && named.any(|path| fs::canonicalize(path).ok() == out) {
            let message = format!("--out: {} is read; accepted: another name", self.out.display());
            return Err(Error::Usage(message));
        }
        if kind == "png" && (self.points.is_some() || self.per != "triangle") {
            let message = "--out: a picture has a point in each pixel; accepted with --points or \
                           --per: .csv, .ply, .glb";
            return Err(Error::Usage(message.into()));
        }
        Ok(kind)
    }

    fn offset(&self, scene: &Scene) -> Result<f64, Error> {
        let bounds = Aabb::union_of(&scene.boxes);
        let largest = f64::from(bounds.min.abs().max(bounds.max.abs()).max_element());
        let size = bounds.extent().max_element();
        match self.offset {
            Some(offset) if !(0.0..=size).contains(&offset) => Err(Error::Usage(format!(
                "--offset is {offset}; accepted: 0 to the size of the scene, {size}"
            ))),
            // Rounding a point moves it by less than half as much.
            given => Ok(given.unwrap_or(largest * (-21f64).exp2())),
        }
    }

    /// Returns the layout of the saved tree, or of a new one for so many rays.
    fn layout(&self, scene: &Scene, rays: u64) -> Result<WideBvh, Error> {
        let triangles = scene.triangles()?;
        if let Some(path) = &self.tree {
            return match Layout::of_file(path, scene)? {
                Layout::Single(wide) => Ok(wide),
                Layout::Double(_) => Err(Error::Usage(format!(
                    "--tree: {} is in double precision; accepted: a tree of a bake in single precision",
                    path.display()
                ))),
            };
        }
        /// Rays a second of one thread, more or less.
        const SPEED: f64 = 5e6;
        let seconds = rays as f64 / (SPEED * rayon::current_num_threads() as f64);
        let deadline = Deadline::after(Duration::from_secs_f64((0.05 * seconds).min(5.0)));
        let objects = Objects::Shapes(scene.primitives.clone());
        let tree = OwnedTree::find(objects, &Options::default(), &deadline);
        let tree = tree.map_err(|error| match error {
            BakeError::Search(error) => Error::search(&scene.name, "best")(error),
            BakeError::Rays(source) => Error::Tracing { scene: scene.name.clone(), source },
        })?;
        let invalid = |error| SceneError::new(&scene.name, error);
        WideBvh::new(tree.tree(), triangles).map_err(|error| invalid(error).into())
    }
}
