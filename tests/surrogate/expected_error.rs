//! Predictions that state their own error, many at a time.

use std::path::Path;

use dempm::trajectory::Trajectory;
use surrogate::simulator::Simulator;
use tempfile::TempDir;

use crate::helpers::{config, data, fails, scene, simulate, succeeds, surrogate, train, warns};

/// A folder with a model in `run` that has hardly learnt anything.
fn model(here: &Path) {
    data(here);
    let config = config(here, 20, "");
    succeeds(&mut train(here, &config, "run"));
}

/// Columns of other heights at other places, so many.
fn unseen(here: &Path, count: usize) {
    for k in 0..count {
        let height = 0.25 + 0.0625 * (k % 4) as f64;
        let text =
            scene(0.05 * k as f64, 1.0, "").replace("0.25, 0.375", &format!("0.25, {height}"));
        simulate(&text, &here.join(format!("unseen/heap-{k:03}.h5")));
    }
}

const CALIBRATE: [&str; 4] = ["calibrate-error", "run/last.safetensors", "--data", "unseen"];

#[test]
fn a_rollout_states_its_error() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    model(here);
    let rollout =
        ["rollout", "run/last.safetensors", "--from", "unseen/heap-003.h5", "-o", "out.h5"];
    let rollout = || {
        let mut command = surrogate(here);
        command.args(rollout).arg("--overwrite");
        command
    };
    unseen(here, 8);
    assert!(warns(&mut rollout()).contains("expected error: unknown"));
    let error = fails(surrogate(here).args(CALIBRATE));
    assert!(error.contains("8 scenes, 0 of them failed; at least 9 are needed"), "{error}");

    unseen(here, 12);
    let said = succeeds(surrogate(here).args(CALIBRATE).args(["--held-out", "unseen"]));
    assert!(said.contains("12 held-out scenes:") && said.contains("heap-011"), "{said}");
    let trained = Simulator::load(&here.join("run/last.safetensors")).unwrap();
    assert_eq!(trained.training.error.as_ref().unwrap().scenes, 12);

    let said = warns(&mut rollout());
    assert!(
        said.contains("expected error after 0.40 s:") && said.contains("nine of ten"),
        "{said}"
    );
    // In every frame; the first ones are the truth's.
    let predicted = Trajectory::open(&here.join("out.h5")).unwrap();
    let [median, bound] = ["expected_error", "error_bound"].map(|name| &predicted.budget()[name]);
    assert_eq!((median[0], bound[0]), (0.0, 0.0));
    let last = predicted.frames() - 1;
    assert!(0.0 < median[last] && median[last] <= bound[last]);
    // The network has hardly learnt anything, and says so: it is wrong by centimetres, not by millimetres.
    let truth = Trajectory::open(&here.join("unseen/heap-003.h5")).unwrap();
    let [one, other] = [&predicted, &truth].map(|file| file.frame(last).unwrap().position);
    let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let wrong = one.iter().zip(&other).map(square).sum::<f64>() / one.len() as f64;
    assert!(wrong.sqrt() < 3.0 * bound[last] && wrong.sqrt() > 0.1 * median[last]);
}

/// The same predictions as one by one, bit for bit on a CPU.
#[test]
fn many_scenes_are_predicted_at_a_time() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    model(here);
    unseen(here, 5);
    let many =
        ["rollout", "run/last.safetensors", "--scenes", "unseen", "-o", "many", "--device", "cpu"];
    let said = succeeds(surrogate(here).args(many));
    assert!(said.contains("5 scenes, 205 frames"), "{said}");
    let table = std::fs::read_to_string(here.join("many/rollouts.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| line.ends_with(",finished")).count(), 5, "{table}");
    let one = ["rollout", "run/last.safetensors", "--from", "unseen/heap-004.h5", "-o", "one.h5"];
    succeeds(surrogate(here).args(one).args(["--device", "cpu"]));
    let last = |name: &str| Trajectory::open(&here.join(name)).unwrap().frame(40).unwrap().position;
    assert_eq!(last("one.h5"), last("many/heap-004.h5"));
    let error = fails(surrogate(here).args(many));
    assert!(error.contains("is there already"), "{error}");

    // A list of scenes.
    std::fs::write(here.join("base.toml"), scene(0.0, 1.0, "")).unwrap();
    let list = "scene = \"base.toml\"\nseed = 1\n[[random]]\nclass = \"heap\"\ntest = 3\n\
                [[random.draw.column]]\ncorner = [{ uniform = [0.0, 0.7] }, 0.0]\nsize = [0.25, 0.375]\n";
    std::fs::write(here.join("list.toml"), list).unwrap();
    let listed = ["rollout", "run/last.safetensors", "--scenes", "list.toml", "-o", "listed"];
    succeeds(surrogate(here).args(listed));
    assert!(here.join("listed/test/heap-002.h5").exists());
}
