//! The scenes of a spec, turned if their names say so: `SCENE:turn:DEGREES` is turned about the
//! vertical, `SCENE:rotation:SEED` by a random rotation.
//!
//! Nothing is moved. Boxes along the file's axes around a scene that is turned by R are boxes in
//! the frame R around the scene itself. So rays are the same at all angles, and vertices are not
//! rounded.

use super::Experiment;
use crate::Error;
use crate::rows::TurnRow;
use bvh_core::glam::{DMat3, DQuat, DVec3, Vec3};
use bvh_core::{Frame, Triangle};
use bvh_scenes::builtin::stand_ins::cos_sin;
use bvh_scenes::{Scene, SceneError, subset};
use bvh_search::{Budget, Choice, Observer, Stream};
use rand::{RngExt, SeedableRng};
use std::collections::HashSet;

impl Experiment {
    /// Loads the scenes. Returns them and the names of optional scenes that are missing.
    pub fn load_scenes(&self) -> Result<(Vec<Scene>, Vec<String>), Error> {
        // The scenes of the suite are names of cases, which the suite itself makes.
        if self.suite.is_some() {
            return Ok(Default::default());
        }
        let names = self.scenes.iter().flat_map(|name| subset::expand(name));
        let mut scenes = names.map(|name| load(&name)).collect::<Result<Vec<_>, _>>()?;
        let mut skipped = Vec::new();
        for name in &self.optional_scenes {
            match load(name) {
                Ok(scene) => scenes.push(scene),
                // An optional scene that cannot be loaded is one that nobody has fetched.
                Err(_) => skipped.push(name.clone()),
            }
        }
        let mut names = HashSet::new();
        match scenes.iter().find(|scene| !names.insert(&scene.name)) {
            Some(twice) => {
                Err(Error::Usage(format!("two scenes are called {}; name each once", twice.name)))
            }
            None => Ok((scenes, skipped)),
        }
    }
}

/// Returns how the scene of this name stands, if it is turned.
pub fn turn_of(name: &str) -> Option<TurnRow> {
    let (before, number) = name.rsplit_once(':')?;
    let (mesh, degrees, rotation) = match before.rsplit_once(':')? {
        (mesh, "turn") => (mesh, Some(number.parse().ok()?), None),
        (mesh, "rotation") => (mesh, None, Some(number.parse().ok()?)),
        _ => return None,
    };
    Some(TurnRow { scene: name.into(), mesh: mesh.into(), degrees, rotation })
}

/// Loads a scene, turned if its name says so. Only triangles are turned.
fn load(name: &str) -> Result<Scene, SceneError> {
    let Some(TurnRow { mesh, degrees, rotation, .. }) = turn_of(name) else {
        return Scene::load(name);
    };
    let scene = Scene::load(&mesh)?;
    scene.triangles()?;
    let turn = match degrees {
        Some(degrees) => {
            let (cos, sin) = cos_sin(f64::from(degrees) / 720.0);
            DQuat::from_vec4((scene.up() * sin).extend(cos))
        }
        None => {
            let mut rng = Stream::seed_from_u64(rotation.unwrap_or_default());
            DQuat::from_array(rng.random::<[f64; 4]>().map(|part| part - 0.5)).normalize()
        }
    };
    let frame = (degrees != Some(0)).then(|| frame(DMat3::from_quat(turn), DVec3::ZERO));
    let name = format!("{}{}", scene.name, &name[mesh.len()..]);
    Ok(Scene { name, ..scene.in_frame(frame) })
}

/// Returns the scene with boxes in the frame that its triangles choose as they stand.
pub fn in_chosen_frame(
    scene: &Scene,
    budget: Budget,
    observer: &dyn Observer,
) -> Result<Scene, SceneError> {
    let turn = scene.frame.unwrap_or_else(|| frame(DMat3::IDENTITY, DVec3::ZERO));
    let corner = |corner: Vec3| turn.point(corner.as_dvec3()).as_vec3();
    let turned: Vec<Triangle> =
        scene.triangles()?.iter().map(|triangle| Triangle(triangle.0.map(corner))).collect();
    let rotation = turn.rotation();
    let chosen = Choice::of(&turned, budget, observer)
        .frame
        .map(|chosen| frame(chosen.rotation() * rotation, rotation.transpose() * chosen.centre()));
    Ok(scene.clone().in_frame(chosen.or(scene.frame)))
}

/// Products of rotations are rotations but for rounding, far within what frames accept.
fn frame(rotation: DMat3, centre: DVec3) -> Frame {
    Frame::new(rotation, centre).expect("a rotation")
}

#[test]
fn boxes_of_a_turned_scene_are_those_of_its_turned_triangles() {
    for (name, up) in [("escher:300:turn:30", DVec3::Z), ("S30:300:turn:30", DVec3::Y)] {
        let scene = load(name).unwrap();
        assert_eq!(scene.name, name);
        let rotation = DMat3::from_axis_angle(up, 30f64.to_radians());
        let size = bvh_core::Aabb::union_of(&scene.boxes).extent().max_element();
        for (found, Triangle(corners)) in scene.boxes.iter().zip(scene.triangles().unwrap()) {
            let turned = Triangle(corners.map(|at| (rotation * at.as_dvec3()).as_vec3())).aabb();
            let off = (found.min - turned.min).abs().max((found.max - turned.max).abs());
            assert!(f64::from(off.max_element()) < 1e-6 * size, "{found:?} {turned:?}");
        }
    }
    let boxes = |turn: &str| load(&format!("escher:300{turn}")).unwrap().boxes;
    assert_eq!(boxes(":turn:0"), boxes(""));
    assert!(boxes(":rotation:1") != boxes(":rotation:2"));
    assert!(load("spheres75:turn:30").unwrap_err().to_string().contains("triangles"));
}
