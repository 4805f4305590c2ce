//! Traces custom primitives together with spheres. Builders need the box of an object, rays need a
//! test.
//!
//! `cargo run -p bvh-build --example custom_primitives`

use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Primitive, Ray, Sphere, boxes, clip_to_box, nearest_hit};
use std::error::Error;

/// A horizontal disc. The library has no such primitive.
struct Disc {
    center: [f32; 3],
    radius: f32,
}

enum Object {
    Disc(Disc),
    Sphere(Sphere),
}

impl Primitive for Object {
    type Prepared = Ray;

    fn aabb(&self) -> Aabb {
        match self {
            Self::Sphere(sphere) => sphere.aabb(),
            Self::Disc(Disc { center: [x, y, z], radius: r }) => {
                Aabb::from([[x - r, *y, z - r], [x + r, *y, z + r]])
            }
        }
    }

    fn prepare(ray: &Ray) -> Ray {
        *ray
    }

    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        match self {
            Self::Sphere(sphere) => sphere.intersect(ray, t_max),
            Self::Disc(disc) => {
                let origin = ray.origin();
                let direction = ray.direction();
                let [x, y, z] = disc.center;
                let t = (y - origin.y) / direction.y;
                let dx = origin.x + t * direction.x - x;
                let dz = origin.z + t * direction.z - z;
                let inside = dx * dx + dz * dz <= disc.radius * disc.radius;
                // Keeps the distance inside the interval of the box. Otherwise the answer would
                // depend on the tree.
                if inside { clip_to_box(ray, &self.aabb(), t, t_max) } else { None }
            }
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut objects = Vec::new();
    for i in 0..1000u16 {
        let center = [i % 10, i / 10 % 10, i / 100].map(|cell| f32::from(cell) * 3.0);
        objects.push(match i % 3 {
            0 => Object::Sphere(Sphere::new(center, 1.0)),
            _ => Object::Disc(Disc { center, radius: 1.25 }),
        });
    }
    let tree = muller_fellner::Config::default().build(&boxes(&objects))?;
    let mut spheres = 0;
    let mut discs = 0;
    for i in 0..100u8 {
        let across = [f32::from(i % 10) - 4.5, -10.0, f32::from(i / 10) - 4.5];
        let ray = Ray::half_line([15.0, 40.0, 15.0], across)?;
        match nearest_hit(&tree, &objects, &ray) {
            Some(hit) if hit.object % 3 == 0 => spheres += 1,
            Some(_) => discs += 1,
            None => {}
        }
    }
    println!("of 100 rays {spheres} meet a sphere first, {discs} a disc");
    assert!(spheres > 0 && discs > 0);
    Ok(())
}
