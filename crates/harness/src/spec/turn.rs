//! Turned scenes: `SCENE:turn:DEGREES` is turned about the vertical, `SCENE:rotation:SEED` by a
//! random rotation.
//!
//! Nothing is moved. Boxes along the file's axes around a scene that is turned by R are boxes in
//! the frame R around the scene itself. So rays are the same at all angles, and vertices are not
//! rounded.

use bvh_core::glam::{DMat3, DQuat, DVec3};
use bvh_core::{Frame, Triangle};
use bvh_scenes::builtin::stand_ins::cos_sin;
use bvh_scenes::{Scene, SceneError};
use bvh_search::{Budget, Choice, Observer, Stream};
use rand::{RngExt, SeedableRng};

/// How a scene is turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// By degrees about the vertical.
    Vertical(u16),
    /// By the random rotation of a seed.
    Random(u64),
}

impl Turn {
    /// Splits the name of a turned scene into the scene's name and the turn.
    pub fn parse(name: &str) -> Option<(&str, Self)> {
        let (before, number) = name.rsplit_once(':')?;
        match before.rsplit_once(':')? {
            (scene, "turn") => Some((scene, Self::Vertical(number.parse().ok()?))),
            (scene, "rotation") => Some((scene, Self::Random(number.parse().ok()?))),
            _ => None,
        }
    }

    /// Returns the rotation; `None` by no degrees.
    fn rotation(self, up: DVec3) -> Option<DQuat> {
        match self {
            Self::Vertical(0) => None,
            Self::Vertical(degrees) => {
                let (cos, sin) = cos_sin(f64::from(degrees) / 720.0);
                Some(DQuat::from_vec4((up * sin).extend(cos)))
            }
            Self::Random(seed) => {
                let mut rng = Stream::seed_from_u64(seed);
                let mut parts =
                    || DQuat::from_array(rng.random::<[f64; 4]>().map(|x| 2.0 * x - 1.0));
                std::iter::repeat_with(&mut parts)
                    .find(|parts| (0.01..1.0).contains(&parts.length_squared()))
            }
        }
    }
}

/// Returns the name of a scene without its turn.
pub fn straight(name: &str) -> &str {
    Turn::parse(name).map_or(name, |(scene, _)| scene)
}

/// Loads a scene, turned if its name says so. Only triangles are turned.
pub fn load(name: &str) -> Result<Scene, SceneError> {
    let Some((whole, turn)) = Turn::parse(name) else { return Scene::load(name) };
    let scene = Scene::load(whole)?;
    scene.triangles()?;
    let rotation = turn.rotation(scene.up());
    let frame = rotation.map(|rotation| frame(DMat3::from_quat(rotation.normalize()), DVec3::ZERO));
    let name = format!("{}{}", scene.name, &name[whole.len()..]);
    Ok(Scene { name, ..scene.in_frame(frame) })
}

/// Returns the scene with boxes in the frame that its triangles choose as they stand.
pub fn in_chosen_frame(
    scene: &Scene,
    budget: Budget,
    observer: &dyn Observer,
) -> Result<Scene, SceneError> {
    let corners = |turn: &Frame, Triangle(corners): &Triangle| {
        Triangle(corners.map(|corner| turn.point(corner.as_dvec3()).as_vec3()))
    };
    let triangles = scene.triangles()?;
    let Some(turn) = &scene.frame else {
        return Ok(scene.clone().in_frame(Choice::of(triangles, budget, observer).frame));
    };
    let turned: Vec<Triangle> = triangles.iter().map(|triangle| corners(turn, triangle)).collect();
    let chosen = Choice::of(&turned, budget, observer).frame.map(|chosen| {
        let rotation = turn.rotation();
        // Products of rotations are rotations but for rounding, far within what frames accept.
        frame(chosen.rotation() * rotation, rotation.transpose() * chosen.centre())
    });
    Ok(scene.clone().in_frame(chosen.or(scene.frame)))
}

fn frame(rotation: DMat3, centre: DVec3) -> Frame {
    Frame::new(rotation, centre).expect("a rotation")
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::Aabb;

    #[test]
    fn boxes_of_a_turned_scene_are_those_of_its_turned_triangles() {
        for (name, up) in [("escher:300:turn:30", DVec3::Z), ("S30:300:turn:30", DVec3::Y)] {
            let scene = load(name).unwrap();
            assert_eq!((scene.name.as_str(), straight(name)), (name, &name[..name.len() - 8]));
            let rotation = DMat3::from_axis_angle(up, 30f64.to_radians());
            let size = Aabb::union_of(&scene.boxes).extent().max_element();
            for (found, Triangle(corners)) in scene.boxes.iter().zip(scene.triangles().unwrap()) {
                let turned =
                    Triangle(corners.map(|at| (rotation * at.as_dvec3()).as_vec3())).aabb();
                let off = (found.min - turned.min).abs().max((found.max - turned.max).abs());
                assert!(f64::from(off.max_element()) < 1e-6 * size, "{found:?} {turned:?}");
            }
        }
        let straight = Scene::load("escher:300").unwrap();
        assert_eq!(load("escher:300:turn:0").unwrap().boxes, straight.boxes);
        let random = [1, 2].map(|seed| load(&format!("escher:300:rotation:{seed}")).unwrap().boxes);
        assert!(random[0] != random[1] && random[0] != straight.boxes);
        assert!(load("spheres75:turn:30").unwrap_err().to_string().contains("triangles"));
    }
}
