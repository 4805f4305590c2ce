//! The tuned numbers of `best` and of the annealing below it: one table of values, units, and what each trades.
//!
//! Numbers that a spec can set are declared with their units and ranges by [`best::Config`](crate::best::Config) and
//! [`Ruin`](crate::ruin_recreate::Ruin). All were found on two virtual cores over the meshes and stand-ins, one at a time,
//! by the commands named here; each trades cost at one budget for cost at another, and none changes what is correct.
//!
//! Units: *work* is nodes created or visited; *sort times* are multiples of the time that the Morton sort of the scene
//! takes, about 25 ns per object; a *fraction* is of the quantity named.

use bvh_build::ploc::Config as Clustering;

/// One constant per entry; the documentation says what it trades, its unit, and the command that found it.
macro_rules! tuned {
    ($command:literal { $($(#[doc = $trade:literal])+ $name:ident: $type:ty = $value:expr, $unit:literal;)* }) => { $(
        $(#[doc = $trade])+
        #[doc = ""]
        #[doc = concat!("Unit: ", $unit, ". Found by `", $command, "`.")]
        pub(crate) const $name: $type = $value;
    )* };
}

// Annealing, at equal work.
tuned! { "cargo bench -p harness --bench search -- --seconds 1,10,60 SCENE..." {
    /// Length of a round, after which the nodes are sorted: shorter ones sort too often, longer ones miss the cache.
    WORK_PER_ROUND: [u64; 2] = [64, 256], "work per object, shortest and longest";
    /// Rounds into which a long annealing run is divided, within those limits.
    ROUNDS: u64 = 100, "rounds";
    /// Work that is kept for the final passes to a local optimum, at most.
    FINAL_PASSES_WORK: u64 = 300, "work per object";
    /// Part of the run that the final passes get at most, where the run is short.
    FINAL_PASSES_PART: u64 = 8, "divisor of the work or time of the run";
    /// A last round that would be shorter than half of the others is joined to the one before it.
    LAST_ROUND: f64 = 1.5, "rounds";
    /// Moves between two updates of the temperature and polls of the observer.
    MOVES_PER_TEMPERATURE: u64 = 64, "moves";
    /// Half the size of the window in which moves begin. Eight times as large a one stays in no near cache: moves on
    /// 66 000 objects then take a fifth longer.
    WINDOW: usize = 512, "nodes";
    /// Enlargement of the window in short runs, which would otherwise not cover the tree.
    WINDOW_OF_SHORT_RUNS: usize = 8, "factor";
    /// Work below which a run is short: about 200 per move, so that 64 per object visit every node once.
    SHORT_RUN: f64 = 64.0, "work per object";
    /// Moves in one window: with fewer, cutting windows takes time; with more, short runs visit few of them.
    MOVES_PER_WINDOW: u32 = 128, "moves";
    /// Trees smaller than this have no windows.
    LEAST_WINDOWS: usize = 16, "windows";
    /// Subtrees with fewer objects are not annealed on their own.
    LEAST_SUBTREE: u32 = 16, "objects";
    /// Part of a round in which moves have the whole tree: 1/16 was worse at equal work, 1/4 no better.
    WHOLE_TREE: f64 = 0.125, "fraction of the work of a round";
    /// Moves on the whole tree begin at most so far below the roots of subtrees that were annealed on their own.
    BELOW_SUBTREE_ROOTS: u8 = 6, "levels";
    /// Smallest subtrees of a round, relative to the largest: varied, so that different subtrees are at the borders.
    SMALLEST_SUBTREES: f64 = 0.5, "fraction of the size";
}}

// The cost of the wide layout.
tuned! { "bvh bake SCENE --cost layout --budget 100Mwork --out FILE" {
    /// How much more a move may add to the area than a temperature would allow, before the layout judges it.
    DEARER_BY_AREA: f64 = 10.0, "factor";
    /// Temperatures for the cost of the layout, which is about a third of the tree's area and falls by small moves.
    LAYOUT_HEAT: f64 = 0.05, "factor";
    /// Rounds of annealing between two looks at the cost of the layout, which take as long as ten moves per object.
    ROUNDS_PER_LOOK: u64 = 8, "rounds";
}}

// Split references.
tuned! { "bvh bake SCENE --references 1.2 --budget 100Mwork --out FILE" {
    /// Ancestors whose boxes suggest planes at which to divide a leaf.
    LEVELS_OF_PLANES: u32 = 12, "levels";
    /// What a division has to save. Without a price, layouts cost more in the end, and leave is spent on divisions that save next to
    /// nothing; twice as high, it forbids some that pay.
    PRICE_OF_A_REFERENCE: f64 = 0.25, "cost of the tree per reference";
    /// As `DEARER_BY_AREA`, for moves that divide or reunite.
    DIVISION_DEARER_BY_AREA: f64 = 2.0, "factor";
    /// Part of the work or time for each of the trials that decide between whole objects and spatial splits as the start.
    TRIAL: f64 = 0.12, "fraction";
    /// Part of the work that goes into dividing and reuniting, between the rounds of annealing.
    WORK_ON_REFERENCES: f64 = 0.2, "fraction of the work of a round";
}}

// `best`, from a second on.
tuned! { "cargo bench -p harness --bench search -- --seconds 0.1,1,10,60 --threads 1,2 SCENE..." {
    /// Gain for which the incumbent is converted and reported before the end of an annealing run.
    WORTH_AN_EVENT: f64 = 1e-3, "fraction of the cost";
    /// Longest useful annealing run of the smallest scenes: above it, two runs end lower than one.
    WORK_PER_PAIR: f64 = 200.0, "work per pair of objects";
    /// Time kept for what follows the last move, expressed as work: the tree is sorted, converted and valued.
    FINISH_WORK: f64 = 10.0, "work per object";
    /// Limit of that time in short runs.
    FINISH_AT_MOST: f64 = 0.5, "fraction of the time left";
    /// Length of the run at the lowest temperature that measures the rate of work under a clock.
    PROBE: u64 = 4, "work per object";
    /// Length under a clock from which on a local optimum of reinsertion is kept before the first annealing run, for searches that
    /// are stopped early: it takes 300 to 900 work per object.
    SECURED_FROM: f64 = 20_000.0, "work per object";
    /// Length from which on several threads anneal disjoint subtrees: shorter runs have too few rounds to cut them.
    WORTH_SUBTREES: f64 = 256.0, "work per object";
    /// Subtrees per thread, so that unequal ones fill the threads.
    SUBTREES_PER_THREAD: usize = 4, "subtrees";
    /// Size up to which trees are recombined after a cancellation: it takes about a microsecond per object.
    RECOMBINED_AT_ONCE: usize = 100_000, "objects";
    /// Cost of a clustering over that of a top-down division below which annealing begins with the clustering, although it ends lower
    /// from a division of the same cost.
    CLUSTERING_MUCH_CHEAPER: f64 = 0.9, "fraction";
    /// End of the plan where generations do not grow.
    MOST_GENERATIONS: u64 = 10_000, "annealing runs";
}}

// `best` within milliseconds. With 35 in place of 45 sort times, annealing gains one percent on some scenes and loses ten
// on others: the top-down build that it begins with takes 14 to 20 sort times, 27 where objects are sorted quickly, and
// half as much again on a disturbed machine.
tuned! { "cargo bench -p harness --bench peers --features peers -- SCENE..." {
    /// Work from which on annealing ends lower than clustering and reinsertion.
    ANNEAL_FROM_WORK: u64 = 20, "work per object";
    /// Time from which on annealing ends lower, with one thread.
    ANNEAL_FROM_TIME: f64 = 45.0, "sort times";
    /// Time from which on both a clustering and a top-down build are tried, with one thread: the latter is better on
    /// smooth surfaces.
    TWO_STARTS_FROM_TIME: f64 = 28.0, "sort times";
    /// Part of these two times that is enough with several threads: two build top-down in 0.58 of the time of one, but do
    /// not sort any faster.
    SEVERAL_THREADS: f64 = 0.65, "fraction";
    /// How much longer the sort takes in memory that is used for the first time.
    COLD_MEMORY: f64 = 2.5, "factor";
    /// Part of the scene on which the sort is timed once more, in warm memory.
    WARM_SAMPLE: usize = 16, "divisor of the number of objects";
    /// Time kept for what follows reinsertion: the tree is put in order and valued.
    FINISH_TIME: f64 = 0.75, "sort times";
    /// Fastest builds by the time they need: with less than this, no reinsertion.
    BUILDS: [(f64, Clustering); 4] = [
        (2.5, Clustering { radius: 1, near_rounds: 0 }),
        (2.75, Clustering { radius: 2, near_rounds: 0 }),
        (3.0, Clustering { radius: 4, near_rounds: 2 }),
        (3.5, CLUSTERING),
    ], "sort times";
    /// The clustering that reinsertion starts from: a better one takes the time of more reinsertions than it saves.
    CLUSTERING: Clustering = Clustering { radius: 5, near_rounds: 1 }, "clusters, rounds";
    /// Samples of the scene on which both builds are compared.
    SAMPLES: usize = 8, "stretches of the Morton curve";
    /// Size of all samples together.
    SAMPLED_PART: usize = 8, "divisor of the number of objects";
    /// Smaller scenes are not sampled: both builds are tried.
    SAMPLED_FROM: usize = 2048, "objects";
    /// Ratio on the samples below which the top-down build is also better on the whole: on smooth surfaces it is 0.92 to
    /// 0.97, elsewhere 0.98 to 1.10.
    TOP_DOWN_BELOW: f64 = 0.975, "cost over that of clustering";
    /// First part of the nodes to be reinserted, the largest; every further pass takes twice as many.
    FIRST_PASS: f64 = 0.01, "fraction of the nodes";
    /// Reinsertions between two readings of the clock.
    MOVES_PER_READING: usize = 16, "moves";
    /// The k largest nodes are looked for among the first nodes only: clustering makes large nodes last, and stores them
    /// first.
    FRONT: usize = 4, "multiple of k";
}}
