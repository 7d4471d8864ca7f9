//! Several processes that train one network, on processors and (where there are two) on GPUs.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rstest::rstest;
use tempfile::TempDir;

use crate::helpers::{column, config, data, succeeds, train};
use crate::port::port;

/// What launchers call the rank, the number of ranks and the rank on the host.
const TORCHRUN: [&str; 3] = ["RANK", "WORLD_SIZE", "LOCAL_RANK"];
const MPIRUN: [&str; 3] =
    ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_RANK"];
const SRUN: [&str; 3] = ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS", "SLURM_LOCALID"];

/// Whether two processes can have the device; says so if not.
fn there_is(device: &str) -> bool {
    let count = gpu::Device::count();
    if device == "cuda" && count < 2 {
        eprintln!("skipped: {count} GPUs, two are needed");
        return false;
    }
    true
}

/// Two trainings, each with a configuration, as a launcher starts them.
fn launch(
    launcher: [&str; 3],
    directory: &Path,
    configs: [&Path; 2],
    output: &str,
    more: &[&str],
) -> [Child; 2] {
    let mut port = port();
    let torchrun = launcher == TORCHRUN;
    // torchrun listens at the port itself, and trainings at the next one.
    port -= u16::from(torchrun);
    [0, 1].map(|rank| {
        let mut command = train(directory, configs[rank], output);
        let values = [rank, 2, rank].map(|value| value.to_string());
        command.envs(launcher.into_iter().zip(values)).env("MASTER_PORT", port.to_string());
        if torchrun {
            command.env("TORCHELASTIC_RUN_ID", "none").env("MASTER_ADDR", "localhost");
        }
        command.args(more).stderr(Stdio::piped()).spawn().unwrap()
    })
}

/// What both said after they ended with a code, as one line each.
fn end(ranks: [Child; 2], code: i32) -> [String; 2] {
    ranks.map(|rank| {
        let output = rank.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(code), "{said}");
        said
    })
}

/// Two processes that share the windows of each step learn what one with twice the batch does.
#[rstest]
#[case("cpu", TORCHRUN)]
#[case("cpu", MPIRUN)]
#[case("cuda", SRUN)]
fn two_processes_train_like_one(#[case] device: &str, #[case] launcher: [&str; 3]) {
    if !there_is(device) {
        return;
    }
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let more = "[data]\nmirror = true\n[pushforward]\nsteps = 1\nstart = 20";
    let whole = config(here, 40, &format!("batch = 2\n{more}"));
    succeeds(train(here, &whole, "whole").args(["--device", device]));
    let half = here.join("half.toml");
    let text = std::fs::read_to_string(&whole).unwrap();
    std::fs::write(&half, text.replace("batch = 2", "batch = 1")).unwrap();
    end(launch(launcher, here, [&half, &half], "shared", &["--device", device]), 0);
    let numbers = |run: &str, file: &str, name: &str| column(&here.join(run).join(file), name);
    // Sums in another order, which rollouts amplify.
    for (file, name, tolerance) in [("log.csv", "loss", 1e-3), ("validation.csv", "mse", 0.05)] {
        let (one, two) = (numbers("whole", file, name), numbers("shared", file, name));
        assert!(!one.is_empty() && one.len() == two.len());
        for (a, b) in one.iter().zip(two) {
            assert!((a / b - 1.0).abs() < tolerance, "{name}: {a} and {b}");
        }
    }
}

#[test]
fn processes_that_do_not_belong_together_say_so() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let one = config(here, 2, "");
    let other = here.join("other.toml");
    let text = std::fs::read_to_string(&one).unwrap();
    std::fs::write(&other, format!("seed = 7\n{text}")).unwrap();
    for said in end(launch(SRUN, here, [&one, &other], "never", &["--device", "cpu"]), 1) {
        assert!(said.contains("rank 1 does not belong to rank 0"), "{said}");
        assert!(said.contains("other arguments, files or devices"), "{said}");
    }
}

/// One is asked to stop, and both do; then one is killed, and the other ends with an error; then both
/// go on to the end, with the bits of a training that nobody disturbed.
#[rstest]
#[cfg(unix)]
fn what_happens_to_one_happens_to_both(#[values("cpu", "cuda")] device: &str) {
    if !there_is(device) {
        return;
    }
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let config = config(here, 600, "ema = 0.99\nbatch = 1\n[data]\nmirror = true");
    let start = |output: &str, more: &[&str]| {
        let more = [&["--device", device], more].concat();
        launch(MPIRUN, here, [&config, &config], output, &more)
    };
    end(start("whole", &[]), 0);

    let checkpoint = here.join("cut/checkpoint.bin");
    let time = || std::fs::metadata(&checkpoint).ok().and_then(|file| file.modified().ok());
    let wait_for_checkpoint = || {
        let (before, began) = (time(), Instant::now());
        while time() == before {
            assert!(began.elapsed() < Duration::from_secs(60), "no progress");
            sleep(Duration::from_millis(2));
        }
    };
    let often = ["--checkpoint-interval", "0"];
    let ranks = start("cut", &often);
    wait_for_checkpoint();
    let kill = Command::new("kill").args(["-INT", &ranks[1].id().to_string()]).status();
    assert!(kill.unwrap().success());
    let said = end(ranks, 130);
    assert!(said[0].contains("--resume") && !said[1].contains("--resume"), "{said:?}");

    let [mut first, second] = start("cut", &[&often[..], &["--resume"]].concat());
    wait_for_checkpoint();
    first.kill().unwrap();
    first.wait().unwrap();
    let output = second.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("rank 0"), "{said}");

    end(start("cut", &["--resume"]), 0);
    for name in ["last.safetensors", "best.safetensors", "log.csv", "validation.csv"] {
        let [a, b] = ["whole", "cut"].map(|run| std::fs::read(here.join(run).join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
}
