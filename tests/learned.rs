//! `--learned`: a network among the models that `dempm choose` and runs `--within` a distance take.

#[path = "common/program.rs"]
mod program;

use std::path::Path;
use std::process::{Command, Output};
use std::sync::LazyLock;

use assert_cmd::cargo::cargo_bin;
use dempm::scene::Scene;
use dempm::trajectory::Trajectory;
use serde_json::Value;
use tempfile::TempDir;

use program::program;

/// Some hundred grains: so few for the height that no model was measured on their like. What `dempm choose` knows of the
/// solvers it does not use here, and a network that knows its error is the only one with a bound.
const SCENE: &str = r#"
duration = 0.2
frame_interval = 0.01
output.fields = []
[domain]
size = [1.5, 1.0]
cell = 0.125
[[column]]
size = [0.25, 0.25]
[material]
kind = "discs"
[grains]
radius_min = 8e-3
radius_max = 1.2e-2
"#;

/// Two runs to learn from and eleven others.
const LIST: &str = r#"
scene = "scene.toml"
[[train]]
grid.column.0.size = [[0.25, 0.25], [0.5, 0.375]]
[[test]]
grid."column.0.corner" = [[0.0, 0.0], [0.25, 0.0], [0.5, 0.0], [0.75, 0.0]]
grid."column.0.size" = [[0.25, 0.25], [0.375, 0.25], [0.25, 0.375]]
"#;

/// Starts from a single frame.
const TRAINING: &str = "steps = 20\nlog_every = 10\n[data]\nbefore_start = 2\n[model]\nwidth = 16\n\
                        hidden_layers = 1\nmessage_layers = 1\nframes = 3\nconnection_radius = 0.13\n";

/// A folder with `scene.toml`, `list.toml`, and two networks: `known.safetensors` states its error, `unknown.safetensors`
/// does not.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    let here = folder.path();
    for (name, text) in [("scene.toml", SCENE), ("list.toml", LIST), ("training.toml", TRAINING)] {
        std::fs::write(here.join(name), text).unwrap();
    }
    succeeds("dempm", here, "dataset list.toml -o data --device cpu");
    succeeds("surrogate", here, "train training.toml --data data -o run");
    std::fs::copy(here.join("run/last.safetensors"), here.join("unknown.safetensors")).unwrap();
    std::fs::rename(here.join("run/last.safetensors"), here.join("known.safetensors")).unwrap();
    succeeds("surrogate", here, "calibrate-error known.safetensors --data data/test --device cpu");
    folder
});

fn command(name: &str, folder: &Path, arguments: &str) -> Command {
    let mut command = program(name, folder);
    command.args(arguments.split(' '));
    command
}

fn succeeds(name: &str, folder: &Path, arguments: &str) -> Output {
    let output = command(name, folder, arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn json(name: &str, arguments: &str) -> Value {
    let output = succeeds(name, FOLDER.path(), &format!("{arguments} --device cpu --json"));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The network of a choice with a network.
fn network(arguments: &str) -> Value {
    let choice = json("dempm", arguments);
    let last = choice["candidates"].as_array().unwrap().last().unwrap().clone();
    assert_eq!(last["family"], "learned");
    last
}

/// The standard error of a command that fails, as one line.
fn fails(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    error.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_network_with_a_bound_is_taken_and_run() {
    let choice = json("dempm", "choose scene.toml --within 100 --learned known.safetensors");
    let taken = &choice["candidates"][choice["taken"].as_u64().unwrap() as usize];
    assert_eq!((&taken["name"], &choice["met"]), (&"network known".into(), &true.into()));
    // What the network says itself.
    let said = json("surrogate", "expect known.safetensors --scene scene.toml");
    assert_eq!(taken["prediction"]["largest"], said["error"]["largest"]);
    let positive = |value: &Value| value.as_f64().unwrap() > 0.0;
    assert!(positive(&taken["seconds"]) && positive(&taken["memory"]), "{taken}");
    // Without it nothing is known, and too far is too far.
    let without = json("dempm", "choose scene.toml --within 100");
    assert_eq!((&without["taken"], &without["met"]), (&0.into(), &false.into()));
    let far = network("choose scene.toml --within 1e-6 --learned known.safetensors");
    assert!(far["out"].as_str().unwrap().contains("its bound is above"), "{far}");

    let run = "run scene.toml --within 100 --learned known.safetensors -o run.h5";
    let report = json("dempm", run);
    assert_eq!((&report["status"], &report["summary"]), (&"finished".into(), &Value::Null));
    let bound = taken["prediction"]["largest"]["bound"].as_f64();
    assert_eq!(report["choice"]["bound"].as_f64(), bound);
    let trajectory = Trajectory::open(&FOLDER.path().join("run.h5")).unwrap();
    assert!(trajectory.header().material.contains("known.safetensors"));
    assert_eq!(trajectory.frames(), 21);
    let stated = Scene::parse(&trajectory.header().scene, "run.h5").unwrap().choice.unwrap();
    assert_eq!((stated.model.as_str(), stated.bound), ("network known", bound));
    assert_eq!(json("dempm", &format!("{run} --resume"))["status"], "finished-before");
    let error = fails(&mut command("dempm", FOLDER.path(), &format!("{run} --device cpu")));
    assert!(error.contains("run.h5: the run already exists"), "{error}");
}

#[test]
fn scenes_of_a_list_are_predicted() {
    let dataset =
        "dataset list.toml -o predicted --only train --within 100 --learned known.safetensors";
    for more in ["", " --resume"] {
        succeeds("dempm", FOLDER.path(), &format!("{dataset}{more} --device cpu"));
    }
    for name in ["000", "001"] {
        let path = FOLDER.path().join(format!("predicted/train/{name}.h5"));
        let trajectory = Trajectory::open(&path).unwrap();
        assert!(trajectory.header().material.starts_with("surrogate"), "{name}");
        assert_eq!(trajectory.status(), "finished");
    }
}

#[test]
fn a_network_is_left_out_for_a_reason() {
    let out = |scene: String, model: &str| {
        let folder = TempDir::new_in(FOLDER.path()).unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, scene).unwrap();
        let path = path.display();
        let found = network(&format!("choose {path} --within 100 --learned {model}.safetensors"));
        found["out"].as_str().unwrap().to_owned()
    };
    let with = |from: &str, to: &str| SCENE.replace(from, to);
    let why = out(SCENE.to_owned(), "unknown");
    assert!(why.contains("`surrogate calibrate-error` measures it"), "{why}");
    let why = out(with("frame_interval = 0.01", "frame_interval = 0.02"), "known");
    assert_eq!(why, "its frames are 0.01 s apart, those of the scene 0.02 s");
    let why = out(with("size = [0.25, 0.25]", "size = [1.25, 0.75]"), "known");
    assert!(why.contains("outside the training data") && why.contains("width 1.19 m"), "{why}");
}

#[test]
fn what_is_missing_is_named() {
    let choose = |model: &str| {
        let arguments = format!("choose scene.toml --within 1 --learned {model} --device cpu");
        command("dempm", FOLDER.path(), &arguments)
    };
    let error = fails(&mut choose("nothing.safetensors"));
    assert!(error.contains("--learned nothing.safetensors: there is no such file"), "{error}");
    // A file that is no network.
    let error = fails(&mut choose("list.toml"));
    assert!(error.contains("list.toml") && error.contains("no expectation from"), "{error}");
    let error = command("dempm", FOLDER.path(), "run scene.toml --learned known.safetensors");
    assert_eq!({ error }.output().unwrap().status.code(), Some(2), "without --within");
    // Alone in a folder.
    let folder = TempDir::new().unwrap();
    let alone = folder.path().join("dempm");
    std::fs::copy(cargo_bin("dempm"), &alone).unwrap();
    let mut command = Command::new(alone);
    command.current_dir(FOLDER.path()).env("PATH", "");
    command.args(["choose", "scene.toml", "--within", "1", "--learned", "known.safetensors"]);
    let error = fails(&mut command);
    assert!(error.contains("--learned needs the program `surrogate`"), "{error}");
}
