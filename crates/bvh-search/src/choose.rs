//! What a bake chooses by itself: its cost, the rays that it is for, divided objects, and its work.
//!
//! Short searches try the combinations of the choices that are open, over the scene, or over parts
//! of a large one. Rays that trained no tree judge the trees. Chosen is the simplest combination
//! that is within [`TOLERANCE`] of the best one. What it gains forecasts what a longer search is
//! worth.

use crate::bake::Untimed;
use crate::exact::most_work_of_tiny;
use crate::frames::saved;
use crate::reason::{More, Reason, Tried};
use crate::{Bake, BakeError, Baked, Budget, Observer, SearchError, parallel};
use bvh_core::cost::Objective;
use bvh_core::{Aabb, Bvh, DensityError, Primitives, RayDensity};

/// The work per object of a bake that chooses its own budget. On the 7 scenes of
/// `results/anytime`, `best` ends within 0.3 % of the best known cost after this work; six times
/// the work saves at most 0.3 % (`results/anytime_long`).
const WORK_PER_OBJECT: u64 = 8000;
/// The work up to which a bake chooses [`WORK_PER_OBJECT`]: about a minute on one core.
const MOST_WORK: u64 = 4_000_000_000;
/// The work per object of the largest scenes. `best` ends within 1.3 % of the best known cost.
const LEAST_WORK_PER_OBJECT: u64 = 800;
/// The share of the work that each short search of a large scene spends.
const TRIED: f64 = 0.02;
/// The work of the short searches of smaller scenes: a fraction of a second each.
const LEAST_TRIED: f64 = 1e7;
/// The largest share of the work that a short search spends. Five times less chose wrongly on small
/// scenes, where dividing objects pays late in the search.
const MOST_TRIED: f64 = 0.1;
/// The most objects that are tried, and those of a part of a larger scene.
const MOST_OBJECTS: usize = 1 << 17;
const PART: usize = 1 << 12;
/// The fraction of the expected tests of rays that a simpler combination may lose. Two searches
/// with other seeds differ by as much.
const TOLERANCE: f64 = 0.005;
/// The fraction of the tests below which a long search does not pay, and the work that then
/// suffices: ten seconds' on two cores, or more in large scenes.
const LITTLE: f64 = 1.0 / 16.0;
const ENOUGH: u64 = 250_000_000;
const ENOUGH_PER_OBJECT: u64 = 300;

/// Makes the density of the rays of a seed in the scene of a bake, by any valid tree over it. `None`
/// soon after the function returns true.
pub type MadeRays<'a> = &'a (dyn Fn(&Bvh, u64, &dyn Fn() -> bool) -> MadeDensity + Sync);

/// The result of [`MadeRays`].
pub type MadeDensity = Result<Option<RayDensity>, DensityError>;

/// What a bake leaves open. All other choices are its own.
#[derive(Clone, Copy, Default)]
pub struct Open<'a> {
    /// The work. The other choices are made only if this one is.
    pub budget: bool,
    /// The cost, unless there are rays.
    pub cost: bool,
    /// Whether objects are divided.
    pub references: bool,
    /// Makes the rays that the tree is for. Without them, it is for random lines, or for rays from
    /// anywhere if these pay.
    pub rays: Option<MadeRays<'a>>,
    /// Makes rays from anywhere in the scene. They judge trees, and may train them. Without them,
    /// random lines judge.
    pub anywhere: Option<MadeRays<'a>>,
}

impl Open<'_> {
    /// The seed of rays that judge trees. A bake trains on other rays, unless this is its seed.
    pub const JUDGING: u64 = u64::MAX;

    /// The number of references per object where divided objects pay.
    pub const REFERENCES: f64 = 1.2;
}

impl Budget {
    /// The budget of a bake of so many objects that chooses its own.
    pub fn of_objects(objects: usize) -> Self {
        let objects = objects as u64;
        let work = (WORK_PER_OBJECT * objects).min(MOST_WORK).max(LEAST_WORK_PER_OBJECT * objects);
        Self { max_work: Some(work), ..Self::UNLIMITED }
    }
}

/// The choices of a bake, and what making them has found.
pub struct Chosen {
    /// The greedy tree, if it was given or needed.
    pub greedy: Option<Bvh>,
    /// The cost.
    pub objective: Objective,
    /// The density of the rays that the tree is for.
    pub density: Option<RayDensity>,
    /// The best tree that was tried, if the observer cancelled meanwhile. It is for these choices.
    pub tried: Option<Baked>,
    /// Why, one line each.
    pub reasons: Vec<Reason>,
    references: f64,
    budget: Budget,
    divided: Option<Bvh>,
    judging: Option<RayDensity>,
}

impl Chosen {
    /// Returns the bake with these choices.
    pub fn bake<'b>(&'b self, bake: &Bake<'b>) -> Bake<'b> {
        Bake {
            objective: Some(self.objective),
            rays: self.density.as_ref(),
            references: self.references,
            budget: self.budget,
            divided: self.divided.as_ref(),
            ..*bake
        }
    }

    /// The tests of rays in the wide layout of a tree, per ray that enters it: of the rays that judged
    /// combinations, otherwise of those that the tree is for; or of random lines, in units of area.
    /// These numbers compare with those of trees along other axes. O(nodes).
    pub fn tests_per_ray(&self, tree: &Bvh) -> f64 {
        per_ray(tree, self.judging.as_ref().or(self.density.as_ref()))
    }

    /// The same tests in a unit that the frame decides, so that those of parts add up.
    fn tests(&self, tree: &Bvh) -> f64 {
        match self.judging.as_ref().or(self.density.as_ref()) {
            Some(density) => Objective::Layout.cost_by(tree, density),
            None => Objective::Layout.cost(tree),
        }
    }

    /// The [tests per ray](Self::tests_per_ray) in a tree along other axes than the bake's, for which
    /// it makes the same rays again by what was open and the seed of the bake. `None` soon after
    /// `is_over` returns true.
    pub fn tests_along(
        &self,
        open: &Open,
        seed: u64,
        tree: &Bvh,
        is_over: &dyn Fn() -> bool,
    ) -> Result<Option<f64>, DensityError> {
        let made = match (&self.judging, &self.density) {
            (Some(_), _) => open.anywhere.map(|rays| (rays, Open::JUDGING)),
            (None, Some(_)) => open.rays.or(open.anywhere).map(|rays| (rays, seed)),
            (None, None) => None,
        };
        match made {
            Some((rays, seed)) => {
                Ok(rays(tree, seed, is_over)?.map(|density| per_ray(tree, Some(&density))))
            }
            None => Ok(Some(per_ray(tree, None))),
        }
    }
}

/// Returns whether a bake that chooses its own budget needs no search for so few objects.
fn has_optimum(objects: usize) -> bool {
    let work = Budget::of_objects(objects).max_work;
    objects < 3 || most_work_of_tiny(objects).is_some_and(|least| Some(least) <= work)
}

fn per_ray(tree: &Bvh, density: Option<&RayDensity>) -> f64 {
    let Some(density) = density else { return Objective::Layout.cost(tree) };
    let root = density.measure(&tree.root_aabb().unwrap_or(Aabb::EMPTY));
    Objective::Layout.cost_by(tree, density) / if root > 0.0 { root } else { 1.0 }
}

#[derive(Clone, Copy)]
struct Combination {
    objective: Objective,
    has_rays: bool,
    references: f64,
}

/// A scene, or a part of one, over which combinations are tried.
struct Trial<'a> {
    bake: Bake<'a>,
    greedy: Option<Bvh>,
    divided: Option<Bvh>,
}

impl<'a> Bake<'a> {
    /// Makes the choices that are open. Takes the `greedy` tree if the caller has it. The choices
    /// are the same on every machine, for any number of threads; a clock of the observer is not
    /// read.
    ///
    /// Only [`best`](crate::best) has choices, without a [start](Bake::start), and of triangles,
    /// which alone have a wide layout. With a budget, only the density of given rays is made.
    ///
    /// ```
    /// use bvh_search::{Open, bvh_core::Primitives, prelude::*};
    /// let at = |x: f32| [[x, 0.0, 0.0], [x + 1.5, 1.0, 0.0], [x, 1.0, 2.0]];
    /// let shapes = Primitives::Triangles((0..50u8).map(|x| at(x.into()).into()).collect());
    /// let boxes = shapes.boxes();
    /// let bake = Bake { shapes: Some(&shapes), ..Bake::new(&boxes) };
    /// let open = Open { budget: true, cost: true, references: true, ..Open::default() };
    /// let mut chosen = bake.choose(&open, None, &())?;
    /// for reason in &chosen.reasons {
    ///     println!("{reason}");
    /// }
    /// let greedy = chosen.greedy.take();
    /// let baked = chosen.bake(&bake).search(greedy, &())?;
    /// assert!(cost::total_area(&baked.outcome.tree) > 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn choose(
        &self,
        open: &Open,
        greedy: Option<Bvh>,
        observer: &dyn Observer,
    ) -> Result<Chosen, BakeError> {
        let default = if open.rays.is_some() { Objective::Layout } else { Objective::InternalArea };
        let mut chosen = Chosen {
            greedy,
            objective: self.objective.unwrap_or(default),
            density: None,
            tried: None,
            reasons: Vec::new(),
            references: self.references,
            budget: self.budget,
            divided: None,
            judging: None,
        };
        let untimed = Untimed(observer);
        let combinations = self.combinations(open, chosen.objective);
        if chosen.greedy.is_none() && (open.rays.is_some() || combinations.len() > 1) {
            chosen.greedy = self.greedy(&untimed)?;
        }
        if let (Some(rays), Some(greedy)) = (open.rays, &chosen.greedy) {
            chosen.density = rays(greedy, self.seed, &|| untimed.cancelled())?;
        }
        let mut forecast = None;
        if combinations.len() > 1
            && let Some(greedy) = chosen.greedy.take()
        {
            forecast = self.compare(open, &combinations, &greedy, &mut chosen, observer)?;
            chosen.greedy = Some(greedy);
        }
        let objects = self.boxes.len();
        if let (true, Some(ample)) = (open.budget, Budget::of_objects(objects).max_work) {
            let objects = objects.max(1) as u64;
            let enough = ENOUGH.max(ENOUGH_PER_OBJECT * objects);
            let (work, more) = match forecast {
                Some(saved) if saved < LITTLE && enough < ample => (enough, More::Little(saved)),
                _ if ample < WORK_PER_OBJECT * objects => (ample, More::Pays),
                _ => (ample, More::HardlyPays),
            };
            chosen.budget.max_work = Some(work);
            let per_object = work / objects;
            if !observer.cancelled() {
                chosen.reasons.insert(0, Reason::Work { work, per_object, more });
            }
        }
        Ok(chosen)
    }

    /// Returns the combinations of the open choices. The simpler ones come first, and the last one
    /// has all choices.
    fn combinations(&self, open: &Open, objective: Objective) -> Vec<Combination> {
        let is_triangles = matches!(self.shapes, Some(Primitives::Triangles(_)));
        let has_choices = self.method.is_none() && self.start.is_none() && is_triangles;
        if !(has_choices && open.budget) || has_optimum(self.boxes.len()) {
            return Vec::new();
        }
        let mut costs = vec![(objective, open.rays.is_some())];
        if open.chooses_cost() {
            costs.push((Objective::Layout, false));
        }
        if open.chooses_rays() {
            costs.push((costs[costs.len() - 1].0, true));
        }
        let divided =
            if open.references { &[1.0, Open::REFERENCES][..] } else { &[self.references] };
        let with = |&references: &f64| {
            let combination =
                move |&(objective, has_rays)| Combination { objective, has_rays, references };
            costs.iter().map(combination)
        };
        divided.iter().flat_map(with).collect()
    }

    /// Tries the combinations, and chooses one. Returns the fraction of the tests of untrained rays
    /// that it saves, unless the observer cancels.
    fn compare(
        &self,
        open: &Open,
        combinations: &[Combination],
        greedy: &Bvh,
        chosen: &mut Chosen,
        observer: &dyn Observer,
    ) -> Result<Option<f64>, BakeError> {
        let untimed = Untimed(observer);
        let most = combinations[combinations.len() - 1];
        if let Some(anywhere) = open.anywhere {
            chosen.judging = anywhere(greedy, Open::JUDGING, &|| untimed.cancelled())?;
            if open.chooses_rays() {
                chosen.density = anywhere(greedy, self.seed, &|| untimed.cancelled())?;
            }
        }
        let parts = self.parts_of(greedy);
        let mut trials = Vec::new();
        if parts.is_empty() {
            trials.push(self.trial(Some(greedy.clone()), most.references, &untimed)?);
        }
        for (boxes, shapes) in &parts {
            let part = Bake { boxes, shapes: shapes.as_ref(), ..*self };
            trials.push(part.trial(None, most.references, &untimed)?);
        }
        let mut best_tree = None;
        let mut tests: Vec<f64> = Vec::new();
        for (index, combination) in combinations.iter().enumerate() {
            observer.trying(index, combinations.len());
            // A trial of no work takes seconds in large scenes.
            if observer.cancelled() {
                break;
            }
            let density = chosen.density.as_ref().filter(|_| combination.has_rays);
            let mut found = tried_by(&trials, combination, density, &untimed)?;
            let cost = found.iter().map(|baked| chosen.tests(&baked.outcome.tree)).sum();
            if parts.is_empty() && tests.iter().all(|&other| cost < other) {
                best_tree = found.pop().map(|baked| (index, baked));
            }
            tests.push(cost);
        }
        observer.trying(combinations.len(), combinations.len());
        // An interrupted search says nothing about the choices, but it has found trees.
        if observer.cancelled() {
            let (index, baked) = best_tree.unzip();
            chosen.settle(combinations[index.unwrap_or(0)], None);
            chosen.tried = baked;
            return Ok(None);
        }
        let greedy = trials.iter().filter_map(|trial| trial.greedy.as_ref());
        let of_greedy: f64 = greedy.map(|tree| chosen.tests(tree)).sum();
        let divided = trials.pop().and_then(|trial| trial.divided);
        let best = tests.iter().copied().fold(f64::INFINITY, f64::min);
        let place = tests.iter().position(|&tests| tests <= best * (1.0 + TOLERANCE)).unwrap_or(0);
        chosen.explain(open, &tests, place);
        chosen.settle(combinations[place], divided.filter(|_| parts.is_empty()));
        Ok(Some(saved(tests[place], of_greedy)))
    }

    fn trial(
        &self,
        greedy: Option<Bvh>,
        references: f64,
        observer: &dyn Observer,
    ) -> Result<Trial<'a>, SearchError> {
        let greedy = if greedy.is_some() { greedy } else { self.greedy(observer)? };
        let divided = Bake { references, ..*self }.division(observer)?;
        Ok(Trial { bake: *self, greedy, divided })
    }

    /// Returns the boxes and the shapes of parts from all over a large scene, each a subtree of the
    /// greedy tree; nothing of a scene that is tried as a whole.
    fn parts_of(&self, greedy: &Bvh) -> Vec<(Vec<Aabb>, Option<Primitives>)> {
        if self.boxes.len() <= MOST_OBJECTS {
            return Vec::new();
        }
        let nodes = &greedy.nodes;
        let mut counts = vec![0usize; nodes.len()];
        let mut roots = Vec::new();
        // Children come after their parents.
        for (index, node) in nodes.iter().enumerate().rev() {
            let children = node.children();
            counts[index] = counts[children.clone()].iter().sum::<usize>() + node.prims().len();
            if counts[index] > PART {
                roots.extend(children.filter(|&child| (PART / 4..=PART).contains(&counts[child])));
            }
        }
        let step = roots.len().div_ceil(MOST_OBJECTS / PART).max(1);
        let part = |root: usize| {
            let mut objects = Vec::new();
            let mut open = vec![root];
            while let Some(index) = open.pop() {
                open.extend(nodes[index].children());
                objects.extend(greedy.prim_ids[nodes[index].prims()].iter().map(|&id| id as usize));
            }
            let boxes = objects.iter().map(|&object| self.boxes[object]).collect();
            (boxes, self.shapes.map(|shapes| shapes.select(&objects)))
        };
        roots.into_iter().step_by(step).map(part).collect()
    }
}

/// Searches all trials by a combination. Scenes of any size take about as much work.
fn tried_by(
    trials: &[Trial],
    combination: &Combination,
    density: Option<&RayDensity>,
    observer: &dyn Observer,
) -> Result<Vec<Baked>, SearchError> {
    let objects = trials.iter().map(|trial| trial.bake.boxes.len()).sum();
    let work = Budget::of_objects(objects).max_work.unwrap_or(0) as f64;
    let per_object = (TRIED * work).max(LEAST_TRIED.min(MOST_TRIED * work)) / objects as f64;
    let search = |Trial { bake, greedy, divided }: &Trial| {
        let work = (per_object * bake.boxes.len() as f64) as u64;
        let bake = Bake {
            objective: Some(combination.objective),
            rays: density,
            references: combination.references,
            divided: divided.as_ref(),
            budget: Budget { max_work: Some(work), ..Budget::UNLIMITED },
            ..*bake
        };
        bake.search(greedy.clone(), observer)
    };
    parallel::map(trials.iter().collect(), search).into_iter().collect()
}

impl Open<'_> {
    fn chooses_cost(&self) -> bool {
        self.cost && self.rays.is_none()
    }

    fn chooses_rays(&self) -> bool {
        self.anywhere.is_some() && self.rays.is_none()
    }
}

impl Chosen {
    fn settle(&mut self, combination: Combination, divided: Option<Bvh>) {
        self.objective = combination.objective;
        self.references = combination.references;
        self.density.take_if(|_| !combination.has_rays);
        self.divided = divided.filter(|_| combination.references > 1.0);
    }

    /// Compares each choice with its alternative, other things being equal: `tests` of the costs
    /// without divided objects, and then with them.
    fn explain(&mut self, open: &Open, tests: &[f64], place: usize) {
        let columns = if open.references { tests.len() / 2 } else { tests.len() };
        let (column, last) = (place % columns, columns - 1);
        let row = place - column;
        let mut tried = |choice, is_open, is_chosen, with: usize, without: usize| {
            if is_open {
                let saved = saved(tests[with], tests[without]);
                self.reasons.push(Reason::Tried { choice, is_chosen, saved });
            }
        };
        let before = row + last.saturating_sub(1);
        tried(Tried::Layout, open.chooses_cost(), column > 0, row + column.max(1), row);
        tried(Tried::Rays, open.chooses_rays(), column == last, row + last, before);
        let divided = (columns + column).min(tests.len() - 1);
        tried(Tried::References, open.references, row > 0, divided, column);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::scatter;
    use bvh_build::{Builder, muller_fellner};
    use bvh_core::cost;

    #[test]
    fn a_bake_chooses_8000_nodes_per_object_up_to_half_a_million_and_never_less_than_800() {
        let work = |objects| Budget::of_objects(objects).max_work.unwrap();
        let expected = [0, 8_000, 4_000_000_000, 4_000_000_000, 4_000_000_800, 8_000_000_000];
        let objects = [0, 1, 500_000, 5_000_000, 5_000_001, 10_000_000];
        assert_eq!(objects.map(work), expected);
        assert_eq!(Budget::of_objects(9).max_evaluations, None);
    }

    #[test]
    fn every_choice_is_compared_with_its_alternative_other_things_being_equal() {
        let anywhere: MadeRays = &|_, _, _| Ok(None);
        let cost = Open { cost: true, ..Open::default() };
        let of_whole = Open { anywhere: Some(anywhere), ..cost };
        let all = Open { references: true, ..of_whole };
        // Area, the layout, and the layout for rays, of whole and of divided objects.
        let tests = [100.0, 90.0, 80.0, 50.0, 40.0, 10.0];
        let ninth = 1.0 / 9.0;
        let [layout, rays, divided] = [Tried::Layout, Tried::Rays, Tried::References];
        for (open, tests, place, expected) in [
            (
                all,
                &tests[..],
                0,
                vec![(layout, false, 0.1), (rays, false, ninth), (divided, false, 0.5)],
            ),
            (
                all,
                &tests,
                1,
                vec![(layout, true, 0.1), (rays, false, ninth), (divided, false, 5.0 * ninth)],
            ),
            (all, &tests, 5, vec![(layout, true, 0.8), (rays, true, 0.75), (divided, true, 0.875)]),
            (of_whole, &tests[..3], 2, vec![(layout, true, 0.2), (rays, true, ninth)]),
            (cost, &[4.0, 5.0], 0, vec![(layout, false, -0.25)]),
        ] {
            let mut chosen = Bake::new(&[]).choose(&Open::default(), None, &()).unwrap();
            chosen.explain(&open, tests, place);
            assert_eq!(chosen.reasons.len(), expected.len());
            for (found, (choice, is_chosen, saved)) in chosen.reasons.iter().zip(expected) {
                let Reason::Tried { saved: found_saved, .. } = *found else { panic!("{found}") };
                assert!((found_saved - saved).abs() < 1e-12, "{place}: {found_saved} {saved}");
                assert_eq!(*found, Reason::Tried { choice, is_chosen, saved: found_saved });
            }
        }
    }

    #[test]
    fn without_rays_the_layout_for_random_lines_judges() {
        let boxes = scatter(50);
        let tree = muller_fellner::Config::default().build(&boxes).unwrap();
        let chosen = Bake::new(&boxes).choose(&Open::default(), None, &()).unwrap();
        let found = [chosen.tests(&tree), chosen.tests_per_ray(&tree)];
        assert_eq!(found, [cost::layout_area(&tree); 2]);
    }
}
