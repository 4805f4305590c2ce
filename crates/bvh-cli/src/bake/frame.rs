//! The frame of a bake: chosen from the triangles, the one of an earlier tree, or the file's axes.

use super::plan::{Plan, Start};
use super::watch::Watch;
use super::{BakeArgs, Effort};
use crate::answer::Answer;
use bvh_core::Frame;
use bvh_scenes::Scene;
use bvh_search::{Budget, Choice, Frames, Method};

/// Returns the scene in the frame of its bake, and says why it is the best one. What the choice
/// takes of a budget of time is missing from the plan's.
pub fn turned(
    args: &BakeArgs,
    plan: &mut Plan,
    scene: Scene,
    start: Option<&Start>,
    answer: &mut Answer,
) -> Scene {
    if let Some(Start { tree, .. }) = start {
        return scene.in_frame(tree.frame);
    }
    let is_free = matches!(plan.method, Method::Best(_)) && args.tracer.is_none();
    let triangles = match scene.triangles() {
        Ok(triangles) if is_free && args.frame != Some(Frames::File) => triangles,
        _ => return scene,
    };
    let watch = Watch::new(plan.effort);
    let budget = Budget { max_work: plan.effort.work(), ..Budget::UNLIMITED };
    let Choice { frame, gain, agreeing } = Choice::of(triangles, budget, &watch);
    watch.bar.finish_and_clear();
    if let Effort::Time(time) = &mut plan.effort {
        *time = time.saturating_sub(watch.deadline.elapsed());
    }
    let percent = 100.0 * gain;
    let what = match &frame {
        Some(frame) => {
            let degrees = angle(frame).to_degrees();
            format!("turned by {degrees:.0} degrees, {percent:.0} % less area than along")
        }
        None => "no other saves enough area; kept are".into(),
    };
    answer.say(&format!("frame: {what} the file's axes"));
    if args.explain && agreeing > 0.0 {
        let percent = 100.0 * agreeing;
        let line = format!("frame: {percent:.0} % of the triangles, by size, share their axes");
        answer.line("explanation", line);
    }
    scene.in_frame(frame)
}

/// Returns the angle of the frame's rotation.
fn angle(frame: &Frame) -> f64 {
    let rotation = frame.rotation();
    let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
    (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
}
