//! Converts and checks numpy arrays. Every array argument comes in through [`numbers`], whatever its
//! type, order, strides and alignment. Errors name the argument, the value found and the values
//! accepted.

use crate::elements::{INTEGERS, Kinds, Number, REAL_NUMBERS, invalid};
use crate::precision::{Precision, Real, with_precision};
use bvh_search::bvh_core::MAX_OBJECTS;
use bvh_search::{Objects, prelude::*};
use numpy::{Element, PyArray1, PyArray2, PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// One number per ray, hit or point.
pub type Column<'py, T> = Bound<'py, PyArray1<T>>;
/// One point or direction per ray or point.
pub type Rows<'py, T> = Bound<'py, PyArray2<T>>;

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

/// Returns anything that numpy accepts as an array of its own numbers.
pub fn given<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let py = argument.py();
    let numpy = py.import("numpy")?;
    // `asanyarray` keeps masked arrays, whose masks a conversion would drop silently. It would read
    // the numbers of a tensor that is no array one by one. Open3D refuses numpy's way to ask for
    // DLPack in an error that prints all numbers.
    let given = match argument {
        tensor if tensor.hasattr("__array__")? => numpy.call_method1("asanyarray", (tensor,)),
        tensor if tensor.hasattr("numpy")? => tensor.call_method0("numpy"),
        tensor if tensor.hasattr("__dlpack__")? => numpy.call_method1("from_dlpack", (tensor,)),
        other => numpy.call_method1("asanyarray", (other,)),
    };
    given.map_err(|error| explained(py, error, name, accepted))
}

/// Returns the error of a conversion, which names the argument if the argument is at fault: Ctrl-C and
/// an end of memory are not.
fn explained(py: Python<'_>, error: PyErr, name: &str, accepted: &str) -> PyErr {
    if error.is_instance_of::<PyValueError>(py) || error.is_instance_of::<PyTypeError>(py) {
        return invalid(format!("{name}: {}; accepted: {accepted}", error.value(py)));
    }
    error
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
    let given = given(name, argument, accepted)?;
    check_elements(name, &numpy, &given, T::KINDS)?;
    // In row order, aligned, and no subclass.
    let array = numpy
        .call_method1("require", (&given, T::DTYPE, "CAE"))
        .map_err(|error| explained(py, error, name, accepted))?;
    let converted: PyReadonlyArrayDyn<T> = array.extract()?;
    assert!(converted.is_c_contiguous(), "numpy converts to row order");
    if accepts(converted.shape()) {
        return Ok(Array { converted, given });
    }
    Err(invalid(format!("{name} has shape {}; accepted: {accepted}", array.getattr("shape")?)))
}

/// Reads numbers that all count.
fn coordinates<'py, N: Real>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
    accepts: impl Fn(&[usize]) -> bool,
) -> PyResult<Array<'py, N>> {
    let array = numbers::<N>(name, argument, accepted, accepts)?;
    if let Some(wrong) = array.elements()?.iter().position(|number| !number.is_accepted()) {
        let [found] = array.given(wrong)?;
        let row = wrong / (array.elements()?.len() / array.shape()[0]);
        let accepted = N::ACCEPTED;
        return Err(invalid(format!("{name} has {found:?} in row {row}; accepted: {accepted}")));
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

pub fn triangles(argument: &Bound<PyAny>, precision: Precision) -> PyResult<Objects> {
    let is_triangles = |shape: &[usize]| matches!(shape, [_, 3, 3]);
    with_precision!(precision, N => {
        let array = coordinates::<N>("triangles", argument, "(n, 3, 3)", is_triangles)?;
        let triangles = bytemuck::cast_slice(array.elements()?).to_vec();
        Ok(Objects::Shapes(N::shapes(triangles)))
    })
}

/// The names of the arguments that are a mesh.
#[derive(Clone, Copy)]
pub struct MeshNames {
    pub vertices: &'static str,
    pub faces: &'static str,
}

/// The arguments of `Tree.from_mesh` and `Tree.update`.
pub const MESH: MeshNames = MeshNames { vertices: "vertices", faces: "faces" };

pub struct Faces {
    /// The vertices of each face.
    pub corners: Vec<[u32; 3]>,
    /// The number of vertices, of which faces may use only some.
    pub vertices: usize,
}

/// Reads the vertices of a mesh, `(v, 3)`, and its faces, `(n, 3)`. Returns triangles and faces.
pub fn mesh<N: Real>(
    names: MeshNames,
    vertices: &Bound<PyAny>,
    faces: &Bound<PyAny>,
) -> PyResult<(Vec<N::Triangle>, Faces)> {
    let faces = numbers::<i64>(names.faces, faces, "(n, 3)", |shape| matches!(shape, [_, 3]))?;
    let vertices = positions::<N>(names, vertices)?;
    let (count, accepted) = (faces.shape()[0], vertices.shape()[0]);
    if count > MAX_OBJECTS {
        let found = format!("{} has {count} faces", names.faces);
        return Err(invalid(format!("{found}; accepted: at most {MAX_OBJECTS}")));
    }
    let outside = |face: usize, vertex: i64| {
        let found = format!("{}: face {face} names vertex {vertex}", names.faces);
        invalid(format!("{found}; accepted: indices below {accepted}"))
    };
    let mut indices = Vec::with_capacity(count);
    for (face, corners) in faces.elements()?.as_chunks::<3>().0.iter().enumerate() {
        let mut index = [0; 3];
        for (index, &corner) in index.iter_mut().zip(corners) {
            *index = u32::try_from(corner).map_err(|_| outside(face, corner))?;
        }
        indices.push(index);
    }
    let triangles =
        triangles_of(names, &vertices, &indices, |face, vertex| outside(face, i64::from(vertex)))?;
    Ok((triangles, Faces { corners: indices, vertices: accepted }))
}

/// Reads a mesh as the objects of a tree, and its faces.
pub fn mesh_objects(
    vertices: &Bound<PyAny>,
    faces: &Bound<PyAny>,
    precision: Precision,
) -> PyResult<(Objects, Faces)> {
    with_precision!(precision, N => {
        let (triangles, faces) = mesh::<N>(MESH, vertices, faces)?;
        Ok((Objects::Shapes(N::shapes(triangles)), faces))
    })
}

pub fn moved_mesh(
    vertices: &Bound<PyAny>,
    faces: &Faces,
    precision: Precision,
) -> PyResult<Objects> {
    with_precision!(precision, N => {
        let vertices = positions::<N>(MESH, vertices)?;
        let (found, accepted) = (vertices.shape()[0], faces.vertices);
        let other = || {
            let accepted = format!("({accepted}, 3), as the tree's mesh");
            invalid(format!("{} has shape ({found}, 3); accepted: {accepted}", MESH.vertices))
        };
        if found != accepted {
            return Err(other());
        }
        let triangles = triangles_of(MESH, &vertices, &faces.corners, |_, _| other());
        triangles.map(N::shapes).map(Objects::Shapes)
    })
}

fn positions<'py, N: Real>(
    names: MeshNames,
    vertices: &Bound<'py, PyAny>,
) -> PyResult<Array<'py, N>> {
    numbers::<N>(names.vertices, vertices, "(v, 3)", |shape| matches!(shape, [_, 3]))
}

/// Makes the triangles of a mesh. `unknown` creates the error of a face, by its number, that names
/// a vertex which does not exist. A vertex that no face uses may be anywhere.
fn triangles_of<N: Real>(
    names: MeshNames,
    vertices: &Array<N>,
    faces: &[[u32; 3]],
    unknown: impl Fn(usize, u32) -> PyErr,
) -> PyResult<Vec<N::Triangle>> {
    let (positions, _) = vertices.elements()?.as_chunks::<3>();
    let mut triangles = Vec::with_capacity(faces.len());
    for (face, &vertex_ids) in faces.iter().enumerate() {
        let mut corners = [[N::default(); 3]; 3];
        for (corner, vertex) in corners.iter_mut().zip(vertex_ids) {
            *corner = *positions.get(vertex as usize).ok_or_else(|| unknown(face, vertex))?;
            if !corner.iter().all(|x| x.is_accepted()) {
                let found = vertices.given::<3>(3 * vertex as usize)?;
                let found = format!("vertex {vertex} of face {face} is {found:?}");
                let accepted = N::ACCEPTED;
                return Err(invalid(format!("{}: {found}; accepted: {accepted}", names.vertices)));
            }
        }
        triangles.push(corners.into());
    }
    Ok(triangles)
}

/// Reads recorded rays: segments of the shape `(m, 2, 3)`.
pub fn segments(argument: Option<&Bound<PyAny>>) -> PyResult<Vec<Segment>> {
    let Some(argument) = argument else { return Ok(vec![]) };
    let array =
        coordinates::<f32>("rays", argument, "(m, 2, 3)", |shape| matches!(shape, [_, 2, 3]))?;
    let (segments, _) = array.elements()?.as_chunks::<6>();
    let segment = |&[a, b, c, d, e, f]: &[f32; 6]| Segment { from: [a, b, c], to: [d, e, f] };
    Ok(segments.iter().map(segment).collect())
}

pub fn boxes(argument: &Bound<PyAny>) -> PyResult<Objects> {
    let array = coordinates::<f32>("boxes", argument, "(n, 2, 3) or (n, 6)", |shape| {
        matches!(shape, [_, 2, 3] | [_, 6])
    })?;
    let boxes: &[Aabb] = bytemuck::cast_slice(array.elements()?);
    Ok(Objects::Boxes(boxes.to_vec()))
}
