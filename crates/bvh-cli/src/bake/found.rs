//! The result of a bake: its file, and what is said of it.

use super::BakeArgs;
use super::effort::Effort;
use super::plan::Plan;
use crate::Error;
use crate::answer::{Answer, frame_facts, gain, saved, whole};
use crate::arguments::{greedy, quoted};
use crate::interrupt::is_interrupted;
use bvh_core::Bvh;
use bvh_core::cost::{Objective, internal_area};
use bvh_scenes::Scene;
use bvh_scenes::files::Reserved;
use bvh_scenes::tree_file::{self, TreeFileError};
use bvh_search::{Bake, Baked, Chosen, Division, Open, Outcome, StopReason};
use glam::DMat3;
use std::path::Path;
use std::time::Duration;

/// What the greedy tree along the file's axes costs.
pub struct Greedy {
    /// The total area of inner nodes, which the documentation compares.
    area: f64,
    /// The tests per ray in the wide layout.
    tests: Option<f64>,
}

impl Greedy {
    /// Measures the greedy tree along the file's axes. `tree` is the one along those of the scene, often
    /// the same.
    pub fn of(
        tree: &Bvh,
        scene: &Scene,
        chosen: &Chosen,
        open: &Open,
        seed: u64,
    ) -> Result<Self, Error> {
        let (area, tests) = if is_turned(scene) && !is_interrupted() {
            let plain = greedy(scene)?;
            let tests = chosen.tests_along(open, seed, &plain, &is_interrupted);
            let traced = |source| Error::Tracing { scene: scene.name.clone(), source };
            (internal_area(&plain), tests.map_err(traced)?)
        } else {
            (internal_area(tree), Some(chosen.tests_per_ray(tree)))
        };
        Ok(Self { area, tests: tests.filter(|_| scene.has_triangles()) })
    }
}

/// The result of a search, with what its file and its summary need.
pub struct Found<'a> {
    pub plan: &'a Plan,
    pub scene: &'a Scene,
    pub chosen: Chosen,
    /// Whether the tree is a trial that the user interrupted.
    pub is_tried: bool,
    pub baked: Baked,
    pub greedy: Option<Greedy>,
    pub work: u64,
    /// The time since the command began.
    pub seconds: f64,
}

/// Returns whether the boxes lie along other axes than the file's.
fn is_turned(scene: &Scene) -> bool {
    scene.frame.is_some_and(|frame| frame.rotation() != DMat3::IDENTITY)
}

impl Found<'_> {
    /// The search with all its choices.
    pub fn settled(&self) -> Bake<'_> {
        self.chosen.bake(&self.plan.bake(self.scene))
    }

    /// Writes the file of the tree. Returns its number of bytes.
    pub fn write(&self, path: &Path, reserved: Reserved) -> Result<usize, Error> {
        let written = self.settled().write(&self.baked.outcome.tree, self.work, |sections| {
            reserved.write(sections)?;
            Ok(sections.iter().map(|section| section.len()).sum())
        });
        written.map_err(TreeFileError::of(path))?
    }

    /// Returns whether the file at the path has a tree over the scene that is no worse than the one
    /// of this interrupted search.
    pub fn is_behind(&self, path: &Path) -> bool {
        let Ok((old, _)) = tree_file::load(path, self.scene) else { return false };
        let Baked { outcome, greedy_cost, division, .. } = &self.baked;
        let [old, new] = [&old, &outcome.tree].map(|tree| match self.is_tried {
            true => self.chosen.tests_per_ray(tree),
            false => self.settled().cost(tree, *division),
        });
        // The old tree may be for another cost, by which a greedy tree would be behind.
        old <= new || *greedy_cost == Some(outcome.cost)
    }

    /// Names the cost that the search minimised, unless it is the total area of inner nodes.
    pub fn unit(&self) -> Option<&'static str> {
        match (self.chosen.objective, self.chosen.density.is_some()) {
            (Objective::Layout, true) => Some("cost of the wide layout for rays"),
            (Objective::Layout, false) => Some("cost of the wide layout"),
            (_, true) => Some("visits of rays"),
            (_, false) if self.baked.division == Division::Allowed => Some("area of all nodes"),
            (_, false) => None,
        }
    }

    /// Writes the file and prints what was found. The file of an interrupted search is kept if it
    /// has a better tree of the scene.
    pub fn save(&self, out: &Path, reserved: Reserved, answer: &mut Answer) -> Result<(), Error> {
        if is_interrupted() && self.is_behind(out) {
            return Err(Error::Interrupted(format!(
                "{0} keeps its tree, which is better than the one so far; {1}",
                out.display(),
                continues(out)
            )));
        }
        let bytes = self.write(out, reserved)?;
        self.summarise(answer);
        answer.say(&format!("{}: {} bytes", out.display(), whole(bytes)));
        answer.record("file", out.display().to_string());
        answer.record("bytes", bytes);
        if is_interrupted() {
            let (tree, out, next) = (self.so_far(), out.display(), continues(out));
            return Err(Error::Interrupted(format!("{out} has {tree}; {next}")));
        }
        Ok(())
    }

    /// Says what an interrupted search has self.
    fn so_far(&self) -> String {
        let cost = self.baked.outcome.cost;
        match self.baked.greedy_cost {
            Some(base) if cost < base => {
                let (gain, unit) = (gain(cost, base), self.unit().unwrap_or("area of inner nodes"));
                format!("the best tree so far, {gain} {unit} against the greedy tree")
            }
            Some(_) => "the greedy tree, because nothing better was found yet".into(),
            None => "the best tree so far".into(),
        }
    }

    fn summarise(&self, answer: &mut Answer) {
        let Found { plan, scene, chosen, baked, greedy, seconds, .. } = self;
        let Outcome { tree, cost, evaluations: moves, work, stop, .. } = &baked.outcome;
        let method = self.settled().name();
        let objects = scene.boxes.len();
        let references = tree.prim_ids.len();
        answer.say(&format!(
            "{} ({}), {} objects, {method}, seed {}",
            scene.name,
            scene.kind,
            whole(objects),
            plan.seed
        ));
        answer.record("scene", scene.name.as_str());
        answer.record("method", method);
        answer.record("objects", objects);
        answer.record("references", references);
        answer.record("frame", frame_facts(tree.frame.as_ref()));
        answer.record("seed", plan.seed);
        let area = internal_area(tree);
        answer.record("area", area);
        if let Some(Greedy { area: base, tests }) = *greedy {
            let mut gains = format!("{} area of inner nodes", gain(area, base));
            if let Some(base) = tests {
                let tests = chosen.tests_per_ray(tree);
                gains = format!("{} tests of rays, {gains}", gain(tests, base));
                answer.record("tests_saved", saved(tests, base));
            }
            answer.say(&format!("{gains}, against a greedy SAH sweep's tree"));
            answer.record("greedy_area", base);
            answer.record("saved", saved(area, base));
        }
        // The cost in the file is that for random lines and whole objects.
        answer.record("cost", chosen.objective.cost(tree));
        answer.record("minimised_cost", *cost);
        // The gain in area is no measure of a search for another cost.
        if let (Some(base), Some(unit)) = (baked.greedy_cost, self.unit()) {
            let gain = gain(*cost, base);
            // A cost for rays is known along the axes of its density.
            let (axes, key) = match is_turned(scene) {
                true => (" along the same axes", "minimised_cost_of_greedy_along_the_same_axes"),
                false => ("", "minimised_cost_of_greedy"),
            };
            answer
                .say(&format!("{unit}, which was minimised, {gain} against the greedy tree{axes}"));
            answer.record(key, base);
        }
        if let Some(before) = baked.start_cost {
            answer.say(&format!("{} cost against the tree it started from", gain(*cost, before)));
            answer.record("minimised_cost_of_start", before);
        }
        if references > objects {
            answer.say(&format!("{} references to {} objects", whole(references), whole(objects)));
        } else if baked.division == Division::Useless {
            answer.say("no object is divided, because no spatial split saves anything");
        } else if plan.references > 1.0 {
            answer.say("no object is divided, because no division paid within the budget");
        }
        // A method that plans its time completes its plan just before the time is over, and then could
        // have used more.
        let limit = if let Some(Effort::Time(limit)) = plan.effort { limit } else { Duration::MAX };
        let why = match stop {
            StopReason::Completed if *seconds < 0.5 * limit.as_secs_f64() => {
                ", and the method has completed"
            }
            StopReason::Optimal => ", and no tree is better",
            _ => "",
        };
        answer.say(&format!(
            "{} moves, {} nodes visited, {seconds:.1} s in all{why}",
            whole(*moves),
            whole(*work)
        ));
        answer.record("moves", *moves);
        answer.record("work", *work);
        answer.record("seconds", *seconds);
    }

    /// Says which commands go on from here.
    pub fn next(&self, args: &BakeArgs, out: &Path, answer: &Answer) {
        let [out, scene] = [&out.to_string_lossy(), &args.scene[..]].map(quoted);
        let tracer = args.tracer.map_or("TRACER", |target| target.name);
        let mut commands = format!("`bvh report {out} {scene}`");
        if self.scene.has_triangles() {
            commands = format!("`bvh bench {out} {scene}`, {commands}");
        }
        if self.scene.frame.is_none() && self.scene.triangles().is_ok() {
            commands += &format!(", `bvh export {out} {scene} --for {tracer} --out FILE`");
        }
        answer.say(&format!("next: {commands}"));
    }
}

/// Says how to go on after an interruption. The file takes the default name of the next bake.
fn continues(out: &Path) -> String {
    let out = quoted(&out.to_string_lossy());
    format!("`--from {out} --out {out}` continues, `--out {out}` begins again")
}
