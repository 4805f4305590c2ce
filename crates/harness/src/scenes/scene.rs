//! Scenes by name or path: built-in stand-ins, the spheres, fetched meshes, and any OBJ file.

use crate::scenes::subset::Part;
use crate::stress::{self, examine};
use crate::{Error, scenes::obj, scenes::standin};
use bvh_core::{Aabb, Sphere, Triangle};
use glam::Vec3;
use std::path::{Path, PathBuf};

/// The objects of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitives {
    /// Three corners each, in world units.
    Triangles(Vec<[Vec3; 3]>),
    /// Centre and radius each, in world units.
    Spheres(Vec<Sphere>),
}

impl Primitives {
    /// The objects' boxes, one each.
    pub fn boxes(&self) -> Vec<Aabb> {
        match self {
            Self::Triangles(triangles) => triangles.iter().map(|&corners| Triangle(corners).aabb()).collect(),
            Self::Spheres(spheres) => spheres.iter().map(Sphere::aabb).collect(),
        }
    }
}

/// A scene, loaded.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name in tables: a built-in name, or the file's name without extension.
    pub name: String,
    /// `stand-in`, `procedural` or `file`. Stand-ins are called that in every table.
    pub kind: &'static str,
    /// What it is made of.
    pub primitives: Primitives,
    /// One box per object.
    pub boxes: Vec<Aabb>,
}

/// Triangles are needed, and the scene of this name has none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} has spheres; accepted: scenes of triangles")]
pub struct NoTriangles(pub String);

/// Meshes that `scripts/fetch-scenes` puts under `scenes/`: name, and the Rust package that ships it.
pub const FETCHED: [(&str, &str); 2] = [("sponza", "bvh"), ("kitchen", "obvhs")];

/// The second document's sphere scenes: name and number of spheres.
pub const SPHERES: [(&str, usize); 3] = [("spheres75", 75), ("spheres750", 750), ("spheres7500", 7500)];

/// Most objects of a case of the suite: ten gigabytes of them, their boxes and a tree.
const MOST_OF_SUITE: usize = 100_000_000;

impl Scene {
    /// Loads a scene by the name or path that a spec or `--scene` gives, or the [`Part`] of it that the name ends with.
    pub fn load(name: &str) -> Result<Self, Error> {
        match Part::parse(name) {
            Some((case, Part::Spaced(objects)))
                if examine::case(case).is_some_and(|case| case.scene().is_some()) =>
            {
                Self::of_suite(case, name, objects)
            }
            Some((whole, part)) => Self::load_whole(whole)?.part(part, &name[whole.len()..]),
            None => Self::load_whole(name),
        }
    }

    fn load_whole(name: &str) -> Result<Self, Error> {
        if let Some(built_in) = standin::STAND_INS.iter().find(|scene| scene.name == name) {
            return Ok(Self::new(name, "stand-in", Primitives::Triangles((built_in.triangles)())));
        }
        if let Some(&(_, count)) = SPHERES.iter().find(|(spheres, _)| *spheres == name) {
            return Ok(Self::new(name, "procedural", Primitives::Spheres(standin::spheres::spheres(count))));
        }
        let path = match FETCHED.iter().find(|(fetched, _)| *fetched == name) {
            Some((_, package)) => fetched_path(name).ok_or_else(|| Error::Scene {
                name: name.into(),
                message: format!(
                    "not fetched yet; run scripts/fetch-scenes, which copies it from the Rust package `{package}` \
                     to scenes/{name}.obj"
                ),
            })?,
            None => PathBuf::from(name),
        };
        if !name.ends_with(".obj") && !path.exists() {
            return Err(Error::Scene {
                name: name.into(),
                message: format!("no such scene; {}", known_scenes()),
            });
        }
        let message = |error: obj::ObjError| Error::Scene { name: name.into(), message: error.to_string() };
        let triangles = obj::load(&path).map_err(message)?.triangles;
        let stem = path.file_stem().map_or_else(|| name.into(), |stem| stem.to_string_lossy().into_owned());
        Ok(Self::new(&stem, "file", Primitives::Triangles(triangles)))
    }

    /// The scene of a case of the suite, made of so many objects, or about so many where others make no such scene.
    fn of_suite(case: &str, name: &str, objects: usize) -> Result<Self, Error> {
        let scene = examine::case(case).and_then(stress::Case::scene);
        let scene = scene.filter(|_| (1..=MOST_OF_SUITE).contains(&objects));
        match scene.map_or(vec![], |case| (case.scene)(objects)) {
            none if none.is_empty() => {
                let message = format!("a case of the suite has 1 to {MOST_OF_SUITE} objects");
                Err(Error::Scene { name: name.into(), message })
            }
            some => {
                let corners = some.iter().map(|triangle| triangle.0).collect();
                Ok(Self::new(name, "procedural", Primitives::Triangles(corners)))
            }
        }
    }

    fn new(name: &str, kind: &'static str, primitives: Primitives) -> Self {
        Self { name: name.into(), kind, boxes: primitives.boxes(), primitives }
    }

    /// A part of the scene's objects, called by the scene's name and `suffix`.
    fn part(self, part: Part, suffix: &str) -> Result<Self, Error> {
        let name = self.name + suffix;
        let all = self.boxes.len();
        if part.count() == 0 || part.count() > all {
            return Err(Error::Scene {
                name,
                message: format!("a subset has 1 to {all} of this scene's objects"),
            });
        }
        let chosen = part.choose(&self.boxes);
        let primitives = match &self.primitives {
            Primitives::Triangles(all) => Primitives::Triangles(chosen.iter().map(|&at| all[at]).collect()),
            Primitives::Spheres(all) => Primitives::Spheres(chosen.iter().map(|&at| all[at]).collect()),
        };
        Ok(Self::new(&name, self.kind, primitives))
    }

    /// The corners of its triangles, three each, in world units.
    pub fn corners(&self) -> Result<&[[Vec3; 3]], NoTriangles> {
        match &self.primitives {
            Primitives::Triangles(corners) => Ok(corners),
            Primitives::Spheres(_) => Err(NoTriangles(self.name.clone())),
        }
    }

    /// Its triangles as the core knows them, in O(n).
    pub fn triangles(&self) -> Result<Vec<Triangle>, NoTriangles> {
        Ok(self.corners()?.iter().copied().map(Triangle).collect())
    }

    /// The checksum as files show it.
    pub fn checksum_text(&self) -> String {
        format!("{:016x}", self.checksum())
    }

    /// 64-bit FNV-1a of the boxes' bits: tells whether results belong to this very scene.
    pub fn checksum(&self) -> u64 {
        let coordinates = self.boxes.iter().flat_map(|b| b.min.to_array().into_iter().chain(b.max.to_array()));
        fnv1a(coordinates.flat_map(f32::to_le_bytes))
    }
}

/// The 64-bit FNV-1a hash of some bytes: stable across machines and versions.
pub fn fnv1a(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Where a fetched scene lies: under the current folder's `scenes/`, else under the repository's.
pub fn fetched_path(name: &str) -> Option<PathBuf> {
    let file = format!("{name}.obj");
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    [PathBuf::new(), repository].iter().map(|top| top.join("scenes").join(&file)).find(|path| path.is_file())
}

/// What would be accepted as a scene.
fn known_scenes() -> String {
    let names = standin::STAND_INS.iter().map(|scene| scene.name);
    let names = names.chain(SPHERES.map(|(name, _)| name)).chain(FETCHED.map(|(name, _)| name));
    format!(
        "accepted: {}, the path of an OBJ file, a case of the suite with a number of objects such as S34:20000, or \
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
        assert_eq!((scene.kind, scene.boxes.len()), ("stand-in", standin::STAND_INS[2].triangle_count));
    }

    #[test]
    fn an_unknown_scene_is_answered_with_the_known_ones() {
        let message = Scene::load("eschre").unwrap_err().to_string();
        assert!(message.contains("eschre") && message.contains("escher, konistil"), "{message}");
        let message = Scene::load("nowhere/x.obj").unwrap_err().to_string();
        assert!(message.contains("nowhere/x.obj: no such file"), "{message}");
    }

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
    fn a_case_of_the_suite_has_no_more_objects_than_memory_has_room_for() {
        assert_eq!(Scene::load("S34:50").unwrap().boxes.len(), 50);
        for wrong in ["S34:0", "S34:100000001", "S34:18446744073709551615"] {
            let message = Scene::load(wrong).unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains("1 to 100000000"), "{message}");
        }
    }

    #[test]
    fn a_file_is_named_by_its_stem() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let scene = Scene::load(path.to_str().unwrap()).unwrap();
        assert_eq!((scene.name.as_str(), scene.kind, scene.boxes.len()), ("one", "file", 1));
    }
}
