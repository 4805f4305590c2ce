//! `bvh render`: draws a scene into a PNG file, and prints times and counts.

use crate::Error;
use crate::arguments::{Jobs, input_file, output_file};
use crate::output::print_line;
use crate::scene_files::SceneFiles;
use bvh_core::Aabb;
use bvh_scenes::Scene;
use bvh_scenes::files;
use bvh_scenes::rays::View;
use bvh_scenes::render::{Film, Options, framing, heat, image, render as draw, structure, tiles};
use bvh_scenes::trace::Accelerator;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Draw a scene with a small Whitted ray tracer. The picture is the same with any structure.
#[derive(clap::Args, Clone, Debug)]
pub struct RenderArgs {
    /// Name or path of the scene, as in `bvh scenes`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// The picture, a PNG file.
    #[arg(long, value_name = "FILE.png")]
    pub out: PathBuf,
    /// The acceleration structure: brute, kdtree, bvh, wide, or a saved tree. It changes only the
    /// time.
    #[arg(long, value_name = "NAME|FILE.bvh", default_value = "bvh")]
    pub accel: String,
    /// Show the number of tests of each pixel's rays instead of the scene.
    #[arg(long)]
    pub heatmap: bool,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = size)]
    pub size: (u32, u32),
    /// Smooth edges with N² rays per pixel.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 2,
        value_parser = clap::value_parser!(u32).range(1..=16)
    )]
    pub samples: u32,
    /// The number of mirror reflections to follow.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4,
        value_parser = clap::value_parser!(u32).range(0..=64)
    )]
    pub depth: u32,
    /// The eye. The default shows the whole scene from outside.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub from: Option<DVec3>,
    /// The middle of the picture. The default is the centre of the scene.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub at: Option<DVec3>,
    /// The angle of view from bottom to top, in degrees.
    #[arg(long, value_name = "DEGREES", value_parser = angle)]
    pub fov: Option<f64>,
    /// A point light that replaces the automatic lights; may be repeated.
    #[arg(long = "light", value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub lights: Vec<DVec3>,
    /// Light surfaces from the eye, without lights and shadow rays.
    #[arg(long, conflicts_with = "lights")]
    pub no_lights: bool,
    /// Draw no ground under a scene that is seen from outside.
    #[arg(long)]
    pub no_ground: bool,
    /// Permits files outside the scene's folder.
    #[command(flatten)]
    pub files: SceneFiles,
    /// Limits the threads.
    #[command(flatten)]
    pub jobs: Jobs,
}

/// The largest number of pixels of a picture. With their counts they need a gigabyte.
const LARGEST: u64 = 100_000_000;

fn size(text: &str) -> Result<(u32, u32), String> {
    let parsed = text
        .split_once('x')
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    match parsed {
        Some((width, height))
            if width > 0 && height > 0 && u64::from(width) * u64::from(height) <= LARGEST =>
        {
            Ok((width, height))
        }
        _ => Err(format!("accepted: width and height as in 960x540, {LARGEST} pixels at most")),
    }
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

fn angle(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(angle) if (1.0..=170.0).contains(&angle) => Ok(angle),
        _ => Err("accepted: 1 to 170".into()),
    }
}

impl RenderArgs {
    fn options(&self, scene: &Scene) -> Options {
        let (width, height) = self.size;
        let bounds = Aabb::union_of(&scene.boxes);
        let automatic = framing::automatic(scene, &bounds, f64::from(width) / f64::from(height));
        // The automatic eye fits the automatic angle; any other pair gets the default angle.
        let view = match (self.from, self.at) {
            (None, None) => View { fov: self.fov.unwrap_or(automatic.fov), ..automatic },
            (from, at) => View {
                from: from.unwrap_or(automatic.from),
                at: at.unwrap_or(bounds.doubled_centroid() / 2.0),
                fov: self.fov.unwrap_or(View::FOV),
            },
        };
        let lights = (self.no_lights || !self.lights.is_empty()).then(|| self.lights.clone());
        let samples = self.samples;
        let depth = self.depth;
        let ground = !self.no_ground;
        Options { width, height, samples, depth, view: Some(view), lights, ground }
    }
}

/// Draws the picture, writes it, and prints its times.
pub fn render(args: &RenderArgs) -> Result<(), Error> {
    if args.accel.ends_with(".bvh") {
        input_file("--accel", Path::new(&args.accel))?;
    }
    output_file("--out", &args.out, "png")?;
    args.jobs.apply()?;
    let scene = args.files.load(&args.scene)?;
    if args.heatmap && args.accel == "wide" {
        return Err(Error::Usage(
            "--heatmap: the wide layout counts no tests; \
             accepted with it: --accel brute, kdtree, bvh, FILE.bvh"
                .into(),
        ));
    }
    let options = args.options(&scene);
    let start = Instant::now();
    let accelerator = Accelerator::new(&scene.primitives, structure::by_name(&args.accel, &scene)?);
    let built = start.elapsed().as_secs_f64();
    let bar = ProgressBar::new(tiles(&options));
    let template = "{msg} {wide_bar} {pos}/{len} tiles, {eta} left";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar.set_message(scene.name.clone());
    let film = draw(&scene, &accelerator, &options, &|| bar.inc(1));
    bar.finish_and_clear();
    let rendered = start.elapsed().as_secs_f64() - built;
    let rays_per_pixel = options.samples * options.samples;
    write(args, &film, rays_per_pixel)?;
    print_line(&summary(args, &scene, &film, rays_per_pixel, built, rendered));
    Ok(())
}

fn write(args: &RenderArgs, film: &Film, rays_per_pixel: u32) -> Result<(), Error> {
    let action = "encode the picture";
    let bytes = if args.heatmap {
        let pixels = heat::map(film, rays_per_pixel, &heat::range(film, rays_per_pixel))
            .map_err(io::Error::other)
            .map_err(Error::io(&args.out, action))?;
        image::png(film.width, &pixels)
    } else {
        image::png(film.width, &film.pixels)
    };
    let bytes = bytes.map_err(io::Error::other).map_err(Error::io(&args.out, action))?;
    Ok(files::write(&args.out, &bytes)?)
}

fn summary(
    args: &RenderArgs,
    scene: &Scene,
    film: &Film,
    rays_per_pixel: u32,
    built: f64,
    rendered: f64,
) -> String {
    let mut text = format!(
        "{}: {} objects, {} rays; built in {built:.3} s, rendered in {rendered:.3} s\n",
        scene.name,
        scene.boxes.len(),
        film.rays
    );
    if args.accel != "wide" {
        let boxes = film.counts.boxes as f64 / film.rays as f64;
        let objects = film.counts.objects as f64 / film.rays as f64;
        let heat::Range { min, median, max, .. } = heat::range(film, rays_per_pixel);
        text += &format!(
            "per ray: {boxes:.2} boxes, {objects:.2} objects; \
             per pixel: at least {min:.0} tests, median {median:.0}, at most {max:.0}\n"
        );
    }
    text + &format!("Picture: {}", args.out.display())
}
