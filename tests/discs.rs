//! Scenes of discs: `kind = "discs"` through the commands, like any other model.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::{bits, dempm, kill, wait_for_frames};
use dempm::trajectory::{Frame, Trajectory};
use tempfile::TempDir;

/// Some three hundred discs that collapse against a barrier.
const SCENE: &str = r#"
title = "Few discs"
duration = 0.2
frame_interval = 0.005
[domain]
size = [0.5, 0.25]
cell = 0.0625
[[column]]
size = [0.125, 0.125]
[[obstacle]]
corner = [0.25, 0.0]
size = [0.0625, 0.0625]
[material]
kind = "discs"
"#;

fn scene(directory: &Path, text: &str) -> PathBuf {
    let path = directory.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    path
}

/// A run with these arguments, which succeeds.
fn run(directory: &Path, output: &str, arguments: &[&str]) -> Output {
    let mut command = dempm(directory);
    command.args(["run", "scene.toml", "-o", output, "--device", "cpu"]).args(arguments);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn all_frames(path: &Path) -> Vec<Frame> {
    let trajectory = Trajectory::open(path).unwrap();
    (0..trajectory.frames()).map(|k| trajectory.frame(k).unwrap()).collect()
}

#[test]
fn discs_become_a_trajectory_of_points() {
    let directory = TempDir::new().unwrap();
    scene(directory.path(), SCENE);
    let output = run(directory.path(), "discs.h5", &[]);
    let summary = String::from_utf8_lossy(&output.stdout);
    for line in ["front", "discs ", "disc-steps", "largest overlap", "means"] {
        assert!(summary.contains(line), "{summary}");
    }
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");

    let path = directory.path().join("discs.h5");
    let trajectory = Trajectory::open(&path).unwrap();
    let header = trajectory.header();
    assert_eq!((trajectory.status(), header.material.as_str()), ("finished", "discs"));
    let discs = header.parameters["discs"];
    assert!((250.0..350.0).contains(&discs), "{discs}");
    let density = trajectory.points().mass.iter().sum::<f64>() / 0.125_f64.powi(2);
    assert!((0.76..0.86).contains(&(density / 2650.0)), "{density}");

    let frames = all_frames(&path);
    assert_eq!((frames.len(), frames[0].position.len()), (41, 16));
    let (first, last) = (&frames[0], &frames[40]);
    // At the start a point is about the centre of its square, and carries the weight above it.
    for (k, x) in first.position.iter().enumerate() {
        let centre = [(k % 4) as f64 + 0.5, (k / 4) as f64 + 0.5].map(|c| 0.03125 * c);
        assert!((0..2).all(|k| (x[k] - centre[k]).abs() < 3.0e-3), "{x:?} {centre:?}");
    }
    let vertical = |row: usize| {
        let stress = &first.stress.as_ref().unwrap()[4 * row..4 * row + 4];
        stress.iter().map(|s| f64::from(s[3])).sum::<f64>() / 4.0
    };
    for row in 0..3 {
        let expected = -density * 9.81 * (0.125 - 0.03125 * (row as f64 + 0.5));
        assert!(
            (vertical(row) / expected - 1.0).abs() < 0.25,
            "{row}: {} {expected}",
            vertical(row)
        );
    }
    let solid = first.solid_fraction.as_ref().unwrap();
    assert!(solid.iter().all(|phi| (0.65..0.95).contains(phi)), "{solid:?}");
    assert!(first.coordination.as_ref().unwrap().iter().all(|z| (1.5..5.0).contains(z)));

    // The column falls and flows, but not through the barrier.
    let mean = |frame: &Frame, k: usize| frame.position.iter().map(|x| x[k]).sum::<f64>() / 16.0;
    assert!(mean(last, 1) < mean(first, 1) - 0.005 && mean(last, 0) > mean(first, 0) + 0.01);
    assert!(last.position.iter().all(|x| x[0] < 0.5 && x[1] < 0.25));
    // What is dissipated comes from the weight, and the budget closes.
    let scalar = |frame: &Frame, name: &str| frame.budget[name];
    let lost = scalar(last, "dashpot_loss") + scalar(last, "friction_loss");
    let fallen = scalar(first, "potential_energy") - scalar(last, "potential_energy");
    assert!(lost > 0.2 * fallen && lost < fallen, "{lost} of {fallen} J/m");
    assert!(scalar(last, "energy_drift").abs() < 0.01 * fallen);
}

/// Every tenth frame has the grains, whose means the points are; pictures and exports show them.
#[test]
fn grains_are_recorded_where_the_scene_asks_for_them() {
    let directory = TempDir::new().unwrap();
    scene(
        directory.path(),
        &format!("{SCENE}[output]\ngrains_every = 10\n[output.grid]\nspacing = 0.01\n"),
    );
    run(directory.path(), "discs.h5", &[]);
    let trajectory = Trajectory::open(&directory.path().join("discs.h5")).unwrap();
    let grains = trajectory.grains().unwrap().unwrap();
    let count = trajectory.header().parameters["discs"] as usize;
    assert_eq!((grains.every, grains.radius.len()), (10, count));
    assert!(grains.radius.iter().all(|r| (2.5e-3..=5.0e-3).contains(r)));
    assert!(grains.column.iter().all(|&column| column == 0));
    for index in 0..trajectory.frames() {
        let frame = trajectory.frame(index).unwrap();
        let Some(shown) = trajectory.grain_frame(index).unwrap() else {
            assert_ne!(index % 10, 0);
            continue;
        };
        assert_eq!((index % 10, shown.position.len()), (0, count));
        for (point, x) in frame.position.iter().enumerate() {
            let (mut mass, mut moment) = (0.0, [0.0; 2]);
            for k in (0..count).filter(|&k| grains.point[k] as usize == point) {
                let area = f64::from(grains.radius[k]).powi(2);
                mass += area;
                moment = [0, 1].map(|i| moment[i] + area * f64::from(shown.position[k][i]));
            }
            assert!((0..2).all(|i| (moment[i] / mass - x[i]).abs() < 1.0e-6), "{point}: {x:?}");
        }
        assert!(shown.pressure.iter().all(|p| p.is_finite()));
    }
    // The mean over the grains, weighted by area and solid fraction, is the pressure of the points.
    let start = trajectory.grain_frame(0).unwrap().unwrap();
    let area: f64 = grains.radius.iter().map(|r| f64::from(*r).powi(2)).sum();
    let weighted = grains.radius.iter().zip(&start.pressure);
    let mean = weighted.map(|(r, p)| f64::from(*r).powi(2) * f64::from(*p)).sum::<f64>() / area;
    let frame = trajectory.frame(0).unwrap();
    let stress = frame.stress.unwrap();
    let of_points = stress.iter().map(|s| -0.5 * f64::from(s[0] + s[3])).sum::<f64>() / 16.0;
    assert!((0.8 * mean / of_points - 1.0).abs() < 0.15, "{mean} {of_points}");

    // The grid holds the mass and momentum of the grains, whatever the width.
    let grid = trajectory.grid().unwrap();
    assert!((grid.width - 3.0 * 7.5e-3).abs() < 1e-12 && grid.x.len() > 60, "{}", grid.width);
    let total: f64 = trajectory.points().mass.iter().sum();
    for index in [0, 20, 40] {
        let fields = trajectory.grid_frame(index).unwrap().unwrap();
        let sum = |of: &dyn Fn(usize) -> f32| -> f64 {
            (0..fields.density.len()).map(|k| f64::from(of(k)) * 1e-4).sum()
        };
        let mass = sum(&|k| fields.density[k]);
        assert!((mass / total - 1.0).abs() < 2e-3, "{mass} {total}");
        let momentum = sum(&|k| fields.density[k] * fields.velocity[k][0]);
        let expected = trajectory.frame(index).unwrap().budget["momentum_x"];
        assert!((momentum - expected).abs() < 5e-3 * total, "{momentum} {expected}");
    }

    let dempm = |words: &[&str]| {
        let output = dempm(directory.path()).args(words).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8_lossy(&text).into_owned())
    };
    let (done, text) = dempm(&["plot", "discs.h5", "--grains", "--width", "400"]);
    assert!(done && directory.path().join("discs.png").exists(), "{text}");
    for field in ["speed", "pressure", "displacement", "column"] {
        let (done, text) =
            dempm(&["plot", "discs.h5", "--grains", "--frames", "last", "--field", field]);
        assert!(done, "{text}");
    }
    let (done, text) = dempm(&["plot", "discs.h5", "--grains", "--frames", "5"]);
    assert!(!done && text.contains("frame 5 has no grains: only frames 0, 10, 20, ..."), "{text}");
    let (done, text) = dempm(&["plot", "discs.h5", "--grains", "--field", "coordination"]);
    assert!(!done && text.contains("grains have no coordination"), "{text}");
    let (done, text) = dempm(&["info", "discs.h5"]);
    assert!(
        done && text.contains(&format!("grains        {count}, in every 10th frame")),
        "{text}"
    );
}

/// The same bits from the cache, on another number of threads, and after a kill.
#[test]
fn a_run_of_discs_is_reproducible_and_resumes_bitwise() {
    let directory = TempDir::new().unwrap();
    let text = SCENE.replace("duration = 0.2", "duration = 0.5");
    scene(directory.path(), &(text + "[output]\ngrains_every = 4\n[output.grid]\n"));
    run(directory.path(), "whole.h5", &[]);
    let whole = bits(&directory.path().join("whole.h5"));
    let cut = directory.path().join("cut.h5");
    let start = |more: &[&str]| {
        let mut command: Command = dempm(directory.path());
        command.args(["run", "scene.toml", "-o", "cut.h5", "--device", "cpu"]);
        command.args(["--checkpoint-interval", "0"]).args(more);
        command.env("RAYON_NUM_THREADS", "1");
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    };
    let mut child = start(&[]);
    let mut kills = 0;
    let mut frames = 15;
    while !wait_for_frames(&mut child, &cut, frames) {
        kill(&mut child);
        kills += 1;
        frames = Trajectory::open(&cut).expect("readable after kill -9").frames() + 15;
        child = start(&["--resume"]);
    }
    assert!(kills > 0, "the run was too short to be killed");
    assert_eq!(bits(&cut), whole);
}

/// Two columns on top of each other under a plate, in the air beside them a third: nothing explodes.
#[test]
fn columns_touch_each_other_and_a_plate() {
    let directory = TempDir::new().unwrap();
    let text = r#"
        duration = 0.02
        frame_interval = 0.005
        [domain]
        size = [0.375, 0.375]
        cell = 0.0625
        [[column]]
        corner = [0.0, 0.0]
        size = [0.0625, 0.0625]
        [[column]]
        corner = [0.0, 0.0625]
        size = [0.0625, 0.0625]
        [[column]]
        corner = [0.25, 0.125]
        size = [0.0625, 0.0625]
        velocity = [0.5, 1.0]
        [plate]
        corner = [0.0, 0.125]
        size = [0.0625, 0.0625]
        velocity = [0.0, -0.5]
        [material]
        kind = "discs"
        precision = "f64"
        [discs]
        floor = "flat"
    "#;
    scene(directory.path(), text);
    run(directory.path(), "three.h5", &[]);
    let frames = all_frames(&directory.path().join("three.h5"));
    let speed = |frame: &Frame, points: std::ops::Range<usize>| {
        frame.velocity[points].iter().map(|[u, v]| u.hypot(*v)).fold(0.0, f64::max)
    };
    for (k, frame) in frames.iter().enumerate() {
        // Free flight of the third, and little motion of what the plate holds.
        let time = 0.005 * k as f64;
        let flight = 0.5_f64.hypot(1.0 - 9.81 * time);
        assert!((speed(frame, 8..12) / flight - 1.0).abs() < 0.05, "{k}: {}", speed(frame, 8..12));
        assert!(speed(frame, 0..8) < 0.8, "{k}: {}", speed(frame, 0..8));
    }
    assert!(frames[4].budget["plate_work"] > 0.0);
}

#[test]
fn discs_that_cannot_be_are_refused_before_the_run() {
    let directory = TempDir::new().unwrap();
    let cases = [
        (SCENE.replace("size = [0.125, 0.125]", "size = [0.125, 0.03125]"), "", 0),
        (
            format!("{SCENE}[grains]\nradius_max = 2e-2\nradius_min = 1e-2\n"),
            "the squares of points may hold no grain",
            1,
        ),
        (
            format!("{SCENE}[grains]\nradius_max = 2e-2\nradius_min = 2e-2\n"),
            "the column is too small for its grains",
            1,
        ),
        (
            format!("{SCENE}[grains]\nthickness = 1e-7\n"),
            "positions in f32 are too coarse for these grains",
            1,
        ),
        (format!("{SCENE}[discs]\nfloor = \"soft\"\n"), "valid: \"rough\", \"flat\"", 1),
        (SCENE.replace("corner = [0.25, 0.0]", "corner = [0.0625, 0.0]"), "overlap", 1),
    ];
    for (text, expected, code) in cases {
        scene(directory.path(), &text);
        let output = dempm(directory.path()).args(["check", "scene.toml"]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(expected), "{expected}: {said}");
    }
}

/// More discs than any memory holds end the run before it begins.
#[test]
fn discs_beyond_the_memory_are_refused() {
    let directory = TempDir::new().unwrap();
    let text = "duration = 1.0\ndomain = { size = [400.0, 400.0], cell = 1.0 }\n\
                material = { kind = \"discs\", precision = \"f64\" }\n[[column]]\nsize = [200.0, 200.0]\n";
    scene(directory.path(), text);
    let mut command = dempm(directory.path());
    let output = command.args(["run", "scene.toml", "--device", "cpu"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("GB of memory"), "{said}");
}

#[test]
fn several_ranks_on_the_cpu_are_refused() {
    let directory = TempDir::new().unwrap();
    scene(directory.path(), SCENE);
    let mut command = dempm(directory.path());
    command.args(["run", "scene.toml", "--device", "cpu"]);
    command.envs([("RANK", "1"), ("WORLD_SIZE", "2"), ("LOCAL_RANK", "1")]);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("rank 1 of 2"), "{said}");
}

/// `check` says that there is nothing to warn about where neither the scene, on standard error, nor its cost, on standard
/// output, has a warning.
#[test]
fn check_says_that_nothing_is_to_warn_about_where_nothing_is() {
    let directory = TempDir::new().unwrap();
    let at_rest = "duration = 2.0\ndomain = { size = [4.0, 1.0], cell = 0.125 }\n\
                   material.kind = \"mu-i\"\n[[column]]\nsize = [0.5, 0.5]\n";
    let lossless = format!("{at_rest}[numerics]\nrelaxation = 0\n");
    let short = at_rest.replace("duration = 2.0", "duration = 0.1");
    for (text, of_scene, of_cost) in [
        (at_rest, false, false),
        (&lossless, true, false),
        (&short, false, true),
        (&lossless.replace("duration = 2.0", "duration = 0.1"), true, true),
    ] {
        scene(directory.path(), text);
        let output = dempm(directory.path()).args(["check", "scene.toml"]).output().unwrap();
        let [table, said] =
            [&output.stdout, &output.stderr].map(|stream| String::from_utf8_lossy(stream));
        assert_eq!(said.contains("warning"), of_scene, "{said}");
        assert_eq!(table.contains("Warnings"), of_cost, "{table}");
        let nothing = table.contains("Nothing to warn about.");
        assert_eq!(nothing, !of_scene && !of_cost, "{table}");
        assert!(table.ends_with('\n') && !table.ends_with("\n\n"), "{table:?}");
    }
}

/// `check` tells the number of discs and what they cost.
#[test]
fn check_counts_discs() {
    let directory = TempDir::new().unwrap();
    scene(directory.path(), SCENE);
    let output = dempm(directory.path()).args(["check", "scene.toml"]).output().unwrap();
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(
        table.contains("material discs") && table.contains("in the square of a point"),
        "{table}"
    );
    // Discs are the truth: only their seeds differ.
    assert!(table.contains("two seeds of discs") && !table.contains("points, root"), "{table}");
}
