//! The tuned numbers of `best` and of its annealing: one table of values, units and trade-offs.
//!
//! All were found on two virtual cores over the meshes and stand-ins, one at a time, by the commands
//! named here. Each trades cost at one budget for cost at another; none affects correctness.
//!
//! The comment behind a value is its unit: *work* is nodes created or visited; *sort times* are
//! multiples of the time that the Morton sort of the scene takes, about 25 ns per object; a
//! *fraction* is of the quantity named.

use bvh_build::ploc::Config as Clustering;

// Annealing, at equal work.
// Found by `cd attic; cargo bench --bench search -- --seconds 1,10,60 SCENE...`

/// Length of a round, after which the nodes are sorted. Shorter rounds sort too often; longer
/// rounds miss the cache.
pub(crate) const WORK_PER_ROUND: [u64; 2] = [64, 256]; // work per object, shortest and longest
/// Number of rounds of a long annealing run, within the limits above.
pub(crate) const ROUNDS: u64 = 100; // rounds
/// Maximum work reserved for the final passes to a local optimum.
pub(crate) const FINAL_PASSES_WORK: u64 = 300; // work per object
/// Maximum part of a short run that the final passes get.
pub(crate) const FINAL_PASSES_PART: u64 = 8; // divisor of the work or time of the run
/// A last round that would be shorter than half of the others is joined to the one before it.
pub(crate) const LAST_ROUND: f64 = 1.5; // rounds
/// Moves between two updates of the temperature and polls of the observer.
pub(crate) const MOVES_PER_TEMPERATURE: u64 = 64; // moves
/// Half the size of the window in which moves begin. A window eight times as large exceeds the
/// near caches, and moves on 66 000 objects take a fifth longer.
pub(crate) const WINDOW: usize = 512; // nodes
/// Enlargement of the window in short runs; small windows would not cover the tree.
pub(crate) const WINDOW_OF_SHORT_RUNS: usize = 8; // factor
/// Work below which a run is short. A move takes about 200, so 64 per object visit every node
/// about once.
pub(crate) const SHORT_RUN: f64 = 64.0; // work per object
/// Moves in one window. Fewer moves spend time on choosing windows; more moves let short runs
/// visit few windows.
pub(crate) const MOVES_PER_WINDOW: u32 = 128; // moves
/// Trees smaller than this have no windows.
pub(crate) const LEAST_WINDOWS: usize = 16; // windows
/// Subtrees with fewer objects are not annealed separately.
pub(crate) const LEAST_SUBTREE: u32 = 16; // objects
/// Maximum part of a round in which moves use the whole tree: 1/16 was worse at equal work on
/// 80 000 objects, 1/4 no better.
pub(crate) const WHOLE_TREE: f64 = 0.125; // fraction of the work of a round
/// How much more often moves on the whole tree begin at a node outside all subtrees than moves
/// on the whole tree alone would. A million objects have few such nodes.
pub(crate) const MOVES_AT_BORDERS: f64 = 1.5; // factor
/// Maximum depth below the root of a separately annealed subtree at which moves on the whole
/// tree begin.
pub(crate) const BELOW_SUBTREE_ROOTS: u8 = 6; // levels
/// Smallest subtrees of a round, relative to the largest. The size varies, so that the borders
/// move.
pub(crate) const SMALLEST_SUBTREES: f64 = 0.5; // fraction of the size

// The move of ruin and recreate.

/// Maximum number of levels from the random node up to the top of the ruined part.
pub(crate) const RUIN_LEVELS: u32 = 8; // levels
/// Maximum number of subtrees that random descents remove.
pub(crate) const RUINED_SUBTREES: u32 = 14; // subtrees
/// Part of the moves that remove a layer.
pub(crate) const LAYERS: f64 = 0.2; // fraction of the moves
/// Maximum thickness of the layer.
pub(crate) const LAYER_THICKNESS: f64 = 0.6; // fraction of the box
/// Maximum number of subtrees in a layer. A layer with more is not removed.
pub(crate) const SUBTREES_IN_A_LAYER: usize = 24; // subtrees
/// Part of the moves that search positions nearby only, in the smallest subtree above the top whose
/// box contains the top's former box. Better positions are seldom further up, and a quarter more
/// moves fit into the same work.
pub(crate) const NEARBY: f64 = 0.6; // fraction of the moves

// The cost of the wide layout.
// Found by `bvh bake SCENE --cost layout --budget 100Mwork --out FILE`

/// Factor by which a move may exceed the area that its temperature allows, before the layout
/// judges it.
pub(crate) const DEARER_BY_AREA: f64 = 10.0; // factor
/// Factor of temperatures for the cost of the layout, which is about a third of the tree's area
/// and falls by small moves.
pub(crate) const LAYOUT_HEAT: f64 = 0.05; // factor
/// Rounds of annealing between two evaluations of the layout; one takes as long as ten moves
/// per object.
pub(crate) const ROUNDS_PER_LOOK: u64 = 8; // rounds

// Split references.
// Found by `bvh bake SCENE --references 1.2 --budget 100Mwork --out FILE`

/// Ancestors whose boxes suggest planes at which to divide a leaf.
pub(crate) const LEVELS_OF_PLANES: u32 = 12; // levels
/// The saving that a division needs. Without a price, layouts end more expensive, and the
/// allowed references are spent on divisions that save almost nothing; twice the price prevents
/// divisions that pay.
pub(crate) const PRICE_OF_A_REFERENCE: f64 = 0.25; // cost of the tree per reference
/// Like `DEARER_BY_AREA`, for moves that divide or reunite.
pub(crate) const DIVISION_DEARER_BY_AREA: f64 = 2.0; // factor
/// Part of the work or time for each of the two trials that choose between whole objects and
/// spatial splits as the start.
pub(crate) const TRIAL: f64 = 0.12; // fraction
/// Part of the work spent on dividing and reuniting, between the rounds of annealing.
pub(crate) const WORK_ON_REFERENCES: f64 = 0.2; // fraction of the work of a round

// `best`, from a second on.
// Found by `cd attic; cargo bench --bench search -- --seconds 0.1,1,10,60 SCENE...`

/// The first generation if the end is not known.
pub(crate) const FIRST_GENERATION: f64 = 1500.0; // work per object
/// Length of every generation relative to the previous one, if the end is not known.
pub(crate) const GROWTH: f64 = 2.0; // factor
/// Maximum length of an annealing run if the end is known. More work is divided into equal runs.
pub(crate) const LONGEST: f64 = 100_000.0; // work per object
/// First temperature of an annealing run, by its length.
pub(crate) const HEAT: f64 = 0.02; // per 1000 nodes of work per object
/// Highest temperature.
pub(crate) const HOTTEST: f64 = 0.2; // temperature
/// Last temperature.
pub(crate) const COLD: f64 = 0.003; // temperature
/// First temperature of the short annealing runs after a long one.
pub(crate) const REHEAT: f64 = 0.07; // temperature
/// Number of short annealing runs after a long one.
pub(crate) const REHEATS: u32 = 6; // runs
/// Part of the work or time reserved for the short annealing runs.
pub(crate) const REHEATED: f64 = 0.3; // fraction
/// Minimum length of a long annealing run that short runs follow.
pub(crate) const REHEATS_FROM: f64 = 7000.0; // work per object
/// Minimum length of an annealing run whose temperatures are relative to the area of the top of a
/// move. Long runs end lower with it, short runs higher.
pub(crate) const TOP_FROM: f64 = 20_000.0; // work per object
/// Minimum gain for which the incumbent is converted and reported during an annealing run.
pub(crate) const WORTH_AN_EVENT: f64 = 1e-3; // fraction of the cost
/// Longest useful annealing run of the smallest scenes. Beyond it, two runs end lower than one.
pub(crate) const WORK_PER_PAIR: f64 = 200.0; // work per pair of objects
/// Time reserved for sorting, converting and evaluating the tree after the last move, expressed
/// as work.
pub(crate) const FINISH_WORK: f64 = 10.0; // work per object
/// Maximum of that time in short runs.
pub(crate) const FINISH_AT_MOST: f64 = 0.5; // fraction of the time left
/// Length of the run at the lowest temperature that measures the rate of work under a time
/// limit.
pub(crate) const PROBE: u64 = 4; // work per object
/// Minimum length of a time-limited search that first keeps a local optimum of reinsertion, in
/// case it is stopped early. The local optimum takes 300 to 900 work per object.
pub(crate) const SECURED_FROM: f64 = 20_000.0; // work per object
/// Work below which plain reinsertion within the same work may end lower, so that a bake makes
/// its tree, too.
pub(crate) const REINSERTED_BELOW: f64 = 300.0; // work per object
/// Minimum length for which several threads anneal disjoint subtrees. Shorter runs have too few
/// rounds to cut them.
pub(crate) const WORTH_SUBTREES: f64 = 256.0; // work per object
/// This minimum for large subtrees, whose borders hold few moves back.
pub(crate) const WORTH_LARGE_SUBTREES: f64 = 64.0; // work per object
/// Minimum size of large subtrees.
pub(crate) const LARGE_SUBTREE: u64 = 1 << 15; // objects
/// Minimum number of large subtrees for which a search without a clock anneals them separately,
/// on any number of threads. Smaller trees end slightly lower as a whole at equal work.
pub(crate) const LEAST_LARGE_SUBTREES: u32 = 8; // subtrees
/// Maximum number of subtrees.
pub(crate) const MOST_SUBTREES: u32 = 4096; // subtrees
/// Subtrees per thread; several unequal subtrees balance the threads.
pub(crate) const SUBTREES_PER_THREAD: u32 = 4; // subtrees
/// Maximum size of trees that are recombined after a cancellation. Recombination takes about a
/// microsecond per object.
pub(crate) const RECOMBINED_AT_ONCE: usize = 100_000; // objects
/// Ratio of the costs of a clustering and a top-down division below which annealing starts from
/// the clustering, although it ends lower from a division of the same cost.
pub(crate) const CLUSTERING_MUCH_CHEAPER: f64 = 0.9; // fraction
/// End of the plan where generations do not grow.
pub(crate) const MOST_GENERATIONS: u64 = 10_000; // annealing runs

// `best` within milliseconds. With 35 instead of 45 sort times, annealing gains one percent on some
// scenes and loses ten on others: its top-down initial build takes 14 to 20 sort times, 27 where
// objects are sorted quickly, and half as much again on a busy machine.
// Found by `cd attic; cargo bench --bench search -- --seconds 0.005,0.02,0.1 SCENE...`

/// Minimum work with which annealing ends lower than clustering and reinsertion.
pub(crate) const ANNEAL_FROM_WORK: u64 = 20; // work per object
/// Minimum time in which annealing ends lower, with one thread.
pub(crate) const ANNEAL_FROM_TIME: f64 = 45.0; // sort times
/// Part of this time that suffices with several threads. Two threads build top-down in
/// 0.58 of the time of one, but sort no faster.
pub(crate) const SEVERAL_THREADS: f64 = 0.65; // fraction
/// Slowdown of the sort in memory that is used for the first time.
pub(crate) const COLD_MEMORY: f64 = 2.5; // factor
/// Part of the scene on which the sort is timed a second time, in warm memory.
pub(crate) const WARM_SAMPLE: usize = 16; // divisor of the number of objects
/// Time reserved for converting and evaluating the tree after reinsertion.
pub(crate) const FINISH_TIME: f64 = 2.0; // sort times
/// The clustering that reinsertion starts from, in clusters and rounds. A better clustering takes
/// the time of more reinsertions than it saves.
pub(crate) const CLUSTERING: Clustering = Clustering { radius: 5, near_rounds: 1 };
/// Part of the nodes that the first pass reinserts, the largest first. Every further pass
/// doubles it.
pub(crate) const FIRST_PASS: f64 = 0.01; // fraction of the nodes
/// Reinsertions between two readings of the clock.
pub(crate) const MOVES_PER_READING: usize = 16; // moves
/// Number of first nodes among which the k largest are selected. Clustering creates large nodes
/// last and stores them first.
pub(crate) const FRONT: usize = 4; // multiple of k
