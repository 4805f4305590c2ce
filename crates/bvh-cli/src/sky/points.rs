//! The points of a scene that look at the sky.

use crate::Error;
use crate::npy::read_npy;
use crate::table::Table;
use bvh_core::{Ray, Triangle, WideBvh};
use bvh_scenes::files::read;
use bvh_scenes::rays::Camera;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::Path;

/// Points on the surfaces of a scene, or anywhere.
#[derive(Debug, Default)]
pub struct Points {
    pub at: Vec<Vec3>,
    /// Unit normals of the surfaces, or zeros where a surface has no area.
    pub normals: Option<Vec<Vec3>>,
    /// The point of each corner of each triangle, if triangles have points.
    pub corners: Vec<[u32; 3]>,
    /// The pixel of each point, if they are seen in a picture.
    pub pixels: Vec<u32>,
}

/// Returns twice the area of a triangle along its normal.
fn area(Triangle(corners): &Triangle) -> DVec3 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    (b - a).cross(c - a)
}

impl Points {
    /// Returns the middle of each triangle.
    pub fn of_triangles(triangles: &[Triangle]) -> Self {
        let middle = |Triangle(corners): &Triangle| {
            let sum: DVec3 = corners.iter().map(|corner| corner.as_dvec3()).sum();
            (sum / 3.0).as_vec3()
        };
        let normal = |triangle| area(triangle).normalize_or_zero().as_vec3();
        Self {
            at: triangles.iter().map(middle).collect(),
            normals: Some(triangles.iter().map(normal).collect()),
            corners: (0..triangles.len() as u32).map(|number| [number; 3]).collect(),
            pixels: Vec::new(),
        }
    }

    /// Returns the places of corners, each once, in the order of the triangles. Their normals are
    /// the means of the triangles', weighted by areas.
    pub fn of_vertices(triangles: &[Triangle]) -> Self {
        let mut numbers = HashMap::new();
        let (mut at, mut sums) = (Vec::new(), Vec::new());
        let mut corner = |place: Vec3, area: DVec3| {
            // The two zeros are one place.
            let key = (place + Vec3::ZERO).to_array().map(f32::to_bits);
            let number = *numbers.entry(key).or_insert(at.len() as u32);
            if number as usize == at.len() {
                at.push(place);
                sums.push(DVec3::ZERO);
            }
            sums[number as usize] += area;
            number
        };
        let corners = triangles.iter().map(|t| t.0.map(|place| corner(place, area(t)))).collect();
        let normals = sums.iter().map(|sum| sum.normalize_or_zero().as_vec3()).collect();
        Self { at, normals: Some(normals), corners, pixels: Vec::new() }
    }

    /// Returns what is seen through the middles of pixels, with normals towards the eye.
    pub fn of_pixels(
        wide: &WideBvh,
        triangles: &[Triangle],
        camera: &Camera,
        (width, height): (u32, u32),
    ) -> Self {
        let seen = |x: u32, y: u32| {
            let direction = camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let ray = Ray::half_line(camera.origin.as_vec3(), direction.as_vec3()).ok()?;
            let hit = wide.nearest_hit(&ray)?;
            let triangle = &triangles[hit.object as usize];
            let [origin, direction] = [ray.origin(), ray.direction()].map(Vec3::as_dvec3);
            let mut normal = area(triangle).normalize_or_zero();
            // In f64 the point is nearer to the plane than by the distance of the hit.
            let t = normal.dot(triangle.0[0].as_dvec3() - origin) / normal.dot(direction);
            let t = if t.is_finite() { t } else { f64::from(hit.t) };
            if normal.dot(direction) > 0.0 {
                normal = -normal;
            }
            Some((y * width + x, (origin + direction * t).as_vec3(), normal.as_vec3()))
        };
        let rows: Vec<Vec<_>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).filter_map(|x| seen(x, y)).collect())
            .collect();
        let mut points = Self { normals: Some(Vec::new()), ..Self::default() };
        for (pixel, at, normal) in rows.into_iter().flatten() {
            points.pixels.push(pixel);
            points.at.push(at);
            points.normals.get_or_insert_default().push(normal);
        }
        points
    }

    /// Reads points, and their normals if there are any.
    pub fn of_file(path: &Path) -> Result<Self, Error> {
        let invalid = |message: String| Error::Usage(format!("{}: {message}", path.display()));
        let bytes = read(path)?;
        let (at, normals) = match path.extension().and_then(|extension| extension.to_str()) {
            Some("npy") => of_rows(read_npy(&bytes, &[3, 6]).map_err(invalid)?),
            Some("csv") => {
                let accepted = "x,y,z, or x,y,z,nx,ny,nz in all lines";
                let table = Table::read(&bytes, |width| [3, 6].contains(&width), accepted);
                let table = table.map_err(invalid)?;
                table.check_names(&["x", "y", "z", "nx", "ny", "nz"]).map_err(invalid)?;
                of_rows((table.width, table.numbers))
            }
            _ => {
                return Err(invalid("--points accepts files that end with .csv or .npy".into()));
            }
        };
        let both = at.iter().enumerate().chain(normals.iter().flatten().enumerate());
        if let Some((number, wrong)) = both.into_iter().find(|(_, vector)| !vector.is_finite()) {
            let message =
                format!("point {number}, counted from 0, has {wrong}; accepted: finite numbers");
            return Err(invalid(message));
        }
        if at.is_empty() {
            return Err(invalid("no points; accepted: one or more".into()));
        }
        Ok(Self { at, normals, ..Self::default() })
    }

    /// Returns the points moved along their normals by a length.
    pub fn above(&self, offset: f64) -> Vec<Vec3> {
        let Some(normals) = &self.normals else { return self.at.clone() };
        let moved = |(at, normal): (&Vec3, &Vec3)| {
            (at.as_dvec3() + normal.as_dvec3().normalize_or_zero() * offset).as_vec3()
        };
        self.at.iter().zip(normals).map(moved).collect()
    }
}

/// Splits rows of three numbers, or of six with normals.
fn of_rows((width, numbers): (usize, Vec<f32>)) -> (Vec<Vec3>, Option<Vec<Vec3>>) {
    let rows = || numbers.chunks_exact(width.max(1));
    let normals = || rows().map(|row| Vec3::from_slice(&row[3..])).collect();
    (rows().map(Vec3::from_slice).collect(), (width == 6).then(normals))
}
