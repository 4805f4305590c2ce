//! Whole specs: the errors of wrong ones, and the values of good ones.

use super::*;

const GOOD: &str =
    "question = 'q'\nscenes = ['escher']\nmethods = [{ method = 'grasp', noise = 0.1 }]\n";

fn read(text: &str) -> Result<Experiment, String> {
    parse(text, &Overrides::default())
}

/// Reads the quick variant.
fn read_quick(text: &str) -> Result<Experiment, String> {
    parse(text, &Overrides { quick: true, ..Default::default() })
}

fn parse(text: &str, overrides: &Overrides) -> Result<Experiment, String> {
    Experiment::parse("spec.toml".as_ref(), text, overrides).map_err(|error| error.to_string())
}

/// Asserts that a spec is rejected by a message with all these parts.
fn assert_rejected(text: &str, parts: &[&str]) {
    let message = read(text).unwrap_err();
    for part in parts {
        assert!(message.contains(part), "{part} in {message} for {text}");
    }
}

/// Lines to add to [`GOOD`], and the parts of the error.
///
/// The test `wrong_values` tries wrong values under every key and demands that each message names
/// the key and the accepted values; a test below tries a file with many errors. These cases are
/// relations between keys, and places within one.
const WRONG_LINES: &[(&str, &[&str])] = &[
    ("name = 'x'", &["name", "the file's name is used"]),
    ("[tracing]\ncount = 9", &["tracing is set, which needs `cargo run", "attic/Cargo.toml"]),
    ("repetitions = 4294967295", &["repetitions", "4294967295 runs"]),
    ("objective = { sah = { traversal = -1.0 } }", &["objective.sah.traversal: -1 is not"]),
    ("[ray_cost]\ntrained = 200_000", &["ray_cost.trained is 200000", "up to 174762", "6 rays"]),
    // More lights leave fewer rays to train on.
    (
        "[ray_cost]\ntrained = 100_000\ncameras.e = { same = [{ eye = [0, 0, 0], target = [1, 1, 1] }], \
         other = [{ eye = [1, 1, 1], target = [0, 0, 0] }], lights = [[1, 1, 1], [1, 1, 2], [1, 1, 3], \
         [1, 1, 4], [1, 1, 5], [1, 1, 6], [1, 1, 7], [1, 1, 8], [1, 1, 9]] }",
        &["ray_cost.trained is 100000", "up to 95325", "11 rays"],
    ),
    (
        "[[reports]]\nkind = 'anytime'\nmethods = ['grasp']\nfile = '../../x'",
        &["reports[0].file is \"../../x\"", "letters, digits"],
    ),
    // Found before hours of runs, not after them.
    (
        "[[reports]]\nkind = 'query'\nfile = 'x'\nby = ['scene']\nrows = 'table.csv'\n\
         [[reports]]\nkind = 'table'\ncolumns = [{ method = 'grasp' }]",
        &["reports[0].rows is \"table.csv\"", "no report before", "runs.csv, "],
    ),
    (
        "[[reports]]\nkind = 'gaps'\nmethods = ['grasp']\noptimum = 'grasp'\n\
         [[reports]]\nkind = 'query'\nfile = 'x'\nby = ['scene']\nrows = 'gaps.csv'\njoin = 'gap.csv'",
        &["reports[1].join is \"gap.csv\"", ", gaps.csv"],
    ),
    (
        "[[reports]]\nkind = 'trials'\nmethods = ['grasp']\n\
         [[reports]]\nkind = 'trials'\nmethods = ['grasp']",
        &["reports[1].kind is a second trials.csv", "one report that makes it"],
    ),
];

/// The methods of a spec, and the parts of the error.
const WRONG_METHODS: &[(&str, &[&str])] = &[
    ("[{ noise = 0.1 }]", &["method is missing", "grasp"]),
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
        "[{ method = 'obvhs', for_rays = 'inside' }]",
        &["methods[0].for_rays is set for obvhs", "of ours"],
    ),
    ("[{ method = 'obvhs', frame = 'auto' }]", &["methods[0].frame is set for obvhs", "of ours"]),
    (
        "[{ method = 'best', frame = 'auto', references = 1.2 }]",
        &["scenes, frame is turned scenes", "`rays` to measure"],
    ),
    (
        "[{ method = 'bvh' }]",
        &["methods[0].method is \"bvh\"", "attic/Cargo.toml --`", "median_cut"],
    ),
];

/// Replacements in [`GOOD`], and the parts of the error.
const WRONG_PARTS: &[(&str, &str, &[&str])] = &[
    ("escher", "a:0..9999:0..99999:0..4294967295", &["scenes", "4294967296000000000 runs"]),
    ("escher", "a:5..4", &["scenes", "a:5..4", "A up to B"]),
    (
        "}]",
        "},\n{ method = 'grasp' }]",
        &["line 4: methods[1].label is \"grasp\" for the second time", "unique labels"],
    ),
    (
        "}]",
        "}]\n[[reports]]\nkind = 'numbers'\nmethods = ['grasp', 'a']",
        &["line 6: reports[0].methods[1] is \"a\"", "accepted: grasp"],
    ),
    (
        "}]",
        "}]\n[[reports]]\nkind = 'numbers'\nmethods = ['grasp']\nfigure = { x = 'runs', y = 'cost_median', \
         lines = [{ name = 'all', methods = ['graps'] }] }",
        &["reports[0].figure.lines[0].methods[0] is \"graps\"", "accepted: grasp"],
    ),
];

#[test]
fn errors_name_wrong_keys_and_the_accepted_values() {
    for (line, parts) in WRONG_LINES {
        assert_rejected(&format!("{GOOD}{line}\n"), parts);
    }
    for (methods, parts) in WRONG_METHODS {
        let text = format!("question = 'q'\nscenes = ['escher']\nmethods = {methods}\n");
        assert_rejected(&text, parts);
    }
    for (from, to, parts) in WRONG_PARTS {
        assert_rejected(&GOOD.replace(from, to), parts);
    }
}

#[test]
fn quick_replaces_keys_and_has_a_separate_folder() {
    let text = format!("{GOOD}repetitions = 5\n[quick]\nrepetitions = 2\n");
    let quick = read_quick(&text).unwrap();
    assert_eq!((quick.repetitions, quick.folder()), (2, "quick/spec".into()));
    assert_eq!(read(&text).unwrap().repetitions, 5);
    let infinite = text.replace("repetitions = 2", "objective = { sah = { traversal = inf } }");
    for (text, part) in [
        (&*infinite, "quick.objective.sah.traversal is inf"),
        (GOOD, "quick is missing; accepted: with --quick"),
    ] {
        let error = read_quick(text).unwrap_err();
        assert!(error.contains(part), "{error}");
    }
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
fn the_lower_of_two_budgets_applies() {
    let good = GOOD.replace("0.1 }", "0.1, budget = { max_work = 9 } }");
    for (common, max_evaluations, max_work) in
        [("max_work = 5", None, Some(5)), ("max_evaluations = 3", Some(3), Some(9))]
    {
        let experiment = read(&format!("{good}budget = {{ {common} }}\n")).unwrap();
        let budget = experiment.budget_of(&experiment.methods[0]);
        assert_eq!(budget, Budget { max_evaluations, max_work });
    }
}

#[test]
fn a_search_without_a_limit_is_rejected() {
    let endless = "question = 'q'\nscenes = ['escher']\nREST\n\
                   methods = [{ method = 'grasp' }, { method = 'best'KEYS }]\n";
    let parts =
        ["line 4: methods[1].budget is missing", "budget = { max_work = ", "work_per_object"];
    let text = endless.replace("REST", "").replace("KEYS", "");
    assert_rejected(&text, &parts);
    assert_eq!(read(&text).unwrap_err().lines().count(), 1);
    for (rest, keys) in [
        ("budget = { max_work = 9 }", ""),
        ("", ", budget = { max_evaluations = 9 }"),
        ("", ", work_per_object = 10_000"),
    ] {
        let text = endless.replace("REST", rest).replace("KEYS", keys);
        assert_eq!(read(&text).err(), None, "{text}");
    }
}

#[test]
fn scenes_of_a_spec_are_relative_to_its_folder_and_scenes_of_the_command_line_are_not() {
    let text = "
question = 'q'
scenes = ['escher:random:9:1..2', 'a/b:random:9:1', '/c.obj', 'd.ply']
methods = [{ method = 'median_cut' }]";
    let of_spec = ["escher:random:9:1..2", "x/y/a/b:random:9:1", "/c.obj", "x/y/d.ply"];
    let given = Overrides { scenes: vec!["a/b.obj".into()], ..Default::default() };
    for (overrides, scenes) in [(Overrides::default(), &of_spec[..]), (given, &["a/b.obj"])] {
        let experiment = Experiment::parse("x/y/spec.toml".as_ref(), text, &overrides).unwrap();
        assert_eq!(experiment.scenes, scenes);
    }
}
