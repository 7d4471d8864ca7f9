//! Warnings about initial frames unlike the training data.

use std::path::Path;

use dempm::scene::Scene;
use surrogate::diagnostics::{asymmetry, mirror_difference, start_checks};
use surrogate::rollout::InitialFrames;
use surrogate::simulator::{Simulator, Training};
use tempfile::TempDir;

use crate::helpers::{config, data, fails, scene, simulate, succeeds, surrogate, train, warns};

/// A model knows what its training data held, or is told.
#[test]
fn a_model_knows_its_training_data() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let config = config(here, 20, "");
    succeeds(&mut train(here, &config, "run"));
    let path = here.join("run/last.safetensors");
    let trained = Simulator::load(&path).unwrap();
    let range = trained.training.range.unwrap();
    assert_eq!((range.least.points, range.most.points), (24.0, 24.0));

    let two = "[[column]]\ncorner = [0.75, 0.0]\nsize = [0.25, 0.375]\n";
    std::fs::write(
        here.join("two.toml"),
        scene(0.0, 1.0, "").replace("[material]", &format!("{two}[material]")),
    )
    .unwrap();
    let rollout = ["rollout", "run/last.safetensors", "--scene", "two.toml", "-o", "out.h5"];
    let rollout = || {
        let mut command = surrogate(here);
        command.args(rollout).args(["--frames", "4", "--overwrite"]);
        command
    };
    let said = warns(&mut rollout());
    assert!(said.contains("points 48, at most 24 in training"), "{said}");

    let training = Training { range: None, ..trained.training.clone() };
    Simulator { training, ..trained.clone() }.save(&path).unwrap();
    let said = warns(&mut rollout());
    assert!(said.contains("does not state the range of its training data"), "{said}");
    let stats = || {
        let mut command = surrogate(here);
        command.arg("stats").arg(&data).args(["--into", "run/last.safetensors"]);
        command
    };
    let error = fails(stats().args(["--stride", "2"]));
    assert!(
        error.contains("trained on frames 0.01 s apart, but these are 0.02 s apart"),
        "{error}"
    );
    succeeds(&mut stats());
    assert_eq!(Simulator::load(&path).unwrap().training, trained.training);

    // Ranges of other data do not take the place of those.
    let wide = scene(0.0, 1.0, "").replace("size = [0.25, 0.375]", "size = [0.5, 0.375]");
    simulate(&wide, &here.join("other/wide.h5"));
    let mut other = surrogate(here);
    other.args(["stats", "other", "--into", "run/last.safetensors"]);
    let error = fails(&mut other);
    assert!(error.contains("states another range of its training data already"), "{error}");
    assert_eq!(Simulator::load(&path).unwrap().training, trained.training);
}

/// The model of the repository believes in a column like those that it learnt from, and in no other
/// start.
#[test]
fn a_start_is_compared_with_the_training_data() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let simulator = Simulator::load(&repository.join("models/tgnns-tiny.safetensors")).unwrap();
    let symmetric = Simulator { mirror: true, ..simulator.clone() };
    let scene = Scene::load(repository.join("scenes/column-mu-i.toml")).unwrap();
    let start = InitialFrames::from_scene(scene, &simulator).unwrap();
    assert_eq!(start_checks(&symmetric, &start), None);

    // A column away from the walls, whose mirror image should move as its mirror image.
    let free = "duration = 1.0\nstep = 4e-4\nframe_interval = 0.02\n[domain]\nsize = [4.0, 2.0]\ncell = 0.125\n\
                [[column]]\ncorner = [1.0, 0.0]\nsize = [0.75, 0.75]\n[material]\nkind = \"mu-i\"\n";
    let free =
        InitialFrames::from_scene(Scene::parse(free, "free.toml").unwrap(), &simulator).unwrap();
    assert!(asymmetry(&simulator, &free).unwrap().contains("--mirror"));
    assert_eq!(asymmetry(&symmetric, &free), None);
    // What is left is the rounding of positions to f32, on either side of the mirror.
    let apart = |simulator, start| mirror_difference(simulator, start).unwrap();
    let (left, before) = (apart(&symmetric, &free), apart(&simulator, &free));
    assert_eq!((left.frames, before.frames), (15, 15));
    assert!(left.ratio < 1e-2 * before.ratio, "{left:?} of {before:?}");

    // What leaves the domain on the way is compared as far as it comes, or not at all.
    let thrown = |speed: f64| {
        let mut thrown = free.clone();
        let frames = thrown.positions.len();
        for (frame, positions) in thrown.positions.iter_mut().enumerate() {
            let back = speed * (frames - 1 - frame) as f64;
            positions.iter_mut().for_each(|x| x[0] -= back);
        }
        mirror_difference(&simulator, &thrown)
    };
    assert_eq!(thrown(1.0).map(|apart| apart.frames), Some(2));
    assert_eq!(thrown(10.0), None);

    let mut noisy = start.clone();
    for (frame, positions) in noisy.positions.iter_mut().enumerate() {
        // Up and down by 1 mm, no two neighbours alike.
        let shift = |p: usize| if (p + frame).is_multiple_of(2) { 1e-3 } else { -1e-3 };
        positions.iter_mut().enumerate().for_each(|(p, x)| x[1] += shift(p));
    }
    let said = start_checks(&symmetric, &noisy).unwrap();
    assert!(said.contains("differences between neighbours' accelerations"), "{said}");

    let mut small = start;
    for positions in &mut small.positions {
        positions.retain(|x| x[0] < 0.25 && x[1] < 0.25);
    }
    let said = start_checks(&symmetric, &small).unwrap();
    for expected in ["points 16, at least 48", "width 0.2"] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
}
