//! `dempm run` as a user meets it: a scene becomes a trajectory, whatever happens on the way.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;

use common::{bits, dempm, kill, wait_for_frames};
use dempm::trajectory::{Frame, Trajectory};
use tempfile::TempDir;

/// A collapse small enough to run in a second.
fn scene(directory: &Path, duration: f64) -> PathBuf {
    let text = format!(
        r#"
        title = "Tiny column"
        duration = {duration}
        frame_interval = 0.005
        [domain]
        size = [1.0, 0.5]
        cell = 0.125
        [[column]]
        size = [0.25, 0.375]
        [material]
        packings = 16
        [rve]
        discs = 60
        [output]
        fields = ["stress", "solid_fraction", "coordination", "inertial_number"]
        "#
    );
    let path = directory.join("tiny.toml");
    std::fs::write(&path, text).unwrap();
    path
}

/// The standard error of a command that has to fail with this exit code.
fn fails(command: &mut Command, code: i32) -> String {
    let output = command.output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{error}");
    error
}

#[test]
fn a_scene_becomes_a_trajectory_and_a_summary() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 0.1);
    let output = dempm(directory.path()).arg("run").arg(&scene).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary = String::from_utf8_lossy(&output.stdout);
    for line in ["front", "final height", "runout", "stable macro step", "wall time", "disc-steps"]
    {
        assert!(summary.contains(line), "{summary}");
    }

    let trajectory = Trajectory::open(&directory.path().join("tiny.h5")).unwrap();
    assert_eq!(trajectory.frames(), 21);
    assert_eq!(trajectory.points().mass.len(), 24);
    assert_eq!(trajectory.status(), "finished");
    let first = trajectory.frame(0).unwrap();
    let last = trajectory.frame(20).unwrap();
    assert_eq!(last.time, 0.1);
    // The column starts with the stress of its depth, and falls down and outwards.
    let base: f64 = first.stress.as_ref().unwrap()[..4].iter().map(|s| f64::from(s[3])).sum();
    let depth = 0.375 - 0.03125;
    let expected = -2650.0 * 0.84 * 9.81 * depth;
    assert!((base / 4.0 / expected - 1.0).abs() < 0.05, "{} {expected}", base / 4.0);
    let mean = |frame: &dempm::trajectory::Frame, k: usize| {
        frame.position.iter().map(|x| x[k]).sum::<f64>() / 24.0
    };
    assert!(mean(&last, 1) < mean(&first, 1));
    assert!(mean(&last, 0) > mean(&first, 0));
    assert!(!directory.path().join("tiny.h5.ckpt").exists(), "a finished run leaves no checkpoint");
}

/// Killed without warning at some moment, the file is readable and the resumed run is bit by bit
/// the run that was never interrupted.
#[test]
fn a_killed_run_resumes_bitwise() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 0.4);
    let run = |output: &str, more: &[&str]| {
        let mut command = dempm(directory.path());
        command.arg("run").arg(&scene).args(["-o", output, "--checkpoint-interval", "0"]);
        command.args(more).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let summary = |output: Output| {
        assert!(output.status.success());
        let text = String::from_utf8(output.stdout).unwrap();
        text.lines().find(|line| line.contains("stable macro step")).unwrap().to_owned()
    };
    let whole = summary(run("whole.h5", &[]).stdout(Stdio::piped()).output().unwrap());

    let cut = directory.path().join("cut.h5");
    let mut child = run("cut.h5", &[]).spawn().unwrap();
    let mut kills = 0;
    // Wait for progress beyond what the last kill left, then kill again.
    let mut frames = 6;
    while !wait_for_frames(&mut child, &cut, frames) {
        kill(&mut child);
        kills += 1;
        frames = Trajectory::open(&cut).expect("readable after kill -9").frames() + 6;
        child = run("cut.h5", &["--resume"]).stdout(Stdio::piped()).spawn().unwrap();
    }
    assert!(kills > 0, "the run was too short to be killed");
    // What it says of all frames holds for those before, too.
    assert_eq!(summary(child.wait_with_output().unwrap()), whole);
    assert_eq!(bits(&cut), bits(&directory.path().join("whole.h5")));
}

/// A run ends when everything is at rest: until then its frames are those of a run to the end, then copies, which the file
/// states. Interrupted before, it ends with the same bits; the option turns it off.
#[test]
fn a_run_ends_at_rest() {
    let directory = TempDir::new().unwrap();
    let scene = directory.path().join("rest.toml");
    let text = "duration = 2.0\nframe_interval = 0.02\n[domain]\nsize = [2.5, 1.0]\ncell = 0.0625\n\
                [[column]]\nsize = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n";
    std::fs::write(&scene, text).unwrap();
    let run = |output: &str, more: &[&str]| {
        let mut command = dempm(directory.path());
        command
            .arg("run")
            .arg(&scene)
            .args(["-o", output, "--checkpoint-interval", "0"])
            .args(more);
        command.stdout(Stdio::piped()).stderr(Stdio::null());
        command
    };
    let output = run("rest.h5", &[]).output().unwrap();
    assert!(output.status.success());
    let open = |name: &str| Trajectory::open(&directory.path().join(name)).unwrap();
    let rested = open("rest.h5");
    let time = rested.rest_time().expect("it comes to rest");
    assert!(time > 0.3 && time < 1.6, "{time} s");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains(&format!("from {time:.3} s on, which later frames repeat")), "{said}");

    assert!(run("whole.h5", &["--stop-at-rest", "false"]).status().unwrap().success());
    let whole = open("whole.h5");
    assert_eq!((whole.rest_time(), whole.frames()), (None, rested.frames()));
    let last = (time / 0.02).round() as usize;
    for k in 0..=last {
        assert_eq!(rested.frame(k).unwrap(), whole.frame(k).unwrap());
    }
    let at_rest = rested.frame(last).unwrap();
    for k in last + 1..rested.frames() {
        let frame = rested.frame(k).unwrap();
        assert!((frame.time - 0.02 * k as f64).abs() < 1e-12);
        assert_eq!(frame, Frame { time: frame.time, ..at_rest.clone() });
    }
    // What is left out is less than what grains are wide.
    let end = whole.frame(whole.frames() - 1).unwrap();
    for (a, b) in at_rest.position.iter().zip(&end.position) {
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 7.5e-3, "{a:?} {b:?}");
    }

    let cut = directory.path().join("cut.h5");
    let mut child = run("cut.h5", &[]).spawn().unwrap();
    assert!(!wait_for_frames(&mut child, &cut, 10), "too short to be killed");
    kill(&mut child);
    assert!(run("cut.h5", &["--resume"]).status().unwrap().success());
    assert_eq!(bits(&cut), bits(&directory.path().join("rest.h5")));
}

/// Off a terminal a run writes lines of progress, here 50 a second, and with `--quiet` none, nor a summary.
#[test]
fn a_batch_system_sees_lines_of_progress() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 0.1);
    let said = |more: &[&str]| {
        let mut command = dempm(directory.path());
        command.arg("run").arg(&scene).args(["--overwrite"]).args(more);
        let output = command.env("DEMPM_PROGRESS_SECONDS", "0.02").output().unwrap();
        assert!(output.status.success());
        [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap())
    };
    let [_, lines] = said(&[]);
    let line = lines.lines().rfind(|line| line.starts_with("step ")).unwrap_or_else(|| {
        panic!("no line of progress in {lines:?}");
    });
    for part in [" of 580 (", " %), ", " steps/s, ", " left"] {
        assert!(line.contains(part), "{line}");
    }
    assert_eq!(said(&["--quiet"]), ["", ""]);
    let json: serde_json::Value = serde_json::from_str(&said(&["--json"])[0]).unwrap();
    assert_eq!((&json["status"], &json["step"]), (&"finished".into(), &580.into()));
    let front = json["summary"]["front"].as_f64().unwrap();
    let [text, _] = said(&[]);
    assert!(text.contains(&format!("  front                 {front:.3} m\n")), "{text}");
}

/// Discs that rest behind a gate are held, and flow as soon as it opens, as those that are never held.
#[test]
fn held_discs_follow_when_a_gate_opens() {
    let directory = TempDir::new().unwrap();
    let centre = |sleep: bool| {
        let text = format!(
            r#"
            duration = 0.5
            [domain]
            size = [2.0, 1.0]
            [[column]]
            size = [0.5, 0.5]
            [plate]
            corner = [0.5, 0.0]
            size = [0.125, 0.5]
            velocity = [0.0, 4.0]
            start = 0.1
            [material]
            kind = "discs"
            [grains]
            radius_min = 6.25e-3
            radius_max = 12.5e-3
            [discs]
            sleep = {sleep}
            "#
        );
        let path = directory.path().join("dam.toml");
        std::fs::write(&path, text).unwrap();
        let output = dempm(directory.path()).args(["run", "--overwrite"]).arg(&path).output();
        assert!(output.unwrap().status.success());
        let trajectory = Trajectory::open(&path.with_extension("h5")).unwrap();
        let last = trajectory.frame(trajectory.frames() - 1).unwrap();
        last.position.iter().map(|x| x[0]).sum::<f64>() / last.position.len() as f64
    };
    let [held, free] = [true, false].map(centre);
    // It moves by 0.07 m; three seeds differ by 10 mm. Where only 0.3 of what presses a disc woke it, it lagged by 20 mm.
    assert!(free > 0.3, "{free}");
    assert!((held - free).abs() < 0.01, "{held} {free}");
}

#[test]
#[cfg(unix)]
fn ctrl_c_leaves_a_checkpoint() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 20.0);
    let mut child = dempm(directory.path())
        .arg("run")
        .arg(&scene)
        .args(["-o", "stopped.h5"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !directory.path().join("stopped.h5.ckpt").exists() {
        assert!(child.try_wait().unwrap().is_none(), "ended early");
        sleep(Duration::from_millis(5));
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--resume"));
    Trajectory::open(&directory.path().join("stopped.h5")).unwrap();
}

#[test]
fn nothing_is_overwritten_by_accident() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 0.005);
    let run = || {
        let mut command = dempm(directory.path());
        command.arg("run").arg(&scene).args(["-o", "kept.h5"]);
        command
    };
    assert!(run().status().unwrap().success());
    let before = std::fs::read(directory.path().join("kept.h5")).unwrap();
    let error = fails(&mut run(), 1);
    assert!(error.contains("kept.h5") && error.contains("--overwrite"), "{error}");
    assert_eq!(before, std::fs::read(directory.path().join("kept.h5")).unwrap());
    // One line serves a queue: what is finished succeeds at once and stays.
    let again = run().arg("--resume").output().unwrap();
    assert!(again.status.success());
    assert_eq!(String::from_utf8_lossy(&again.stdout), "kept.h5: finished already\n");
    assert_eq!(before, std::fs::read(directory.path().join("kept.h5")).unwrap());
    // Another scene is another run, which is not this one.
    let other = directory.path().join("other.toml");
    std::fs::write(&other, std::fs::read_to_string(&scene).unwrap() + "# other\n").unwrap();
    let mut resume = dempm(directory.path());
    resume.arg("run").arg(&other).args(["-o", "kept.h5", "--resume"]);
    let error = fails(&mut resume, 1);
    assert!(error.contains("nothing to resume") && error.contains("another scene"), "{error}");
    assert!(run().arg("--overwrite").status().unwrap().success());

    // What is read is not replaced, whoever asks for it.
    let text = std::fs::read(&scene).unwrap();
    let mut into_scene = dempm(directory.path());
    into_scene.arg("run").arg(&scene).arg("-o").arg(&scene).arg("--overwrite");
    let kept = ["kept.h5", "-o", "./kept.h5"];
    let mut plot = dempm(directory.path());
    plot.arg("plot").args(kept);
    let mut export = dempm(directory.path());
    export.args(["export", "--to", "npz"]).args(kept);
    let [checkpoint, list] =
        ["other.h5.ckpt", "scenes.csv"].map(|name| directory.path().join(name));
    std::fs::copy(&scene, &checkpoint).unwrap();
    let mut into_checkpoint = dempm(directory.path());
    into_checkpoint.arg("run").arg(&checkpoint).args(["-o", "other.h5", "--overwrite"]);
    let name = scene.file_name().unwrap().to_str().unwrap();
    std::fs::write(&list, format!("scene = {name:?}\n[[train]]\n")).unwrap();
    let mut dataset = dempm(directory.path());
    dataset.arg("dataset").arg(&list).args(["-o", "."]);
    for command in [&mut into_scene, &mut plot, &mut export, &mut into_checkpoint, &mut dataset] {
        let error = fails(command, 1);
        assert!(error.contains("would replace its own input"), "{error}");
    }
    assert_eq!(text, std::fs::read(&scene).unwrap());
    assert_eq!(text, std::fs::read(&checkpoint).unwrap());
    Trajectory::open(&directory.path().join("kept.h5")).unwrap();
}

/// Two trajectories whose names differ after a dot only: each has its own checkpoint.
#[test]
fn every_trajectory_has_its_own_checkpoint() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 20.0);
    for output in ["mu0.3", "mu0.5"] {
        let mut command = dempm(directory.path());
        command.arg("run").arg(&scene).args(["-o", output]).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        while !directory.path().join(format!("{output}.ckpt")).exists() {
            assert!(child.try_wait().unwrap().is_none(), "ended early");
            sleep(Duration::from_millis(5));
        }
        kill(&mut child);
    }
}

#[test]
fn a_checkpoint_of_another_scene_is_refused() {
    let directory = TempDir::new().unwrap();
    let scene_file = scene(directory.path(), 20.0);
    let mut child = dempm(directory.path())
        .arg("run")
        .arg(&scene_file)
        .args(["-o", "one.h5"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !directory.path().join("one.h5.ckpt").exists() {
        sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    scene(directory.path(), 10.0);
    let mut resume = dempm(directory.path());
    resume.arg("run").arg(&scene_file).args(["-o", "one.h5", "--resume"]);
    let error = fails(&mut resume, 1);
    assert!(error.contains("another scene"), "{error}");
    // A damaged checkpoint is an error too, not a crash.
    std::fs::write(directory.path().join("one.h5.ckpt"), b"not a checkpoint").unwrap();
    let error = fails(&mut resume, 1);
    assert!(error.contains("one.h5.ckpt"), "{error}");
}

#[test]
fn a_wrong_scene_says_where() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("wrong.toml");
    std::fs::write(&path, "duration = 1.0\n[domain]\nsise = [1.0, 1.0]\n").unwrap();
    let error = fails(dempm(directory.path()).arg("run").arg(&path), 1);
    assert!(error.contains("wrong.toml:3") && error.contains("sise"), "{error}");
    assert!(!directory.path().join("wrong.h5").exists());
    let error = fails(dempm(directory.path()).args(["run", "missing.toml"]), 1);
    assert!(error.contains("missing.toml"), "{error}");
}

/// Different numbers of threads give the same bits.
#[test]
fn threads_do_not_change_the_result() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 0.05);
    for threads in ["1", "3"] {
        let status = dempm(directory.path())
            .arg("run")
            .arg(&scene)
            .args(["-o", &format!("{threads}.h5")])
            .env("RAYON_NUM_THREADS", threads)
            .stdout(Stdio::null())
            .status()
            .unwrap();
        assert!(status.success());
    }
    let [one, three] = ["1.h5", "3.h5"].map(|name| bits(&directory.path().join(name)));
    assert_eq!(one, three);
}

/// On a GPU: closer to the run on the CPU than a run with another packing is, the same bits after
/// an interrupt, and checkpoints that go from one to the other.
#[test]
fn gpu_runs_resume_and_agree_with_the_cpu() {
    let directory = TempDir::new().unwrap();
    let scene = scene(directory.path(), 2.0);
    let run = |output: &str, device: &str, more: &[&str]| {
        let mut command = dempm(directory.path());
        command.arg("run").arg(&scene).args(["-o", output, "--device", device]).args(more);
        command.args(["--checkpoint-interval", "0"]).stdout(Stdio::null());
        command
    };
    let first = run("gpu.h5", "cuda", &[]).output().unwrap();
    if !first.status.success() {
        let reason = String::from_utf8_lossy(&first.stderr).into_owned();
        assert!(std::env::var_os("DEMPM_REQUIRE_GPU").is_none(), "{reason}");
        assert!(reason.contains("NVIDIA") || reason.contains("CUDA"), "{reason}");
        eprintln!("skipped: {}", reason.trim());
        return;
    }
    assert!(run("cpu.h5", "cpu", &[]).status().unwrap().success());
    let [gpu, cpu] = ["gpu.h5", "cpu.h5"].map(|name| directory.path().join(name));
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(directory.path().join("seed.toml"), format!("seed = 7\n{text}")).unwrap();
    let mut other = dempm(directory.path());
    other.args(["run", "seed.toml", "--device", "cpu"]).stdout(Stdio::null());
    assert!(other.status().unwrap().success());
    let noise = distance(&cpu, &directory.path().join("seed.h5"));
    assert!(distance(&gpu, &cpu) < noise, "{} {noise}", distance(&gpu, &cpu));

    // Interrupted on one device, resumed on another.
    for (from, to) in [("cuda", "cuda"), ("cpu", "cuda"), ("cuda", "cpu")] {
        let name = format!("{from}-{to}.h5");
        let file = directory.path().join(&name);
        let mut child = run(&name, from, &[]).stderr(Stdio::null()).spawn().unwrap();
        assert!(!wait_for_frames(&mut child, &file, 2), "ended before it could be killed");
        kill(&mut child);
        assert!(run(&name, to, &["--resume"]).status().unwrap().success());
        if from == to {
            assert_eq!(bits(&file), bits(&gpu));
        } else {
            assert!(distance(&file, &cpu) < noise, "{} {noise}", distance(&file, &cpu));
        }
    }
}

/// Root mean square distance of the points of two runs after 0.05 s (m), before chaos has made it
/// as large as that of any two runs.
fn distance(a: &Path, b: &Path) -> f64 {
    let [a, b] = [a, b].map(|path| {
        let trajectory = Trajectory::open(path).unwrap();
        trajectory.frame(10).unwrap().position
    });
    let square = |(x, y): (&[f64; 2], &[f64; 2])| (x[0] - y[0]).powi(2) + (x[1] - y[1]).powi(2);
    (a.iter().zip(&b).map(square).sum::<f64>() / a.len() as f64).sqrt()
}
