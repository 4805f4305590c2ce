use super::*;
use crate::rows::{TraceRow, TraceTimeRow};
use harness::rows::{FILES, Row};

fn speed(scene: &str, library: &str, mode: &str, million_per_s: f64) -> Speed {
    let row = PeerRayRow {
        scene: scene.into(),
        processor: "P".into(),
        instructions: "AVX2".into(),
        library: library.into(),
        version: "1".into(),
        mode: mode.into(),
        rays: "primary".into(),
        million_per_s,
        build_seconds: million_per_s,
        disagreements: 1,
    };
    Speed { row, turns: vec![million_per_s, million_per_s / 2.0] }
}

#[test]
fn no_report_of_a_spec_may_replace_the_rows_of_traversals() {
    for file in [TraceRow::FILE, TraceTimeRow::FILE] {
        assert!(FILES.contains(&file), "{file}");
    }
}

#[test]
fn means_are_over_all_scenes_and_disagreements_add_up() {
    let measured = [
        speed("a", OURS, "wide", 2.0),
        speed("a", "embree", "high", 1.0),
        speed("b", OURS, "wide", 8.0),
        speed("b", "embree", "high", 4.0),
        speed("b", "embree", "robust", 4.0),
    ];
    let rows = rows(&measured);
    let means: Vec<_> = rows
        .iter()
        .filter(|row| row.scene == MEAN)
        .map(|row| (row.library.as_str(), row.million_per_s, row.build_seconds, row.disagreements))
        .collect();
    assert_eq!(rows.len(), 5 + 2, "a mode that not all scenes have has no mean: {means:?}");
    assert_eq!((means[0].0, means[1].0), (OURS, "embree"));
    assert!((means[0].1 - 4.0).abs() < 1e-12 && (means[1].1 - 2.0).abs() < 1e-12);
    assert_eq!((means[0].2, means[0].3), (5.0, 2));
}

#[test]
fn ratios_are_to_the_fastest_rival_of_each_scene_and_kind() {
    let measured = [
        speed("a", OURS, "wide", 2.0),
        speed("a", "embree", "high, coherent packets", 4.0),
        speed("a", "embree", "high robust", 1.0),
        speed("b", OURS, "wide", 9.0),
        speed("b", "embree", "high robust", 1.0),
        speed("b", "tinybvh", "BVH8 splits", 4.5),
        speed("b", "tinybvh", "BVH8", 3.0),
    ];
    let ratios = ratios(&measured);
    let of = |against: &str| -> Vec<(&str, f64)> {
        let of = ratios.iter().filter(|row| row.against == against);
        of.map(|row| (row.scene.as_str(), row.ratio)).collect()
    };
    assert_eq!(of("any mode"), [("a", 0.5), ("b", 2.0), (MEAN, 1.0)]);
    assert_eq!(of("single calls")[..2], [("a", 2.0), ("b", 2.0)]);
    assert_eq!(of("whole triangles")[..2], [("a", 2.0), ("b", 3.0)]);
    assert_eq!(of("robust")[..2], [("a", 2.0), ("b", 9.0)]);
    assert_eq!(of("robust")[2].1, to_six_decimals(18f64.sqrt()));
    assert_eq!(
        (ratios[0].fastest.as_str(), ratios[0].processor.as_str()),
        ("embree high, coherent packets", "P, AVX2")
    );
    assert_eq!((ratios[2].carried_by.as_str(), ratios[2].ratio_without), ("b", Some(0.5)));
    let slower = RayRatioRow { mode: "other".into(), ratio: 0.4, ..ratios[2].clone() };
    let text = text(&[vec![slower], ratios].concat());
    assert!(
        text.contains("P, AVX2, primary: 1.00 (wide), least 0.50 on a"),
        "of our fastest mode: {text}"
    );
}

#[test]
fn ours_are_compared_with_the_same_instruction_set_and_with_code_that_has_none() {
    let held_to = |instructions: &str, mut speed: Speed| {
        speed.row.instructions = instructions.into();
        speed
    };
    let measured = [
        speed("a", OURS, "wide", 2.0),
        held_to("AVX-512", speed("a", "embree", "high", 8.0)),
        held_to(COMPILED, speed("a", "obvhs", "binary", 4.0)),
        held_to(COMPILED, speed("a", OURS, "binary", 4.0)),
    ];
    let any: Vec<f64> = ratios(&measured)
        .iter()
        .filter(|row| row.scene == "a" && row.against == "any mode")
        .map(|row| row.ratio)
        .collect();
    assert_eq!(any, [0.5]);
}

#[test]
fn turns_are_compared_one_by_one() {
    let mut own = speed("a", OURS, "wide", 3.0);
    own.turns = vec![1.0, 3.0, 2.0];
    let mut rival = speed("a", "embree", "high", 2.0);
    rival.turns = vec![2.0, 1.0, 2.0];
    let scene = ratios(&[own, rival])[0].clone();
    assert_eq!((scene.ratio, scene.least_turn, scene.greatest_turn), (1.5, 0.5, 3.0));
}

#[test]
fn a_contender_that_answers_wrongly_has_no_speed() {
    let shown = |missed_hits| {
        let traced = Traced {
            answers: TraceRow { count: 1000, missed_hits, ..TraceRow::default() },
            times: TraceTimeRow { count: 1000, seconds: 1.0, ..TraceTimeRow::default() },
            instructions: String::new(),
            version: String::new(),
            turns: vec![1.0],
        };
        speeds(&[Raced { library: "L".into(), search_seconds: 0.0, traced: &traced }]).len()
    };
    assert_eq!((shown(10), shown(11)), (1, 0));
}
