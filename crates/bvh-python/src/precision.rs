//! What differs between trees over triangles in `float32` and in `float64`.

use crate::elements::Number;
use crate::scalars::named;
use bvh_search::OwnedTree;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{
    Corners, DHit, DRay, DTriangle, DWideBvh, InvalidBvh, InvalidRay, OutOfExactRange, Primitives,
    Select, Traced,
};
use bvh_search::prelude::*;
use bytemuck::Pod;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// The range of numbers in `float32`.
pub const FLOAT32: &str = "finite numbers of float32, up to 3.4e38";

/// The numbers of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    Single,
    Double,
}

impl Precision {
    pub fn read(precision: &str) -> PyResult<Self> {
        named("precision", precision, [("single", Self::Single), ("double", Self::Double)])
    }

    pub fn of_tree(tree: &OwnedTree) -> Self {
        if tree.doubles().is_some() { Self::Double } else { Self::Single }
    }

    /// Returns the numbers that an array has, in either byte order, or is converted to.
    pub fn of(argument: &Bound<PyAny>) -> Self {
        let is_single = argument.cast::<PyUntypedArray>().is_ok_and(|array| {
            let dtype = array.dtype();
            dtype.kind() == b'f' && dtype.itemsize() <= size_of::<f32>()
        });
        if is_single { Self::Single } else { Self::Double }
    }
}

/// Calls a function that is generic over the numbers of a tree.
macro_rules! with_precision {
    ($precision:expr, $number:ident => $call:expr) => {
        match $precision {
            Precision::Single => {
                type $number = f32;
                $call
            }
            Precision::Double => {
                type $number = f64;
                $call
            }
        }
    };
}
pub(crate) use with_precision;

/// What counts, and whether the rays are similar.
type How<'a> = (Select<'a>, Coherence);

/// A layout, and its triangles by their indices.
type Scene<'a, N> = (&'a <N as Real>::Layout, &'a [<N as Real>::Triangle]);

/// A point of a layout.
pub type Point<N> = <<N as Real>::Layout as Traced>::Point;

/// A number of coordinates, and how triangles with such corners are traced.
pub trait Real: Number + Pod + Default {
    type Triangle: Corners + From<[[Self; 3]; 3]> + Pod + Sync;
    type Layout: Traced<Point: Send + Sync> + Sync;
    type Ray: Send + Sync;
    type Hit: Clone + Send + Sync;
    /// The coordinates that triangles may have.
    const ACCEPTED: &str;
    /// The directions that rays may have.
    const DIRECTIONS: &str;

    fn is_accepted(self) -> bool;

    fn shapes(triangles: Vec<Self::Triangle>) -> Primitives;

    /// Returns the triangles of a tree, if they have such numbers.
    fn triangles(tree: &OwnedTree) -> Option<&[Self::Triangle]>;

    fn layout(tree: &OwnedTree) -> Option<Result<Self::Layout, InvalidBvh>>;

    fn point(point: DVec3) -> Point<Self>;

    /// Makes a ray over a range of distances, or says what is wrong with it.
    fn ray(origin: DVec3, direction: DVec3, limits: [f64; 2]) -> Result<Self::Ray, String>;

    /// Returns the range of distances that a ray has over these limits.
    fn range(limits: [f64; 2]) -> [f64; 2];

    /// Returns the origin and the direction.
    fn ends(ray: &Self::Ray) -> [DVec3; 2];

    fn nearest(scene: Scene<Self>, rays: &[Self::Ray], how: How) -> Vec<Self::Hit>;

    fn any(scene: Scene<Self>, rays: &[Self::Ray], how: How, hits: &mut [bool]);

    /// Appends all hits, ray after ray, and writes how many each ray has.
    fn all(
        layout: &Self::Layout,
        rays: &[Self::Ray],
        hits: &mut Vec<Self::Hit>,
        counts: &mut [u32],
    );

    /// Returns the distance, and the triangle or −1.
    fn parts(hit: &Self::Hit) -> (Self, i32);

    /// Returns the weights of the corners at a hit, and the normal.
    fn surface(triangle: &Self::Triangle, ray: &Self::Ray) -> ([f64; 3], [Self; 3]);
}

fn wrong(part: &str, found: DVec3, accepted: &str) -> String {
    format!("the ray's {part} is {:?}; accepted: {accepted}", found.to_array())
}

/// Returns the largest range of `f32` within a range: no distance outside is let in.
fn inward([t_min, t_max]: [f64; 2]) -> [f32; 2] {
    let up = |t: f64| if f64::from(t as f32) < t { (t as f32).next_up() } else { t as f32 };
    [up(t_min), -up(-t_max)]
}

/// Returns what counts for each of some rays, which exclude the same number of triangles.
fn each(select: Select, rays: usize) -> impl Iterator<Item = Select> {
    let excluded = select.exclude.len().checked_div(rays).unwrap_or(0);
    (0..rays)
        .map(move |ray| Select { exclude: &select.exclude[ray * excluded..][..excluded], ..select })
}

impl Real for f32 {
    type Triangle = Triangle;
    type Layout = WideBvh;
    type Ray = Ray;
    type Hit = Hit;
    const ACCEPTED: &str = FLOAT32;
    const DIRECTIONS: &str = "finite, its largest component between 2^-100 and 2^100";

    fn is_accepted(self) -> bool {
        self.is_finite()
    }

    fn shapes(triangles: Vec<Triangle>) -> Primitives {
        Primitives::Triangles(triangles)
    }

    fn triangles(tree: &OwnedTree) -> Option<&[Triangle]> {
        tree.triangles()
    }

    fn layout(tree: &OwnedTree) -> Option<Result<WideBvh, InvalidBvh>> {
        tree.layout()
    }

    fn point(point: DVec3) -> Vec3 {
        point.as_vec3()
    }

    #[inline(always)]
    fn ray(origin: DVec3, direction: DVec3, limits: [f64; 2]) -> Result<Ray, String> {
        let singles = (origin.as_vec3(), direction.as_vec3());
        let [t_min, t_max] = limits.map(|t| t as f32);
        match Ray::new(singles.0, singles.1, t_min, t_max) {
            Ok(ray) => {
                let inner = inward(limits);
                let is_same = inner == [t_min, t_max];
                let within = || Ray::assume_valid(singles.0, singles.1, inner[0], inner[1]);
                Ok(if is_same { ray } else { within() })
            }
            Err(InvalidRay::Origin(_)) => Err(wrong("origin", origin, Self::ACCEPTED)),
            Err(InvalidRay::Direction(_)) => Err(wrong("direction", direction, Self::DIRECTIONS)),
            Err(error @ InvalidRay::Range { .. }) => Err(error.to_string()),
        }
    }

    fn range(limits: [f64; 2]) -> [f64; 2] {
        inward(limits).map(f64::from)
    }

    fn ends(ray: &Ray) -> [DVec3; 2] {
        [ray.origin(), ray.direction()].map(Vec3::as_dvec3)
    }

    fn nearest((layout, all): Scene<f32>, rays: &[Ray], (select, coherence): How) -> Vec<Hit> {
        let mut hits = vec![Hit::MISS; rays.len()];
        if select.counts_all() {
            layout.nearest_hits(rays, &mut hits, coherence);
        } else {
            for ((hit, ray), select) in hits.iter_mut().zip(rays).zip(each(select, rays.len())) {
                *hit = layout.nearest_hit_where(ray, select.filter(ray, all)).unwrap_or(Hit::MISS);
            }
        }
        hits
    }

    fn any((layout, all): Scene<f32>, rays: &[Ray], how: How, hits: &mut [bool]) {
        let (select, coherence) = how;
        if select.counts_all() {
            return layout.any_hits(rays, hits, coherence);
        }
        for ((hit, ray), select) in hits.iter_mut().zip(rays).zip(each(select, rays.len())) {
            *hit = layout.any_hit_where(ray, select.filter(ray, all));
        }
    }

    fn all(layout: &WideBvh, rays: &[Ray], hits: &mut Vec<Hit>, counts: &mut [u32]) {
        layout.all_hits_of(rays, hits, counts);
    }

    fn parts(hit: &Hit) -> (f32, i32) {
        // The cast turns the id of a miss, `u32::MAX`, into −1.
        (hit.t, hit.object as i32)
    }

    fn surface(triangle: &Triangle, ray: &Ray) -> ([f64; 3], [f32; 3]) {
        let normal = triangle.normal().unwrap_or_default();
        (triangle.barycentrics(ray).unwrap_or_default(), normal.to_array())
    }
}

impl Real for f64 {
    type Triangle = DTriangle;
    type Layout = DWideBvh;
    type Ray = DRay;
    type Hit = DHit;
    const ACCEPTED: &str = "0 or 2^-150 to 2^120 in size";
    const DIRECTIONS: &str = "0 or 2^-150 to 2^120 in size, the largest from 2^-100 to 2^100";

    fn is_accepted(self) -> bool {
        self == 0.0 || (DRay::LEAST..=DRay::MOST).contains(&self.abs())
    }

    fn shapes(triangles: Vec<DTriangle>) -> Primitives {
        Primitives::Doubles(triangles)
    }

    fn triangles(tree: &OwnedTree) -> Option<&[DTriangle]> {
        tree.doubles()
    }

    fn layout(tree: &OwnedTree) -> Option<Result<DWideBvh, InvalidBvh>> {
        Some(DWideBvh::new(tree.tree(), tree.doubles()?))
    }

    fn point(point: DVec3) -> DVec3 {
        point
    }

    #[inline(always)]
    fn ray(origin: DVec3, direction: DVec3, [t_min, t_max]: [f64; 2]) -> Result<DRay, String> {
        DRay::new(origin, direction, t_min, t_max).map_err(|error| match error {
            OutOfExactRange::Origin(_) => wrong("origin", origin, Self::ACCEPTED),
            OutOfExactRange::Direction(_) => wrong("direction", direction, Self::DIRECTIONS),
            error => error.to_string(),
        })
    }

    fn range(limits: [f64; 2]) -> [f64; 2] {
        limits
    }

    fn ends(ray: &DRay) -> [DVec3; 2] {
        [ray.origin(), ray.direction()]
    }

    fn nearest((layout, _): Scene<f64>, rays: &[DRay], (select, coherence): How) -> Vec<DHit> {
        const MISS: DHit = DHit { t: f64::INFINITY, object: u32::MAX };
        let mut hits = vec![None; rays.len()];
        layout.nearest_hits(rays, select, &mut hits, coherence);
        hits.into_iter().map(|hit| hit.unwrap_or(MISS)).collect()
    }

    fn any((layout, _): Scene<f64>, rays: &[DRay], how: How, hits: &mut [bool]) {
        let (select, coherence) = how;
        layout.any_hits(rays, select, hits, coherence);
    }

    fn all(layout: &DWideBvh, rays: &[DRay], hits: &mut Vec<DHit>, counts: &mut [u32]) {
        layout.all_hits_of(rays, hits, counts);
    }

    fn parts(hit: &DHit) -> (f64, i32) {
        (hit.t, hit.object as i32)
    }

    fn surface(triangle: &DTriangle, ray: &DRay) -> ([f64; 3], [f64; 3]) {
        let normal = triangle.normal().unwrap_or_default();
        (triangle.barycentrics(ray).unwrap_or_default(), normal.to_array())
    }
}
