//! Of whole specs: what is refused and how, and what is read.

use super::*;
use crate::peers::Peer;
use std::collections::HashSet;

const GOOD: &str =
    "question = 'q'\nscenes = ['escher']\nmethods = [{ method = 'grasp', noise = 0.1 }]\n";

fn read(text: &str) -> Result<Experiment, String> {
    parse(text, &Overrides::default())
}

/// The quick variant.
fn read_quick(text: &str) -> Result<Experiment, String> {
    parse(text, &Overrides { quick: true, ..Default::default() })
}

fn parse(text: &str, overrides: &Overrides) -> Result<Experiment, String> {
    Experiment::parse("spec.toml".as_ref(), text, overrides).map_err(|error| error.to_string())
}

/// The spec is refused by a message with all these parts.
fn refused(text: &str, parts: &[&str]) {
    let message = read(text).unwrap_err();
    parts
        .iter()
        .for_each(|part| assert!(message.contains(part), "{part} in {message} for {text}"));
}

#[test]
fn wrong_keys_and_values_are_named_with_what_would_be_accepted() {
    for (wrong, parts) in [
        ("alpa = 1\n", &["spec.toml", "alpa", "expected one of", "repetitions"][..]),
        ("repetitions = 0\n", &["repetitions is 0", "1 or more"]),
        ("repetitions = 'x'\n", &["repetitions", "x", "line"]),
        ("seed = -1\n", &["seed", "-1"]),
        ("name = 'x'\n", &["name", "the file's name is used"]),
        ("objective = 'volume'\n", &["volume", "internal_area"]),
        ("budget = { seconds = 1 }\n", &["seconds", "max_evaluations"]),
        ("[[reports]]\nkind = 'pie'\n", &["pie", "table"]),
        ("rays = [{ family = 'lines', query = 'any', count = 0 }]\n", &["rays[0].count is 0"]),
        ("tracing = { rounds = 0 }\n", &["tracing.rounds is 0", "1 to 1000000"]),
        ("render = { width = 0 }\n", &["render.width is 0; accepted: 1 to 10000"]),
        ("max_seconds = 0\n", &["max_seconds is 0", "0.001 to 1000000"]),
        ("threads = 0\n", &["threads is 0", "1 to 1024"]),
        ("threads = 65535\n", &["threads is 65535", "1 to 1024"]),
        ("repetitions = 4294967295\n", &["repetitions", "4294967295 runs"]),
        ("optional_scenes = []\nscenes = ['a:0..4294967295']\n", &["scenes", "4294967296 runs"]),
        (
            "scenes = ['a:0..9999:0..99999:0..4294967295']\n",
            &["scenes", "4294967296000000000 runs"],
        ),
        ("scenes = ['a:5..4']\n", &["scenes", "a:5..4", "A up to B"]),
        ("tracing = { count = 4294967295 }\n", &["tracing.count", "1 to 100000000"]),
        ("objective = { sah = { traversal = -1.0 } }\n", &["objective.sah.traversal: -1 is not"]),
        ("rays = [{ count = nan }]\n", &["rays[0].count is nan", "finite"]),
        ("rays = [{ family = 'curves', query = 'any', count = 1 }]\n", &["curves", "inside"]),
    ] {
        let good = if wrong.contains("scenes = ['a") {
            GOOD.replace("scenes = ['escher']\n", "")
        } else {
            GOOD.into()
        };
        refused(&format!("{good}{wrong}"), parts);
    }
}

#[test]
fn nothing_that_repeats_stands_beside_a_budget_in_seconds() {
    let clocked = format!("{GOOD}sequential = true\nmax_seconds = 0.5\n");
    let of_one = GOOD.replace("noise = 0.1", "max_seconds = 2.0");
    assert!(read(&clocked).unwrap().is_by_the_clock());
    assert!(!read(GOOD).unwrap().is_by_the_clock());
    let report = "[[reports]]\nkind = 'numbers'\ntitle = 't'\nmethods = ['grasp']\n";
    for (spec, key) in [
        (format!("{clocked}{report}"), "line 6: reports is set"),
        (format!("{clocked}rays = [{{}}]\n"), "line 6: rays is set"),
        (format!("{clocked}lower_bound = 3\n"), "lower_bound is set"),
        (format!("{clocked}[ray_cost]\ncount = 10\n"), "ray_cost is set"),
        (format!("{clocked}[tracing]\ncount = 10\n"), "tracing is set"),
        (format!("{clocked}[render]\nwidth = 10\n"), "render is set"),
        (of_one, "sequential is false"),
    ] {
        let message = read(&spec).unwrap_err();
        let parts = ["spec.toml", key, "beside `max_seconds`; accepted: "];
        assert!(parts.iter().all(|part| message.contains(part)), "{spec}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    refused(&format!("{GOOD}tinybvh = 'x'\n"), &["tinybvh is set without `max_seconds`"]);
}

#[test]
fn the_lower_of_both_budgets_in_seconds_holds_and_only_for_methods_of_ours() {
    let methods = "[{ method = 'grasp', max_seconds = 0.2 }, { method = 'best', max_seconds = 9.0 }, \
                   { method = 'external', command = ['x'] }]";
    let spec = format!(
        "question = 'q'\nscenes = ['escher']\nsequential = true\nmax_seconds = 1.0\nmethods = {methods}\n"
    );
    let spec = read(&spec).unwrap();
    let limits: Vec<_> = spec
        .methods
        .iter()
        .map(|method| spec.max_seconds_of(method))
        .collect();
    assert_eq!(limits, [Some(0.2), Some(1.0), None]);
}

#[test]
fn finite_nonsense_in_reports_is_named_with_what_would_be_accepted() {
    let common = "source = 's'\ntitle = 't'\n";
    for (kind, wrong, parts) in [
        ("significance", "level = -0.5", &["reports[0].level is -0.5", "above 0 and below 1"][..]),
        ("significance", "level = 1", &["reports[0].level is 1", "above 0 and below 1"]),
        ("trials", "best_of = 0", &["reports[0].best_of is 0", "1 or more"]),
        ("ray_tests", "tolerance = -0.1", &["reports[0].tolerance is -0.1", "0 to 1"]),
        (
            "ray_tests",
            "paper = { escher = [1, 2] }",
            &["reports[0].paper.escher is a list of 2", "up to 1"],
        ),
        ("times", "paper = { escher = [0.0] }", &["reports[0].paper.escher[0] is 0", "above 0"]),
        ("ecdf", "targets = []", &["reports[0].targets is empty", "one or more"]),
        (
            "ecdf",
            "targets = [{ of = 'base', percent = -100 }]",
            &["targets[0].percent is -100", "above -100"],
        ),
        (
            "anytime",
            "at_seconds = [1, 10, 2]",
            &["reports[0].at_seconds is [1.0, 10.0, 2.0]", "ascending"],
        ),
        ("anytime", "at_seconds = [0]", &["reports[0].at_seconds[0] is 0", "above 0"]),
        ("anytime", "file = '../../x'", &["reports[0].file is \"../../x\"", "letters, digits"]),
        ("generations", "paper_gain = 0", &["reports[0].paper_gain is 0", "above 0"]),
        (
            "generations",
            "paper_final = { e = [3, 2] }",
            &["paper_final.e is [3.0, 2.0]", "the lower number first"],
        ),
        (
            "pictures",
            "document = { 'brute force' = -1 }",
            &["document.brute force is -1", "above 0"],
        ),
        ("pareto", "methods = []", &["reports[0].methods is empty", "one or more"]),
    ] {
        let keys = match kind {
            "significance" => "title = 't'\nmethod = 'grasp'\nagainst = ['grasp']\n".to_owned(),
            "generations" => format!("{common}method = 'grasp'\nbaseline = 'grasp'\n"),
            "pictures" => format!("{common}methods = ['grasp']\nscene = 'escher'\n"),
            _ if wrong.starts_with("methods") => common.to_owned(),
            _ => format!("{common}methods = ['grasp']\n"),
        };
        refused(&format!("{GOOD}[[reports]]\nkind = '{kind}'\n{keys}{wrong}\n"), parts);
    }
}

#[test]
fn nonsense_beside_reports_is_named_with_what_would_be_accepted() {
    let view = "[{ eye = [0, 0, 0], target = [1, 1, 1] }]";
    let lights = |count| {
        format!(
            "cameras.escher = {{ same = {view}, other = {view}, lights = {:?} }}",
            vec![[1; 3]; count]
        )
    };
    let suite = |measure: &str| format!("question = 'q'\n[suite]\n{measure}\n");
    for (text, parts) in [
        (
            suite(
                "stability = { builders = 'few', work_per_object = 1, rays = 9223372036854775807 }",
            ),
            &["suite.stability.rays", "1 to 100000000"][..],
        ),
        (
            suite("precision = { objects = 2, repetitions = 1 }"),
            &["suite.precision.objects is 2", "3 to"],
        ),
        (
            format!("{GOOD}[ray_cost]\ntrained = 200_000"),
            &["ray_cost.trained is 200000", "up to 174762", "6 rays"],
        ),
        (
            format!("{GOOD}[ray_cost]\ntrained = 100_000\n{}", lights(9)),
            &["ray_cost.trained is 100000", "up to 95325", "11 rays"],
        ),
    ] {
        refused(&text, parts);
    }
}

#[test]
fn wrong_methods_are_named_with_what_would_be_accepted() {
    for (methods, parts) in [
        ("[]", &["methods is empty"][..]),
        ("[{ noise = 0.1 }]", &["method is missing", "grasp"]),
        ("[{ method = 'grep' }]", &["\"grep\"", "muller_fellner"]),
        ("[{ method = 'obvhs', preset = 'best' }]", &["methods[0].preset", "best", "very_slow"]),
        ("[{ method = 'grasp', alpa = 1 }]", &["methods[0]", "alpa", "noise"]),
        ("[{ method = 'grasp', noise = 1.5 }]", &["methods[0].noise is 1.5", "0 to 1"]),
        ("[{ method = 'grasp', label = 3 }]", &["methods[0].label", "3", "string"]),
        ("[{ method = 'grasp', budget = { max_seconds = 3 } }]", &["max_seconds", "max_work"]),
        (
            "[{ method = 'grasp', judge = { count = 0 } }]",
            &["methods[0].judge.count is 0", "1 or more"],
        ),
        (
            "[{ method = 'best', judge = { count = 9 } }]",
            &["methods[0].judge is set for best", "genetic"],
        ),
        (
            "[{ method = 'best', for_rays = 'camera' }]",
            &["methods[0].for_rays is set without `ray_cost`"],
        ),
        (
            "[{ method = 'median_cut', for_rays = 'inside' }]",
            &["methods[0].for_rays", "median_cut, which compares"],
        ),
        (
            "[{ method = 'best', for_rays = 'camera' }]\n[ray_cost]\n[tracing]\nlayouts = ['wide_dear_blocks']",
            &[
                "methods[0].for_rays is set beside `tracing.layouts` with another cost of blocks",
                "other layouts",
            ],
        ),
        (
            "[{ method = 'obvhs', for_rays = 'inside' }]",
            &["methods[0].for_rays is set for obvhs", "of ours"],
        ),
        ("[{ method = 'best', for_rays = 'all' }]", &["methods[0].for_rays", "all", "default"]),
        ("[{ method = 'grasp' }, { method = 'grasp' }]", &["methods[1].label", "second time"]),
    ] {
        refused(&format!("question = 'q'\nscenes = ['escher']\nmethods = {methods}\n"), parts);
    }
}

#[test]
fn another_library_is_accepted_exactly_with_its_feature() {
    for name in Peer::NAMES {
        let text =
            format!("question = 'q'\nscenes = ['escher']\nmethods = [{{ method = '{name}' }}]\n");
        let Contestant::Peer(peer) = toml::from_str::<Experiment>(&text)
            .unwrap()
            .methods
            .remove(0)
            .method
        else {
            panic!("{name} is no library");
        };
        let read = read(&text);
        match peer.missing_feature() {
            Some(feature) => {
                refused(
                    &text,
                    &["methods[0].method", name, "--features", feature, "muller_fellner"],
                );
            }
            None => assert!(read.is_ok(), "{read:?}"),
        }
    }
}

#[test]
fn quick_takes_no_infinity_either() {
    let text = format!("{GOOD}[quick]\nobjective = {{ sah = {{ traversal = inf }} }}\n");
    let error = read_quick(&text).unwrap_err().to_string();
    assert!(error.contains("quick.objective.sah.traversal is inf"), "{error}");
}

#[test]
fn quick_replaces_keys_and_names_its_results_apart() {
    let text = format!("{GOOD}repetitions = 5\n[quick]\nrepetitions = 2\n");
    let quick = read_quick(&text).unwrap();
    assert_eq!((quick.repetitions, quick.folder()), (2, "quick/spec".into()));
    assert_eq!(read(&text).unwrap().repetitions, 5);
}

#[test]
fn a_resolved_spec_spells_out_every_default_and_reads_back_as_itself() {
    let good = GOOD.replace("0.1 }", "0.1, budget = { max_work = 9 } }");
    let experiment = read(&good).unwrap();
    let text = toml::to_string(&experiment).unwrap();
    assert!(text.contains("trials = 100") && text.contains("skip_same_order = true"), "{text}");
    assert_eq!(toml::from_str::<Experiment>(&text).unwrap(), experiment);
}

#[test]
fn of_two_limits_the_lower_one_counts() {
    let good = GOOD.replace("0.1 }", "0.1, budget = { max_work = 9 } }");
    let budget = |of_all: &str| {
        let experiment = read(&format!("{good}budget = {of_all}\n")).unwrap();
        experiment.budget_of(&experiment.methods[0])
    };
    let max_evaluations = Some(3);
    let max_work = Some(5);
    assert_eq!(budget("{ max_work = 5 }"), Budget { max_work, max_evaluations: None });
    assert_eq!(budget("{ max_evaluations = 3 }"), Budget { max_evaluations, max_work: Some(9) });
}

#[test]
fn seeds_differ_between_runs_and_follow_the_spec_alone() {
    let experiment = read(GOOD).unwrap();
    let mut seeds: Vec<u64> = (0..100)
        .map(|repetition| experiment.seed_of("escher", "grasp", repetition))
        .collect();
    seeds.push(experiment.seed_of("bijou", "grasp", 0));
    let distinct: HashSet<_> = seeds.iter().collect();
    assert_eq!(distinct.len(), seeds.len());
    assert_eq!(seeds[0], read(GOOD).unwrap().seed_of("escher", "grasp", 0));
}

#[test]
fn naming_a_wrong_key_among_thousands_of_methods_takes_no_time() {
    let methods = "[[methods]]\nmethod = 'grasp'\nlabel = 'NUMBER'\n";
    let many: String = (0..3000)
        .map(|number| methods.replace("NUMBER", &number.to_string()))
        .collect();
    let text = format!(
        "question = 'q'\nscenes = ['escher']\n{}",
        many.replacen("'2900'", "'2900'\nnoise = 'x'", 1)
    );
    let start = std::time::Instant::now();
    let message = read(&text).unwrap_err();
    assert!(message.contains("methods[2900].noise"), "{message}");
    assert!(start.elapsed().as_secs_f64() < 1.0, "{:?}", start.elapsed());
}

#[test]
fn all_errors_of_a_file_are_said_at_once_in_its_order_and_once_each() {
    let text = "\
question = ' '
scenes = ['escher', 3]
repetitions = 0
sedd = 1
seed = 1979-05-27
budget = { max_work = 'x', max_wrok = 1 }
rays = [{ count = 0, query = 'any' }, { family = 'curves', count = nan }]
methods = [
    { method = 'grasp', noise = 2.0, trials = 0, trails = 1, label = 3 },
    { method = 'grep', noise = 2.0, label = 'a' },
    7,
    { method = 'annealing', label = 'a', hot = -1, cold = 0.2, move = { climb = 0 }, judge = { count = 0 }, for_rays = 'camera' },
    { method = 'best', work_per_object = 'x', label = 'c' },
    { method = 'best', label = 'd', references = 99.0, keep = ['nothing'] },
]
[[reports]]
kind = 'ecdf'
titel = 't'
methods = ['a', 'b', 'e']
targets = [{ of = 'bse', percent = 'x' }, { of = 'base', percent = -100 }]
[[reports]]
kind = 'pie'
[[reports]]
kind = 'anytime'
methods = []
at_seconds = [1, -1]
file = '../x'
";
    let message = read(text).unwrap_err();
    let key = |line: &str| {
        let (place, rest) = line
            .split_once("spec.toml: ")?
            .1
            .split_once(": ")?;
        Some(format!("{} {}", place.strip_prefix("line ")?, rest.split([' ', ':']).next()?))
    };
    let said: Vec<String> = message
        .lines()
        .map(|line| key(line).unwrap_or_else(|| line.into()))
        .collect();
    let expected = [
        "1 question",
        "2 scenes[1]",
        "3 repetitions",
        "4 sedd",
        "5 seed",
        "6 budget.max_work",
        "6 budget.max_wrok",
        "7 rays[0].count",
        "7 rays[1].family",
        "7 rays[1].count",
        "9 methods[0].noise",
        "9 methods[0].trials",
        "9 methods[0].trails",
        "9 methods[0].label",
        "10 methods[1].method",
        "11 methods[2]",
        "12 methods[3].label",
        "12 methods[3].hot",
        "12 methods[3].move.climb",
        "12 methods[3].judge",
        "12 methods[3].judge.count",
        "12 methods[3].for_rays",
        "13 methods[4].work_per_object",
        "14 methods[5].references",
        "14 methods[5].keep[0]",
        "18 reports[0].titel",
        "20 reports[0].targets[0].of",
        "20 reports[0].targets[0].percent",
        "20 reports[0].targets[1].percent",
        "22 reports[1].kind",
        "25 reports[2].methods",
        "26 reports[2].at_seconds",
        "26 reports[2].at_seconds[1]",
        "27 reports[2].file",
    ];
    assert_eq!(said, expected, "{message}");
    // Labels that can be told are.
    let labels = "question = 'q'\nscenes = ['escher']\n[[methods]]\nmethod = 'grep'\n[[methods]]\nmethod = 'grasp'\n\
                  [[methods]]\nmethod = 'grasp'\n[[reports]]\nkind = 'numbers'\nmethods = ['grep', 'grasp', 'a', 'b']\n";
    let message = read(labels).unwrap_err();
    let said: Vec<String> = message.lines().filter_map(key).collect();
    assert_eq!(
        said,
        [
            "4 methods[0].method",
            "7 methods[2].label",
            "11 reports[0].methods[2]",
            "11 reports[0].methods[3]"
        ]
    );
}

#[test]
fn a_search_that_would_go_on_for_hours_is_refused_unless_the_spec_says_when_it_ends() {
    let spec = |rest: &str, of_best: &str| {
        let methods = format!("methods = [{{ method = 'grasp' }}, {{ method = 'best'{of_best} }}]");
        read(&format!("question = 'q'\nscenes = ['escher']\n{rest}\n{methods}\n"))
    };
    let message = spec("", "").unwrap_err();
    let parts = [
        "line 4: methods[1].budget is missing",
        "budget = { max_work = ",
        "max_seconds = ",
        "work_per_object",
    ];
    assert!(
        parts.iter().all(|part| message.contains(part)) && message.lines().count() == 1,
        "{message}"
    );
    for (rest, of_best) in [
        ("budget = { max_work = 9 }", ""),
        ("sequential = true\nmax_seconds = 9.0", ""),
        ("", ", budget = { max_evaluations = 9 }"),
        ("sequential = true", ", max_seconds = 9.0"),
        ("", ", work_per_object = 10_000"),
    ] {
        assert_eq!(spec(rest, of_best).err(), None, "{rest}{of_best}");
    }
}

#[test]
fn quick_is_refused_where_nothing_says_what_it_is() {
    let text = "question = 'q'\nscenes = ['escher']\n[[methods]]\nmethod = 'median_cut'\n";
    let message = read_quick(text).unwrap_err();
    assert!(message.contains("quick is missing") && message.contains("--quick"), "{message}");
}

#[test]
fn scenes_of_a_spec_are_found_from_its_folder_and_those_of_the_command_line_are_not() {
    let text = "question = 'q'\nscenes = ['escher:random:9:1..2', 'a/b:random:9:1', '/c.obj', 'd.ply']\n[[methods]]\nmethod = 'median_cut'\n";
    let scenes = |overrides: &Overrides| {
        Experiment::parse("x/y/spec.toml".as_ref(), text, overrides)
            .unwrap()
            .scenes
    };
    assert_eq!(
        scenes(&Overrides::default()),
        ["escher:random:9:1..2", "x/y/a/b:random:9:1", "/c.obj", "x/y/d.ply"]
    );
    let given = Overrides { scenes: vec!["a/b.obj".into()], ..Default::default() };
    assert_eq!(scenes(&given), ["a/b.obj"]);
}
