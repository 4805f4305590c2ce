//! S54: no particle is lost. Particles fly through nested solids with shared faces, from each hit
//! point without the faces there, as transport codes send them. `examples/transport` walks through
//! further solids in the same way.
//!
//! A hit point is rounded, and may lie across the face that was hit or beyond the next one. Hence:
//!
//! 1. A face is passed once: those at the particle's place are excluded.
//! 2. The particle is in its volume if the first face ahead that bounds the volume leaves it. This is
//!    exact, and fails only where rounding carried the particle across a face, a *slip*, or where the
//!    ray touches an edge.
//! 3. After a slip, the first face of all ahead tells the volume, by the side from which the particle
//!    comes. Where faces of both sides are first, the ray meets an edge, and another half line from
//!    the way there tells it.
//!
//! In real arithmetic a half line from the inside of a closed surface crosses it, and hits are those
//! of real arithmetic. So the third rule fails for no particle within the outermost surface.

use bvh_build::{Builder, muller_fellner};
use bvh_core::{Bvh, DHit, DRay, DTriangle, DWideBvh, Orientation, Select};
use bvh_search::Stream;
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// How many flights are examined: one in so many.
const EXAMINED: usize = 16;
/// Half lines that may meet an edge, too. A point on an edge stays undecided.
const TRIES: usize = 4;

/// Makes the faces of spheres around each other, of `turns` by `turns / 2` quads, the outermost first.
/// Sphere i lies between the volume i + 1 in it and i around it, 0 is outside.
fn nested(radii: &[f64], turns: usize, place: impl Fn(DVec3) -> DVec3) -> Vec<[DVec3; 3]> {
    let at = |radius: f64, turn: usize, up: usize| {
        let (sin, cos) = (TAU / turns as f64 * (turn % turns) as f64).sin_cos();
        let (height, width) = (TAU / turns as f64 * up as f64).sin_cos();
        // Both poles are one point each.
        let height = if up.is_multiple_of(turns / 2) { 0.0 } else { height };
        place(radius * DVec3::new(height * cos, height * sin, -width))
    };
    let mut faces = vec![];
    for &radius in radii {
        for (turn, up) in (0..turns).flat_map(|turn| (0..turns / 2).map(move |up| (turn, up))) {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)]
                .map(|(right, over)| at(radius, turn + right, up + over));
            faces.extend(
                [[a, b, c], [a, c, d]].into_iter().filter(|f| !DTriangle(*f).is_degenerate()),
            );
        }
    }
    faces
}

/// The faces around a volume, whose normals point out of it.
struct Volume {
    wide: DWideBvh,
    /// The number of each face in the scene.
    faces: Vec<u32>,
}

impl Volume {
    fn new(triangles: &[DTriangle], faces: Vec<u32>) -> Self {
        let frame = DWideBvh::centred(triangles);
        let tree =
            muller_fellner::Config::default().build(&DWideBvh::boxes(triangles, &frame)).unwrap();
        let wide = DWideBvh::new(&Bvh { frame: Some(frame), ..tree }, triangles).unwrap();
        Self { wide, faces }
    }

    /// Returns the nearest face ahead on this side, by its number in the scene, without those passed.
    fn nearest(&self, ray: &DRay, orientation: Orientation, passed: &[u32]) -> Option<DHit> {
        let own = passed.iter().filter_map(|face| self.faces.binary_search(face).ok());
        let exclude: Vec<u32> = own.map(|own| own as u32).collect();
        let hit = self.wide.nearest_hit(ray, Select { orientation, exclude: &exclude })?;
        Some(DHit { object: self.faces[hit.object as usize], ..hit })
    }
}

struct World {
    faces: Vec<[DVec3; 3]>,
    /// Faces per sphere.
    per_sphere: usize,
    volumes: Vec<Volume>,
    all: Volume,
}

/// Steps, slips, lost particles, and those in another volume than they are said to be in.
type Count = [usize; 4];

impl World {
    fn new(faces: Vec<[DVec3; 3]>, spheres: usize) -> Self {
        let per_sphere = faces.len() / spheres;
        let numbers = |volume: usize| {
            let from = volume.saturating_sub(1) * per_sphere;
            (from..((volume + 1) * per_sphere).min(faces.len())).map(|number| number as u32)
        };
        let of_volume = |volume: usize| {
            let outwards = |number: u32| {
                let [a, b, c] = faces[number as usize];
                let is_inner = number as usize / per_sphere == volume;
                DTriangle(if is_inner { [a, c, b] } else { [a, b, c] })
            };
            let triangles: Vec<DTriangle> = numbers(volume).map(outwards).collect();
            Volume::new(&triangles, numbers(volume).collect())
        };
        let volumes = (0..=spheres).map(of_volume).collect();
        let triangles: Vec<DTriangle> = faces.iter().map(|&face| DTriangle(face)).collect();
        let all = Volume::new(&triangles, (0..faces.len() as u32).collect());
        Self { per_sphere, volumes, all, faces }
    }

    /// Returns the volume ahead and the face by which the ray leaves it.
    fn locate(&self, ray: &DRay, passed: &[u32], tries: usize) -> Option<(usize, DHit)> {
        let sides = [(Orientation::Exiting, 1), (Orientation::Entering, 0)];
        let hits = sides.into_iter().filter_map(|(side, inside)| {
            let hit = self.all.nearest(ray, side, passed)?;
            Some((hit.object as usize / self.per_sphere + inside, hit))
        });
        let first = hits.min_by(|a, b| a.1.t.total_cmp(&b.1.t))?;
        let others = [passed, &[first.1.object]].concat();
        let second = self.all.nearest(ray, Orientation::Any, &others);
        if tries == 0 || second.is_none_or(|second| second.t > first.1.t) {
            return Some(first);
        }
        let [x, y, z] = ray.direction().to_array();
        let middle = ray.origin() + ray.direction() * (0.5 * first.1.t);
        let aside = DRay::half_line(middle, [0.6 * y - z, z + 0.7 * x, x - 0.3 * y]).ok()?;
        let (volume, _) = self.locate(&aside, &[], tries - 1)?;
        let exit = self.volumes[volume].nearest(ray, Orientation::Exiting, passed);
        exit.filter(|exit| exit.t == first.1.t).map(|exit| (volume, exit)).or(Some(first))
    }

    /// Returns the volume of the particle, another one after a slip, and the face by which it leaves.
    fn leave(&self, ray: &DRay, volume: usize, passed: &[u32]) -> Option<(usize, DHit)> {
        let nearest = |side| self.volumes[volume].nearest(ray, side, passed);
        let exit = nearest(Orientation::Exiting)
            .filter(|exit| nearest(Orientation::Entering).is_none_or(|entry| entry.t > exit.t));
        exit.map(|exit| (volume, exit)).or_else(|| self.locate(ray, passed, TRIES))
    }

    /// Returns whether a point is as near to a face as rounding moves it, along an axis.
    fn is_at_face(&self, point: DVec3) -> bool {
        let near = 8.0 * f64::EPSILON * self.faces[0][0].abs().max_element();
        DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).any(|axis| {
            let ray = DRay::new(point, axis, 0.0, near).unwrap();
            self.all.wide.any_hit(&ray, Select::default())
        })
    }

    /// Returns a direction at random, to a corner, or to the middle of an edge.
    fn direction(&self, from: DVec3, random: &mut Stream) -> DVec3 {
        let [a, b, _] = self.faces[random.random_range(0..self.faces.len())];
        let to = match random.random_range(0..6) {
            0 => a,
            1 => (a + b) * 0.5,
            _ => from + DVec3::from_array(random.random()) - 0.5,
        };
        // A particle may be at the corner, or so near to it that there is no ray from one to the other.
        let towards = to - from;
        if towards.abs().max_element() < 1e-30 { DVec3::X } else { towards }
    }

    /// Flies particles from places in the outermost sphere until they are outside or lost.
    fn fly(&self, steps: usize, seed: u64) -> Count {
        let mut random = Stream::seed_from_u64(seed);
        let [mut taken, mut slips, mut lost, mut misplaced] = [0; 4];
        while taken < steps {
            let [_, b, c] = self.faces[random.random_range(0..self.faces.len())];
            let mut place = self.faces[0][0].lerp(b, random.random()).lerp(c, random.random());
            let mut direction = self.direction(place, &mut random);
            let mut passed = vec![];
            let ray = DRay::half_line(place, direction).unwrap();
            let Some((mut volume, _)) = self.locate(&ray, &[], TRIES) else { continue };
            while volume != 0 && taken < steps {
                taken += 1;
                let ray = DRay::half_line(place, direction).unwrap();
                let Some((actual, hit)) = self.leave(&ray, volume, &passed) else {
                    // Rounding may carry a particle out of the outermost surface, too.
                    lost += usize::from(!self.is_at_face(place));
                    break;
                };
                slips += usize::from(actual != volume);
                if taken.is_multiple_of(EXAMINED) {
                    let middle = place + direction * (0.5 * hit.t);
                    let aside = DVec3::from_array(random.random()) - 0.5;
                    let aside = DRay::half_line(middle, aside).unwrap();
                    let found = self.locate(&aside, &[], TRIES).map(|(volume, _)| volume);
                    misplaced += usize::from(found != Some(actual) && !self.is_at_face(middle));
                }
                // One time in four it turns before the face.
                let turns = random.random_range(0..4) == 0;
                let part = if turns { random.random() } else { 1.0 };
                let next = place + direction * (hit.t * part);
                if turns || next != place {
                    passed.clear();
                }
                place = next;
                volume = actual;
                if turns {
                    direction = self.direction(place, &mut random);
                } else {
                    passed.push(hit.object);
                    let sphere = hit.object as usize / self.per_sphere;
                    volume = if volume == sphere { sphere + 1 } else { sphere };
                }
            }
        }
        [taken, slips, lost, misplaced]
    }
}

/// `STEPS` sets how many steps there are in all worlds together.
#[test]
fn no_particle_is_lost_in_solids_with_shared_faces() {
    let steps = std::env::var("STEPS").map_or(40_000, |steps| steps.parse().expect("a number"));
    let turn = DQuat::from_xyzw(0.1, 0.7, -0.3, 0.5).normalize();
    let map = DVec3::new(512_345.678, 5_412_345.678, 123.4);
    // The innermost has a shell of a millionth of its size around it.
    let shells = [2.5, 1.8, 1.2, 1.1, 0.300_000_3, 0.3];
    // Surfaces that rounding cannot tell apart: a hit point may be beyond several.
    let mut thin: Vec<f64> = vec![2.5, 0.5];
    (0..6).for_each(|_| thin.insert(1, thin[1].next_up()));
    let worlds = [
        ("as drawn", World::new(nested(&shells, 24, |corner| corner), shells.len())),
        ("turned", World::new(nested(&shells, 24, |corner| turn * corner), shells.len())),
        ("on a map", World::new(nested(&shells, 24, |corner| turn * corner + map), shells.len())),
        ("an ulp apart", World::new(nested(&thin, 4, |corner| corner), thin.len())),
    ];
    /// Enough for all processors, and the same for any number of them.
    const PARTS: usize = 64;
    let each = usize::div_ceil(steps, PARTS * worlds.len());
    let mut all_slips = 0;
    for (name, world) in &worlds {
        let parts = (0..PARTS as u64).into_par_iter().map(|part| world.fly(each, part));
        let add = |a: Count, b: Count| std::array::from_fn(|at| a[at] + b[at]);
        let [taken, slips, lost, misplaced] = parts.reduce(|| [0; 4], add);
        println!("S54, {name}: {taken} steps, {slips} slips");
        assert_eq!((lost, misplaced), (0, 0), "{name}");
        assert!(taken >= steps / worlds.len(), "{name}: {taken} steps");
        all_slips += slips;
    }
    assert!(all_slips > 0, "rounding carries some particles across a face");
}
