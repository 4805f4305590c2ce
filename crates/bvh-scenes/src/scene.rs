//! One loaded scene, and how its name says where it comes from.

use crate::builtin::{spheres, stand_ins, stiff};
use crate::load::OutsideFiles;
use crate::subset::Subset;
use crate::{fnv1a, load};
use bvh_core::{Aabb, Primitives, Triangle};
use glam::DVec3;
use std::fmt;
use std::path::{Path, PathBuf};

/// Where a scene comes from. Tables name it beside every scene that is not from a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SceneKind {
    /// Made in code in place of an original that is no longer distributed.
    #[cfg_attr(feature = "serde", serde(rename = "stand-in"))]
    StandIn,
    /// Made in code: spheres, and the stiff and extreme scenes.
    #[cfg_attr(feature = "serde", serde(rename = "procedural"))]
    Procedural,
    /// Read from a mesh file.
    #[cfg_attr(feature = "serde", serde(rename = "file"))]
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

/// A scene, loaded.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name in tables: a built-in name, or the file's name without extension.
    pub name: String,
    /// Where it comes from.
    pub kind: SceneKind,
    /// Its objects.
    pub primitives: Primitives,
    /// One box per object.
    pub boxes: Vec<Aabb>,
    /// One line for the user about what its file contains besides plain triangles; none if nothing.
    pub remark: Option<String>,
}

/// A scene that is neither built in, nor fetched, nor a readable mesh file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("scene {name}: {message}")]
pub struct SceneError {
    /// The scene, as it was named.
    pub name: String,
    /// The fault, and the accepted names or contents.
    pub message: String,
}

/// Triangles are needed, and the scene of this name has none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} has spheres; accepted: scenes of triangles")]
pub struct NoTriangles(pub String);

/// Meshes that `scripts/fetch-scenes` puts under `scenes/`: name, and the Rust package that ships it.
pub const FETCHED: [(&str, &str); 3] = [("sponza", "bvh"), ("kitchen", "obvhs"), ("spot", "meshx")];

/// The second document's sphere scenes: name and number of spheres.
pub const SPHERES: [(&str, usize); 3] =
    [("spheres75", 75), ("spheres750", 750), ("spheres7500", 7500)];

/// The largest number of objects of a stiff scene: with boxes and a tree they take ten gigabytes.
const MOST_STIFF: usize = 100_000_000;

impl Scene {
    /// Loads a scene by name.
    ///
    /// `name` is a stand-in, one of [`SPHERES`], one of [`FETCHED`] or the path of a mesh file, and may end like a
    /// [`Subset`]; or it is a stiff scene with its number of objects, such as `S34:20000`.
    ///
    /// # Errors
    ///
    /// [`SceneError`] says what is wrong with the name or the file, and which names are accepted.
    pub fn load(name: &str) -> Result<Self, SceneError> {
        Self::load_with(name, OutsideFiles::Refused)
    }

    /// As [`load`](Self::load); `outside` says whether a glTF file may refer to files outside its folder.
    pub fn load_with(name: &str, outside: OutsideFiles) -> Result<Self, SceneError> {
        match Subset::parse(name) {
            Some((id, Subset::Spaced(objects))) if stiff::by_id(id).is_some() => {
                Self::stiff(id, name, objects)
            }
            Some((whole, subset)) => {
                Self::load_whole(whole, outside)?.subset(subset, &name[whole.len()..])
            }
            None => Self::load_whole(name, outside),
        }
    }

    fn load_whole(name: &str, outside: OutsideFiles) -> Result<Self, SceneError> {
        if let Some(stand_in) = stand_ins::STAND_INS
            .iter()
            .find(|scene| scene.name == name)
        {
            return Ok(Self::new(
                name,
                SceneKind::StandIn,
                Primitives::Triangles((stand_in.triangles)()),
            ));
        }
        if let Some(&(_, count)) = SPHERES
            .iter()
            .find(|(spheres, _)| *spheres == name)
        {
            return Ok(Self::new(
                name,
                SceneKind::Procedural,
                Primitives::Spheres(spheres::spheres(count)),
            ));
        }
        let refused = |message: String| SceneError { name: name.into(), message };
        let path = match FETCHED.iter().find(|(fetched, _)| *fetched == name) {
            Some((_, package)) => fetched_path(name).ok_or_else(|| {
                refused(format!(
                    "not fetched yet; run scripts/fetch-scenes, which copies it from the Rust package `{package}` \
                     to scenes/{name}.obj"
                ))
            })?,
            None => PathBuf::from(name),
        };
        // A word is a scene's name; with an extension or a folder it is a path, and the reader says what is wrong with it.
        if path.extension().is_none() && path.components().count() == 1 && !path.exists() {
            return Err(refused(format!("no such scene; {}", known_scenes())));
        }
        let mesh = load::load_with(&path, outside).map_err(|error| refused(error.to_string()))?;
        let stem = path
            .file_stem()
            .map_or_else(|| name.into(), |stem| stem.to_string_lossy().into_owned());
        let remark = mesh
            .remark()
            .map(|remark| format!("scene {stem}: {remark}"));
        Ok(Self {
            remark,
            ..Self::new(&stem, SceneKind::File, Primitives::Triangles(mesh.triangles))
        })
    }

    /// The stiff scene `id` of about `objects` objects: of exactly as many where such a scene exists.
    fn stiff(id: &str, name: &str, objects: usize) -> Result<Self, SceneError> {
        let generator = stiff::by_id(id).filter(|_| (1..=MOST_STIFF).contains(&objects));
        let triangles = generator.map_or_else(Vec::new, |triangles| triangles(objects));
        if triangles.is_empty() {
            let message = format!("a case of the suite has 1 to {MOST_STIFF} objects");
            return Err(SceneError { name: name.into(), message });
        }
        Ok(Self::new(name, SceneKind::Procedural, Primitives::Triangles(triangles)))
    }

    /// A scene of these objects, without remark.
    pub fn new(name: &str, kind: SceneKind, primitives: Primitives) -> Self {
        Self { name: name.into(), kind, boxes: primitives.boxes(), primitives, remark: None }
    }

    /// A subset of the scene's objects, called by the scene's name and `suffix`.
    fn subset(self, subset: Subset, suffix: &str) -> Result<Self, SceneError> {
        let name = self.name + suffix;
        let all = self.boxes.len();
        if subset.count() == 0 || subset.count() > all {
            let message = format!("a subset has 1 to {all} of this scene's objects");
            return Err(SceneError { name, message });
        }
        let primitives = self
            .primitives
            .select(&subset.choose(&self.boxes));
        Ok(Self { remark: self.remark, ..Self::new(&name, self.kind, primitives) })
    }

    /// Its triangles.
    pub fn triangles(&self) -> Result<&[Triangle], NoTriangles> {
        match &self.primitives {
            Primitives::Triangles(triangles) => Ok(triangles),
            Primitives::Spheres(_) => Err(NoTriangles(self.name.clone())),
        }
    }

    /// The direction that is up: z in the stand-ins, elsewhere y, as most modellers have it.
    pub fn up(&self) -> DVec3 {
        match self.kind {
            SceneKind::StandIn => DVec3::Z,
            SceneKind::Procedural | SceneKind::File => DVec3::Y,
        }
    }

    /// A hash of all boxes, by which results tell whether they belong to this very scene.
    pub fn checksum(&self) -> u64 {
        let coordinates = self.boxes.iter().flat_map(|b| {
            b.min
                .to_array()
                .into_iter()
                .chain(b.max.to_array())
        });
        fnv1a(coordinates.flat_map(f32::to_le_bytes))
    }
}

/// The path of a fetched scene: in `scenes/` of the current folder, else of the repository.
pub fn fetched_path(name: &str) -> Option<PathBuf> {
    let file = format!("{name}.obj");
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    [PathBuf::new(), repository]
        .iter()
        .map(|top| top.join("scenes").join(&file))
        .find(|path| path.is_file())
}

/// The names that are accepted, as a part of an error message.
fn known_scenes() -> String {
    let names = stand_ins::STAND_INS
        .iter()
        .map(|scene| scene.name);
    let names = names
        .chain(SPHERES.map(|(name, _)| name))
        .chain(FETCHED.map(|(name, _)| name));
    format!(
        "accepted: {}, the path of an OBJ, PLY, STL or glTF file, a case of the suite with a number of objects such as S34:20000, or \
         either of the others with `:COUNT`, `:random:COUNT:SEED` or `:cluster:COUNT:SEED` for a subset",
        names.collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stand_ins_are_labelled_and_have_one_box_per_triangle() {
        let scene = Scene::load("escher").unwrap();
        assert_eq!(
            (scene.kind, scene.boxes.len()),
            (SceneKind::StandIn, stand_ins::STAND_INS[2].triangle_count)
        );
    }

    #[test]
    fn a_subset_has_as_many_distinct_objects_as_asked_for() {
        let scene = Scene::load("spheres75:30").unwrap();
        assert_eq!((scene.name.as_str(), scene.boxes.len()), ("spheres75:30", 30));
        assert!((1..30).all(|i| scene.boxes[i] != scene.boxes[i - 1]));
        for wrong in ["spheres75:0", "spheres75:76"] {
            assert!(
                Scene::load(wrong)
                    .unwrap_err()
                    .to_string()
                    .contains("1 to 75"),
                "{wrong}"
            );
        }
    }

    #[test]
    fn a_stiff_scene_has_no_more_objects_than_memory_has_room_for() {
        assert_eq!(Scene::load("S34:50").unwrap().boxes.len(), 50);
        for wrong in ["S34:0", "S34:100000001", "S34:18446744073709551615"] {
            let message = Scene::load(wrong).unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains("1 to 100000000"), "{message}");
        }
    }

    #[test]
    fn a_file_is_named_by_its_stem_and_what_it_has_besides_triangles_is_remarked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n").unwrap();
        let scene = Scene::load(path.to_str().unwrap()).unwrap();
        assert_eq!(
            (scene.name.as_str(), scene.kind, scene.boxes.len()),
            ("one", SceneKind::File, 1)
        );
        assert!(scene.remark.unwrap().contains("1 face"));
    }
}
