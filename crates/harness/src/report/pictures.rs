//! The second document's table: one picture by brute force, by a KD-tree and by trees; tests, and apart from them
//! seconds.

use super::data::middle;
use super::prelude::*;
use crate::measure::picture::BASELINES;
use crate::rows::RenderRow;
use bvh_config::above;
use std::collections::BTreeMap;

bvh_config::config! { serde;
    /// A comparison of structures by the picture of each scene.
    pub struct Config {
        /// Where the document has it.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods; brute force and the KD-tree come before them.
        methods: Vec<String>, in OneOrMore;
        /// The document's scene.
        scene: String;
        /// The document's seconds for it, by label.
        document: BTreeMap<String, f64>, in above(0.0);
    }
}

/// One structure on one scene, as written to `pictures.csv`: the run of median tests.
#[derive(Serialize, JsonSchema)]
pub(super) struct Tests<'a> {
    scene: &'a str,
    method: &'a str,
    objects: usize,
    /// Number of rays: through pixels, to lights, and mirrored.
    rays: u64,
    boxes_per_ray: f64,
    objects_per_ray: f64,
    /// Both together.
    tests_per_ray: f64,
    /// How many times fewer tests than brute force.
    brute_force_over_tests: f64,
    /// Whether the picture is that of brute force, bit by bit.
    same_picture: bool,
}

/// The same, as written to `timing_pictures.csv`: the fastest run.
#[derive(Serialize, JsonSchema)]
pub(super) struct Times<'a> {
    scene: &'a str,
    method: &'a str,
    build_seconds: f64,
    /// Wall time of drawing on one thread.
    render_seconds: f64,
    /// Million rays per second.
    million_rays_per_second: f64,
    /// Brute force's seconds over these.
    speed_up: f64,
    /// The document's seconds, where it has some.
    document_seconds: Option<f64>,
    /// Its speed-up over brute force.
    document_speed_up: Option<f64>,
}

const BRUTE_FORCE: &str = BASELINES[0].0;
const DOCUMENT: &str = "the document's";

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let pictures = || {
            scenes.iter().flat_map(|scene| {
                self.structures()
                    .map(move |method| (*scene, method))
            })
        };
        let tests: Vec<Tests> = pictures()
            .filter_map(|(scene, method)| self.tests(rows, scene, method))
            .collect();
        let times: Vec<Times> = tests
            .iter()
            .map(|row| self.times(rows, row.scene, row.method, row.rays))
            .collect();
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("pictures", &tests)?;
        output.add_csv("timing_pictures", &times)?;
        let caption = "Mean number of tests over all rays of one picture: through pixels, to lights, and mirrored. The \
                       picture is the same, bit by bit, whatever it is made with.";
        let panels = scenes
            .iter()
            .map(|scene| draw_tests(rows, scene, &tests))
            .collect();
        output.add_figure("pictures", caption, 3, panels);
        let caption = "Seconds of brute force over seconds, one thread, each the least of several.";
        let panels = scenes
            .iter()
            .map(|scene| draw_times(rows, scene, &times))
            .collect();
        output.add_figure("timing_pictures", caption, 3, panels);
        output.set_reference(DOCUMENT);
        let columns = "scene method boxes_per_ray objects_per_ray brute_force_over_tests";
        output.show("Tests per ray:", &tests, columns)?;
        let columns = "scene method render_seconds speed_up document_seconds document_speed_up";
        output.show("Seconds of one picture on one thread:", &times, columns)?;
        output.reading = reading(&tests, &times);
        Ok(output)
    }

    /// The labels of all that is compared, in order.
    fn structures(&self) -> impl Iterator<Item = &str> {
        BASELINES
            .iter()
            .map(|(label, _)| *label)
            .chain(self.methods.iter().map(String::as_str))
    }

    fn tests<'a>(&self, rows: &Rows, scene: &'a str, method: &'a str) -> Option<Tests<'a>> {
        let brute = middle_picture(rows, scene, BRUTE_FORCE)?;
        let own = middle_picture(rows, scene, method)?;
        Some(Tests {
            scene,
            method,
            objects: own.objects,
            rays: own.rays,
            boxes_per_ray: own.boxes_per_ray,
            objects_per_ray: own.objects_per_ray,
            tests_per_ray: tests_per_ray(own),
            brute_force_over_tests: tests_per_ray(brute) / tests_per_ray(own),
            same_picture: own.picture == brute.picture && own.rays == brute.rays,
        })
    }

    fn times<'a>(&self, rows: &Rows, scene: &'a str, method: &'a str, rays: u64) -> Times<'a> {
        let (build_seconds, render_seconds) = seconds(rows, scene, method);
        Times {
            scene,
            method,
            build_seconds,
            render_seconds,
            million_rays_per_second: rays as f64 * 1e-6 / render_seconds,
            speed_up: seconds(rows, scene, BRUTE_FORCE).1 / render_seconds,
            document_seconds: self.document_seconds(scene, method),
            document_speed_up: self.document_speed_up(scene, method),
        }
    }

    fn document_seconds(&self, scene: &str, method: &str) -> Option<f64> {
        self.document
            .get(method)
            .filter(|_| scene == self.scene)
            .copied()
    }

    fn document_speed_up(&self, scene: &str, method: &str) -> Option<f64> {
        Some(self.document_seconds(scene, BRUTE_FORCE)? / self.document_seconds(scene, method)?)
    }
}

fn tests_per_ray(row: &RenderRow) -> f64 {
    row.boxes_per_ray + row.objects_per_ray
}

/// Of a structure's pictures of a scene, the one of median tests, the lower of two.
fn middle_picture<'a>(rows: &'a Rows, scene: &str, method: &str) -> Option<&'a RenderRow> {
    let own = rows
        .renders
        .iter()
        .filter(|row| row.scene == scene && row.method == method);
    middle(own.collect(), tests_per_ray)
}

/// Seconds to build and to draw, of the repetition that drew fastest.
fn seconds(rows: &Rows, scene: &str, method: &str) -> (f64, f64) {
    let own = rows
        .render_times
        .iter()
        .filter(|row| row.scene == scene && row.method == method);
    let fastest = own.min_by(|a, b| a.render_seconds.total_cmp(&b.render_seconds));
    fastest.map_or((f64::NAN, f64::NAN), |row| (row.build_seconds, row.render_seconds))
}

fn draw_tests(rows: &Rows, scene: &str, tests: &[Tests]) -> Panel {
    let own: Vec<&Tests> = tests
        .iter()
        .filter(|row| row.scene == scene)
        .collect();
    let bars = |name: &str, value: fn(&Tests) -> f64| {
        let values = own.iter().map(|row| value(row)).collect();
        Layer::bars(name, values, 0.1)
    };
    let layers = vec![
        bars("boxes or cells", |row| row.boxes_per_ray),
        bars("objects", |row| row.objects_per_ray),
    ];
    let x = Axis::categories(
        "",
        own.iter()
            .map(|row| row.method.to_owned())
            .collect(),
    );
    panel(rows.shown(scene), x, Axis::log("tests per ray").starting_at(0.1), layers)
}

fn draw_times(rows: &Rows, scene: &str, times: &[Times]) -> Panel {
    let own: Vec<&Times> = times
        .iter()
        .filter(|row| row.scene == scene)
        .collect();
    let theirs = own
        .iter()
        .enumerate()
        .filter_map(|(at, row)| Some((at as f64, row.document_speed_up?)));
    let values = own.iter().map(|row| row.speed_up).collect();
    let layers = vec![
        Layer::bars("ours", values, 1.0),
        Layer::new(DOCUMENT, Marks::Points(theirs.collect())),
    ];
    let x = Axis::categories(
        "",
        own.iter()
            .map(|row| row.method.to_owned())
            .collect(),
    );
    panel(rows.shown(scene), x, Axis::log("speed-up over brute force"), layers)
}

/// The fastest structure of every scene, and whether all have drawn the same picture.
fn reading(tests: &[Tests], times: &[Times]) -> String {
    let fastest = times
        .chunk_by(|a, b| a.scene == b.scene)
        .filter_map(|scene| {
            let best = scene
                .iter()
                .max_by(|a, b| a.speed_up.total_cmp(&b.speed_up))?;
            Some(format!(
                "{}: {}, {:.1} times faster than brute force",
                best.scene, best.method, best.speed_up
            ))
        });
    let same = match tests.iter().find(|row| !row.same_picture) {
        Some(row) => {
            format!("{}: {} gives ANOTHER PICTURE than brute force", row.scene, row.method)
        }
        None => "All structures give the same picture of a scene, bit by bit".into(),
    };
    format!("{}. {same}.", fastest.collect::<Vec<_>>().join("; "))
}
