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

/// Replacements in [`GOOD`], or lines to add to it, and the part of the error. The test `wrong_values`
/// tries wrong values under every key; these are relations between keys, and places within one.
const WRONG: &[(&str, &str, &str)] = &[
    ("", "name = 'x'", "name is x; accepted: none, the file's name is used"),
    ("", "[tracing]\ncount = 9", "tracing is set, which needs `cargo run"),
    ("", "repetitions = 4294967295", "4294967295 runs"),
    ("", "[ray_cost]\ntrained = 200_000", "ray_cost.trained is 200000; accepted: up to 174762"),
    ("escher", "a:0..9999:0..99999:0..4294967295", "4294967296000000000 runs"),
    ("escher", "a:5..4", "scenes is \"a:5..4\"; accepted: A..B with A up to B"),
    ("escher'", "escher:turn:9']\nrender = { width = 9 }#", "scenes, frame is turned scenes"),
    (
        "}]",
        "},\n{ method = 'grasp' }]",
        "line 4: methods[1].label is \"grasp\" for the second time",
    ),
    ("0.1", "0.1, for_rays = 'camera'", "methods[0].for_rays is set without `ray_cost`"),
    ("grasp', noise = 0.1", "obvhs', frame = 'auto'", "methods[0].frame is set for obvhs"),
    ("grasp', noise = 0.1", "best', judge = { count = 9 }", "methods[0].judge is set for best"),
    ("grasp', noise = 0.1", "best'", "line 3: methods[0].budget is missing for best"),
    ("grasp', noise = 0.1", "bvh'", "methods[0].method is \"bvh\", another library"),
    (
        "",
        "[[reports]]\nkind = 'anytime'\nmethods = ['grasp', 'a']",
        "line 6: reports[0].methods[1] is \"a\", no label of a method; accepted: grasp",
    ),
    (
        "",
        "[[reports]]\nkind = 'query'\nfile = 'x'\nby = ['scene']\nrows = 'table.csv'",
        "reports[0].rows is \"table.csv\", which no run and no report before this one writes",
    ),
    (
        "",
        "[[reports]]\nkind = 'trials'\nmethods = ['grasp']\n\
         [[reports]]\nkind = 'trials'\nmethods = ['grasp']",
        "reports[1].kind is a second trials.csv",
    ),
];

#[test]
fn keys_that_contradict_each_other_are_named_with_what_would_be_accepted() {
    for (from, to, part) in WRONG {
        let text = if from.is_empty() { format!("{GOOD}{to}\n") } else { GOOD.replace(from, to) };
        let message = read(&text).unwrap_err();
        assert!(message.contains(part) && message.contains("accepted"), "{part} in {message}");
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
fn a_search_that_ends_by_a_budget_or_by_its_work_is_accepted() {
    for end in ["budget = { max_evaluations = 9 }", "work_per_object = 10_000"] {
        let text = GOOD.replace("grasp', noise = 0.1", &format!("best', {end}"));
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
