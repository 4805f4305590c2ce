//! What a bake decides before it searches: the file, the scene, the tree to start from, the plan.

use super::effort::Effort;
use super::{BEST, BakeArgs};
use crate::Error;
use crate::answer::Answer;
use crate::arguments::{input_file, load_scene, output_file, output_or_free, precision_of};
use crate::rays::Rays;
use bvh_core::cost::Objective;
use bvh_core::export::Target;
use bvh_core::file::Header;
use bvh_core::{Bvh, Node};
use bvh_scenes::{Precision, Scene, tree_file};
use bvh_search::{Bake, Method, Open};
use std::path::{Path, PathBuf};

/// The file to write, and all that a search needs.
pub struct Prepared {
    pub out: PathBuf,
    /// The scene, along the file's axes.
    pub scene: Scene,
    pub start: Option<Start>,
    pub plan: Plan,
}

/// A search for the best tree of any scene.
#[derive(Clone)]
pub struct Plan {
    pub method: Method,
    /// The budget, unless the bake chooses it.
    pub effort: Option<Effort>,
    pub seed: u64,
    /// The cost, unless it is the default for the rays.
    pub objective: Option<Objective>,
    /// The largest number of references per object; 1 for whole objects.
    pub references: f64,
    /// The rays whose visits replace areas.
    pub rays: Option<Rays>,
    /// The tracer of another library.
    pub tracer: Option<Target>,
    /// What the bake chooses, without rays.
    pub open: Open<'static>,
}

/// The tree of an earlier bake of the scene, from which a search continues.
pub struct Start {
    pub tree: Bvh,
    /// The work of the earlier bake, in nodes built or visited.
    pub work: u64,
}

/// Decides what the arguments ask for. Wrong ones are reported before the scene is loaded, which may
/// take long, unless only the scene shows that they are.
pub fn prepare(args: &BakeArgs, answer: &mut Answer) -> Result<Prepared, Error> {
    let out = out(args)?;
    let rays = args.rays.as_deref().map(Rays::read).transpose()?;
    let references = references(args)?;
    let precision = precision(args)?;
    let scene = load_scene(&args.scene, precision)?;
    rays.as_ref().map_or(Ok(()), |rays| rays.check(&scene))?;
    let (start, objective, rays, references) = match &args.from {
        None => (None, args.cost, rays, references),
        Some(from) => {
            let (tree, own) = tree_file::load(from, &scene)?;
            check_binary(from, &tree)?;
            let (objective, rays) = minimised(args, rays, &own, answer);
            let references = permitted(args, references, from, &own)?;
            (Some(Start { tree, work: own.work }), objective, rays, references)
        }
    };
    // The tracers of others have a cost of their own. Parts reserve no room for references.
    let is_free = args.tracer.is_none() && args.parts.is_none();
    let plan = Plan {
        method: args.method.clone(),
        effort: args.budget,
        seed: args.seed,
        objective,
        references,
        rays,
        tracer: args.tracer,
        open: Open {
            budget: args.budget.is_none(),
            cost: is_free && args.cost.is_none(),
            references: is_free && args.references.is_none(),
            ..Open::default()
        },
    };
    Ok(Prepared { out, scene, start, plan })
}

/// Returns the file to write.
fn out(args: &BakeArgs) -> Result<PathBuf, Error> {
    if let Some(from) = &args.from {
        input_file("--from", from)?;
    }
    let out = output_or_free(args.out.as_ref(), || {
        let scene = Path::new(&args.scene);
        let stem = scene.file_stem().unwrap_or(scene.as_os_str());
        // The colon of `escher:1000` is no part of a file's name everywhere.
        let stem = stem.to_string_lossy().replace(':', "-");
        PathBuf::from(stem + ".bvh")
    })?;
    output_file("--out", &out, "bvh")?;
    Ok(out)
}

/// Returns the number of references per object that is given, or the default. Rejects methods that
/// would ignore other arguments.
fn references(args: &BakeArgs) -> Result<f64, Error> {
    let is_best = matches!(args.method, Method::Best(_));
    let default = args.tracer.filter(|_| is_best).map_or(1.0, |tracer| tracer.references);
    let references = args.references.unwrap_or(default);
    Bake::check_references(references).map_err(|error| Error::Usage(format!("--{error}")))?;
    let name = args.method.name();
    let ignored = match (&args.from, references > 1.0) {
        _ if is_best => return Ok(references),
        (Some(_), _) => format!("--method {name} cannot continue --from a tree"),
        (None, true) => format!("--references {references} with --method {name}"),
        (None, false) => return Ok(references),
    };
    Err(Error::Usage(format!("{ignored}; accepted: {BEST}")))
}

/// Returns the numbers of the scene's triangles. Rejects f64 for tracers of f32, and for parts.
fn precision(args: &BakeArgs) -> Result<Precision, Error> {
    let precision = match (args.precision, &args.from) {
        (None, Some(from)) => precision_of(from)?,
        (given, _) => given.unwrap_or_default(),
    };
    let single = args.tracer.map(|tracer| format!("--for {}", tracer.name));
    match single.or(args.parts.map(|count| format!("--parts {count}"))) {
        Some(flag) if precision == Precision::Double => {
            Err(Error::Usage(format!("{flag} in double; accepted: --precision single")))
        }
        _ => Ok(precision),
    }
}

/// Rejects a tree with nodes that no search moves.
fn check_binary(from: &Path, tree: &Bvh) -> Result<(), Error> {
    let is_wide = |node: &Node| !node.is_leaf() && node.children().len() != 2;
    let Some(wide) = tree.nodes.iter().position(is_wide) else { return Ok(()) };
    let children = tree.nodes[wide].children().len();
    Err(Error::Usage(format!(
        "--from {}: inner node {wide} has {children} children; accepted: a tree of nodes with two",
        from.display()
    )))
}

/// Returns the cost and the rays that are given, or where the arguments say nothing else, those of
/// the bake of the tree of `--from`, and says so.
fn minimised(
    args: &BakeArgs,
    rays: Option<Rays>,
    own: &Header,
    answer: &mut Answer,
) -> (Option<Objective>, Option<Rays>) {
    let objective = own.objective;
    let is_open = args.tracer.is_none() && rays.is_none();
    // Trees of other programs may be for other costs.
    let is_ours = [Objective::InternalArea, Objective::Layout].contains(&objective);
    if !(is_open && is_ours && args.cost.is_none_or(|cost| cost == objective)) {
        return (args.cost, rays);
    }
    if objective == Objective::Layout && args.cost.is_none() {
        answer.line("choices", "cost: the wide layout's, as of the tree of --from".into());
    }
    if own.has_visits {
        let why = "rays: default, because the tree of --from is for rays; for others, --rays";
        answer.line("choices", why.into());
    }
    (Some(objective), own.has_visits.then_some(Rays::Default))
}

/// Returns the number of references per object that permits those of the tree of `--from`. Rejects
/// a tree with more than the arguments permit.
fn permitted(args: &BakeArgs, most: f64, from: &Path, own: &Header) -> Result<f64, Error> {
    let Header { objects, references, .. } = *own;
    if references <= objects.max((most * objects as f64) as usize) {
        return Ok(most);
    }
    if args.references.is_none() && args.tracer.is_none() {
        // No search makes all divided objects whole again.
        return Ok(Bake::references_of(references, objects));
    }
    // Rounded up, so that the message's number suffices.
    let least = (100 * references).div_ceil(objects) as f64 / 100.0;
    Err(Error::Usage(format!(
        "--from {}: the tree has {references} references to {objects} objects; accepted: \
         --references {least:.2} or more",
        from.display()
    )))
}
