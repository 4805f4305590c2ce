//! A loaded scene, and the names that select one.

use crate::builtin::{spheres, stand_ins, stiff};
use crate::files::did_you_mean;
use crate::fnv1a;
use crate::load::mesh::FromFile;
use crate::load::{self, MeshError};
use crate::subset::Subset;
use bvh_core::{Aabb, Corners, DTriangle, Frame, Primitives, Triangle};
use glam::DVec3;
use std::fmt;
use std::path::{Path, PathBuf};

/// The origin of a scene. Tables print it next to every scene that is not from a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SceneKind {
    /// Generated in code to replace an original that is no longer distributed.
    StandIn,
    /// Generated in code: spheres, and the stiff and extreme scenes.
    Procedural,
    /// Read from a mesh file.
    File,
}

impl fmt::Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::StandIn => "stand-in",
            Self::Procedural => "procedural",
            Self::File => "file",
        })
    }
}

/// A loaded scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The name in tables: a built-in name, or the file's name without extension.
    pub name: String,
    /// The origin.
    pub kind: SceneKind,
    /// The objects.
    pub primitives: Primitives,
    /// One box per object, in the frame if there is one.
    pub boxes: Vec<Aabb>,
    /// The frame that the boxes lie in; `None` for the file's axes.
    pub frame: Option<Frame>,
    /// One line for the user about anything in the file besides plain triangles.
    pub remark: Option<String>,
}

/// The numbers of a scene's triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// f32, to which the coordinates of a file are rounded.
    #[default]
    Single,
    /// f64, as the coordinates are in a file.
    Double,
}

/// A scene that is neither built in, nor fetched, nor a readable mesh file, or that has no
/// triangles.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("scene {name}: {message}")]
pub struct SceneError {
    /// The name that the caller gave.
    pub name: String,
    /// The fault, and the accepted names or contents.
    pub message: String,
}

impl SceneError {
    /// Returns the rejection of a name. A message that begins with the name says it once.
    pub fn new(name: &str, message: impl ToString) -> Self {
        let message = message.to_string();
        let fault = message.strip_prefix(name).and_then(|rest| rest.strip_prefix(": "));
        Self { name: name.into(), message: fault.unwrap_or(&message).into() }
    }
}

/// Meshes that `scripts/fetch-scenes` puts into `scenes/`: the name, and the Rust package that
/// contains the mesh.
pub const FETCHED: [(&str, &str); 3] = [("sponza", "bvh"), ("kitchen", "obvhs"), ("spot", "meshx")];

/// The second document's sphere scenes: the name and the number of spheres.
pub const SPHERES: [(&str, usize); 3] =
    [("spheres75", 75), ("spheres750", 750), ("spheres7500", 7500)];

/// The largest number of objects of a generated scene.
const MOST_GENERATED: usize = 100_000_000;

impl Scene {
    /// Loads a scene by name.
    ///
    /// `name` is a stand-in, one of [`SPHERES`], one of [`FETCHED`] or the path of a mesh file,
    /// each optionally followed by a [`Subset`]; or it is a stiff scene with its number of objects,
    /// such as `S34:20000`.
    ///
    /// # Errors
    ///
    /// [`SceneError`] reports the fault of the name or of the file, and the accepted names.
    pub fn load(name: &str) -> Result<Self, SceneError> {
        Self::load_as(name, Precision::Single)
    }

    /// Loads a scene by name, as [`load`](Self::load) does, with triangles of this precision.
    ///
    /// # Errors
    ///
    /// Those of [`load`](Self::load), and for f64 also spheres, and triangles that
    /// [`DTriangle::check`] rejects.
    pub fn load_as(name: &str, precision: Precision) -> Result<Self, SceneError> {
        let mut scene = Self::load_named(name, precision)?;
        if precision == Precision::Single {
            return Ok(scene);
        }
        if let Ok(generated) = scene.triangles() {
            let triangles = generated.iter().map(|triangle| DTriangle(triangle.corners()));
            let triangles = Primitives::Doubles(triangles.collect());
            scene = Self::new(&scene.name, scene.kind, triangles);
        }
        DTriangle::check(scene.doubles()?).map_err(|error| SceneError::new(&scene.name, error))?;
        Ok(scene)
    }

    fn load_named(name: &str, precision: Precision) -> Result<Self, SceneError> {
        match Subset::parse(name) {
            // A generated scene has any number of objects, so its count is not a subset.
            Some((id, Subset::Spaced(objects))) if stiff::by_id(id).is_some() => {
                Self::generated(id, name, objects)
            }
            Some((whole, subset)) => {
                Self::load_whole(whole, precision)?.subset(subset, &name[whole.len()..])
            }
            None => Self::load_whole(name, precision),
        }
    }

    fn load_whole(name: &str, precision: Precision) -> Result<Self, SceneError> {
        if let Some(scene) = stand_ins::STAND_INS.iter().find(|scene| scene.name == name) {
            let triangles = Primitives::Triangles((scene.triangles)());
            return Ok(Self::new(name, SceneKind::StandIn, triangles));
        }
        if let Some(&(_, count)) = SPHERES.iter().find(|(spheres, _)| *spheres == name) {
            let spheres = Primitives::Spheres(spheres::spheres(count));
            return Ok(Self::new(name, SceneKind::Procedural, spheres));
        }
        if name == "-" {
            let message = "no scene is read from a pipe; accepted: a name, or the path of a file";
            return Err(SceneError::new(name, message));
        }
        let path = match FETCHED.iter().find(|(fetched, _)| *fetched == name) {
            Some((_, package)) => fetched_path(name).ok_or_else(|| {
                let message = format!(
                    "not fetched yet; run scripts/fetch-scenes, which copies it from the Rust \
                     package `{package}` to scenes/{name}.obj"
                );
                SceneError::new(name, message)
            })?,
            None => PathBuf::from(name),
        };
        // A single word without an extension was meant as a scene's name, so that the error lists
        // the names. Anything else is a path, and the reader reports its fault.
        if path.extension().is_none() && path.components().count() == 1 && !path.exists() {
            let meant = did_you_mean(name, known_names().map(Into::into));
            return Err(SceneError::new(name, format!("no such scene{meant}; {}", known_scenes())));
        }
        let read = match precision {
            Precision::Single => Self::read::<Triangle>(&path),
            Precision::Double => Self::read::<DTriangle>(&path),
        };
        read.map_err(|error| SceneError::new(name, error))
    }

    fn read<T: FromFile>(path: &Path) -> Result<Self, MeshError> {
        let mesh = load::load_as::<T>(path)?;
        let stem = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy();
        // The remark names the scene, because an experiment loads many.
        let remark = mesh.remark().map(|remark| format!("scene {stem}: {remark}"));
        Ok(Self { remark, ..Self::new(&stem, SceneKind::File, T::primitives(mesh.triangles)) })
    }

    /// Generates a scene of `objects` objects, or of nearly as many where the generator cannot make
    /// exactly that number.
    fn generated(id: &str, name: &str, objects: usize) -> Result<Self, SceneError> {
        let generator = stiff::by_id(id).filter(|_| (1..=MOST_GENERATED).contains(&objects));
        let triangles = generator.map_or_else(Vec::new, |triangles| triangles(objects));
        if triangles.is_empty() {
            let message = format!("a generated scene has 1 to {MOST_GENERATED} objects");
            return Err(SceneError::new(name, message));
        }
        Ok(Self::new(name, SceneKind::Procedural, Primitives::Triangles(triangles)))
    }

    /// Creates a scene of these objects without a remark.
    pub fn new(name: &str, kind: SceneKind, primitives: Primitives) -> Self {
        let (name, boxes) = (name.into(), primitives.boxes());
        Self { name, kind, primitives, boxes, frame: None, remark: None }
    }

    /// Returns the same scene with the boxes of its triangles in a frame, if there is one.
    #[must_use]
    pub fn in_frame(self, frame: Option<Frame>) -> Self {
        match &self.primitives {
            Primitives::Spheres(_) => self,
            _ if frame.is_none() => self,
            triangles => Self { boxes: triangles.boxes_in(frame.as_ref()), frame, ..self },
        }
    }

    fn subset(self, subset: Subset, suffix: &str) -> Result<Self, SceneError> {
        let name = self.name + suffix;
        let all = self.boxes.len();
        if subset.count() == 0 || subset.count() > all {
            let message = format!("a subset has 1 to {all} of this scene's objects");
            return Err(SceneError { name, message });
        }
        let primitives = self.primitives.select(&subset.choose(&self.boxes));
        Ok(Self { remark: self.remark, ..Self::new(&name, self.kind, primitives) })
    }

    /// Returns the triangles in f64, or an error if the objects are others.
    pub fn doubles(&self) -> Result<&[DTriangle], SceneError> {
        match &self.primitives {
            Primitives::Doubles(triangles) => Ok(triangles),
            _ => Err(SceneError::new(&self.name, "spheres; accepted: a scene of triangles")),
        }
    }

    /// Returns the triangles in f32, or an error if the objects are others.
    pub fn triangles(&self) -> Result<&[Triangle], SceneError> {
        match &self.primitives {
            Primitives::Triangles(triangles) => Ok(triangles),
            Primitives::Doubles(_) => {
                Err(SceneError::new(&self.name, "triangles in f64; accepted: triangles in f32"))
            }
            Primitives::Spheres(_) => {
                Err(SceneError::new(&self.name, "spheres; accepted: a scene of triangles"))
            }
        }
    }

    /// Returns whether the objects are triangles, in f32 or f64.
    pub fn has_triangles(&self) -> bool {
        !matches!(self.primitives, Primitives::Spheres(_))
    }

    /// Returns the direction that is up: z in the stand-ins, and y otherwise, which most modellers
    /// use.
    pub fn up(&self) -> DVec3 {
        match self.kind {
            SceneKind::StandIn => DVec3::Z,
            SceneKind::Procedural | SceneKind::File => DVec3::Y,
        }
    }

    /// Returns a hash of all boxes, which identifies the scene in results.
    pub fn checksum(&self) -> u64 {
        let coordinates =
            self.boxes.iter().flat_map(|b| b.min.to_array().into_iter().chain(b.max.to_array()));
        fnv1a(coordinates.flat_map(f32::to_le_bytes))
    }
}

/// Returns the path of a fetched scene: in `scenes/` of the current folder, or otherwise of the
/// repository.
pub fn fetched_path(name: &str) -> Option<PathBuf> {
    let file = format!("{name}.obj");
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    [PathBuf::new(), repository]
        .iter()
        .map(|top| top.join("scenes").join(&file))
        .find(|path| path.is_file())
}

fn known_names() -> impl Iterator<Item = &'static str> {
    let names = stand_ins::STAND_INS.iter().map(|scene| scene.name);
    names.chain(SPHERES.map(|(name, _)| name)).chain(FETCHED.map(|(name, _)| name))
}

fn known_scenes() -> String {
    format!(
        "accepted: {}, the path of an OBJ, PLY, STL or glTF file, either of them with `:COUNT`, \
         `:random:COUNT:SEED` or `:cluster:COUNT:SEED` for a subset, or a case of the suite with a \
         number of objects such as S34:20000",
        known_names().collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subset_has_as_many_distinct_objects_as_asked_for() {
        let scene = Scene::load("spheres75:30").unwrap();
        assert_eq!((scene.name.as_str(), scene.boxes.len()), ("spheres75:30", 30));
        assert!((1..30).all(|i| scene.boxes[i] != scene.boxes[i - 1]));
        for wrong in ["spheres75:0", "spheres75:76"] {
            assert!(Scene::load(wrong).unwrap_err().to_string().contains("1 to 75"), "{wrong}");
        }
    }

    #[test]
    fn a_stiff_scene_has_up_to_a_hundred_million_objects() {
        assert_eq!(Scene::load("S34:50").unwrap().boxes.len(), 50);
        for wrong in ["S34:0", "S34:100000001", "S34:18446744073709551615"] {
            let message = Scene::load(wrong).unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains("1 to 100000000"), "{message}");
        }
    }
}
