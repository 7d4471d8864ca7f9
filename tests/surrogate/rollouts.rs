//! Rollouts of trained, untrained and broken models.

use std::path::Path;

use dempm::trajectory::Trajectory;
use rstest::rstest;
use surrogate::features::Normalisation;
use surrogate::network::burn_backend::device;
use surrogate::network::parameters::with_weights;
use surrogate::network::{Model, ModelConfig};
use surrogate::simulator::{Simulator, Training};
use tempfile::TempDir;

use crate::helpers::{
    column, config, data, fails, scene, simulate, succeeds, surrogate, train, warns,
};

/// The models that come with the program let a column collapse.
#[rstest]
fn the_models_of_the_repository_follow_a_collapse(
    #[values("tgnns-tiny", "tgnns-baseline")] name: &str,
) {
    let directory = TempDir::new().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let output = directory.path().join("out.h5");
    let mut command = surrogate(directory.path());
    command.arg("rollout").arg(root.join(format!("models/{name}.safetensors")));
    command.arg("--scene").arg(root.join("scenes/column-mu-i.toml"));
    succeeds(command.arg("-o").arg(&output).args(["--frames", "81"]));
    let budget = |frame| Trajectory::open(&output).unwrap().frame(frame).unwrap().budget;
    let (first, last) = (budget(0), budget(80));
    assert!(last["front"] > 1.5 * first["front"] && last["front"] < 3.5, "{last:?}");
    assert!(last["max_height"] < 0.95 * first["max_height"], "{last:?}");
}

/// A network that learnt from discs starts from discs, on the grid of its training, whichever model the scene names.
#[test]
fn networks_start_from_the_material_of_their_training() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/tgnns-tiny.safetensors");
    let scene = "duration = 0.2\n[domain]\nsize = [2.0, 1.0]\n[[column]]\nsize = [0.5, 0.5]\n";
    let predicted = |material: &str| {
        std::fs::write(here.join("scene.toml"), format!("{scene}[material]\n{material}")).unwrap();
        let mut command = surrogate(here);
        command.arg("rollout").arg(&model).args(["--scene", "scene.toml", "--frames", "10"]);
        let output = command.args(["-o", "out.h5", "--overwrite"]).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let last = Trajectory::open(&here.join("out.h5")).unwrap().frame(9).unwrap().position;
        (last, String::from_utf8(output.stderr).unwrap())
    };
    let ((discs, silent), (law, said)) =
        (predicted("kind = \"discs\""), predicted("kind = \"mu-i\""));
    assert_eq!(discs, law);
    let note = "starts from discs, as in training, averaged over squares of 62.5 mm";
    assert!(said.contains(note) && !silent.contains(note), "{said}");
}

/// Rollouts of networks with further features start from what the scene or the file says.
#[test]
fn networks_can_know_load_and_first_stress() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let with_stress = |x| scene(x, 1.0, "").replace("fields = []", "fields = [\"stress\"]");
    simulate(&with_stress(0.0), &here.join("data/left.h5"));
    let path = config(here, 20, "");
    let text = std::fs::read_to_string(&path).unwrap();
    let features = "[model]\nnode_features = [\"overburden\", \"initial-stress\"]";
    std::fs::write(&path, text.replace("[model]", features)).unwrap();
    succeeds(&mut train(here, &path, "run"));
    std::fs::write(here.join("scene.toml"), with_stress(0.125)).unwrap();
    let rollout = ["rollout", "run/last.safetensors", "--frames", "6", "-o", "out.h5"];
    succeeds(surrogate(here).args(rollout).args(["--scene", "scene.toml"]));
    succeeds(surrogate(here).args(rollout).args(["--from", "data/left.h5", "--overwrite"]));

    simulate(&scene(0.0, 1.0, ""), &here.join("data/bare.h5"));
    let error =
        fails(surrogate(here).args(rollout).args(["--from", "data/bare.h5", "--overwrite"]));
    assert!(error.contains("bare.h5") && error.contains("no stress in it"), "{error}");
    let error = fails(train(here, &path, "run").arg("--overwrite"));
    assert!(error.contains("bare.h5") && error.contains("no stress in it"), "{error}");
}

/// What a network sees of obstacles and how many frames it starts from is kept with its weights: with
/// all of its window from before the run but one, it predicts from the first frame on.
#[test]
fn networks_can_see_obstacles_and_start_from_one_frame() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let barrier = "[[obstacle]]\ncorner = [0.375, 0.0]\nsize = [0.25, 0.125]\n";
    simulate(&scene(0.0, 1.0, barrier), &here.join("data/barrier.h5"));
    simulate(&scene(0.125, 1.0, ""), &here.join("data/free.h5"));
    let path = config(here, 20, "");
    let text = std::fs::read_to_string(&path).unwrap();
    let keys = "[data]\nbefore_start = 2\n[model]\nobstacles = true";
    std::fs::write(&path, text.replace("[model]", keys)).unwrap();
    succeeds(&mut train(here, &path, "run"));
    std::fs::write(here.join("scene.toml"), scene(0.0, 1.0, barrier)).unwrap();
    let mut command = surrogate(here);
    command.args(["rollout", "run/last.safetensors", "--frames", "4", "-o", "out.h5"]);
    let output = command.args(["--scene", "scene.toml"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("4 frames, 3 of them predicted"));
    assert!(!String::from_utf8_lossy(&output.stderr).contains("does not see"));
    let times = Trajectory::open(&here.join("out.h5")).unwrap().time().to_vec();
    assert!((0..4).all(|k| (times[k] - 0.01 * k as f64).abs() < 1e-12), "{times:?}");
}

/// Boxes, a plate under way and the material of each run are inputs of training, rollouts from scene and
/// file, and evaluation; a training goes on from such a network with other material.
#[test]
fn networks_can_see_surfaces_and_material() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let box_and_plate = "[[obstacle]]\ncorner = [0.375, 0.0]\nsize = [0.25, 0.125]\n\
         [plate]\ncorner = [0.0, 0.375]\nsize = [0.25, 0.125]\nvelocity = [0.0, -0.3]\n\
         start = 0.055\n";
    let rough = |x| scene(x, 1.0, "[mu-i]\nstatic_friction = 0.4\n");
    simulate(&scene(0.0, 1.0, box_and_plate), &here.join("data/train/boxes.h5"));
    simulate(&rough(0.125), &here.join("data/train/rough.h5"));
    simulate(&scene(0.0625, 1.0, box_and_plate), &here.join("data/valid/boxes.h5"));
    let path = config(here, 40, "");
    let text = std::fs::read_to_string(&path).unwrap();
    let keys = "[data]\nmirror = true\n[pushforward]\nsteps = 2\n[model]\n\
                node_features = [\"acceleration\", \"surfaces\", \"material\"]";
    std::fs::write(&path, text.replace("[model]", keys)).unwrap();
    succeeds(&mut train(here, &path, "run"));
    let losses = column(&here.join("run/log.csv"), "loss");
    assert!(losses.iter().all(|loss| loss.is_finite() && *loss > 0.0), "{losses:?}");

    std::fs::write(here.join("scene.toml"), scene(0.0, 1.0, box_and_plate)).unwrap();
    let rollout = ["rollout", "run/last.safetensors", "--frames", "12", "-o", "out.h5"];
    let mut command = surrogate(here);
    let said = warns(command.args(rollout).args(["--scene", "scene.toml", "--mirror"]));
    assert!(!said.contains("does not see"), "{said}");
    // From the same frames of the file the prediction is the same.
    let positions = |file: &str| {
        let trajectory = Trajectory::open(&here.join(file)).unwrap();
        trajectory.frame(11).unwrap().position
    };
    let from_scene = positions("out.h5");
    let from = ["--from", "data/train/boxes.h5", "--overwrite", "--mirror"];
    succeeds(surrogate(here).args(rollout).args(from));
    assert_eq!(positions("out.h5"), from_scene);
    let eval = ["eval", "run/last.safetensors", "--data", "data/valid", "-o", "errors"];
    succeeds(surrogate(here).args(eval));

    simulate(&rough(0.25), &here.join("more/train/rough.h5"));
    let on = text.replace("[model]", "[data]\nnoise = 1e-4\n").replace("steps = 40", "steps = 5");
    let on = on.lines().filter(|line| {
        !["width", "hidden", "message", "frames", "connection"].iter().any(|k| line.starts_with(k))
    });
    let on = on.collect::<Vec<_>>().join("\n");
    std::fs::write(&path, format!("start = \"run/last.safetensors\"\n{on}")).unwrap();
    let mut command = surrogate(here);
    succeeds(command.arg("train").arg(&path).args(["--data", "more", "-o", "tuned"]));
    let [before, after] = ["run", "tuned"]
        .map(|run| Simulator::load(&here.join(run).join("last.safetensors")).unwrap());
    assert_eq!(before.normalisation, after.normalisation);
    assert_eq!(after.training.steps, 45);
}

/// A network that knows nothing of a barrier does not get through it either.
#[test]
fn points_stay_out_of_barriers_and_plates() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let config = config(here, 20, "");
    succeeds(&mut train(here, &config, "run"));
    let barrier = "[[obstacle]]\ncorner = [0.375, 0.0]\nsize = [0.25, 0.125]\n\
                   [plate]\ncorner = [0.0, 0.375]\nsize = [0.25, 0.125]\nvelocity = [0.0, -0.1]\n";
    std::fs::write(here.join("scene.toml"), scene(0.0, 1.0, barrier)).unwrap();
    let rollout = ["rollout", "run/last.safetensors", "--scene", "scene.toml", "-o", "out.h5"];
    // A network after 20 steps may well break down; what it has written counts.
    surrogate(here).args(rollout).output().unwrap();
    let trajectory = Trajectory::open(&here.join("out.h5")).unwrap();
    assert!(trajectory.frames() > 5, "{}", trajectory.status());
    let plate = trajectory.frame(4).unwrap().boxes[1];
    assert!((plate[1] - (0.375 - 0.1 * 0.04)).abs() < 1e-12, "the plate moves: {plate:?}");
    for index in 3..trajectory.frames() {
        let frame = trajectory.frame(index).unwrap();
        for [x, y] in frame.position {
            assert!((0.0..=1.0).contains(&x) && (0.0..=0.5).contains(&y));
            for [left, low, right, high] in &frame.boxes {
                let inside =
                    x > left + 1e-8 && x < right - 1e-8 && y > low + 1e-8 && y < high - 1e-8;
                assert!(
                    !inside,
                    "frame {index}: ({x}, {y}) in [{left}, {right}] x [{low}, {high}]"
                );
            }
        }
    }
}

/// A prediction that breaks down ends the rollout, and the frames before are in the file.
#[test]
fn a_broken_model_says_where_it_broke() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    std::fs::write(here.join("scene.toml"), scene(0.0, 1.0, "")).unwrap();
    let config = ModelConfig { width: 4, frames: 3, ..ModelConfig::default() };
    let healthy = Model::new(&config, 1, &device());
    // Finite, as others are refused, but products of them are not.
    let sick = with_weights(healthy.clone(), &vec![1e30; config.parameter_count()]);
    for (model, size, reason) in
        [(healthy, 1e9, "leaves the domain by"), (sick, 1e-3, "is not finite")]
    {
        let normalisation = Normalisation::about_zero(2, 1e-3, size);
        let training = Training::untrained(0.01, false);
        let simulator = Simulator::new(model, config.clone(), normalisation, training);
        simulator.save(&here.join("model.safetensors")).unwrap();
        let rollout = ["rollout", "model.safetensors", "--scene", "scene.toml", "-o", "out.h5"];
        let error = fails(surrogate(here).args(rollout).arg("--overwrite"));
        assert!(error.contains(reason) && error.contains("frame 3"), "{error}");
        assert!(error.contains("out.h5 holds the 3 frames before"), "{error}");
        let trajectory = Trajectory::open(&here.join("out.h5")).unwrap();
        assert_eq!(trajectory.frames(), 3);
        assert!(trajectory.status().starts_with("failed: frame 3"), "{}", trajectory.status());
    }
}
