//! The JSON of a glTF or GLB file, and the binary chunk next to it.
//!
//! The types contain what places triangles and nothing else. This module does not use `gltf-json`
//! 1.4, because that crate takes references modulo 2³², and speaks of its own types where a file is
//! wrong. The readers in `gltf` panic on forged files.

use super::super::mesh::Fault;
use super::super::without_mark;
use serde::de::{Error as _, IgnoredAny};
use serde::{Deserialize, Deserializer};
use serde_json::{Number, Value};
use std::collections::BTreeMap;

/// The extensions that a file may require, because the loader reads quantised positions and
/// compressed views, and no other of these changes a triangle: lights, materials, textures, metadata, and what else a program
/// may do with a node. A later extension with a similar name may displace vertices.
const COVERED: &str = "EXT_lights_ies EXT_lights_image_based EXT_mesh_features EXT_mesh_manifold \
    EXT_meshopt_compression EXT_structural_metadata EXT_texture_astc EXT_texture_avif EXT_texture_webp FB_ngon_encoding \
    KHR_animation_pointer KHR_lights_punctual KHR_materials_anisotropy KHR_materials_clearcoat \
    KHR_materials_diffuse_transmission KHR_materials_dispersion KHR_materials_emissive_strength \
    KHR_materials_ior KHR_materials_iridescence KHR_materials_pbrSpecularGlossiness \
    KHR_materials_sheen KHR_materials_specular KHR_materials_transmission KHR_materials_unlit \
    KHR_materials_variants KHR_materials_volume KHR_mesh_quantization KHR_node_hoverability \
    KHR_node_selectability KHR_techniques_webgl KHR_texture_basisu KHR_texture_transform KHR_xmp \
    KHR_xmp_json_ld MSFT_packing_normalRoughnessMetallic \
    MSFT_packing_occlusionRoughnessMetallic MSFT_texture_dds";

/// Reads a member that programs write as null where it should be absent.
fn or_none<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Default + Deserialize<'de>,
{
    Option::deserialize(deserializer).map(Option::unwrap_or_default)
}

/// Reads a whole number, which some programs write as 3.0.
fn whole<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: TryFrom<u64> + Default,
{
    let Some(number) = Option::<Number>::deserialize(deserializer)? else {
        return Ok(T::default());
    };
    let float = number.as_f64().filter(|x| x.fract() == 0.0 && (0.0..1e15).contains(x));
    let integer = number.as_u64().or(float.map(|x| x as u64));
    let integer = integer.and_then(|integer| T::try_from(integer).ok());
    integer.ok_or_else(|| D::Error::custom(format!("{number}; expected a whole number from 0")))
}

/// The JSON of a file. References to elements are their ranks in these lists.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Document {
    asset: Asset,
    pub scene: Option<usize>,
    #[serde(deserialize_with = "or_none")]
    pub scenes: Vec<Scene>,
    #[serde(deserialize_with = "or_none")]
    pub nodes: Vec<Node>,
    #[serde(deserialize_with = "or_none")]
    pub meshes: Vec<Mesh>,
    #[serde(deserialize_with = "or_none")]
    pub accessors: Vec<Accessor>,
    #[serde(deserialize_with = "or_none")]
    pub buffer_views: Vec<View>,
    #[serde(deserialize_with = "or_none")]
    pub buffers: Vec<Buffer>,
    #[serde(deserialize_with = "or_none")]
    pub animations: Vec<IgnoredAny>,
    #[serde(deserialize_with = "or_none")]
    pub extensions_used: Vec<String>,
    #[serde(deserialize_with = "or_none")]
    extensions_required: Vec<String>,
}

/// The part of a file that all versions share.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Versioned {
    asset: Asset,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Asset {
    version: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Scene {
    #[serde(deserialize_with = "or_none")]
    pub nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Node {
    #[serde(deserialize_with = "or_none")]
    pub children: Vec<usize>,
    pub mesh: Option<usize>,
    pub skin: Option<IgnoredAny>,
    #[serde(deserialize_with = "or_none")]
    pub weights: Vec<f64>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

impl Node {
    /// Returns the quaternion of the node. Some programs write zeros where nothing turns.
    pub fn rotation(&self) -> Option<[f64; 4]> {
        self.rotation.filter(|rotation| *rotation != [0.0; 4])
    }
}

#[derive(Debug, Deserialize)]
pub struct Mesh {
    pub primitives: Vec<Primitive>,
    #[serde(default, deserialize_with = "or_none")]
    pub weights: Vec<f64>,
}

#[derive(Debug, Deserialize)]
pub struct Primitive {
    pub attributes: BTreeMap<String, usize>,
    #[serde(default, deserialize_with = "or_none")]
    pub targets: Vec<BTreeMap<String, usize>>,
    pub indices: Option<usize>,
    /// Points, three kinds of lines, triangles (the default), strips and fans of triangles.
    pub mode: Option<u32>,
    #[serde(default, deserialize_with = "or_none")]
    pub extensions: BTreeMap<String, IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default, deserialize_with = "whole")]
    pub byte_offset: usize,
    #[serde(deserialize_with = "whole")]
    pub component_type: u32,
    #[serde(default, deserialize_with = "or_none")]
    pub normalized: bool,
    #[serde(deserialize_with = "whole")]
    pub count: usize,
    #[serde(rename = "type")]
    pub type_: String,
    pub sparse: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct View {
    pub buffer: usize,
    #[serde(default, deserialize_with = "whole")]
    pub byte_offset: usize,
    #[serde(deserialize_with = "whole")]
    pub byte_length: usize,
    /// The number of bytes from item to item; 0 if they lie side by side.
    #[serde(default, deserialize_with = "whole")]
    pub byte_stride: usize,
    #[serde(default, deserialize_with = "or_none")]
    pub extensions: ViewExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    pub meshopt: Option<Compressed>,
}

/// A view by what it is decoded from.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Compressed {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: usize,
    pub byte_length: usize,
    pub byte_stride: usize,
    pub count: usize,
    pub mode: String,
    pub filter: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Buffer {
    pub byte_length: usize,
    pub uri: Option<String>,
}

/// The text of a file's JSON; the binary chunk of a GLB file, and all chunks after it.
type Chunks<'a> = (&'a [u8], Option<&'a [u8]>, &'a [u8]);

/// Divides the bytes of a file.
pub fn text(bytes: &[u8]) -> Result<Chunks<'_>, Fault> {
    let (json, chunk, further) = match bytes.starts_with(b"glTF") {
        true if bytes.get(4..8) == Some(&[1, 0, 0, 0]) => return Err(of_version("1")),
        true => chunks(bytes)?,
        false => (bytes, None, &[][..]),
    };
    let json = without_mark(json);
    // Some programs pad the chunk with zeros instead of blanks.
    let zeros = json.iter().rev().take_while(|&&byte| byte == 0).count();
    Ok((&json[..json.len() - zeros], chunk, further))
}

/// Reads a file's JSON, and returns the bytes of the binary chunk of a GLB file with it.
pub fn document(bytes: &[u8]) -> Result<(Document, Option<&[u8]>), Fault> {
    let (json, chunk, _) = text(bytes)?;
    let document = serde_json::from_slice(json);
    // Another version has other types of the same names.
    let version = match &document {
        Ok(Document { asset, .. }) => Some(asset.version.clone()),
        Err(_) => serde_json::from_slice(json).ok().map(|Versioned { asset }| asset.version),
    };
    if let Some(version) = version {
        let version = version.as_str().map_or_else(|| version.to_string(), Into::into);
        if !version.starts_with("2.") {
            return Err(of_version(&version));
        }
    }
    let document: Document =
        document.map_err(|error| Fault::of_file(format!("{error} of the JSON")))?;
    if let Some(unknown) = document.extensions_required.iter().find(|name| !is_covered(name)) {
        let decompress = if unknown.contains("compression") { DECOMPRESS } else { "" };
        let message = format!("`{unknown}`; expected none that changes triangles{decompress}");
        return Err(Fault::of("extensionsRequired", message));
    }
    Ok((document, chunk))
}

fn of_version(version: &str) -> Fault {
    let convert = match version.starts_with('1') {
        true => ", which `npx gltf-pipeline -i OLD -o NEW` writes",
        false => "",
    };
    Fault::of("asset", format!("version `{version}`; expected 2.0{convert}"))
}

/// What to do about compressed meshes that are not read.
pub const DECOMPRESS: &str = "; `npx @gltf-transform/cli copy OLD NEW` decompresses";

/// Returns whether no triangle is lost or moved for want of reading an extension.
pub fn is_covered(extension: &str) -> bool {
    COVERED.split(' ').any(|covered| covered == extension)
}

fn chunks(bytes: &[u8]) -> Result<Chunks<'_>, Fault> {
    let number = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let fault = || Fault::of_file("no chunk of JSON in version 2; expected a GLB file, and whole");
    let length = number(8).filter(|_| number(4) == Some(2)).ok_or_else(fault)? as usize;
    if bytes.len() < length {
        let found = bytes.len();
        return Err(Fault::of_file(format!("cut: {found} of {length} bytes; expected all")));
    }
    // The file's header has 12 bytes, and each chunk's header has 8.
    let json = chunk(bytes, 12, b"JSON").ok_or_else(fault)?;
    let binary = chunk(bytes, 20 + json.len(), b"BIN\0");
    let end = 20 + json.len() + binary.map_or(0, |binary| 8 + binary.len());
    Ok((json, binary, bytes[..length].get(end..).unwrap_or_default()))
}

/// Returns the contents of the chunk whose header begins at `offset`, if it has this kind.
fn chunk<'a>(bytes: &'a [u8], offset: usize, kind: &[u8; 4]) -> Option<&'a [u8]> {
    let (header, contents) = bytes.get(offset..)?.split_first_chunk::<8>()?;
    let length = u32::from_le_bytes(*header.first_chunk()?) as usize;
    if header[4..] != *kind {
        return None;
    }
    contents.get(..length)
}
