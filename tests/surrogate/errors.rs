//! Wrong files are refused with their names, and those that come with the program are right.

use std::path::Path;

use surrogate::network::PAPER_NETWORKS;
use surrogate::train::TrainConfig;
use tempfile::TempDir;

use crate::helpers::{config, data, fails, scene, simulate, succeeds, surrogate, train};

#[test]
fn errors_name_the_file_and_what_is_wrong() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let good = config(here, 2, "");
    let refused = |text: &str| {
        std::fs::write(here.join("bad.toml"), text).unwrap();
        fails(&mut train(here, &here.join("bad.toml"), "bad"))
    };
    let expect = |error: &str, parts: &[&str]| {
        for part in parts {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
    };
    expect(&refused("step = 3"), &["bad.toml", "`step`", "`steps`"]);
    expect(&refused("batch = 0"), &["bad.toml", "`batch` is 0"]);
    expect(&refused("[model]\nwidth = 0"), &["bad.toml", "`width`"]);
    expect(&refused("precision = \"bf16\""), &["bad.toml", "bf16", "CPU"]);
    expect(&refused("[data]\nstride = 30"), &["left.h5", "41 frames", "stride 30"]);
    assert!(!here.join("bad").exists(), "nothing is written for a wrong file");

    succeeds(&mut train(here, &good, "run"));
    expect(&fails(&mut train(here, &good, "run")), &["run", "already", "--resume"]);
    let other = config(here, 2, "seed = 2");
    let error = fails(train(here, &other, "run").arg("--resume"));
    expect(&error, &["checkpoint.bin", "the configuration has changed"]);

    // Data that do not belong together, and none at all.
    simulate(&scene(0.0, 1.25, ""), &data.join("train/wide.h5"));
    let error = fails(&mut train(here, &other, "mixed"));
    expect(&error, &["wide.h5", "domain", "1.25"]);
    std::fs::write(data.join("train/wide.h5"), "text").unwrap();
    expect(&fails(surrogate(here).arg("stats").arg(&data)), &["wide.h5"]);
    std::fs::rename(data.join("train/wide.h5"), data.join("valid/broken.h5")).unwrap();
    expect(&fails(surrogate(here).arg("stats").arg(&data)), &["broken.h5"]);
    std::fs::create_dir(here.join("empty")).unwrap();
    expect(&fails(surrogate(here).args(["stats", "empty"])), &["empty", "no trajectory files"]);

    // Rollouts.
    let rollout = |model: &str, scene: &str| {
        std::fs::write(here.join("scene.toml"), scene).unwrap();
        let mut command = surrogate(here);
        command.args(["rollout", model, "--scene", "scene.toml", "-o", "out.h5", "--overwrite"]);
        fails(&mut command)
    };
    expect(&rollout("scene.toml", &scene(0.0, 1.0, "")), &["scene.toml", "safetensors"]);
    let coarse = format!("step = 3.0e-4\n{}", scene(0.0, 1.0, ""))
        .replace("0.01", "0.012")
        .replace("duration = 0.4", "duration = 0.12");
    expect(&rollout("run/last.safetensors", &coarse), &["scene.toml", "0.01 s", "0.0003 s"]);
    let short = ["rollout", "run/last.safetensors", "--from", "data/valid/between.h5"];
    let error = fails(surrogate(here).args(short).args(["--start", "39", "-o", "late.h5"]));
    expect(&error, &["between.h5", "from frame 39 on", "3"]);

    // What is read is not replaced, and what the model knows of itself is not lost.
    let model = std::fs::read(here.join("run/last.safetensors")).unwrap();
    let into = ["-o", "run/last.safetensors", "--overwrite"];
    expect(
        &fails(surrogate(here).args(short).args(into)),
        &["last.safetensors", "the output would replace its own input"],
    );
    std::fs::create_dir(here.join("tables")).unwrap();
    std::fs::copy(here.join("run/last.safetensors"), here.join("tables/summary.csv")).unwrap();
    let eval = ["eval", "tables/summary.csv", "--data", "data/valid", "-o", "tables"];
    let replaces = "summary.csv: the output would replace its own input";
    expect(&fails(surrogate(here).args(eval)), &[replaces]);
    std::fs::copy(&good, here.join("tables/log.csv")).unwrap();
    let mut command = train(here, &here.join("tables/log.csv"), "tables");
    let replaces = "log.csv: the output would replace its own input";
    expect(&fails(command.arg("--overwrite")), &[replaces]);
    assert_eq!(model, std::fs::read(here.join("tables/summary.csv")).unwrap());
    let eval = ["eval", "run/last.safetensors", "--data", "data/test", "--frames", "2", "--record"];
    std::fs::create_dir(data.join("test")).unwrap();
    std::fs::copy(data.join("valid/between.h5"), data.join("test/between.h5")).unwrap();
    expect(&fails(surrogate(here).args(eval)), &["--frames 2", "starts from"]);
    // A run that is too short is found before the rollouts from the others.
    let short = scene(0.0, 1.0, "").replace("duration = 0.4", "duration = 0.01");
    simulate(&short, &data.join("test/too-short.h5"));
    let eval = ["eval", "run/last.safetensors", "--data", "data/test"];
    let error = fails(surrogate(here).args(eval));
    expect(&error, &["too-short.h5", "needs 3 initial frames"]);
    assert!(!error.contains("s each"), "{error}");
    assert_eq!(model, std::fs::read(here.join("run/last.safetensors")).unwrap());
}

#[test]
fn the_configurations_that_come_with_the_program_are_valid() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    TrainConfig::load(&configs.join("discs-tiny.toml")).unwrap();
    // Parts of a training: the later ones start from weights that do not come with the program.
    for part in ["", "-2", "-3"] {
        let file = configs.join(format!("all-columns{part}.toml"));
        let text = std::fs::read_to_string(&file).unwrap();
        TrainConfig::parse(&text, &file.display().to_string()).unwrap();
    }
    let paper = configs.join("paper");
    for network in PAPER_NETWORKS {
        for (set, stride) in [1, 2, 3, 6, 10].into_iter().enumerate() {
            let file = paper.join(format!("{network}-data{}.toml", set + 1));
            let config = TrainConfig::load(&file).unwrap();
            assert_eq!(config.network.as_deref(), Some(network));
            assert_eq!(config.data.stride, stride);
        }
    }
    assert_eq!(std::fs::read_dir(paper).unwrap().count(), 50, "ten networks on five data sets");
}
