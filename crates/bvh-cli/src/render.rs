//! `bvh render`: draws a scene into a PNG file, and prints times and counts.

use crate::Error;
use crate::answer::{Answer, whole};
use crate::arguments::{greedy, input_file, load_scene, output_file, precision_of};
use crate::output::{Progress, png};
use bvh_core::{Aabb, WideBvh};
use bvh_scenes::files::{self, WriteError};
use bvh_scenes::rays::View;
use bvh_scenes::render::{Options, framing, heat, render as draw};
use bvh_scenes::trace::{Accelerator, KdTree, Structure};
use bvh_scenes::{Precision, Scene, tree_file};
use glam::DVec3;
use std::borrow::Cow;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Draw a scene with a small Whitted ray tracer. The picture is the same with any structure.
#[derive(clap::Args, Clone, Debug)]
pub struct RenderArgs {
    /// Name or path of the scene, as in `bvh scenes`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// The picture, a PNG file.
    #[arg(short, long, value_name = "FILE.png")]
    pub out: PathBuf,
    /// The acceleration structure: brute, kdtree, bvh, wide, or a saved tree. It changes only the
    /// time.
    #[arg(long, value_name = "NAME|FILE.bvh", default_value = "bvh")]
    pub accel: String,
    /// Show the number of tests of each pixel's rays instead of the scene. The last colour is for
    /// so many tests per ray, or for most pixels of this picture.
    #[arg(long, value_name = "TESTS", num_args = 0..=1, require_equals = true)]
    pub heatmap: Option<Option<NonZeroU32>>,
    /// Smooth edges with N² rays per pixel.
    #[arg(long, value_name = "N", default_value_t = 2)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=16))]
    pub samples: u32,
    #[command(flatten)]
    pub camera: CameraArgs,
}

/// The camera of a picture.
#[derive(clap::Args, Clone, Debug)]
pub struct CameraArgs {
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = size)]
    pub size: (u32, u32),
    /// The eye. The default shows the whole scene from outside.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub from: Option<DVec3>,
    /// The middle of the picture. The default is the centre of the scene.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub at: Option<DVec3>,
}

/// The largest number of pixels of a picture. With their counts they need a gigabyte.
const LARGEST: u64 = 100_000_000;

fn size(text: &str) -> Result<(u32, u32), String> {
    let pixels = |&(width, height): &(u32, u32)| u64::from(width) * u64::from(height);
    text.split_once('x')
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)))
        .filter(|size| (1..=LARGEST).contains(&pixels(size)))
        .ok_or_else(|| {
            format!("accepted: width and height as in 960x540, {LARGEST} pixels at most")
        })
}

fn point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|number| number.trim().parse().ok()).collect();
    // Rays have f32 coordinates, so that larger numbers would overflow.
    match numbers.as_deref() {
        Some(&[x, y, z]) if DVec3::new(x, y, z).as_vec3().is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err("accepted: three numbers as in 1.5,-2,0".into()),
    }
}

impl CameraArgs {
    /// Returns the view of a scene that has this direction up.
    pub fn view(&self, scene: &Scene, up: DVec3) -> View {
        let (width, height) = self.size;
        let automatic = framing::upright(scene, up, f64::from(width) / f64::from(height));
        // The automatic eye fits the automatic angle; any other pair gets the default angle.
        match (self.from, self.at) {
            (None, None) => automatic,
            (from, at) => View {
                from: from.unwrap_or(automatic.from),
                at: at.unwrap_or_else(|| Aabb::union_of(&scene.boxes).doubled_centroid() / 2.0),
                fov: View::FOV,
            },
        }
    }
}

/// Draws the picture, writes it, and prints its times.
pub fn render(args: &RenderArgs, answer: &mut Answer) -> Result<(), Error> {
    let accel = Path::new(&args.accel);
    let is_file = args.accel.ends_with(".bvh");
    if is_file {
        input_file("--accel", accel)?;
    }
    output_file("--out", &args.out, "png")?;
    let precision = if is_file { precision_of(accel)? } else { Precision::Single };
    let scene = load_scene(&args.scene, precision)?;
    if args.heatmap.is_some() && args.accel == "wide" {
        return Err(Error::Usage(
            "--heatmap: the wide layout counts no tests; \
             accepted with it: --accel brute, kdtree, bvh, FILE.bvh"
                .into(),
        ));
    }
    let (width, height) = args.camera.size;
    let view = args.camera.view(&scene, scene.up());
    let options = Options { samples: args.samples, ..Options::new(width, height, view) };
    let start = Instant::now();
    let accelerator = Accelerator::new(&scene.primitives, structure(&args.accel, &scene)?);
    let built = start.elapsed().as_secs_f64();
    let progress = Progress::new(options.height.into(), "rows");
    let film = draw(&scene, &accelerator, &options, &|| progress.add(1));
    progress.end();
    let rendered = start.elapsed().as_secs_f64() - built;
    let heat::Range { median, top: common } = heat::range(film.tests.clone());
    let rays_per_pixel = f64::from(options.samples * options.samples);
    let top = args.heatmap.flatten().map(|tests| f64::from(tests.get()) * rays_per_pixel);
    let heat = args.heatmap.map(|_| heat::colours(&film, top.unwrap_or(common)));
    let bytes = png(film.width, heat.as_ref().unwrap_or(&film.pixels))
        .map_err(WriteError::of(&args.out, "encode the picture"))?;
    files::write(&args.out, &bytes)?;
    let objects = scene.boxes.len();
    answer.say(&format!(
        "{}: {} objects, {} rays; built in {built:.3} s, rendered in {rendered:.3} s",
        scene.name,
        whole(objects),
        whole(film.rays)
    ));
    answer.record("objects", objects);
    answer.record("rays", film.rays);
    answer.record("seconds_to_build", built);
    answer.record("seconds_to_render", rendered);
    if args.accel != "wide" {
        answer.fact("boxes per ray", film.counts.boxes as f64 / film.rays as f64);
        answer.fact("objects per ray", film.counts.objects as f64 / film.rays as f64);
        answer.fact("median tests per ray of a pixel", median / rays_per_pixel);
        let top = top.unwrap_or(common) / rays_per_pixel;
        answer.fact("tests per ray of the last colour of --heatmap", top);
    }
    answer.say(&format!("picture: {}", args.out.display()));
    answer.record("file", args.out.display().to_string());
    Ok(())
}

/// Builds the structure that `--accel` names over the scene. Trees are built by greedy Müller–Fellner
/// division.
fn structure(name: &str, scene: &Scene) -> Result<Structure<'static>, Error> {
    Ok(match name {
        "brute" => Structure::Brute,
        "kdtree" => {
            let tree = KdTree::build(&scene.boxes);
            Structure::KdTree(tree.map_err(Error::search(&scene.name, name))?)
        }
        "bvh" => Structure::Tree(Cow::Owned(greedy(scene)?)),
        "wide" => {
            let triangles = scene.triangles().map_err(|fault| {
                Error::Usage(format!("--accel wide: {fault}, or --accel brute, kdtree, bvh"))
            })?;
            let layout = WideBvh::new(&greedy(scene)?, triangles);
            Structure::Wide(layout.map_err(Error::search(&scene.name, name))?)
        }
        _ if name.ends_with(".bvh") => {
            Structure::Tree(Cow::Owned(tree_file::load(Path::new(name), scene)?.0))
        }
        _ => {
            let accepted = "brute, kdtree, bvh, wide, or the path of a .bvh file";
            return Err(Error::Usage(format!("--accel is {name:?}; accepted: {accepted}")));
        }
    })
}
