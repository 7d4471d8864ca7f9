//! `dempm run` as several ranks. Most of it needs two GPUs and NCCL.

mod common;
#[path = "common/port.rs"]
mod port;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use common::{bits, dempm, kill, wait_for_frames};
use dempm::trajectory::Trajectory;
use port::port;
use tempfile::TempDir;

/// A collapse of 35 points: slices of 18 and 17.
fn scene(directory: &Path, duration: f64, more: &str) -> PathBuf {
    let text = format!(
        r#"
        duration = {duration}
        frame_interval = 0.005
        [domain]
        size = [1.0, 0.5]
        cell = 0.125
        [[column]]
        size = [0.4375, 0.3125]
        [rve]
        discs = 60
        {more}
        "#
    );
    let path = directory.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn run(directory: &Path, output: &str) -> Command {
    let mut command = dempm(directory);
    command.args(["run", "scene.toml", "-o", output]);
    command
}

/// Starts `count` ranks as a launcher does.
fn start(directory: &Path, count: usize, output: &str, more: &[&str]) -> Vec<Child> {
    let port = port();
    let rank = |rank: usize| {
        let mut command = run(directory, output);
        let words = [("RANK", rank), ("LOCAL_RANK", rank), ("WORLD_SIZE", count)];
        command.envs(words.map(|(name, value)| (name, value.to_string())));
        command.env("MASTER_PORT", port.to_string()).args(more).stdout(Stdio::null());
        command.stderr(Stdio::piped()).spawn().unwrap()
    };
    (0..count).map(rank).collect()
}

/// Waits for all ranks to end with this code; what they said.
fn end(ranks: Vec<Child>, code: i32) -> Vec<String> {
    let end = |child: Child| {
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{said}");
        said
    };
    ranks.into_iter().map(end).collect()
}

fn two_gpus() -> bool {
    let count = gpu::Device::count();
    if count < 2 {
        eprintln!("skipped: {count} GPUs, two are needed");
    }
    count >= 2
}

#[test]
fn two_ranks_give_the_bits_of_one_however_often_they_are_stopped() {
    if !two_gpus() {
        return;
    }
    let directory = TempDir::new().unwrap();
    for precision in ["f32", "f64"] {
        let more = format!("[material]\nprecision = \"{precision}\"");
        scene(directory.path(), 0.3, &more);
        let file = |name: &str| directory.path().join(format!("{name}-{precision}.h5"));
        let name = |name: &str| file(name).display().to_string();
        let one = run(directory.path(), &name("one")).arg("--device=cuda").output().unwrap();
        assert!(one.status.success(), "{}", String::from_utf8_lossy(&one.stderr));
        end(start(directory.path(), 2, &name("two"), &[]), 0);
        assert_eq!(bits(&file("two")), bits(&file("one")));
        assert!(Trajectory::open(&file("two")).unwrap().header().device.starts_with("2 x "));

        if precision == "f64" {
            continue;
        }
        // One rank is asked to stop, and both do; then both are killed; then one goes on alone,
        // is killed, and two finish.
        let often = ["--checkpoint-interval", "0"];
        let mut ranks = start(directory.path(), 2, &name("cut"), &often);
        assert!(!wait_for_frames(&mut ranks[0], &file("cut"), 5));
        Command::new("kill").args(["-INT", &ranks[1].id().to_string()]).status().unwrap();
        let said = end(ranks, 130);
        assert!(said[0].contains("--resume") && !said[1].contains("--resume"), "{said:?}");

        let frames = Trajectory::open(&file("cut")).unwrap().frames();
        let again = [often.as_slice(), &["--resume"]].concat();
        let mut ranks = start(directory.path(), 2, &name("cut"), &again);
        assert!(!wait_for_frames(&mut ranks[0], &file("cut"), frames + 5));
        ranks.iter_mut().for_each(kill);

        let frames = Trajectory::open(&file("cut")).unwrap().frames();
        let mut alone = run(directory.path(), &name("cut"));
        let mut alone = alone.args(&again).arg("--device=cuda").spawn().unwrap();
        assert!(!wait_for_frames(&mut alone, &file("cut"), frames + 5));
        kill(&mut alone);

        end(start(directory.path(), 2, &name("cut"), &["--resume"]), 0);
        assert_eq!(bits(&file("cut")), bits(&file("one")));
    }
}

/// Discs that slide along the floor, from the slab of one rank into that of the other, under a moving plate. With
/// long frames they leave the windows that the first sort gives them.
fn sliding(directory: &Path, precision: &str, duration: f64, frame_interval: f64) {
    let text = format!(
        r#"
        duration = {duration}
        frame_interval = {frame_interval}
        [domain]
        size = [2.0, 0.5]
        cell = 0.0625
        [[column]]
        corner = [0.125, 0.0]
        size = [1.0, 0.125]
        velocity = [2.0, 0.0]
        [[obstacle]]
        corner = [1.25, 0.0]
        size = [0.0625, 0.0625]
        [plate]
        corner = [0.125, 0.125]
        size = [0.5, 0.0625]
        velocity = [0.5, -0.1]
        [material]
        kind = "discs"
        precision = "{precision}"
        [discs]
        sleep = false
        [output]
        grains_every = 1
        fields = ["stress", "solid_fraction", "coordination"]
        "#
    );
    std::fs::write(directory.join("scene.toml"), text).unwrap();
}

#[test]
fn discs_on_two_ranks_are_those_of_one() {
    if !two_gpus() {
        return;
    }
    let directory = TempDir::new().unwrap();
    for (precision, duration, frame) in
        [("f32", 0.1, 0.0025), ("f64", 0.05, 0.0025), ("f32", 0.3, 0.1)]
    {
        sliding(directory.path(), precision, duration, frame);
        let file = |name: &str| directory.path().join(format!("{name}-{precision}-{frame}.h5"));
        let name = |name: &str| file(name).display().to_string();
        let one = run(directory.path(), &name("one")).arg("--device=cuda").output().unwrap();
        assert!(one.status.success(), "{}", String::from_utf8_lossy(&one.stderr));
        end(start(directory.path(), 2, &name("two"), &[]), 0);
        assert_eq!(bits(&file("two")), bits(&file("one")), "{precision}, frames of {frame} s");
        if precision == "f64" || frame > 0.01 {
            continue;
        }
        // Two ranks are asked to stop, one goes on and is killed, two finish.
        let often = ["--checkpoint-interval", "0"];
        let mut ranks = start(directory.path(), 2, &name("cut"), &often);
        assert!(!wait_for_frames(&mut ranks[0], &file("cut"), 5));
        Command::new("kill").args(["-INT", &ranks[1].id().to_string()]).status().unwrap();
        end(ranks, 130);
        let frames = Trajectory::open(&file("cut")).unwrap().frames();
        let again = [often.as_slice(), &["--resume"]].concat();
        let mut alone = run(directory.path(), &name("cut"));
        let mut alone = alone.args(&again).arg("--device=cuda").spawn().unwrap();
        assert!(!wait_for_frames(&mut alone, &file("cut"), frames + 5));
        kill(&mut alone);
        end(start(directory.path(), 2, &name("cut"), &["--resume"]), 0);
        assert_eq!(bits(&file("cut")), bits(&file("one")));
    }
}

#[test]
fn a_disc_that_fails_on_one_rank_ends_all() {
    if !two_gpus() {
        return;
    }
    let directory = TempDir::new().unwrap();
    // Thrown against the obstacle, which is in the slab of the second rank.
    sliding(directory.path(), "f32", 0.05, 0.0025);
    let path = directory.path().join("scene.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("[2.0, 0.0]", "[20.0, 0.0]").replace("0.125, 0.125]", "0.125, 0.375]");
    let text = text.replace("sleep = false", "floor = \"flat\"");
    std::fs::write(&path, text + "[grains]\noverlap_limit = 0.3\n").unwrap();
    let said = end(start(directory.path(), 2, "failed.h5", &[]), 1);
    assert!(said.iter().all(|said| said.contains("overlap")), "{said:?}");
    let status = Trajectory::open(&directory.path().join("failed.h5")).unwrap();
    assert!(status.status().contains("overlap"), "{}", status.status());
}

#[test]
fn a_failure_on_one_rank_ends_all() {
    if !two_gpus() {
        return;
    }
    let directory = TempDir::new().unwrap();
    // Thrown against the lid, so that packings of the second rank fail.
    let path = scene(directory.path(), 0.3, "[grains]\n        overlap_limit = 0.1");
    let text = std::fs::read_to_string(&path).unwrap();
    let thrown = text.replace("[rve]", "velocity = [0.0, 20.0]\n        [rve]");
    std::fs::write(&path, thrown).unwrap();
    let said = end(start(directory.path(), 2, "failed.h5", &[]), 1);
    assert!(said[0].contains("overlap"), "{}", said[0]);
    let status = Trajectory::open(&directory.path().join("failed.h5")).unwrap();
    assert!(status.status().contains("overlap"), "{}", status.status());
    // An output that is there stops both, too.
    let said = end(start(directory.path(), 2, "failed.h5", &[]), 1);
    assert!(said[0].contains("--overwrite") && said[1].contains("another rank"), "{said:?}");
}

#[test]
fn what_cannot_be_shared_is_refused_by_every_rank() {
    let directory = TempDir::new().unwrap();
    scene(directory.path(), 0.3, "[material]\nkind = \"mu-i\"");
    for said in end(start(directory.path(), 2, "never.h5", &[]), 1) {
        assert!(said.contains("of 2") && said.contains("packings"), "{said}");
    }
    scene(directory.path(), 0.3, "");
    for said in end(start(directory.path(), 2, "never.h5", &["--device=cpu"]), 1) {
        assert!(said.contains("of 2") && said.contains("one GPU each"), "{said}");
    }
    assert!(!directory.path().join("never.h5").exists());
}
