//! `dempm choose`, and runs and data sets `--within` a distance, as a user meets them.

#[path = "common/program.rs"]
mod program;

use std::path::Path;
use std::process::Output;

use dempm::scene::Scene;
use dempm::trajectory::Trajectory;
use serde_json::Value;
use tempfile::TempDir;

use program::program;

/// A small column like those that were measured.
const SCENE: &str = r#"
title = "Small column"
duration = 0.5
frame_interval = 0.05
output.fields = []
[domain]
size = [3.0, 1.0]
cell = 0.125
[[column]]
size = [0.5, 0.5]
[material]
kind = "discs"
[grains]
radius_min = 5e-3
radius_max = 1e-2
"#;

fn command(directory: &Path, arguments: &[&str]) -> Output {
    std::fs::write(directory.join("scene.toml"), SCENE).unwrap();
    program("dempm", directory).args(arguments).args(["--device", "cpu"]).output().unwrap()
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_more_exact_the_dearer() {
    let directory = TempDir::new().unwrap();
    let choose = |within: &str| {
        let found = json(&command(
            directory.path(),
            &["choose", "scene.toml", "--within", within, "--json"],
        ));
        let taken = found["taken"].as_u64().unwrap() as usize;
        (found["candidates"][taken].clone(), found["met"] == true, found["candidates"].clone())
    };
    let number = |entry: &Value, pointer: &str| entry.pointer(pointer).unwrap().as_f64().unwrap();
    let (coarse, met, all) = choose("100");
    assert!(met);
    // Every result is within 100 m: the cheapest is taken.
    let cheapest = |other: &Value| number(&coarse, "/seconds") <= number(other, "/seconds");
    let near = all.as_array().unwrap().iter().filter(|other| other["out"].is_null());
    assert!(near.into_iter().all(cheapest), "{all:#}");
    let bound = number(&coarse, "/prediction/largest/bound");
    // A thousandth below its bound another one has to do.
    let (finer, met, _) = choose(&format!("{}", 0.999 * bound));
    assert!(number(&finer, "/prediction/largest/bound") < bound);
    assert!(!met || number(&finer, "/seconds") >= number(&coarse, "/seconds"));
    let (_, met, _) = choose("1e-6");
    assert!(!met);
}

#[test]
fn a_run_within_a_distance_states_its_model() {
    let directory = TempDir::new().unwrap();
    let run = |more: &[&str]| {
        let arguments = ["run", "scene.toml", "-o", "run.h5", "--within", "100", "--json"];
        json(&command(directory.path(), &[&arguments, more].concat()))
    };
    let report = run(&[]);
    let choice = &report["choice"];
    assert_eq!((&choice["within"], &choice["met"]), (&Value::from(100.0), &Value::from(true)));
    let trajectory = Trajectory::open(&directory.path().join("run.h5")).unwrap();
    let stated = Scene::parse(&trajectory.header().scene, "run.h5").unwrap().choice.unwrap();
    assert_eq!(Value::from(stated.model), choice["model"]);
    assert_eq!(stated.bound, choice["bound"].as_f64());
    // The finished run is found again.
    assert_eq!(run(&["--resume"])["status"], "finished-before");
}

#[test]
fn a_list_within_a_distance_has_a_model_for_each_scene() {
    let directory = TempDir::new().unwrap();
    let list = "scene = \"scene.toml\"\n[[train]]\ngrid.column.0.size = [[0.5, 0.5], [1.0, 0.5]]\n";
    std::fs::write(directory.path().join("list.toml"), list).unwrap();
    for more in [&[][..], &["--resume"]] {
        let arguments = ["dataset", "list.toml", "-o", "data", "--within", "100"];
        let output = command(directory.path(), &[&arguments, more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for name in ["000", "001"] {
        let path = directory.path().join(format!("data/train/{name}.h5"));
        let trajectory = Trajectory::open(&path).unwrap();
        let scene = Scene::parse(&trajectory.header().scene, name).unwrap();
        assert_eq!(scene.choice.unwrap().within, 100.0);
    }
}

#[test]
fn what_cannot_be_chosen_is_an_error() {
    let directory = TempDir::new().unwrap();
    let error = |arguments: &[&str]| {
        let output = command(directory.path(), arguments);
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let near = error(&["choose", "scene.toml", "--within", "near"]);
    assert!(near.contains("a distance in metres such as 0.1"), "{near}");
    let plate =
        format!("{SCENE}[plate]\ncorner = [1.0, 0.5]\nsize = [0.5, 0.1]\nvelocity = [0.0, -0.1]\n");
    std::fs::write(directory.path().join("plate.toml"), plate).unwrap();
    let plate = error(&["choose", "plate.toml", "--within", "0.1"]);
    assert!(plate.contains("plate.toml: no model can be chosen for a moving plate"), "{plate}");
}
