//! Converts and checks numpy arrays. Every array argument comes in through [`numbers`], whatever its
//! type, order, strides and alignment. Errors name the argument, the value found and the values
//! accepted.

use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{InvalidRay, MeshError, Primitives};
use bvh_search::{Objects, prelude::*};
use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::fmt::Display;

/// Creates the error of an invalid argument.
pub fn invalid(message: impl Display) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// A numpy array in row order, aligned and of native byte order. Only [`numbers`] makes one.
///
/// numpy's own slices are no substitute: they also give the elements of an array in column order,
/// in that order.
pub struct Array<'py, T: Element> {
    converted: PyReadonlyArrayDyn<'py, T>,
    /// The array before its conversion.
    given: Bound<'py, PyAny>,
}

impl<'py, T: Element> Array<'py, T> {
    pub fn shape(&self) -> &[usize] {
        self.converted.shape()
    }

    /// Returns the elements in row order.
    pub fn elements(&self) -> PyResult<&[T]> {
        Ok(self.converted.as_slice()?)
    }

    pub fn into_numpy(self) -> Bound<'py, PyArrayDyn<T>> {
        (*self.converted).clone()
    }

    /// Returns numbers as the caller gave them, for messages. Numbers beyond `float32` are infinite
    /// after their conversion.
    fn given<const N: usize>(&self, first: usize) -> PyResult<[f64; N]> {
        let flat = self.given.getattr("flat")?;
        let mut numbers = [0.0; N];
        for (position, number) in (first..).zip(&mut numbers) {
            *number = flat.get_item(position)?.extract()?;
        }
        Ok(numbers)
    }
}

/// The kinds of elements that are accepted, by numpy's letters, and their name.
type Kinds = (&'static str, &'static str);

/// The range of numbers.
const FLOAT32: &str = "finite numbers of float32, up to 3.4e38";

const REAL_NUMBERS: Kinds = ("biuf", "real numbers");
const INTEGERS: Kinds = ("iu", "integers");

/// A type of elements, with its name in numpy and the kinds that are converted to it.
pub trait Number: Element {
    const DTYPE: &str;
    const KINDS: Kinds;
}

impl Number for f32 {
    const DTYPE: &str = "float32";
    const KINDS: Kinds = REAL_NUMBERS;
}

impl Number for f64 {
    const DTYPE: &str = "float64";
    const KINDS: Kinds = REAL_NUMBERS;
}

impl Number for i64 {
    const DTYPE: &str = "int64";
    const KINDS: Kinds = INTEGERS;
}

/// Converts anything that numpy accepts as an array, and checks its shape. An array that has the
/// type and is in row order already is not copied.
pub fn numbers<'py, T: Number>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
    accepts: impl Fn(&[usize]) -> bool,
) -> PyResult<Array<'py, T>> {
    let py = argument.py();
    let numpy = py.import("numpy")?;
    let no_array =
        |error: PyErr| invalid(format!("{name}: {}; accepted: {accepted}", error.value(py)));
    // `asanyarray` keeps masked arrays, whose masks the conversion below would drop silently. It
    // would read the numbers of a tensor that is no array one by one.
    let given = match argument {
        tensor if tensor.hasattr("__array__")? => numpy.call_method1("asanyarray", (tensor,)),
        tensor if tensor.hasattr("__dlpack__")? => numpy.call_method1("from_dlpack", (tensor,)),
        tensor if tensor.hasattr("numpy")? => tensor.call_method0("numpy"),
        other => numpy.call_method1("asanyarray", (other,)),
    };
    let given = given.map_err(no_array)?;
    check_elements(name, &numpy, &given, T::KINDS)?;
    // In row order, aligned, and no subclass.
    let array = numpy.call_method1("require", (&given, T::DTYPE, "CAE")).map_err(no_array)?;
    let converted: PyReadonlyArrayDyn<T> = array.extract()?;
    assert!(converted.is_c_contiguous(), "numpy converts to row order");
    if accepts(converted.shape()) {
        return Ok(Array { converted, given });
    }
    Err(invalid(format!("{name} has shape {}; accepted: {accepted}", array.getattr("shape")?)))
}

/// Reads `float32`, all of whose numbers count.
fn single_numbers<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
    accepts: impl Fn(&[usize]) -> bool,
) -> PyResult<Array<'py, f32>> {
    let array = numbers::<f32>(name, argument, accepted, accepts)?;
    if let Some(infinite) = array.elements()?.iter().position(|number| number.is_infinite()) {
        let [found] = array.given(infinite)?;
        return Err(invalid(format!("{name} has {found:?}; accepted: {FLOAT32}")));
    }
    Ok(array)
}

/// Rejects elements that would silently lose their fraction, imaginary part, unit or mask in a
/// conversion.
fn check_elements(
    name: &str,
    numpy: &Bound<PyModule>,
    array: &Bound<PyAny>,
    (kinds, accepted): Kinds,
) -> PyResult<()> {
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    // An empty list is an array of `float64` for numpy.
    let is_empty = array.getattr("size")?.extract::<usize>()? == 0;
    if !(kinds.contains(&kind) || is_empty && REAL_NUMBERS.0.contains(&kind)) {
        return Err(invalid(format!("{name} has dtype {}; accepted: {accepted}", dtype.str()?)));
    }
    // Numbers above the range of `int64` would become negative.
    if kinds == INTEGERS.0 && kind == "u" && !is_empty {
        let largest: u64 = array.call_method0("max")?.extract()?;
        if i64::try_from(largest).is_err() {
            return Err(invalid(format!("{name} has {largest}; accepted: {accepted} of 63 bits")));
        }
    }
    let masked_arrays = numpy.getattr("ma")?;
    let is_masked = masked_arrays.call_method1("is_masked", (array,))?;
    if is_masked.is_truthy()? {
        return Err(invalid(format!("{name} has masked elements; accepted: none")));
    }
    Ok(())
}

/// Reads triangles with three corners each.
pub fn triangles(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array =
        single_numbers("triangles", argument, "(n, 3, 3)", |shape| matches!(shape, [_, 3, 3]))?;
    let triangles: &[Triangle] = bytemuck::cast_slice(array.elements()?);
    Ok(shapes(triangles.to_vec()))
}

/// Makes objects that can be divided.
pub fn shapes(triangles: Vec<Triangle>) -> Objects {
    Objects::Shapes(Primitives::Triangles(triangles))
}

/// The names of the arguments that are a mesh.
#[derive(Clone, Copy)]
pub struct MeshNames {
    pub vertices: &'static str,
    pub faces: &'static str,
}

/// The arguments of `Tree.from_mesh` and `Tree.update`.
pub const MESH: MeshNames = MeshNames { vertices: "vertices", faces: "faces" };

/// Reads the vertices of a mesh, `(v, 3)`, and its faces, `(n, 3)`. Returns triangles and faces.
pub fn mesh(
    names: MeshNames,
    vertices: &Bound<PyAny>,
    faces: &Bound<PyAny>,
) -> PyResult<(Vec<Triangle>, Vec<[u32; 3]>)> {
    let faces = numbers::<i64>(names.faces, faces, "(n, 3)", |shape| matches!(shape, [_, 3]))?;
    let vertices = positions(names, vertices)?;
    let accepted = vertices.shape()[0];
    let outside = |face: usize, vertex: i64| {
        let found = format!("{}: face {face} names vertex {vertex}", names.faces);
        invalid(format!("{found}; accepted: indices below {accepted}"))
    };
    let mut indices = Vec::with_capacity(faces.shape()[0]);
    for (face, corners) in faces.elements()?.as_chunks::<3>().0.iter().enumerate() {
        let mut index = [0; 3];
        for (index, &corner) in index.iter_mut().zip(corners) {
            *index = u32::try_from(corner).map_err(|_| outside(face, corner))?;
        }
        indices.push(index);
    }
    let triangles =
        triangles_of(names, &vertices, &indices, |face, vertex| outside(face, i64::from(vertex)))?;
    Ok((triangles, indices))
}

/// Reads the vertices of a mesh with known faces.
pub fn moved_mesh(vertices: &Bound<PyAny>, faces: &[[u32; 3]]) -> PyResult<Objects> {
    let vertices = positions(MESH, vertices)?;
    let found = vertices.shape()[0];
    // The faces are known to be right, so the vertices are too few.
    let missing = |face: usize, vertex: u32| {
        let accepted = format!("a row for vertex {vertex}, which face {face} names");
        invalid(format!("{} has shape ({found}, 3); accepted: {accepted}", MESH.vertices))
    };
    triangles_of(MESH, &vertices, faces, missing).map(shapes)
}

fn positions<'py>(names: MeshNames, vertices: &Bound<'py, PyAny>) -> PyResult<Array<'py, f32>> {
    numbers::<f32>(names.vertices, vertices, "(v, 3)", |shape| matches!(shape, [_, 3]))
}

/// Makes the triangles of a mesh. `unknown` creates the error of a face, by its number, that names
/// a vertex which does not exist.
fn triangles_of(
    names: MeshNames,
    vertices: &Array<f32>,
    faces: &[[u32; 3]],
    unknown: impl Fn(usize, u32) -> PyErr,
) -> PyResult<Vec<Triangle>> {
    let (corners, _) = vertices.elements()?.as_chunks::<3>();
    Triangle::from_mesh(corners, faces).map_err(|error| match error {
        MeshError::Index { triangle, index, .. } => unknown(triangle, index),
        MeshError::NotFinite { triangle, index, .. } => {
            match vertices.given::<3>(3 * index as usize) {
                Ok(found) => {
                    let found = format!("vertex {index} of face {triangle} is {found:?}");
                    invalid(format!("{}: {found}; accepted: {FLOAT32}", names.vertices))
                }
                Err(error) => error,
            }
        }
        MeshError::TooMany(_) => invalid(format!("{}: {error}", names.faces)),
    })
}

/// Reads recorded rays: segments of the shape `(m, 2, 3)`.
pub fn segments(argument: Option<&Bound<PyAny>>) -> PyResult<Vec<Segment>> {
    let Some(argument) = argument else { return Ok(vec![]) };
    let array = single_numbers("rays", argument, "(m, 2, 3)", |shape| matches!(shape, [_, 2, 3]))?;
    let (segments, _) = array.elements()?.as_chunks::<6>();
    let segment = |&[a, b, c, d, e, f]: &[f32; 6]| Segment { from: [a, b, c], to: [d, e, f] };
    Ok(segments.iter().map(segment).collect())
}

/// Reads points, `(m, 3)`, relative to the place of the tree.
pub fn points(argument: &Bound<PyAny>, place: Option<&Place>) -> PyResult<Vec<Vec3>> {
    let points = Vectors::read("points", argument, "(m, 3)", |shape| matches!(shape, [_, 3]))?;
    let slice = points.slice()?;
    Ok((0..points.len())
        .map(|index| match place {
            Some(place) => (slice.exact(index) - place.center).as_vec3(),
            None => slice.at(index),
        })
        .collect())
}

/// Reads a point.
pub fn point(name: &str, argument: &Bound<PyAny>) -> PyResult<DVec3> {
    let array = numbers::<f64>(name, argument, "(3,)", |shape| shape == [3])?;
    let point = DVec3::from_slice(array.elements()?);
    if !point.is_finite() {
        return Err(invalid(format!("{name} is {point}; accepted: finite coordinates")));
    }
    Ok(point)
}

/// Reads boxes with a lower and an upper corner each.
pub fn boxes(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array = single_numbers("boxes", argument, "(n, 2, 3) or (n, 6)", |shape| {
        matches!(shape, [_, 2, 3] | [_, 6])
    })?;
    let boxes: &[Aabb] = bytemuck::cast_slice(array.elements()?);
    Ok(Objects::Boxes(boxes.to_vec()))
}

/// Points or directions in either precision: `float64` is rounded vector by vector, without a copy
/// of the array.
pub enum Vectors<'py> {
    Single(Array<'py, f32>),
    Double(Array<'py, f64>),
}

impl<'py> Vectors<'py> {
    pub fn read(
        name: &str,
        argument: &Bound<'py, PyAny>,
        accepted: &str,
        accepts: impl Fn(&[usize]) -> bool,
    ) -> PyResult<Self> {
        // In either byte order.
        let is_single = argument.cast::<PyUntypedArray>().is_ok_and(|array| {
            let dtype = array.dtype();
            dtype.kind() == b'f' && dtype.itemsize() <= size_of::<f32>()
        });
        if is_single {
            numbers::<f32>(name, argument, accepted, accepts).map(Self::Single)
        } else {
            numbers::<f64>(name, argument, accepted, accepts).map(Self::Double)
        }
    }

    pub fn into_numpy(self) -> Bound<'py, PyAny> {
        match self {
            Self::Single(array) => array.into_numpy().into_any(),
            Self::Double(array) => array.into_numpy().into_any(),
        }
    }

    fn len(&self) -> usize {
        let shape = match self {
            Self::Single(array) => array.shape(),
            Self::Double(array) => array.shape(),
        };
        shape.iter().product::<usize>() / 3
    }

    fn slice(&self) -> PyResult<VectorSlice<'_>> {
        Ok(match self {
            Self::Single(array) => VectorSlice::Single(array.elements()?.as_chunks().0),
            Self::Double(array) => VectorSlice::Double(array.elements()?.as_chunks().0),
        })
    }
}

/// A vector for each index, or one for all.
#[derive(Clone, Copy)]
enum VectorSlice<'a> {
    Single(&'a [[f32; 3]]),
    Double(&'a [[f64; 3]]),
}

impl VectorSlice<'_> {
    #[inline(always)]
    fn at(self, index: usize) -> Vec3 {
        match self {
            Self::Single(vectors) => Vec3::from(*at(vectors, index)),
            Self::Double(vectors) => Vec3::from(at(vectors, index).map(|x| x as f32)),
        }
    }

    fn exact(self, index: usize) -> DVec3 {
        match self {
            Self::Single(vectors) => Vec3::from(*at(vectors, index)).as_dvec3(),
            Self::Double(vectors) => DVec3::from(*at(vectors, index)),
        }
    }
}

/// Returns an element; the first one is for all later ones that are missing.
#[inline(always)]
fn at<T>(elements: &[T], index: usize) -> &T {
    elements.get(index).unwrap_or(&elements[0])
}

/// The place of a tree in a world whose coordinates `float32` is too coarse for.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The point of the world that is the tree's zero.
    pub center: DVec3,
    /// The middle of the tree's box, relative to the centre, and its distance from the corners.
    sphere: (DVec3, f64),
}

impl Place {
    pub fn new(center: DVec3, bounds: Option<Aabb>) -> Self {
        let bounds = bounds.unwrap_or(Aabb { min: Vec3::ZERO, max: Vec3::ZERO });
        let [min, max] = [bounds.min.as_dvec3(), bounds.max.as_dvec3()];
        Self { center, sphere: ((min + max) / 2.0, (max - min).length() / 2.0) }
    }

    /// Advances a ray that begins far away to the sphere around the tree's box. Returns the origin
    /// relative to the centre, and its distance in multiples of the direction's length. It is exact
    /// enough for a ray that misses the sphere: that ray advances to its point next to the sphere.
    ///
    /// A ray that is not so far away stays where it is if `f32` has its origin: distances and limits
    /// are then exact.
    fn advanced(&self, origin: DVec3, direction: DVec3) -> (Vec3, f64) {
        /// The largest distance of rays that may stay, in radii. The rounding of a direction moves a
        /// ray further the longer it is.
        const NEAR: f64 = 16.0;
        let (middle, radius) = self.sphere;
        let origin = origin - self.center;
        let square = direction.length_squared();
        let nearest = (middle - origin).dot(direction) / square;
        let distance = nearest - radius / square.sqrt();
        let is_near = distance * square.sqrt() <= NEAR * radius;
        let may_stay = is_near && origin.as_vec3().as_dvec3() == origin;
        if distance > 0.0 && distance.is_finite() && !may_stay {
            ((origin + distance * direction).as_vec3(), distance)
        } else {
            (origin.as_vec3(), 0.0)
        }
    }
}

/// Returns the largest range of `f32` within a range: no distance outside is let in.
fn inward([t_min, t_max]: [f64; 2]) -> [f32; 2] {
    let up = |t: f64| if f64::from(t as f32) < t { (t as f32).next_up() } else { t as f32 };
    [up(t_min), -up(-t_max)]
}

/// The arrays of rays. Each has one element for all rays or one per ray.
pub struct RayArrays<'py> {
    rays: usize,
    origins: Vectors<'py>,
    directions: Vectors<'py>,
    limits: [Vec<f64>; 2],
    /// Whether an invalid ray hits nothing, instead of being an error.
    misses: bool,
}

impl<'py> RayArrays<'py> {
    /// Reads the arguments of a call. `invalid` is `error` or `miss`.
    pub fn read(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        invalid: &str,
    ) -> PyResult<Self> {
        let misses = match invalid {
            "error" => false,
            "miss" => true,
            _ => {
                let message = format!("invalid is {invalid:?}; accepted: error, miss");
                return Err(self::invalid(message));
            }
        };
        let are_vectors = |shape: &[usize]| matches!(shape, [_, 3] | [3]);
        let origins = Vectors::read("origins", origins, "(m, 3) or (3,)", are_vectors)?;
        let accepted = match origins.len() {
            1 => "(m, 3) or (3,)".to_owned(),
            rays => format!("({rays}, 3), as origins, or (3,)"),
        };
        let directions = Vectors::read("directions", directions, &accepted, |shape| {
            are_vectors(shape) && (origins.len() == 1 || matches!(shape, [3] | [1, 3]))
                || shape == [origins.len(), 3]
        })?;
        let rays = if origins.len() == 1 { directions.len() } else { origins.len() };
        let accepted = format!("a number or ({rays},), as origins");
        let mut limits = [vec![0.0], vec![f64::INFINITY]];
        for ((name, argument), limit) in
            [("t_min", t_min), ("t_max", t_max)].into_iter().zip(&mut limits)
        {
            if let Some(argument) = argument {
                // An array without axes is one number for all rays.
                *limit = numbers::<f64>(name, argument, &accepted, |shape| {
                    shape.is_empty() || shape == [rays]
                })?
                .elements()?
                .to_vec();
            }
        }
        Ok(Self { rays, origins, directions, limits, misses })
    }

    /// Returns the rays for threads without Python.
    pub fn source(&self, place: Option<Place>) -> PyResult<RaySource<'_>> {
        Ok(RaySource {
            origins: self.origins.slice()?,
            directions: self.directions.slice()?,
            limits: self.limits.each_ref().map(Vec::as_slice),
            rays: self.rays,
            misses: self.misses,
            place,
        })
    }
}

/// Rays in arrays.
#[derive(Clone, Copy)]
pub struct RaySource<'a> {
    origins: VectorSlice<'a>,
    directions: VectorSlice<'a>,
    limits: [&'a [f64]; 2],
    pub rays: usize,
    misses: bool,
    place: Option<Place>,
}

/// Consecutive rays.
#[derive(Default)]
pub struct Batch {
    pub rays: Vec<Ray>,
    /// The distances by which the rays have been advanced; none if no ray has.
    advances: Vec<f64>,
}

impl Batch {
    /// Returns the distance of a hit from the origin that the caller gave.
    pub fn distance(&self, ray: usize, t: f32) -> f32 {
        match self.advances.get(ray) {
            Some(advance) => (advance + f64::from(t)) as f32,
            None => t,
        }
    }
}

impl RaySource<'_> {
    /// Returns the batch of this number, of batches of so many rays, or the fault of an invalid ray.
    pub fn batch(&self, number: usize, size: usize) -> Result<Batch, String> {
        let mut batch = Batch::default();
        for index in (number * size..self.rays).take(size) {
            let direction = self.directions.at(index);
            let (origin, advance) = match self.place {
                Some(place) => {
                    place.advanced(self.origins.exact(index), self.directions.exact(index))
                }
                None => (self.origins.at(index), 0.0),
            };
            let limits = self.limits.map(|limits| *at(limits, index));
            let [t_min, t_max] = limits.map(|t| t as f32);
            let inner = inward(limits.map(|t| t - advance));
            let ray = match Ray::new(origin, direction, t_min, t_max) {
                // An empty range hits nothing.
                Err(_) if self.misses => Ray::assume_valid(Vec3::ZERO, Vec3::X, 1.0, 0.0),
                // The limits next to the caller's, and not their neighbours.
                Err(error) => return Err(self.fault(index, &error)),
                Ok(ray) if inner == [t_min, t_max] => ray,
                Ok(_) => Ray::assume_valid(origin, direction, inner[0], inner[1]),
            };
            batch.rays.push(ray);
            if self.place.is_some() {
                batch.advances.push(advance);
            }
        }
        Ok(batch)
    }

    /// Says what is wrong with a ray, in the caller's numbers.
    fn fault(&self, index: usize, error: &InvalidRay) -> String {
        let [origin, direction] =
            [self.origins, self.directions].map(|v| v.exact(index).to_array());
        match error {
            InvalidRay::Origin(_) => {
                format!("ray {index}: the ray's origin is {origin:?}; accepted: {FLOAT32}")
            }
            InvalidRay::Direction(_) => format!(
                "ray {index}: the ray's direction is {direction:?}; accepted: finite, its largest \
                 component between 2^-100 and 2^100"
            ),
            InvalidRay::Range { .. } => format!("ray {index}: {error}"),
        }
    }
}
