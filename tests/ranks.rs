//! `dempm run` as several ranks. Most of it needs two GPUs and NCCL.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;
use dempm::trajectory::Trajectory;
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

fn dempm(directory: &Path, output: &str) -> Command {
    let mut command = Command::new(cargo_bin("dempm"));
    command.current_dir(directory).env("DEMPM_CACHE_DIR", directory.join("cache"));
    command.args(["run", "scene.toml", "-o", output]);
    command
}

/// Starts `count` ranks as a launcher does.
fn start(directory: &Path, count: usize, output: &str, more: &[&str]) -> Vec<Child> {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let rank = |rank: usize| {
        let mut command = dempm(directory, output);
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

/// Every number of every frame, as bits.
fn bits(path: &Path) -> Vec<u64> {
    let trajectory = Trajectory::open(path).unwrap();
    let mut bits = Vec::new();
    for index in 0..trajectory.frames() {
        let frame = trajectory.frame(index).unwrap();
        bits.extend(frame.position.iter().flatten().map(|x| x.to_bits()));
        bits.extend(frame.velocity.iter().flatten().map(|x| x.to_bits()));
        let singles = frame.stress.iter().flatten().flatten();
        let singles = singles.chain(frame.solid_fraction.iter().flatten());
        let singles = singles.chain(frame.coordination.iter().flatten());
        bits.extend(singles.map(|x| u64::from(x.to_bits())));
        bits.extend(frame.budget.values().map(|x| x.to_bits()));
    }
    bits
}

fn two_gpus() -> bool {
    let count = gpu::Device::count();
    if count < 2 {
        eprintln!("skipped: {count} GPUs, two are needed");
    }
    count >= 2
}

/// Waits until the checkpoint holds a few more frames than the file had.
fn wait_for_frames(path: &Path, frames: usize) {
    let start = Instant::now();
    while !Trajectory::open(path).is_ok_and(|t| t.frames() >= frames) {
        assert!(start.elapsed() < Duration::from_secs(60), "no progress");
        sleep(Duration::from_millis(5));
    }
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
        let one = dempm(directory.path(), &name("one")).arg("--device=cuda").output().unwrap();
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
        let ranks = start(directory.path(), 2, &name("cut"), &often);
        wait_for_frames(&file("cut"), 5);
        Command::new("kill").args(["-INT", &ranks[1].id().to_string()]).status().unwrap();
        let said = end(ranks, 130);
        assert!(said[0].contains("--resume") && !said[1].contains("--resume"), "{said:?}");

        let frames = Trajectory::open(&file("cut")).unwrap().frames();
        let again = [often.as_slice(), &["--resume"]].concat();
        let mut ranks = start(directory.path(), 2, &name("cut"), &again);
        wait_for_frames(&file("cut"), frames + 5);
        ranks.iter_mut().for_each(|rank| rank.kill().unwrap());
        for rank in &mut ranks {
            rank.wait().unwrap();
        }

        let frames = Trajectory::open(&file("cut")).unwrap().frames();
        let mut alone = dempm(directory.path(), &name("cut"));
        let mut alone = alone.args(&again).arg("--device=cuda").spawn().unwrap();
        wait_for_frames(&file("cut"), frames + 5);
        alone.kill().unwrap();
        alone.wait().unwrap();

        end(start(directory.path(), 2, &name("cut"), &["--resume"]), 0);
        assert_eq!(bits(&file("cut")), bits(&file("one")));
    }
}

#[test]
fn a_failure_on_one_rank_ends_all() {
    if !two_gpus() {
        return;
    }
    let directory = TempDir::new().unwrap();
    // Thrown against the lid, so that packings of the second rank fail.
    let path = scene(directory.path(), 0.3, "overlap_limit = 0.1");
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
        assert!(said.contains("of 2") && said.contains("GPUs"), "{said}");
    }
    assert!(!directory.path().join("never.h5").exists());
}
