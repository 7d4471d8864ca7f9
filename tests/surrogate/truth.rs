//! Predictions against the mean of several seeds of the grains.

use std::path::Path;

use dempm::trajectory::Trajectory;
use tempfile::TempDir;

use crate::helpers::{config, data, scene, simulate, succeeds, surrogate, train};

/// The collapse of `scene` with some 130 coarse grains, of so many seeds.
fn grains(here: &Path, seeds: u32) {
    for seed in 1..=seeds {
        let text = scene(0.0, 1.0, "[grains]\nradius_min = 0.01\nradius_max = 0.02\n")
            .replace("kind = \"mu-i\"", "kind = \"discs\"");
        let name = if seed == 1 { "heap-000".to_owned() } else { format!("heap-000-seed-{seed}") };
        simulate(&format!("seed = {seed}\n{text}"), &here.join(format!("truth/{name}.h5")));
    }
}

#[test]
fn a_prediction_is_compared_with_the_mean_of_the_other_seeds() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let config = config(here, 20, "");
    succeeds(&mut train(here, &config, "run"));
    grains(here, 3);
    // One scene without a second seed, and the continuum beside the grains.
    simulate(&scene(0.25, 1.0, ""), &here.join("truth/lone-000.h5"));
    simulate(&scene(0.0, 1.0, ""), &here.join("law/heap-000.h5"));
    let eval = |more: &[&str]| {
        let mut command = surrogate(here);
        command.args(["eval", "run/last.safetensors", "--data", "truth", "--truth", "-o", "eval"]);
        command.args(more);
        command
    };
    let said = succeeds(&mut eval(&["--beside", "mu-i=law"]));
    assert!(
        said.contains("heap, mu-i: ") && said.contains("within 1.5 times the spread"),
        "{said}"
    );
    assert!(!said.contains("lone"), "{said}");

    // The spread in the last frame: the mean square over seeds of the distance from the mean of the two others.
    let last = |seed: &str| {
        let file = Trajectory::open(&here.join(format!("truth/heap-000{seed}.h5"))).unwrap();
        file.frame(40).unwrap().position
    };
    let runs = ["", "-seed-2", "-seed-3"].map(last);
    let apart = |k: usize| {
        let [a, b] = [(k + 1) % 3, (k + 2) % 3];
        let square = |p: usize| {
            let of = |axis: usize| 0.5 * (runs[a][p][axis] + runs[b][p][axis]) - runs[k][p][axis];
            of(0).powi(2) + of(1).powi(2)
        };
        (0..24).map(square).sum::<f64>() / 24.0
    };
    let expected = ((0..3).map(apart).sum::<f64>() / 3.0).sqrt();
    let table = std::fs::read_to_string(here.join("eval/truth.csv")).unwrap();
    let cells: Vec<&str> = table.lines().last().unwrap().split(',').collect();
    assert_eq!(cells[..4], ["heap", "heap-000", "3", "0.400000"]);
    let number = |k: usize| cells[k].parse::<f64>().unwrap();
    // Six digits are written.
    assert!((number(4) / expected - 1.0).abs() < 1e-6, "{} {expected}", number(4));
    // The law is off by centimetres: farther than a seed, and no farther than the column is wide.
    assert!(expected < number(7) && number(7) < 0.25, "{table}");

    let refused = eval(&["--beside", "law"]).output().unwrap();
    let error = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        refused.status.code() == Some(2) && error.contains("such as rve=out/rve/test"),
        "{error}"
    );
}
