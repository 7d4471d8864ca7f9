//! Scenes that are right, scenes that are wrong, and scenes at random.

use std::collections::BTreeSet;

use mpm::{
    Basis, DruckerPragerParameters, Friction, Numerics, Scheme, Transfer, WallContact, Walls,
};
use proptest::prelude::*;
use rstest::rstest;

use super::*;

/// The shortest scene.
const SHORT: &str =
    "duration = 3.0\n[domain]\nsize = [10.0, 10.0]\n[[column]]\nsize = [3.0, 3.0]\n";

/// Every key of the schema but the material parameters, none at its default.
const FULL: &str = r#"
title = "Everything"
seed = 7
gravity = [1.0, -9.0]
duration = 0.4
step = 2.0e-4
frame_interval = 0.02
[domain]
size = [8.0, 6.0]
cell = 0.25
points_per_cell = 4
point_layout = "square"
walls = { left = "stick", right = 0.3, bottom = "slip", top = 0.1 }
[[column]]
corner = [0.0, 0.0]
size = [2.0, 1.0]
velocity = [1.0, 0.0]
[[column]]
corner = [0.5, 1.0]
size = [1.0, 1.0]
[[column]]
corner = [0.5, 3.0]
size = [1.0, 1.0]
[[obstacle]]
corner = [4.0, 0.0]
size = [0.5, 0.5]
faces = { left = 0.1, right = 0.2, bottom = "stick", top = "slip" }
[plate]
corner = [5.0, 2.0]
size = [1.0, 0.25]
velocity = [0.0, -0.1]
start = 0.2
faces = { bottom = "stick" }
[material]
kind = "mu-i"
packings = 3
precision = "f64"
initial_stress = "none"
[mu-i]
static_friction = 0.3
[numerics]
basis = "gimp"
scheme = "usf"
transfer = "flip"
relaxation = 2.0
wall_contact = "points"
cell_average = true
density_correction = 5.0
shock_width = 3.0
[output]
fields = ["stress", "velocity"]
grains_every = 5
[output.grid]
width = 0.02
spacing = 0.01
"#;

fn parse(text: &str) -> Scene {
    Scene::parse(text, "test.toml").unwrap_or_else(|error| panic!("{}", render(&error.into())))
}

fn render(report: &miette::Report) -> String {
    let mut text = String::new();
    miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
        .with_width(100)
        .render_report(&mut text, report.as_ref())
        .unwrap();
    text
}

/// How the errors of a text are shown.
fn errors(text: &str) -> String {
    match Scene::parse(text, "test.toml") {
        Ok(_) => String::new(),
        Err(error) => render(&error.into()),
    }
}

#[test]
fn the_shortest_scene_has_the_documented_defaults() {
    let scene = parse(SHORT);
    assert_eq!((scene.title.as_str(), scene.seed), ("test", 1));
    // 7 substeps of 25 us are the most in which a wave of 80 m/s crosses less than 0.45 of a cell: 58 steps a frame.
    assert_eq!((scene.steps(), scene.steps_per_frame(), scene.frames()), (17_400, 58, 300));
    assert!((scene.step - 0.01 / 58.0).abs() < 1e-15);
    assert_eq!((scene.domain.cell, scene.point_count()), (0.03125, 36_864));
    assert_eq!(scene.text, SHORT);
    assert_eq!(scene.domain.walls.bottom, Friction::Coulomb(0.5));
    assert_eq!(scene.numerics.transfer, Transfer::FlipApic { rate: 10.0 });
    assert_eq!(scene.fields, crate::trajectory::Field::OPTIONAL);
    let Material::Rve(rve) = &scene.material else { panic!("{:?}", scene.material) };
    assert_eq!(rve.packings, 64);
    let expected = dem::RveParameters {
        grains: dem::Grains { step_factor: 0.401, overlap_limit: 2.0, ..Default::default() },
        discs: 64,
        max_solid_fraction: 1.0,
        ..Default::default()
    };
    assert_eq!(rve.parameters, expected);
    assert_eq!(scene.warnings, []);

    let transfer = |kind| parse(&format!("{SHORT}[material]\nkind = \"{kind}\"")).numerics.transfer;
    assert_eq!(transfer("mu-i"), Transfer::FlipApic { rate: 500.0 });
    let discs = parse(&format!("{SHORT}[material]\nkind = \"discs\""));
    let grains = dem::Grains { step_factor: 0.401, ..Default::default() };
    assert_eq!(discs.material.grains(), Some(&grains));
    assert_eq!(discs.domain.cell, 0.125);
}

#[test]
fn every_key_is_read() {
    let scene = parse(FULL);
    assert_eq!((scene.title.as_str(), scene.seed, scene.gravity), ("Everything", 7, [1.0, -9.0]));
    assert_eq!((scene.steps(), scene.steps_per_frame(), scene.frames()), (2000, 100, 20));
    assert_eq!((scene.domain.cell, scene.domain.points_per_cell), (0.25, 4));
    assert_eq!(scene.domain.cells(), [32, 24]);
    assert_eq!(
        scene.domain.walls,
        Walls {
            left: Friction::Stick,
            right: Friction::Coulomb(0.3),
            bottom: Friction::Slip,
            top: Friction::Coulomb(0.1),
        }
    );
    assert_eq!(scene.columns[0].velocity, [1.0, 0.0]);
    assert_eq!(scene.obstacles[0].faces.bottom, Friction::Stick);
    let plate = scene.plate.unwrap();
    assert_eq!(plate.at(0.1), plate.place);
    assert_eq!(plate.at(10.2).corner, [5.0, 1.0]);
    assert_eq!((plate.velocity_at(0.1), plate.velocity_at(0.3)), ([0.0, 0.0], [0.0, -0.1]));
    assert_eq!((plate.faces.bottom, plate.faces.top), (Friction::Stick, Friction::Coulomb(0.5)));
    assert_eq!(
        scene.material,
        Material::MuI(DruckerPragerParameters { static_friction: 0.3, ..Default::default() })
    );
    assert_eq!(scene.initial_stress, InitialStress::None);
    assert_eq!(
        scene.numerics,
        Numerics {
            basis: Basis::Gimp,
            scheme: Scheme::Usf,
            transfer: Transfer::Flip { rate: 2.0 },
            wall_contact: WallContact::Points,
            cell_average_volumetric: true,
            density_correction: 5.0,
            shock_width: 3.0,
            ..Numerics::default()
        }
    );
    assert_eq!(scene.fields, [crate::trajectory::Field::Stress]);
    assert_eq!(scene.grains_every, 5);
    assert_eq!(scene.grid.map(|grid| [grid.width, grid.spacing]), Some([0.02, 0.01]));
}

#[test]
fn rve_keys_are_those_of_the_dem() {
    let scene = parse(&format!(
        "{SHORT}[material]\npackings = 3\nprecision = \"f64\"\nneighbours = \"ample\"\n[grains]\nradius_min = 3e-3\n\
         friction = 1\n[rve]\ndiscs = 200\nkinetic_stress = false\npreparation = {{ pressure = 1000 }}"
    ));
    let Material::Rve(rve) = scene.material else { panic!() };
    assert_eq!((rve.packings, rve.precision), (3, Precision::F64));
    assert_eq!(rve.neighbours, dem::cuda::Room::Ample);
    let mut expected = dem::RveParameters {
        grains: dem::Grains {
            radius_min: 3.0e-3,
            friction: 1.0,
            step_factor: 0.401,
            overlap_limit: 2.0,
            ..Default::default()
        },
        discs: 200,
        kinetic_stress: false,
        max_solid_fraction: 1.0,
        ..Default::default()
    };
    expected.preparation.pressure = 1000.0;
    assert_eq!(rve.parameters, expected);
}

#[test]
fn points_fill_the_columns() {
    let scene = parse(FULL);
    let points = scene.points();
    assert_eq!(points.position.len(), scene.point_count());
    assert_eq!(points.position[0], [0.03125, 0.03125]);
    assert_eq!(points.position[1], [0.09375, 0.03125]);
    assert_eq!(points.velocity[0], [1.0, 0.0]);
    assert_eq!(scene.point_area() * points.position.len() as f64, 2.0 + 1.0 + 1.0);
    // The second column rests on the first; the third is in the air.
    assert_eq!(scene.resting_columns(), [true, true, false]);
    let depth = |x: f64, y: f64| {
        let at = |p: &[f64; 2]| (p[0] - x).abs() < 0.031 && (p[1] - y).abs() < 0.031;
        points.depth[points.position.iter().position(at).unwrap()]
    };
    assert!((depth(0.1, 0.1) - (1.0 - 0.09375)).abs() < 1e-12);
    assert!((depth(1.0 + 0.03125, 0.03125) - (2.0 - 0.03125)).abs() < 1e-12);
    assert_eq!(depth(1.03125, 3.03125), 0.0);
}

#[test]
fn staggered_points_stay_in_their_squares_and_are_centred_over_two_rows() {
    let square = parse(FULL);
    let staggered = parse(&FULL.replace("\"square\"", "\"staggered\""));
    let (square, staggered) = (square.points(), staggered.points());
    let spacing = 0.0625;
    let shift = |(a, b): (&[f64; 2], &[f64; 2])| [a[0] - b[0], a[1] - b[1]];
    let shifts: Vec<_> = staggered.position.iter().zip(&square.position).map(shift).collect();
    // Rows of the first column, 32 points each.
    for (row, shifts) in shifts[..32 * 16].chunks(32).enumerate() {
        let expected = if row % 2 == 0 { -0.25 * spacing } else { 0.25 * spacing };
        assert!(shifts.iter().all(|s| (s[0] - expected).abs() < 1e-12 && s[1] == 0.0), "{row}");
    }
    assert_eq!(staggered.depth, square.depth);
}

#[rstest]
#[case::unknown_key("stepp = 1", &["unknown key `stepp`", "did you mean `step`?", ":1:1"])]
#[case::misplaced_key("cell = 1.0", &["`cell` belongs in [domain]"])]
#[case::unknown_table("[numeric]", &["did you mean `numerics`?"])]
#[case::far_key("foo = 1", &["valid keys here are `choice`, `column`, `discs`, `domain`"])]
#[case::wrong_type("step = \"fast\"", &["`step` must be a number (s)", "this is: text"])]
#[case::unit("step = 0.1", &["step = 0.1 s is unstable", "80 m/s", "at most 0.5", "2.5e-5 s"])]
#[case::huge_step("step = 100", &["must be above 0 and at most 1 s", "0.1 ms is 1.0e-4"])]
#[case::not_finite("gravity = [nan, inf]", &["`gravity` = NaN", "`gravity` = inf"])]
#[case::half_frame("step = 1e-4\nframe_interval = 0.01005", &["100.5", "nearest: frame_interval = 0.0101"])]
#[case::frames("frame_interval = 0.07", &["nearest: duration = 3.01"])]
#[case::moved("rve.friction = 0.5", &["`friction` is now in [grains]", "no longer here"])]
#[case::moved_deep("rve.preparation.friction = 0.5", &["is now `preparation_friction` in [grains]"])]
#[case::nested("rve.grains = { skin = 0.3 }", &["have a table of their own, [grains]"])]
#[case::radii("grains.radius_min = 6e-3", &["smallest radius is larger", "radius_min = 0.006 m"])]
#[case::few_discs("rve.discs = 8", &["8 discs are too few", "at least"])]
#[case::unstable_dem("grains.step_factor = 0.6", &["must be from 0.005 to 0.5", "near 0.55"])]
#[case::tiny_discs("grains.radius_min = 1e-9", &["DEM steps in a macro step are too many"])]
#[case::density("step = 1e-4\nnumerics.density_correction = 2e4", &["faster than one step", "1 / step = 10000"])]
#[case::relaxation("step = 1e-4\nnumerics.relaxation = 2e4", &["faster than one step", "1 / step = 10000"])]
#[case::word("numerics.basis = \"quadratc\"", &["did you mean \"quadratic\"?", "\"gimp\""])]
#[case::field("output.fields = [\"stresss\"]", &["did you mean \"stress\"?"])]
#[case::face("domain.walls.left = \"slick\"", &["cannot be \"slick\"", "valid: \"slip\", \"stick\""])]
#[case::no_table("plate = 3", &["`plate` is a table", "write [plate]"])]
#[case::plate("plate.size = [1, 1]", &["`corner` is missing in [plate]", "corner = [0.0, 0.0]"])]
#[case::overlap(
    "plate = { corner = [2, 2], size = [1, 1], velocity = [0, 0] }",
    &["column 1 and the plate overlap", "x = 2 to 3 m"]
)]
#[case::outside("obstacle = [{ corner = [9, 0], size = [2, 1] }]", &["not inside the domain"])]
#[case::bodies("obstacle = { corner = [9, 0], size = [2, 1] }", &["write [[obstacle]]"])]
#[case::bodies("obstacle = [3]", &["write [[obstacle]]"])]
#[case::syntax("step = 1e", &["not valid TOML"])]
#[case::duplicate("duration = 3.0", &["duplicate key"])]
fn a_wrong_line_is_explained(#[case] line: &str, #[case] expected: &[&str]) {
    // Lines with a dotted key are tables; all come first.
    let shown = errors(&format!("{line}\n{SHORT}").replace("[domain]\nsize", "domain.size"));
    for words in expected {
        let shown = shown.replace("\n        ", " ");
        assert!(shown.contains(words), "{words:?} is not in\n{shown}");
    }
}

#[rstest]
#[case::empty("", &["`duration` is missing", "[domain] is missing", "[[column]] is missing"])]
#[case::no_points("column = []\nduration = 1\ndomain.size = [1, 1]", &["no material points"])]
#[case::single("duration = 1\n[domain]\nsize=[1,1]\n[column]\nsize=[1,1]", &["write [[column]]"])]
#[case::negative(
    "duration = 1\n[domain]\nsize=[1,1]\n[[column]]\nsize=[1,-1]",
    &["`column.size` = -1 is out of range"]
)]
#[case::columns(
    "duration = 1\n[domain]\nsize=[4,4]\n[[column]]\nsize=[2,2]\n[[column]]\nsize=[1,1]",
    &["column 1 and column 2 overlap"]
)]
#[case::cells(
    "duration = 1\n[domain]\nsize=[1.3,1]\n[[column]]\nsize=[1,1]",
    &["41.600000 x 32.000000 cells", "nearest: size = [1.3125, 1.0]"]
)]
#[case::many(
    "duration = 1\nstep=1e-9\nframe_interval=1e-6\n[domain]\nsize=[4,4]\ncell=1e-5\n[[column]]\nsize=[2,2]",
    &["points are too many", "cells are too many"]
)]
#[case::fast(
    "duration = 1\nstep = 1e-4\n[domain]\nsize=[4,4]\n[[column]]\nsize=[2,2]\nvelocity=[300,0]",
    &["300.0000 m/s is too fast", "62.5000 m/s"]
)]
#[case::coarse(
    "duration = 1\n[domain]\nsize=[4,4]\ncell=1.0\n[[column]]\nsize=[0.5,0.5]",
    &["smaller than a cell", "0.50 cells of 1 m across"]
)]
#[case::soft(
    "duration = 1\n[domain]\nsize=[4,4]\n[[column]]\nsize=[1,1]\n[material]\nkind=\"elastic\"\n\
     [elastic]\nyoung_modulus=1e4",
    &["compresses its base by 192 %", "waves travel at 2.3 m/s"]
)]
fn a_wrong_scene_is_explained(#[case] text: &str, #[case] expected: &[&str]) {
    let shown = errors(text);
    for words in expected {
        assert!(shown.contains(words), "{words:?} is not in\n{shown}");
    }
}

#[rstest]
#[case("[[obstacle]]\ncorner = [5.1, 0]\nsize = [1, 1]", "not on lines of the background grid")]
#[case("[material]\npackings = 8", "8 packings of 64 discs make a noisy material")]
#[case("[numerics]\nbasis = \"linear\"", "for tests only")]
#[case("[plate]\ncorner=[5,5]\nsize=[1,1]\nvelocity=[1,0]\nstart=9", "never moves")]
#[case("[plate]\ncorner=[8,5]\nsize=[1,1]\nvelocity=[1,0]", "leaves the domain")]
#[case("[grains]\noverlap_limit = 0.1", "smaller overlap than it would warn at")]
#[case("[numerics]\nrelaxation = 0", "leaves points in random motion")]
#[case(
    "[mu-i]\nbulk_modulus = 1e5\nshear_modulus = 1e5\n[material]\nkind = \"mu-i\"",
    "compresses its base"
)]
fn a_doubtful_scene_is_warned_about(#[case] lines: &str, #[case] expected: &str) {
    let scene = parse(&format!("{SHORT}{lines}"));
    let shown = render(&scene.warning_report().unwrap());
    assert!(shown.contains(expected), "{shown}");
}

#[test]
fn all_problems_of_a_pass_are_reported_at_once_in_the_order_of_the_file() {
    let shown = errors("duration = -1\nsteep = 1\n[domain]\nsize = 3\n");
    let at = |words| shown.find(words).unwrap_or_else(|| panic!("{words} is not in {shown}"));
    assert!(at("4 errors") < at("[[column]] is missing"));
    assert!(at("`duration` = -1") < at("`steep`") && at("`steep`") < at("`domain.size` must be"));
}

#[test]
fn one_missing_bracket_is_one_error() {
    let broken = format!("{SHORT}[[obstacle]]\ncorner = [5.0, 0.0\nsize = [1, 1]\n[numerics]\n");
    let shown = errors(&broken);
    assert!(shown.contains("1 error in the scene") && shown.contains("expected `,`"), "{shown}");
}

#[test]
fn an_impact_faster_than_waves_is_warned_about() {
    let fast =
        SHORT.replace("[[column]]\n", "[[column]]\nvelocity = [0.0, -60.0]\ncorner = [0, 1]\n");
    let fast = format!("step = 1e-4\n{fast}");
    let shown = render(&parse(&fast).warning_report().unwrap());
    assert!(shown.contains("column 1 hits a wall or the floor at up to 60.2 m/s"), "{shown}");
}

#[test]
fn a_scene_longer_than_its_trajectory_can_hold_is_refused() {
    let shown = errors(&format!("{SHORT}# {}", "long ".repeat(12_000)));
    assert!(shown.contains("bytes are too many") && shown.contains("at most 60000"), "{shown}");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = Scene::load("no/such/scene.toml").unwrap_err();
    assert!(error.to_string().contains("no/such/scene.toml"), "{error}");
}

/// Every key of the schema.
fn keys() -> BTreeSet<String> {
    let log = Log::default();
    let document = read::parse(&log, SHORT);
    read::read(&log, &document, "test.toml", SHORT);
    log.keys()
}

#[test]
fn every_key_is_documented_in_the_section_of_its_table() {
    let reference = include_str!("../../../docs/scenes.md");
    let tables: BTreeSet<String> =
        keys().iter().filter_map(|path| Some(path.rsplit_once('.')?.0.to_owned())).collect();
    for path in keys() {
        // A table has a section, a key a line in it; small tables are explained with their parent.
        let (table, key) = path.rsplit_once('.').unwrap_or(("", &path));
        let section = |table: &str| {
            let find = |heading: String| reference.find(&heading);
            let start = find(format!("## [{table}]")).or(find(format!("## [[{table}]]")))?;
            let rest = &reference[start + 2..];
            Some(rest.find("\n## ").map_or(rest, |end| &rest[..end]))
        };
        if tables.contains(&path) && section(&path).is_some() {
            continue;
        }
        let text = match table.split('.').next().unwrap_or("") {
            "" => Some(reference),
            // The four sides are explained once.
            _ if table.ends_with(".faces") => section("domain"),
            table => section(table),
        };
        let text = text.unwrap_or_else(|| panic!("docs/scenes.md has no section [{table}]"));
        assert!(text.contains(&format!("| `{key}` |")), "docs/scenes.md does not explain {path}");
    }
}

/// A scene or its problems, shown: nothing panics.
fn survives(text: &str) {
    match Scene::parse(text, "random.toml") {
        Ok(scene) => {
            assert!(scene.steps() > 0 && scene.frames() > 0 && scene.point_count() > 0);
            if scene.point_count() < 100_000 {
                assert_eq!(scene.points().position.len(), scene.point_count());
            }
            let needs = crate::check::Needs::of(&scene, &crate::check::Rates::of_processor(1.0e8));
            let _ = needs.to_string();
            let _ = scene.warning_report().map(|report| render(&report));
        }
        Err(error) => assert!(!render(&error.into()).is_empty()),
    }
}

fn any_value() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        any::<f64>().prop_map(|x| if x.is_nan() { "nan".into() } else { format!("{x:?}") }),
        any::<i64>().prop_map(|n| n.to_string()),
        (-9.0..9.0_f64).prop_map(|e| format!("{:?}", 10_f64.powf(e))),
        (0..2000_u32).prop_map(|n| format!("{:?}", f64::from(n) * 0.125)),
        (1..300_u32).prop_map(|n| n.to_string()),
    ]
    .prop_map(|text: String| text.replace("inf", "1e308"));
    let number = number.boxed();
    prop_oneof![
        4 => number.clone(),
        3 => (number.clone(), number.clone()).prop_map(|(x, y)| format!("[{x}, {y}]")),
        1 => Just("[]".to_owned()),
        1 => Just("{}".to_owned()),
        1 => Just("true".to_owned()),
        1 => Just("1979-05-27".to_owned()),
        1 => "[a-zµ-]{0,6}".prop_map(|word| format!("{word:?}")),
        1 => Just("[{}, 3]".to_owned()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn random_text_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        survives(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn random_toml_like_text_never_panics(text in "([a-z_.]{1,8} ?= ?[\\[\\]{}\"'0-9.e,#-]{0,12}\r?\n|\\[\\[?[a-z.]{0,8}\\]?\\]\n){0,12}") {
        survives(&text);
    }

    #[test]
    fn mutated_scenes_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<char>(), 0..4_u8), 1..6)
    ) {
        let mut text: Vec<char> = FULL.chars().collect();
        for (place, character, kind) in edits {
            let k = place.index(text.len());
            match kind {
                0 => { text.remove(k); }
                1 => text.insert(k, character),
                2 => text[k] = character,
                _ => { let other = text[(k * 7 + 3) % text.len()]; text[k] = other; }
            }
        }
        survives(&text.into_iter().collect::<String>());
    }

    #[test]
    fn random_scenes_of_sensible_numbers_never_panic(
        cell in -6..3_i32,
        [domain_x, domain_y, x, y, width, height] in prop::array::uniform6(0..12_u32),
        steps in [1..1000_u32, 1..1000],
        [step, radius, spread, stiffness, thickness, gravity] in prop::array::uniform6(-3.0..3.0_f64),
        discs in 4..2000_u32,
        velocity in [-20.0..20.0_f64, -20.0..20.0],
        kind in prop::sample::select(vec!["rve", "mu-i", "elastic"]),
    ) {
        let cell = 2_f64.powi(cell);
        let length = |cells: u32| f64::from(cells) * cell;
        let step = 1.0e-4 * 10_f64.powf(step);
        let frame = step * f64::from(steps[0]);
        let radius = 3.0e-3 * 10_f64.powf(radius / 3.0);
        survives(&format!(
            "gravity = [0, {:?}]\nstep = {step:?}\nframe_interval = {frame:?}\nduration = {:?}\n\
             domain = {{ size = [{:?}, {:?}], cell = {cell:?} }}\nmaterial.kind = {kind:?}\n\
             [[column]]\ncorner = [{:?}, {:?}]\nsize = [{:?}, {:?}]\nvelocity = {velocity:?}\n\
             [rve]\ndiscs = {discs}\n[grains]\nradius_min = {radius:?}\nradius_max = {:?}\n\
             normal_stiffness = {:?}\nthickness = {:?}\n",
            3.0 * gravity,
            frame * f64::from(steps[1]),
            length(domain_x + 4),
            length(domain_y + 4),
            length(x / 3),
            length(y / 3),
            length(width / 3 + 1),
            length(height / 3 + 1),
            radius * (1.0 + spread.max(0.0)),
            1.0e5 * 10_f64.powf(stiffness),
            7.5e-3 * 10_f64.powf(thickness / 3.0),
        ));
    }

    #[test]
    fn random_values_in_every_key_never_panic(
        values in prop::collection::vec((any::<prop::sample::Index>(), any_value()), 1..6)
    ) {
        let keys: Vec<String> = keys().into_iter().collect();
        let mut text = String::new();
        let mut used = BTreeSet::new();
        for (index, value) in values {
            let path = index.get(&keys);
            // The same key twice, or a table after its key, would not get past the syntax.
            if used.iter().any(|other: &String| other.starts_with(path) || path.starts_with(other)) {
                continue;
            }
            text += &match path.split_once('.') {
                Some((table @ ("column" | "obstacle"), _)) if used.iter().any(|other| other.starts_with(table)) => String::new(),
                Some((table @ ("column" | "obstacle"), key)) =>
                    format!("{table} = [{{ {key} = {value}, {} }}]\n", if key == "size" { "velocity = [1, 0]" } else { "size = [1, 1]" }),
                _ => format!("{path} = {value}\n"),
            };
            used.insert(path.clone());
        }
        for (path, line) in [
            ("duration", "duration = 1.0\n"),
            ("domain", "domain.size = [4.0, 4.0]\n"),
            ("column", "column = [{ size = [1.0, 1.0] }]\n"),
        ] {
            if !used.iter().any(|other| other.starts_with(path)) {
                text += line;
            }
        }
        survives(&text);
    }
}

#[test]
fn stacked_columns_of_discs_are_warned_about() {
    let text = |kind: &str, x: f64| {
        format!(
            "duration = 1\n[domain]\nsize = [2, 2]\n[[column]]\nsize = [0.5, 0.5]\n[[column]]\n\
             corner = [{x}, 0.5]\nsize = [0.5, 0.5]\n[material]\nkind = \"{kind}\"\n"
        )
    };
    let stacked = |kind, x| {
        let report = parse(&text(kind, x)).warning_report();
        report.is_some_and(|report| render(&report).contains("column 2 stands on column 1"))
    };
    assert!(stacked("discs", 0.25));
    assert!(!stacked("discs", 0.5) && !stacked("rve", 0.25));
}
