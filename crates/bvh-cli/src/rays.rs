//! The rays of `--rays`, from a file, from a renderer or any through the scene, and their density.

use crate::Error;
use crate::arguments::input_file;
use crate::interrupt::is_interrupted;
use crate::npy::read_npy;
use crate::table::Table;
use bvh_config::fault;
use bvh_core::cost::Objective;
use bvh_core::{Aabb, Bvh, DensityError, Ray, RayDensity, Segment, Slabs};
use bvh_scenes::Scene;
use bvh_scenes::files::{read, read_text};
use bvh_scenes::rays::{RenderedRays, TRAINED, density, of_anything, of_renderer};
use bvh_search::{Open, ray_density};
use glam::Vec3;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::path::Path;
use std::time::{Duration, Instant};

/// The rays that train a tree.
#[derive(Clone, Debug)]
pub enum Rays {
    /// Rays that need no camera.
    Default,
    /// The rays of a renderer.
    Rendered(RenderedRays),
    /// The segments of the file of this name.
    Recorded(String, Vec<Segment>),
}

impl Rays {
    /// Returns the rays named `default`, or reads the file with this name.
    pub fn read(named: &str) -> Result<Self, Error> {
        if named == "default" {
            return Ok(Self::Default);
        }
        let path = Path::new(named);
        input_file("--rays", path)?;
        let extension = path.extension().and_then(|extension| extension.to_str());
        let invalid = |message: String| Error::Usage(format!("{named}: {message}"));
        match extension {
            Some("toml") => fault::parse(&read_text(path)?).map(Self::Rendered).map_err(invalid),
            Some(format @ ("csv" | "npy" | "bin")) => {
                let segments = recorded(format, &read(path)?).map_err(invalid)?;
                Ok(Self::Recorded(named.to_owned(), segments))
            }
            _ => {
                Err(invalid("--rays accepts files that end with .toml, .csv, .npy or .bin".into()))
            }
        }
    }

    /// Rejects recorded rays if no ray meets the scene. The search could not find that out: it adds
    /// rays from anywhere in the scene.
    pub fn check(&self, scene: &Scene) -> Result<(), Error> {
        let Self::Recorded(file, segments) = self else { return Ok(()) };
        let bounds = Aabb::union_of(&scene.boxes);
        let meets = |&Segment { from, to }: &Segment| {
            let from = Vec3::from(from);
            let ray = Ray::new(from, Vec3::from(to) - from, 0.0, 1.0);
            bounds.contains(&Aabb { min: from, max: from })
                || ray.is_ok_and(|ray| Slabs::new(&ray, &bounds).entry(&bounds) <= 1.0)
        };
        // A search rejects a scene without objects, with a better message.
        if scene.boxes.is_empty() || segments.iter().any(meets) {
            return Ok(());
        }
        let message = format!(
            "{file}: none of the {} segments meets the box of scene {}, {} to {}; accepted: one or \
             more segments that do",
            segments.len(),
            scene.name,
            bounds.min,
            bounds.max
        );
        Err(Error::Usage(message))
    }

    /// Returns the density in a scene of one in `step` of the rays, or `None` soon after `is_over`
    /// returns true; `tree` is any valid tree over the scene.
    pub fn density(
        &self,
        scene: &Scene,
        tree: &Bvh,
        step: u32,
        seed: u64,
        is_over: &dyn Fn() -> bool,
    ) -> Result<Option<RayDensity>, DensityError> {
        let shapes = &scene.primitives;
        let rays = match self {
            Self::Default => of_anything(TRAINED.div_ceil(step), shapes, tree, seed, is_over),
            Self::Rendered(all) => {
                let some = RenderedRays { count: all.count.div_ceil(step), ..all.clone() };
                of_renderer(&some, scene, tree, is_over)
            }
            Self::Recorded(_, segments) => {
                let some = segments.iter().step_by(step as usize).copied();
                let some: Cow<[Segment]> = if step == 1 { segments.into() } else { some.collect() };
                return ray_density(tree, Some(shapes), &some, is_over);
            }
        };
        // After an interruption there may be none, which is an error otherwise.
        if is_over() { Ok(None) } else { density(&rays, tree).map(Some) }
    }

    /// Returns a step, up to 64, with which the rays take about this time, by the time that few of
    /// them take. A good tree of `spot.obj` that is searched on for one in 64 rays loses 0.03 %,
    /// for one in 512 it loses 5 %.
    pub fn step_within(
        &self,
        scene: &Scene,
        tree: &Bvh,
        time: Duration,
        is_over: &dyn Fn() -> bool,
    ) -> u32 {
        /// More than [`RayDensity::MOST_TESTS`] take.
        const AMPLE: Duration = Duration::from_secs(8);
        const FEW: u32 = 64;
        if time >= AMPLE {
            return 1;
        }
        let began = Instant::now();
        // What comes before the first ray takes as long for few of them.
        let first = OnceCell::new();
        let is_late = || {
            first.get_or_init(Instant::now);
            is_over() || began.elapsed() >= time
        };
        match (self.density(scene, tree, FEW, 1, &is_late), first.get()) {
            (Ok(Some(_)), Some(first)) => {
                let times = f64::from(FEW) * first.elapsed().div_duration_f64(time);
                times.ceil().clamp(1.0, FEW.into()) as u32
            }
            // So few may miss the scene.
            (Err(_), _) => 1,
            _ => FEW,
        }
    }

    /// Returns the expected number of tests of a ray that enters the scene, in the wide layout of a
    /// tree. No bake trains on the same default rays.
    pub fn expected_tests(&self, tree: &Bvh, scene: &Scene) -> Result<f64, Error> {
        self.check(scene)?;
        let density = self
            .density(scene, tree, 1, Open::JUDGING, &is_interrupted)
            .map_err(|source| Error::Tracing { scene: scene.name.clone(), source })?;
        let (Some(density), Some(root)) = (density, tree.root_aabb()) else { return Ok(0.0) };
        let tests = Objective::Layout.cost_by(tree, &density);
        let entering = density.measure(&root);
        Ok(if entering > 0.0 { tests / entering } else { 0.0 })
    }
}

/// Reads segments, in the scene's coordinates, from a file in the format `csv` or `npy`; in any
/// other format the file is little-endian `f32`. Messages count lines from 1, as editors do, and
/// segments from 0, as arrays do.
fn recorded(format: &str, bytes: &[u8]) -> Result<Vec<Segment>, String> {
    let numbers = match format {
        "csv" => Table::read(bytes, |width| width == 6, "six numbers")?.numbers,
        "npy" => read_npy(bytes, &[6])?.1,
        _ => {
            let (floats, rest) = bytes.as_chunks();
            if !rest.is_empty() {
                let count = bytes.len();
                return Err(format!("there are {count} bytes; accepted: a multiple of 24"));
            }
            floats.iter().map(|&float| f32::from_le_bytes(float)).collect()
        }
    };
    let (segments, rest) = numbers.as_chunks::<6>();
    if !rest.is_empty() {
        let count = numbers.len();
        return Err(format!("there are {count} numbers; accepted: six for each segment"));
    }
    // The search would find these faults too, but only after the first tree of the scene.
    if segments.is_empty() {
        return Err("there are no segments; accepted: one or more".to_owned());
    }
    for (index, segment) in segments.iter().enumerate() {
        if !segment.iter().all(|number| number.is_finite()) {
            return Err(format!("segment {index} is {segment:?}; accepted: finite `f32`"));
        }
    }
    let segment = |&[x, y, z, to_x, to_y, to_z]: &[f32; 6]| Segment {
        from: [x, y, z],
        to: [to_x, to_y, to_z],
    };
    Ok(segments.iter().map(segment).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEGMENT: Segment = Segment { from: [1.0, 2.0, 3.0], to: [4.0, 5.0, -6.5] };

    #[test]
    fn segments_come_from_all_formats() {
        let floats = [1.0f32, 2.0, 3.0, 4.0, 5.0, -6.5].map(f32::to_le_bytes).concat();
        for (format, bytes) in [
            ("bin", floats),
            ("csv", b"x,y,z,to x,to y,to z\n1,2,3, 4,5,-6.5\n".to_vec()),
            ("csv", b"1,2,3,4,5,-6.5".to_vec()),
            ("csv", b"x;y;z;a;b;c\n1;2;3;4;5; -6.5\n".to_vec()),
            ("csv", b"# x y\n1.0e0 2 3\t4  5 -6.5 \n".to_vec()),
            ("csv", "\u{feff}1,2,3,4,5,-6.5\r\n".into()),
        ] {
            assert_eq!(recorded(format, &bytes), Ok(vec![SEGMENT]), "{format}");
        }
    }

    #[test]
    fn faults_are_named() {
        for (format, bytes, message) in [
            ("bin", &[0; 7][..], "there are 7 bytes; accepted: a multiple of 24"),
            ("bin", &[0; 28], "there are 7 numbers; accepted: six for each segment"),
            ("csv", b"1;2;3;4;5;6,5", "line 1 is \"1;2;3;4;5;6,5\"; accepted: six numbers"),
            ("csv", b"1,,3,4,5,6,7", "line 1 is \"1,,3,4,5,6,7\"; accepted: six numbers"),
            ("csv", b"1,2,3,4,5,6\n1,2,3", "line 2 is \"1,2,3\"; accepted: six numbers"),
            ("csv", b"1,2,3,4,5,6.5.0\n1,2,3,4,5,6", "line 1 is \"1,2,3,4,5,6.5.0\"; accepted"),
            ("csv", b"x,y,z,to x,to y,to z\n", "there are no segments; accepted: one or more"),
            ("bin", b"", "there are no segments; accepted: one or more"),
            (
                "csv",
                b"1,2,3,4,5,6\n1,2,3,4,nan,1e40",
                "segment 1 is [1.0, 2.0, 3.0, 4.0, NaN, inf]",
            ),
        ] {
            let found = recorded(format, bytes).unwrap_err();
            assert!(found.starts_with(message), "{found}");
        }
    }
}
