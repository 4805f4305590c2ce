//! Tables, meshes and pictures of values.

use super::SkyArgs;
use super::points::Points;
use crate::Error;
use crate::answer::{short, snake};
use crate::output::{png, write_table};
use bvh_core::Triangle;
use bvh_scenes::SceneError;
use bvh_scenes::files::{self, WriteError};
use bvh_scenes::load;
use bvh_scenes::render::heat;
use glam::{DMat3, DMat4, DVec3, Vec3};
use serde_json::json;
use std::path::Path;

/// The column that colours show, and their scale.
pub struct Legend {
    pub name: String,
    column: usize,
    columns: usize,
    pub least: f64,
    pub most: f64,
    colours: Vec<[u8; 3]>,
}

impl Legend {
    /// Chooses a column by its name, or the first one.
    pub fn of(name: Option<&str>, columns: &[String]) -> Result<Self, String> {
        let column = match name {
            None => 0,
            Some(name) => columns.iter().position(|column| column == name).ok_or_else(|| {
                format!("--column: no column {name:?}; accepted: {}", columns.join(", "))
            })?,
        };
        let (name, columns) = (columns[column].clone(), columns.len());
        Ok(Self { name, column, columns, least: 0.0, most: 0.0, colours: heat::scale(256) })
    }

    /// Fits the scale to values.
    pub fn over(mut self, values: &[f64]) -> Self {
        self.least = self.of_points(values).reduce(f64::min).unwrap_or(0.0);
        self.most = self.of_points(values).reduce(f64::max).unwrap_or(0.0);
        self
    }

    /// Returns the shown value of each point.
    pub fn of_points<'a>(&self, values: &'a [f64]) -> impl Iterator<Item = f64> + use<'a> {
        let column = self.column;
        values.chunks_exact(self.columns).map(move |row| row[column])
    }

    /// The first colour is that of 0, or of negative values.
    fn first(&self) -> f64 {
        self.least.min(0.0)
    }

    /// Describes the scale, in a unit, of this kind of file.
    pub fn line(&self, kind: &str, unit: &str) -> String {
        let [first, least, most] = [self.first(), self.least, self.most].map(short);
        let bar = if kind == "png" { ", as along the lower edge," } else { "" };
        format!(
            "{least} to {most}{unit}; colours{bar} from black for {first} to pale yellow for {most}{unit}"
        )
    }

    fn colour(&self, value: f64) -> [u8; 3] {
        let place = (value - self.first()) / (self.most - self.first()).max(f64::MIN_POSITIVE);
        self.colours[(place * (self.colours.len() - 1) as f64).round() as usize]
    }
}

/// Writes the values into the file of `--out`, of this kind.
#[expect(clippy::too_many_arguments, reason = "one file has them all")]
pub fn write(
    args: &SkyArgs,
    kind: &str,
    points: &Points,
    triangles: &[Triangle],
    legend: &Legend,
    columns: &[String],
    values: &[f64],
    upright: &DMat3,
) -> Result<(), Error> {
    let out = &args.out;
    let rows = values.chunks_exact(columns.len());
    if kind == "csv" {
        let rows = points.at.iter().zip(rows).enumerate();
        let rows = rows.map(|(number, (at, row))| (number, at.to_array(), row));
        return write_table(out, &format!("point,x,y,z,{}", columns.join(",")), rows);
    }
    let colours: Vec<[u8; 3]> =
        legend.of_points(values).map(|value| legend.colour(value)).collect();
    if kind == "png" {
        return picture(out, args.camera.size, points, legend, &colours);
    }
    // Every triangle has corners of its own, because each may have a colour of its own.
    let vertices: Vec<(Vec3, usize)> = match points.corners.is_empty() {
        true => points.at.iter().copied().zip(0..).collect(),
        false => {
            let numbers = points.corners.iter().flatten().map(|&number| number as usize);
            triangles.iter().flat_map(|triangle| triangle.0).zip(numbers).collect()
        }
    };
    let bytes = if kind == "ply" {
        let value = |point: usize| values[point * columns.len()..][..columns.len()].iter();
        let properties = columns.iter().map(|name| format!("property float {}\n", snake(name)));
        let faces = points.corners.len();
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
             property float y\nproperty float z\nproperty uchar red\nproperty uchar green\n\
             property uchar blue\n{}element face {faces}\n\
             property list uchar uint vertex_indices\nend_header\n",
            vertices.len(),
            properties.collect::<String>()
        )
        .into_bytes();
        for &(at, point) in &vertices {
            bytes.extend(at.to_array().map(f32::to_le_bytes).as_flattened());
            bytes.extend(colours[point]);
            bytes.extend(value(point).flat_map(|value| (*value as f32).to_le_bytes()));
        }
        for face in 0..faces as u32 {
            bytes.push(3);
            bytes.extend([0, 1, 2].map(|corner| (3 * face + corner).to_le_bytes()).as_flattened());
        }
        bytes
    } else {
        let name = out.display().to_string();
        glb(&vertices, &colours, !points.corners.is_empty(), upright)
            .map_err(|fault| SceneError::new(&name, fault))?
    };
    Ok(files::write(out, &bytes)?)
}

/// Returns a GLB file of vertices with unlit colours, turned so that y is up.
fn glb(
    vertices: &[(Vec3, usize)],
    colours: &[[u8; 3]],
    has_triangles: bool,
    upright: &DMat3,
) -> Result<Vec<u8>, load::mesh::Fault> {
    // The colours of vertices are linear in glTF.
    let linear = |byte: u8| {
        let value = f64::from(byte) / 255.0;
        let linear = match value <= 0.04045 {
            true => value / 12.92,
            false => libm::pow((value + 0.055) / 1.055, 2.4),
        };
        (linear * 65_535.0).round() as u16
    };
    let linear: Vec<u16> = (0..=255).map(linear).collect();
    let at = || vertices.iter().map(|(at, _)| *at);
    let mut binary: Vec<u8> =
        at().flat_map(|at| at.to_array()).flat_map(f32::to_le_bytes).collect();
    let positions = binary.len();
    for &(_, point) in vertices {
        let [red, green, blue] = colours[point].map(|byte| linear[usize::from(byte)]);
        binary.extend([red, green, blue, u16::MAX].map(u16::to_le_bytes).as_flattened());
    }
    let [least, most] = [at().reduce(Vec3::min), at().reduce(Vec3::max)]
        .map(|bound| bound.unwrap_or_default().to_array());
    let turn = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y) * upright.transpose();
    let json = json!({
        "asset": { "version": "2.0", "generator": "bvh" },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "matrix": DMat4::from_mat3(turn).to_cols_array() }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "COLOR_0": 1 },
            "material": 0,
            "mode": if has_triangles { 4 } else { 0 },
        }] }],
        "materials": [{ "doubleSided": true, "extensions": { "KHR_materials_unlit": {} } }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": vertices.len(), "type": "VEC3",
                "min": least, "max": most },
            { "bufferView": 1, "componentType": 5123, "count": vertices.len(), "type": "VEC4",
                "normalized": true },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": positions },
            { "buffer": 0, "byteOffset": positions, "byteLength": binary.len() - positions },
        ],
        "buffers": [{}],
    });
    load::glb(json, binary, &[])
}

/// Writes the pixels, over a grey background, and the colours from the first to the last along the
/// lower edge.
fn picture(
    out: &Path,
    (width, height): (u32, u32),
    points: &Points,
    legend: &Legend,
    colours: &[[u8; 3]],
) -> Result<(), Error> {
    const BACKGROUND: [u8; 3] = [205; 3];
    let mut pixels = vec![BACKGROUND; width as usize * height as usize];
    for (&pixel, &colour) in points.pixels.iter().zip(colours) {
        pixels[pixel as usize] = colour;
    }
    let above = (height - height / 40) * width;
    for (number, pixel) in pixels.iter_mut().skip(above as usize).enumerate() {
        let column = number % width as usize;
        *pixel = legend.colours[column * legend.colours.len() / width as usize];
    }
    let bytes = png(width, &pixels).map_err(WriteError::of(out, "encode the picture"))?;
    Ok(files::write(out, &bytes)?)
}
