//! S54: no particle is lost. Particles fly through nested solids with shared faces, from each hit
//! point without the faces there, as transport codes send them. Solids stand as they were drawn,
//! turned, and turned at map coordinates.
//!
//! A hit point is rounded, and may lie across the face that was hit or beyond the next one. Hence:
//!
//! 1. A face is passed once: those at the particle's place are excluded.
//! 2. The particle is in its volume if the first face ahead that bounds the volume leaves it. This is
//!    exact, and fails only where rounding carried the particle across a face: a *slip*.
//! 3. After a slip, the first face of all ahead tells the volume, by the side from which the particle
//!    comes. The particle passes that face next, so that every flight gets on. Where faces of both
//!    sides are first, the ray meets an edge, and the volume of the way there decides.
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

/// The volume around everything, where flights end.
const OUTSIDE: usize = 0;
/// How many flights are examined: one in so many.
const EXAMINED: usize = 16;
/// Half lines that may meet an edge, too. A point on an edge stays undecided.
const TRIES: usize = 4;

/// Faces, each between the volume behind its normal and the one before it.
#[derive(Clone, Default)]
struct Solids {
    faces: Vec<[DVec3; 3]>,
    sides: Vec<[usize; 2]>,
}

impl Solids {
    /// Adds a polygon, counterclockwise seen from the volume `sides[1]`, as a fan without degenerate
    /// triangles.
    fn add(&mut self, corners: &[DVec3], sides: [usize; 2]) {
        for pair in corners[1..].windows(2) {
            let face = [corners[0], pair[0], pair[1]];
            if !DTriangle(face).is_degenerate() {
                self.faces.push(face);
                self.sides.push(sides);
            }
        }
    }

    /// Adds a surface of `steps[0]` by `steps[1]` quads, closed in both directions.
    fn add_closed(&mut self, steps: [usize; 2], sides: [usize; 2], at: impl Fn(f64, f64) -> DVec3) {
        let at = |i: usize, j: usize| {
            at((i % steps[0]) as f64 / steps[0] as f64, (j % steps[1]) as f64 / steps[1] as f64)
        };
        for i in 0..steps[0] {
            for j in 0..steps[1] {
                self.add(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], sides);
            }
        }
    }

    /// Adds boxes between planes along each axis. Neighbours share their faces.
    fn add_boxes(&mut self, planes: [&[f64]; 3], first: usize, around: usize) {
        let counts = planes.map(|planes| planes.len() - 1);
        let volume = |cell: [usize; 3]| {
            let is_within = (0..3).all(|axis| (1..=counts[axis]).contains(&cell[axis]));
            let [x, y, z] = cell.map(|number| number.wrapping_sub(1));
            if is_within { first + x + counts[0] * (y + counts[1] * z) } else { around }
        };
        for axis in 0..3 {
            let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
            for plane in 0..=counts[axis] {
                for (u, v) in
                    (1..=counts[next]).flat_map(|u| (1..=counts[last]).map(move |v| (u, v)))
                {
                    let mut cell = [0; 3];
                    (cell[axis], cell[next], cell[last]) = (plane, u, v);
                    let behind = volume(cell);
                    cell[axis] += 1;
                    let sides = [behind, volume(cell)];
                    let corner = |u: usize, v: usize| {
                        let mut corner = DVec3::ZERO;
                        corner[axis] = planes[axis][plane];
                        (corner[next], corner[last]) = (planes[next][u], planes[last][v]);
                        corner
                    };
                    self.add(
                        &[corner(u - 1, v - 1), corner(u, v - 1), corner(u, v), corner(u - 1, v)],
                        sides,
                    );
                }
            }
        }
    }

    fn turned(&self, turn: DQuat, offset: DVec3) -> Self {
        let place = |corner: DVec3| turn * corner + offset;
        let faces = self.faces.iter().map(|face| face.map(place)).collect();
        Self { faces, ..self.clone() }
    }

    fn volumes(&self) -> usize {
        self.sides.iter().flatten().max().map_or(0, |&most| most + 1)
    }
}

/// Returns the drawn scenes, within 2 of the origin along each axis, in a box of their own.
fn scenes() -> [(&'static str, Solids); 5] {
    let mut scenes =
        ["spheres", "boxes", "tori", "gears", "slivers"].map(|name| (name, Solids::default()));
    let [(_, spheres), (_, boxes), (_, tori), (_, gears), (_, slivers)] = &mut scenes;
    // The innermost of five has a shell of a millionth of its size around it.
    for (number, radius) in [1.8, 1.2, 1.1, 0.300_000_3, 0.3].into_iter().enumerate() {
        let at = |turn: usize, up: usize| {
            let (sin, cos) = (TAU / 24.0 * (turn % 24) as f64).sin_cos();
            let (height, width) = (TAU / 24.0 * up as f64).sin_cos();
            // Both poles are one point each.
            let height = if up.is_multiple_of(12) { 0.0 } else { height };
            radius * DVec3::new(height * cos, height * sin, -width)
        };
        for (turn, up) in (0..24).flat_map(|turn| (0..12).map(move |up| (turn, up))) {
            let corners = [at(turn, up), at(turn + 1, up), at(turn + 1, up + 1), at(turn, up + 1)];
            spheres.add(&corners, [number + 2, number + 1]);
        }
    }
    boxes.add_boxes(
        [&[-1.5, -0.7, 0.1, 0.11, 1.6], &[-1.0, -0.3, 1.2], &[-1.7, 0.0, 0.5, 1.3]],
        2,
        1,
    );
    for (number, tube) in [0.6, 0.35, 0.349, 0.1].into_iter().enumerate() {
        tori.add_closed([40, 16], [number + 2, number + 1], |turn, around| {
            let (sin, cos) = (TAU * turn).sin_cos();
            let (height, width) = (TAU * around).sin_cos();
            DVec3::new((1.1 + tube * width) * cos, (1.1 + tube * width) * sin, tube * height)
        });
    }
    for (number, size) in [1.7, 1.0, 0.999].into_iter().enumerate() {
        let sides = [number + 2, number + 1];
        let rim = |step: usize, z: f64| {
            let (sin, cos) = (TAU / 96.0 * (step % 96) as f64).sin_cos();
            let radius = if step % 4 < 2 { 1.0 } else { 0.8 };
            size * DVec3::new(radius * cos, radius * sin, z)
        };
        for step in 0..96 {
            let [low, high] = [-0.4, 0.4].map(|z| [rim(step, z), rim(step + 1, z)]);
            gears.add(&[low[0], low[1], high[1], high[0]], sides);
            gears.add(&[DVec3::Z * -0.4 * size, low[1], low[0]], sides);
            gears.add(&[DVec3::Z * 0.4 * size, high[0], high[1]], sides);
        }
    }
    let thin = [-1.9, -1.2, -1.2 + 1e-6, -1.2 + 3e-6, 0.3, 0.3 + 1e-4, 1.9];
    slivers.add_boxes([&thin, &[-1.8, 0.5, 0.5 + 1e-6, 1.7], &[-1.9, 1.9]], 2, 1);
    for (_, solids) in &mut scenes {
        solids.add_boxes([&[-2.5, 2.5]; 3], 1, OUTSIDE);
    }
    scenes
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
    solids: Solids,
    /// The size of its coordinates.
    size: f64,
    volumes: Vec<Volume>,
    all: Volume,
}

/// What happened to particles.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    steps: usize,
    passages: usize,
    slips: usize,
    lost: usize,
    misplaced: usize,
}

impl Count {
    fn plus(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            passages: self.passages + other.passages,
            slips: self.slips + other.slips,
            lost: self.lost + other.lost,
            misplaced: self.misplaced + other.misplaced,
        }
    }
}

struct Particle {
    place: DVec3,
    direction: DVec3,
    volume: usize,
    /// The faces at its place.
    passed: Vec<u32>,
}

impl World {
    fn new(solids: Solids) -> Self {
        let mut faces = vec![vec![]; solids.volumes()];
        for (number, sides) in (0..).zip(&solids.sides) {
            sides.iter().for_each(|&volume| faces[volume].push(number));
        }
        let volumes = faces.into_iter().enumerate().map(|(volume, faces)| {
            let triangle = |&number: &u32| {
                let [a, b, c] = solids.faces[number as usize];
                let is_behind = solids.sides[number as usize][0] == volume;
                DTriangle(if is_behind { [a, b, c] } else { [a, c, b] })
            };
            Volume::new(&faces.iter().map(triangle).collect::<Vec<_>>(), faces)
        });
        let volumes = volumes.collect();
        let triangles: Vec<DTriangle> = solids.faces.iter().map(|&face| DTriangle(face)).collect();
        let all = Volume::new(&triangles, (0..triangles.len() as u32).collect());
        let size = solids.faces.iter().flatten().map(|corner| corner.abs().max_element());
        Self { size: size.fold(0.0, f64::max), volumes, all, solids }
    }

    /// Returns the volume ahead and the face by which the ray leaves it: the first face of all, on the
    /// side of the ray. Where several are first, the ray meets an edge, and another half line, from
    /// the way there, tells the volume.
    fn locate(&self, ray: &DRay, passed: &[u32], tries: usize) -> Option<(usize, DHit)> {
        let sides = [Orientation::Exiting, Orientation::Entering].into_iter().enumerate();
        let mut ahead: Vec<(usize, DHit)> = sides
            .filter_map(|(number, side)| {
                let hit = self.all.nearest(ray, side, passed)?;
                Some((self.solids.sides[hit.object as usize][number], hit))
            })
            .collect();
        ahead.sort_by(|a, b| a.1.t.total_cmp(&b.1.t));
        let &first = ahead.first()?;
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

    /// Returns the face by which the particle leaves its volume, after a slip that of another volume.
    fn leave(&self, ray: &DRay, particle: &mut Particle, count: &mut Count) -> Option<DHit> {
        let Particle { volume, passed, .. } = particle;
        let own = &self.volumes[*volume];
        if let Some(exit) = own.nearest(ray, Orientation::Exiting, passed) {
            let entry = own.nearest(ray, Orientation::Entering, passed);
            if entry.is_none_or(|entry| entry.t > exit.t) {
                return Some(exit);
            }
        }
        let (actual, hit) = self.locate(ray, passed, TRIES)?;
        count.slips += usize::from(*volume != actual);
        *volume = actual;
        Some(hit)
    }

    /// Returns whether a point is in a volume, or as near to a face as rounding moves it.
    fn contains(&self, volume: usize, point: DVec3, direction: DVec3) -> bool {
        let ray = DRay::half_line(point, direction).unwrap();
        if self.locate(&ray, &[], TRIES).is_some_and(|(actual, _)| actual == volume) {
            return true;
        }
        self.is_at_face(point)
    }

    /// Returns whether a point is as near to a face as rounding moves it, along an axis.
    fn is_at_face(&self, point: DVec3) -> bool {
        let near = 8.0 * f64::EPSILON * self.size;
        DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).any(|axis| {
            let ray = DRay::new(point, axis, 0.0, near).unwrap();
            self.all.wide.any_hit(&ray, Select::default())
        })
    }

    /// Returns a direction at random, to a corner, or to the middle of an edge.
    fn direction(&self, from: DVec3, random: &mut Stream) -> DVec3 {
        let [a, b, _] = self.solids.faces[random.random_range(0..self.solids.faces.len())];
        let to = match random.random_range(0..6) {
            0 => a,
            1 => (a + b) * 0.5,
            _ => from + DVec3::from_array(random.random()) - 0.5,
        };
        // A particle may be at the corner.
        if to == from { DVec3::X } else { to - from }
    }

    fn fly(&self, steps: usize, seed: u64) -> Count {
        let mut random = Stream::seed_from_u64(seed);
        let mut count = Count::default();
        while count.steps < steps {
            let face = self.solids.faces[random.random_range(0..self.solids.faces.len())];
            let middle = self.solids.faces[0][0].lerp(face[1], random.random());
            let place = middle.lerp(face[2], random.random());
            let direction = self.direction(place, &mut random);
            let ray = DRay::half_line(place, direction).unwrap();
            let Some((volume, _)) = self.locate(&ray, &[], TRIES) else { continue };
            let mut particle = Particle { place, direction, volume, passed: vec![] };
            while particle.volume != OUTSIDE && count.steps < steps {
                count.steps += 1;
                if !self.step(&mut particle, &mut count, &mut random) {
                    // Rounding may carry a particle out of the outermost surface, too.
                    count.lost += usize::from(!self.is_at_face(particle.place));
                    break;
                }
            }
        }
        count
    }

    /// Moves a particle to the next face, or one time in four to a place before it, where it turns.
    /// Returns false if there is no face.
    fn step(&self, particle: &mut Particle, count: &mut Count, random: &mut Stream) -> bool {
        let ray = DRay::half_line(particle.place, particle.direction).unwrap();
        let Some(hit) = self.leave(&ray, particle, count) else { return false };
        let Particle { place, direction, volume, passed } = particle;
        if count.steps.is_multiple_of(EXAMINED) {
            let aside = DVec3::from_array(random.random()) - 0.5;
            let middle = *place + *direction * (0.5 * hit.t);
            count.misplaced += usize::from(!self.contains(*volume, middle, aside));
        }
        if random.random_range(0..4) == 0 {
            *place += *direction * (hit.t * random.random::<f64>());
            *direction = self.direction(*place, random);
            passed.clear();
            return true;
        }
        let next = *place + *direction * hit.t;
        if next != *place {
            passed.clear();
        }
        passed.push(hit.object);
        let [behind, before] = self.solids.sides[hit.object as usize];
        *volume = if *volume == behind { before } else { behind };
        *place = next;
        count.passages += 1;
        true
    }
}

/// `STEPS` sets how many steps there are in all scenes together.
#[test]
fn no_particle_is_lost_in_solids_with_shared_faces() {
    let steps = std::env::var("STEPS").map_or(40_000, |steps| steps.parse().expect("a number"));
    let turn = DQuat::from_xyzw(0.1, 0.7, -0.3, 0.5).normalize();
    let map = DVec3::new(512_345.678, 5_412_345.678, 123.4);
    let mut worlds = vec![];
    for (name, solids) in scenes() {
        worlds.push((format!("{name} as drawn"), World::new(solids.clone())));
        worlds.push((format!("{name} turned"), World::new(solids.turned(turn, DVec3::ZERO))));
        worlds.push((format!("{name} on a map"), World::new(solids.turned(turn, map))));
    }
    // Walls that rounding cannot tell apart: a hit point may be beyond several.
    let mut walls = vec![-1.0];
    (0..6).for_each(|_| walls.push(walls.last().map_or(0.5, |&x: &f64| x.max(0.5).next_up())));
    walls.push(1.0);
    let mut solids = Solids::default();
    solids.add_boxes([&walls, &[-1.0, 0.3, 1.0], &[-1.0, 1.0]], 2, 1);
    solids.add_boxes([&[-2.5, 2.5]; 3], 1, OUTSIDE);
    worlds.push(("walls of one unit in the last place".into(), World::new(solids)));

    /// Enough for all processors, and the same for any number of them.
    const PARTS: usize = 64;
    let each = usize::div_ceil(steps, PARTS * worlds.len());
    let mut slips = 0;
    for (name, world) in &worlds {
        let parts = (0..PARTS as u64).into_par_iter().map(|part| world.fly(each, part));
        let count = parts.reduce(Count::default, Count::plus);
        println!("S54, {name}: {count:?}");
        assert_eq!((count.lost, count.misplaced), (0, 0), "{name}: {count:?}");
        assert!(count.passages > count.steps / 2, "{name}: {count:?}");
        slips += count.slips;
    }
    assert!(slips > 0, "rounding carries some particles across a face");
}
