//! A search without its command line.

use super::found::{Found, Greedy};
use super::plan::{Plan, Start};
use super::watch::Watch;
use crate::Error;
use crate::answer::Answer;
use crate::interrupt::{INTERRUPTED, hold};
use crate::rays::Rays;
use bvh_core::export::Target;
use bvh_core::file::Header;
use bvh_core::{Bvh, Frame, Node, Triangle};
use bvh_scenes::Scene;
use bvh_search::{
    Bake, BakeError, Baked, Budget, MadeRays, Method, Observer, Open, Outcome, Reason,
};
use std::sync::OnceLock;
use std::time::Duration;

/// What is left of a budget of time, over the time for the rays.
const SHARE: u32 = 4;

impl Plan {
    /// Returns the limits of a search over so many objects besides its time.
    pub fn budget(&self, objects: usize) -> Budget {
        match self.effort {
            None => Budget::of_objects(objects),
            Some(effort) => Budget { max_work: effort.work(), ..Budget::UNLIMITED },
        }
    }

    /// Returns the same search with a fraction of the budget.
    pub fn share(&self, part: f64) -> Self {
        Self { effort: self.effort.map(|effort| effort.share(part)), ..self.clone() }
    }

    /// Returns the size in bytes of the largest file of a tree over the scene.
    pub fn most_bytes(&self, scene: &Scene) -> usize {
        let chosen = if self.open.references { Open::REFERENCES } else { 1.0 };
        let references = self.references.max(chosen) * scene.boxes.len() as f64;
        // A tree with n leaves has fewer than 2n nodes; each node may have a number of visits.
        let reference = 2 * (size_of::<Node>() + size_of::<f32>()) + size_of::<u32>();
        Header::BYTES + size_of::<Frame>() + references as usize * reference
    }

    /// Returns the search of a scene without its choices.
    pub fn bake<'a>(&'a self, scene: &'a Scene) -> Bake<'a> {
        Bake {
            frame: scene.frame.as_ref(),
            shapes: Some(&scene.primitives),
            objective: self.objective,
            references: self.references,
            method: match &self.method {
                Method::Best(_) => None,
                method => Some((method.name(), method)),
            },
            seed: self.seed,
            budget: self.budget(scene.boxes.len()),
            ..Bake::new(&scene.boxes)
        }
    }

    /// Returns the tree that is compared with the best one for another tracer, if there is time for
    /// it, which the search then has less. A method that was asked for gives its own tree.
    fn rival<'a>(&self, scene: &'a Scene, greedy: &Bvh, watch: &mut Watch) -> Option<Rival<'a>> {
        let tracer = self.tracer.filter(|_| matches!(self.method, Method::Best(_)))?;
        let triangles = scene.triangles().ok()?;
        if let Some(left) = watch.left() {
            let cost = tracer.cost(&tracer.fit(greedy));
            let time = Duration::from_secs_f64(Target::comparison_seconds(cost));
            if time > left / SHARE {
                return None;
            }
            watch.deadline = watch.deadline.sooner(time);
        }
        Some(Rival { tracer, greedy: greedy.clone(), triangles })
    }

    /// Makes the open choices, prints their reasons, and searches until the budget is spent, or the
    /// watch's time is over, or the user interrupts.
    pub fn search<'a>(
        &'a self,
        scene: &'a Scene,
        start: Option<&'a Start>,
        watch: Watch,
        answer: &mut Answer,
    ) -> Result<Found<'a>, Error> {
        hold();
        let failed = |error| Error::search(&scene.name, self.method.name())(error);
        let bake = Bake { start: start.map(|start| &start.tree), ..self.bake(scene) };
        // Without time, and after an interruption, the greedy tree is the answer.
        let greedy = bake.greedy(&()).map_err(failed)?;
        let rays = self.rays.as_ref();
        let step = OnceLock::new();
        let made = |tree: &_, seed, is_over: &dyn Fn() -> bool| {
            let rays = rays.unwrap_or(&Rays::Default);
            // By fewer rays than the start is for, the result could be worse for all.
            let left = watch.left().filter(|_| start.is_none());
            let within = |time| rays.step_within(scene, tree, time, is_over);
            let step = *step.get_or_init(|| left.map_or(1, |left| within(left / SHARE)));
            match rays.density(scene, tree, step, seed, is_over) {
                // So few may miss the scene.
                Err(_) if step > 1 => rays.density(scene, tree, 1, seed, is_over),
                made => made,
            }
        };
        let rays = rays.is_some().then_some(&made as MadeRays);
        let anywhere = |tree: &_, seed, is_over: &dyn Fn() -> bool| {
            Rays::Default.density(scene, tree, 1, seed, is_over)
        };
        let anywhere = self.tracer.is_none().then_some(&anywhere as MadeRays);
        let open = Open { rays, anywhere, ..self.open };
        let untimed: &dyn Observer = if open.budget { &watch } else { &INTERRUPTED };
        let mut chosen = bake.choose(&open, greedy, untimed).map_err(|error| match error {
            BakeError::Search(error) => failed(error),
            BakeError::Rays(source) => Error::Tracing { scene: scene.name.clone(), source },
        })?;
        // A file would no longer say that the tree is for rays.
        if start.is_some() && rays.is_some() && chosen.density.is_none() {
            let left = "nothing was written; the tree of --from is the best so far";
            return Err(Error::Interrupted(left.into()));
        }
        watch.bar.suspend(|| {
            if let Some(step @ 2..) = step.get() {
                let why = format!("rays: one in {step}, because more would take too much time");
                answer.line("choices", why);
            }
            let explain = |reason: &Reason| answer.line("choices", reason.to_string());
            chosen.reasons.iter().for_each(explain);
        });
        let greedy = chosen.greedy.take();
        let facts = greedy.as_ref().map(|tree| Greedy::of(tree, scene, &chosen, &open, self.seed));
        let facts = facts.transpose()?;
        let tried = chosen.tried.take();
        let is_tried = tried.is_some();
        let settled = chosen.bake(&bake);
        let mut watch = watch.within(settled.budget.max_work);
        let rival = greedy.as_ref().filter(|_| start.is_none());
        let rival = rival.and_then(|greedy| self.rival(scene, greedy, &mut watch));
        let baked = match tried {
            Some(tried) => Ok(tried),
            None => settled.search(greedy, &watch),
        };
        watch.bar.finish_and_clear();
        let mut baked = baked.map_err(failed)?;
        if let Some(rival) = rival {
            baked = rival.or_better(baked, answer);
        }
        let seconds = watch.deadline.elapsed().as_secs_f64();
        // The work of all bakes that led to this tree, one after the other.
        let work = start.map_or(0, |start| start.work).saturating_add(baked.outcome.work);
        Ok(Found { plan: self, scene, chosen, is_tried, baked, greedy: facts, work, seconds })
    }
}

/// The tree that a tracer traces if its rays take fewer tests there than in a searched tree.
struct Rival<'a> {
    tracer: Target,
    greedy: Bvh,
    triangles: &'a [Triangle],
}

impl Rival<'_> {
    /// Returns what was searched, or says that this tree is better, and returns it.
    fn or_better(self, searched: Baked, answer: &mut Answer) -> Baked {
        let Self { tracer, greedy, triangles } = self;
        if tracer.fit_better(&searched.outcome.tree, &greedy, triangles).is_searched() {
            return searched;
        }
        let name = tracer.name;
        let why = format!("greedy, because rays take fewer tests in {name} than in the best tree");
        answer.line("choices", format!("tree: {why}"));
        let cost = searched.greedy_cost.unwrap_or(searched.outcome.cost);
        Baked { outcome: Outcome { tree: greedy, cost, ..searched.outcome }, ..searched }
    }
}
