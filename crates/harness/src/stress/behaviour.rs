//! What the cases ask that is not a scene to be built: rays that are none, files, budgets, threads, edges of
//! parameters.

use super::examine::{ROUNDING, check_outcome, check_scale, run};
use super::{Verdict, is_builder, scenes, tracing};
use crate::measure::{Query, empirical_cost, rays::Family};
use crate::run::rows::RayRow;
use crate::scenes::obj;
use crate::scenes::{Primitives, Scene};
use bvh_build::{Builder, goldsmith_salmon, muller_fellner};
use bvh_core::{Aabb, Ray, Shear, Triangle, cost, file, validate};
use bvh_search::grasp::{self, Candidates};
use bvh_search::{Budget, Event, Method, Observer, Problem, annealing, genetic, solve};
use glam::Vec3;
use std::path::Path;
use std::time::{Duration, Instant};

/// `Ok` if `holds`, else what is wrong.
fn require(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

fn boxes(n: usize) -> Vec<Aabb> {
    scenes::boxes(&scenes::uniform(n))
}

/// S15: directions and origins that are none are refused, before any traversal.
pub fn no_such_rays() -> Verdict {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let mut refused = 0;
    for bad in [Vec3::ZERO, -Vec3::ZERO, Vec3::NAN, Vec3::X * nan, Vec3::Y * inf, Vec3::new(1.0, -inf, 0.0)] {
        require(Ray::half_line(Vec3::ZERO, bad).is_err(), || format!("direction {bad} is accepted"))?;
        refused += 1;
    }
    for bad in [Vec3::NAN, Vec3::new(0.0, inf, 0.0), Vec3::new(0.0, 0.0, nan)] {
        require(Ray::half_line(bad, Vec3::X).is_err(), || format!("origin {bad} is accepted"))?;
        refused += 1;
    }
    Ok(format!("{refused} refused"))
}

/// S16: an empty range hits nothing, an infinite one is the longest finite one, a single point hits what is there.
pub fn ranges_are_defined() -> Verdict {
    let triangle = Primitives::Triangles(vec![[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    let origin = Vec3::new(0.25, 0.25, -2.0);
    for (t_min, t_max, expected) in [
        (0.0, f32::INFINITY, true),
        (2.0, 2.0, true),
        (1.0, 1.0, false),
        (2.0, 1.0, false),
        (0.0, 2f32.next_down(), false),
        (2f32.next_up(), f32::INFINITY, false),
        (f32::INFINITY, f32::INFINITY, false),
    ] {
        let ray = Ray::new(origin, Vec3::Z, t_min, t_max).map_err(|error| error.to_string())?;
        for (name, traversal) in tracing::TRAVERSALS {
            for accelerator in traversal(&triangle)? {
                let (nearest, any) =
                    (accelerator.nearest_hit(&ray, &mut ()), accelerator.any_hit(&ray, &mut ()));
                let agree = nearest.is_some() == expected && any == expected;
                require(agree, || format!("{name}: range {t_min}..={t_max} gives {nearest:?} and {any}"))?;
            }
        }
    }
    for (t_min, t_max) in [(f32::NAN, 1.0), (0.0, f32::NAN), (-1.0, 1.0)] {
        let refused = Ray::new(origin, Vec3::Z, t_min, t_max).is_err();
        require(refused, || format!("range {t_min}..={t_max} is accepted"))?;
    }
    Ok(String::new())
}

/// S17: degenerate triangles are never hit, and counted by the reader.
pub fn degenerate_are_counted() -> Verdict {
    let triangles = scenes::degenerate(60);
    let degenerate = triangles.iter().filter(|triangle| triangle.is_degenerate()).count();
    require(degenerate == 30, || format!("{degenerate} of 60 are degenerate"))?;
    for ray in tracing::rays(&triangles, 2000, 17) {
        let shear = Shear::new(&ray);
        let hit = triangles.iter().find(|t| t.is_degenerate() && t.intersect(&shear, f32::MAX).is_some());
        require(hit.is_none(), || format!("{ray:?} hits {hit:?}"))?;
    }
    let mesh = read(&to_obj(&triangles))?;
    require((mesh.triangles.len(), mesh.degenerate_triangles) == (60, 30), || {
        format!("the reader counts {} of {}", mesh.degenerate_triangles, mesh.triangles.len())
    })?;
    Ok(format!("{degenerate} kept, none hit"))
}

fn to_obj(triangles: &[Triangle]) -> String {
    let corner = |p: &Vec3| format!("v {} {} {}\n", p.x, p.y, p.z);
    let triangle = |t: &Triangle| t.0.iter().map(corner).collect::<String>() + "f -3 -2 -1\n";
    triangles.iter().map(triangle).collect()
}

fn read(text: &str) -> Result<obj::Mesh, String> {
    obj::parse(text.as_bytes(), Path::new("scene.obj")).map_err(|error| error.to_string())
}

/// Refused in that line.
fn refused_in_line(text: &str, line: usize) -> Verdict {
    match read(text) {
        Err(message) if message.contains(&format!("scene.obj:{line}: ")) => Ok(message),
        Err(message) => Err(format!("the error names no line {line}: {message}")),
        Ok(_) => Err("the file is accepted".into()),
    }
}

/// S18: text `nan` is refused by its line.
pub fn nan_in_a_file() -> Verdict {
    refused_in_line("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", 2)
}

/// S19: infinities likewise, however they are written.
pub fn infinity_in_a_file() -> Verdict {
    refused_in_line("v 0 0 0\nv 1 0 0\nv 0 -inf 0\nf 1 2 3\n", 3)?;
    refused_in_line("v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 1)
}

/// S35: unused vertices do not count, relative indices and polygons are resolved, files without faces are refused.
pub fn files_as_people_write_them() -> Verdict {
    let mesh = read("v 9e9 0 0\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n")?;
    let bounds =
        Primitives::Triangles(mesh.triangles.clone()).boxes().iter().fold(Aabb::EMPTY, |a, b| a.union(b));
    require((mesh.triangles.len(), mesh.unused_vertices) == (2, 1), || format!("{mesh:?}"))?;
    require(bounds == Aabb::from(([0.0; 3], [1.0, 1.0, 0.0])), || {
        format!("an unused vertex counts: {bounds:?}")
    })?;
    require(read("v 0 0 0\nv 1 0 0\n").is_err(), || "a file without faces is accepted".into())?;
    refused_in_line("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", 4)?;
    refused_in_line("v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 4\n", 2)
}

/// Five scenes for P5: uniform, flat, a line, many ties, and very different sizes; coordinates between 2^-5 and 2^5.
pub fn scaled_scenes(n: usize) -> [Vec<Aabb>; 5] {
    let flat = |b: &Aabb| Aabb { min: b.min * Vec3::new(1.0, 1.0, 0.0), max: b.max * Vec3::new(1.0, 1.0, 0.0) };
    let line = |b: &Aabb| Aabb { min: b.min * Vec3::Y, max: b.max * Vec3::Y };
    let sized =
        |(i, b): (usize, &Aabb)| Aabb { min: b.min, max: b.min + b.extent().as_vec3() / (1 + i % 9) as f32 };
    let uniform = boxes(n);
    [
        uniform.iter().map(flat).collect(),
        uniform.iter().map(line).collect(),
        scenes::boxes(&scenes::planar_grid(n)),
        uniform.iter().enumerate().map(sized).collect(),
        uniform,
    ]
}

/// S21: every k from -120 to 120 on five scenes.
pub fn scales(method: &Method) -> Verdict {
    let n = if let Method::Exact(_) = method { 7 } else { 24 };
    const WORK: u64 = 60;
    for (scene, boxes) in scaled_scenes(n).iter().enumerate() {
        let outcome = run(method, boxes, WORK)?;
        for k in -120..=120 {
            check_scale(method, boxes, WORK, &outcome, k).map_err(|error| format!("scene {scene}: {error}"))?;
        }
    }
    Ok("241 scales of 5 scenes".into())
}

/// S37: threads 1, 2, 3 and 8, three seeds.
pub fn threads_and_seeds(method: &Method) -> Verdict {
    let boxes = boxes(if let Method::Exact(_) = method { 10 } else { 120 });
    for seed in [1, 2, 1 << 40] {
        let on = |threads| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
            let budget = Budget { max_evaluations: None, max_work: Some(20_000) };
            let solved = pool.install(|| solve(method, &Problem::new(&boxes), seed, budget, &()));
            solved.map_err(|error| error.to_string())
        };
        let one = on(1)?;
        for threads in [1, 2, 3, 8] {
            let other = on(threads)?;
            let same = (&one.tree, &one.history) == (&other.tree, &other.history);
            require(same, || format!("P4: seed {seed}: another outcome on {threads} threads"))?;
        }
    }
    Ok("4 numbers of threads, 3 seeds".into())
}

/// Cancels at once, or at a time.
struct Deadline(Option<Instant>);

impl Observer for Deadline {
    fn event(&self, _: &Event) {}

    fn cancelled(&self) -> bool {
        self.0.is_none_or(|end| Instant::now() >= end)
    }
}

/// S39: a budget of nothing, cancelled at once and after a millisecond: the best so far, which is a tree.
pub fn budgets_end(method: &Method) -> Verdict {
    let boxes = boxes(if let Method::Exact(_) = method { 10 } else { 200 });
    let nothing = Budget { max_evaluations: Some(0), max_work: Some(0) };
    let one = Budget { max_evaluations: Some(1), max_work: None };
    let soon = Deadline(Some(Instant::now() + Duration::from_millis(1)));
    let free = Budget::default();
    let watchers: [(Budget, &dyn Observer); 4] =
        [(nothing, &()), (one, &()), (free, &Deadline(None)), (free, &soon)];
    for (budget, observer) in watchers {
        let outcome =
            solve(method, &Problem::new(&boxes), 1, budget, observer).map_err(|error| error.to_string())?;
        check_outcome(&boxes, &outcome)?;
    }
    Ok(String::new())
}

/// S40: populations of one and two, mutation and crossover never and always: permutations stay permutations, and the
/// best is never lost.
pub fn genetic_edges(_: &Method) -> Verdict {
    let boxes = boxes(30);
    for (population, mutation, crossover) in (0..8).map(|i| (1 + i % 2, (i / 2 % 2) as f64, (i / 4) as f64)) {
        let config = genetic::Config { population, generations: 40, mutation, crossover, ..Default::default() };
        let solved = solve(&config, &Problem::new(&boxes), 3, Budget::default(), &());
        let outcome = solved.map_err(|error| error.to_string())?;
        // The tree is valid only if its order was a permutation.
        check_outcome(&boxes, &outcome)?;
        let incumbents: Vec<f64> = outcome.history.iter().map(|event| event.incumbent).collect();
        require(incumbents.is_sorted_by(|a, b| a >= b), || "the best was lost".into())?;
        require(incumbents.last() == Some(&outcome.cost), || "the best was not returned".into())?;
    }
    // Cuts fall on both ends when there are two places only.
    let config =
        genetic::Config { population: 2, generations: 40, crossover: 1.0, mutation: 1.0, ..Default::default() };
    for n in 0..3 {
        let solved = solve(&config, &Problem::new(&boxes[..n]), 3, Budget::default(), &());
        check_outcome(&boxes[..n], &solved.map_err(|error| error.to_string())?)?;
    }
    Ok("8 settings, scenes of 0, 1, 2 and 30".into())
}

/// S41: without noise, and with one candidate, GRASP is greedy, bit by bit; more candidates than there are do no harm.
pub fn grasp_edges(_: &Method) -> Verdict {
    let boxes = boxes(150);
    let greedy = muller_fellner::Config::default().build(&boxes).map_err(|error| error.to_string())?;
    for (candidates, noise, equal) in [
        (Candidates::AxisBest, Some(0.0), true),
        (Candidates::KBest(5), Some(0.0), true),
        (Candidates::Within(0.1), Some(0.0), true),
        (Candidates::KBest(1), None, true),
        (Candidates::KBest(1), Some(1.0), true),
        (Candidates::Within(0.0), None, true),
        (Candidates::KBest(100_000), None, false),
    ] {
        let config = grasp::Config { trials: 3, candidates, noise, ..Default::default() };
        let solved = solve(&config, &Problem::new(&boxes), 5, Budget::default(), &());
        let outcome = solved.map_err(|error| error.to_string())?;
        check_outcome(&boxes, &outcome)?;
        require(!equal || outcome.tree == greedy, || format!("{candidates:?}, noise {noise:?} is not greedy"))?;
    }
    Ok(String::new())
}

/// S42: after a million random moves the cost is that of the tree, which is what every move had been judged by. That
/// the area kept move by move equals the recomputed one is a unit test beside the private type that keeps it.
pub fn a_million_moves(_: &Method) -> Verdict {
    const MOVES: u64 = 1_000_000;
    let boxes = boxes(60);
    let config = annealing::Config::default();
    let budget = Budget { max_evaluations: Some(MOVES), max_work: None };
    let outcome = solve(&config, &Problem::new(&boxes), 42, budget, &()).map_err(|error| error.to_string())?;
    let error = check_outcome(&boxes, &outcome)?;
    Ok(format!("{} moves, off by {error:.0e}", outcome.evaluations))
}

/// S42: the cost that insertion keeps is the recomputed one.
pub fn insertion_keeps_its_cost() -> Verdict {
    let mut largest: f64 = 0.0;
    for make in [scenes::uniform, scenes::slivers, scenes::two_densities, scenes::enormous, scenes::denormal] {
        let boxes = scenes::boxes(&make(2000));
        let scene = goldsmith_salmon::Scene::new(&boxes).map_err(|error| error.to_string())?;
        let (mut workspace, mut tree) = (goldsmith_salmon::Workspace::default(), Default::default());
        let order: Vec<u32> = (0..boxes.len() as u32).collect();
        let config = goldsmith_salmon::Config::default();
        let kept = config.insert_all(&scene, &order, &mut workspace).map_err(|error| error.to_string())?;
        workspace.write(&mut tree);
        let recomputed = cost::goldsmith_salmon(&tree);
        largest = largest.max((kept - recomputed).abs() / recomputed);
    }
    require(largest <= ROUNDING, || format!("off by {largest:e}"))?;
    Ok(format!("off by {largest:.0e} at most"))
}

/// S43: no method is below the exact optimum of small scenes; the largest gap.
pub fn above_the_optimum(method: &Method) -> Verdict {
    let exact = bvh_search::exact::Config::default();
    let mut largest: f64 = 0.0;
    for make in
        [scenes::uniform, scenes::overlapping, scenes::slivers, scenes::planar_grid, scenes::two_densities]
    {
        for n in [3, 7, 10] {
            let boxes = scenes::boxes(&make(n));
            let optimum = solve(&exact, &Problem::new(&boxes), 1, Budget::default(), &());
            let optimum = optimum.map_err(|error| error.to_string())?.cost;
            let outcome = run(method, &boxes, 2000)?;
            check_outcome(&boxes, &outcome)?;
            if outcome.tree.nodes.iter().any(|node| node.children().len() > 2) {
                return Ok("wide nodes: another class of trees".into());
            }
            let gap = outcome.cost / optimum - 1.0;
            require(gap >= -ROUNDING, || format!("{} is below the optimum {optimum}", outcome.cost))?;
            largest = largest.max(gap);
        }
    }
    require(is_builder(method) || largest < 1.0, || format!("a search with a gap of {largest}"))?;
    Ok(format!("gap up to {:.2} %", 100.0 * largest.max(0.0)))
}

/// S44: four times the rays halve the standard error, and the 95 % intervals cover what many more rays find.
pub fn estimates_converge() -> Verdict {
    let triangles = scenes::uniform(500);
    let primitives = Primitives::Triangles(triangles.iter().map(|t| t.0).collect());
    let scene = Scene { name: "uniform".into(), kind: "procedural", boxes: primitives.boxes(), primitives };
    let tree = muller_fellner::Config::default().build(&scene.boxes).map_err(|error| error.to_string())?;
    validate(&tree, &scene.boxes).map_err(|error| error.to_string())?;
    let measure = |count, seed| {
        let config = empirical_cost::Config { family: Family::Inside, query: Query::Any, count };
        empirical_cost::measure(&config, &scene, &tree, seed, RayRow::default())
    };
    const FEWEST: u64 = 2000;
    let truth = measure(1 << 18, 0).boxes_per_ray;
    const SEEDS: u64 = 60;
    let mut covered = 0;
    let mut errors = [0.0; 3];
    for seed in 1..=SEEDS {
        let row = measure(FEWEST, seed);
        covered += u64::from((row.boxes_low..=row.boxes_high).contains(&truth));
        if seed <= 5 {
            for (factor, error) in [1, 4, 16].into_iter().zip(&mut errors) {
                *error += measure(FEWEST * factor, seed).boxes_standard_error;
            }
        }
    }
    let ratios = [errors[0] / errors[1], errors[1] / errors[2]];
    require(ratios.iter().all(|ratio| (ratio - 2.0).abs() < 0.15), || {
        format!("standard errors fall by {ratios:?}")
    })?;
    // Fewer than 51 of 60 would happen once in a thousand times.
    require(covered >= 51, || format!("{covered} of {SEEDS} intervals cover {truth}"))?;
    Ok(format!("{covered} of {SEEDS} intervals cover"))
}

/// S38: a tree file with any bit flipped, cut at any length, of another version or endianness, or of another scene is
/// refused.
pub fn damaged_tree_files() -> Verdict {
    let boxes = boxes(12);
    let say = |error: &dyn std::error::Error| error.to_string();
    let tree = muller_fellner::Config::default().build(&boxes).map_err(|error| say(&error))?;
    let whole = file::save(&tree, &boxes, &file::Origin::default()).map_err(|error| say(&error))?;
    require(file::load(&whole, &boxes).ok() == Some(tree), || {
        "an undamaged file is not the tree saved".into()
    })?;
    for bit in 0..8 * whole.len() {
        let mut damaged = whole.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        require(file::load(&damaged, &boxes).is_err(), || format!("bit {bit} can be flipped"))?;
    }
    for length in 0..whole.len() {
        require(file::load(&whole[..length], &boxes).is_err(), || format!("{length} bytes are enough"))?;
    }
    let reversed: Vec<u8> = whole.chunks(4).flat_map(|word| word.iter().rev()).copied().collect();
    require(file::load(&reversed, &boxes).is_err(), || "another endianness is accepted".into())?;
    let mut others = boxes.clone();
    others[3].max.x = others[3].max.x.next_up();
    require(file::load(&whole, &others).is_err(), || "the tree of another scene is accepted".into())?;
    Ok(format!("{} damages refused", 9 * whole.len() + 2))
}
