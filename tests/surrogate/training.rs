//! From trajectories to a model, interrupted or not.

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::{Frame, Trajectory, TrajectoryWriter};
use surrogate::data::{DataSet, WindowShape};
use surrogate::network::Model;
use surrogate::network::parameters::weights;
use surrogate::simulator::Simulator;
use tempfile::TempDir;

use crate::helpers::{
    LAW, column, config, data, fails, scene, simulate, succeeds, surrogate, train, warns,
};

/// From files that geoelements/gns reads.
#[test]
fn imported_trajectories_train_a_model() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let (data, foreign) = (data(here), here.join("gns"));
    dempm::export::write_data_set(&data, &foreign, dempm::export::Format::Gns, true).unwrap();
    std::fs::remove_dir_all(&data).unwrap();
    let mut points = Vec::new();
    let format = dempm::import::Format::Gns;
    dempm::import::import(&foreign, format, &data, &mut |file| points.push(file.points)).unwrap();
    assert_eq!(points, [24, 24, 24]);
    let stats = succeeds(surrogate(here).arg("stats").arg(&data));
    assert!(stats.contains("2 training files, 1 validation files"), "{stats}");

    let config = config(here, 600, "[data]\nmirror = true\nnoise = 3.0e-4");
    succeeds(&mut train(here, &config, "run"));
    let losses = column(&here.join("run/log.csv"), "loss");
    let last = losses[55..].iter().sum::<f64>() / 5.0;
    assert!(last < 0.7 * losses[0], "the loss fell from {} to {last} only", losses[0]);
    let from = ["rollout", "run/best.safetensors", "--from", "data/valid/000.h5", "-o", "out.h5"];
    succeeds(surrogate(here).args(from));
    let predicted = Trajectory::open(&here.join("out.h5")).unwrap();
    assert_eq!((predicted.status(), predicted.frames()), ("finished", 41));
}

/// Frames that repeat a state at rest have nothing to teach: one window of them is learnt from.
#[test]
fn frames_at_rest_are_learnt_once() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("rest.h5");
    let scene = Scene::parse(&scene(0.0, 1.0, ""), "tiny.toml").unwrap();
    let mut simulation = Simulation::new(scene).unwrap();
    let header = simulation.header("2026-11-23T00:00:00Z".to_owned());
    let mut writer = TrajectoryWriter::create(&path, &header, &simulation.static_points()).unwrap();
    for _ in 0..10 {
        writer.push(simulation.frame()).unwrap();
        for _ in 0..simulation.scene.steps_per_frame() {
            simulation.advance().unwrap();
        }
    }
    let rest = simulation.frame();
    writer.set_rest_time(rest.time);
    for later in 0..20 {
        writer.push(Frame { time: rest.time + 0.01 * f64::from(later), ..rest.clone() }).unwrap();
    }
    writer.finish("finished").unwrap();
    let shape = WindowShape { frames: 3, stride: 1, before: 0 };
    let set = DataSet::open(&[path], shape, 0).unwrap();
    // Of frames 0 to 10 and three copies, all but the first three are targets.
    assert_eq!(set.len(), 11);
    let [moving, rest] = [8, 10].map(|window| set.example(window).unwrap());
    assert!(moving.acceleration().iter().any(|&change| change != 0.0));
    assert!(rest.velocity().iter().chain(&rest.acceleration()).all(|&change| change == 0.0));
}

#[test]
fn trajectories_become_a_model_that_continues_them() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let stats = succeeds(surrogate(here).arg("stats").arg(&data));
    assert!(stats.contains("2 training files, 1 validation files"), "{stats}");

    let more = "ema = 0.9\n[data]\nmirror = true\nnoise = 3.0e-4";
    let config = config(here, 600, more);
    succeeds(&mut train(here, &config, "run"));
    let losses = column(&here.join("run/log.csv"), "loss");
    assert_eq!(losses.len(), 60);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, last) = (losses[0], mean(&losses[55..]));
    assert!(last < 0.7 * first, "the loss fell from {first} to {last} only");
    assert!(here.join("run/loss.svg").exists());

    // A rollout from the scene: the same format, finished, and the column comes down.
    std::fs::write(here.join("scene.toml"), scene(0.125, 1.0, LAW)).unwrap();
    let rollout = ["rollout", "run/best.safetensors", "--scene", "scene.toml", "-o", "out.h5"];
    let said = warns(surrogate(here).args(rollout));
    assert!(!said.contains("outside the training data"), "{said}");
    let predicted = Trajectory::open(&here.join("out.h5")).unwrap();
    let truth = Trajectory::open(&data.join("valid/between.h5")).unwrap();
    assert_eq!(predicted.status(), "finished");
    assert_eq!(predicted.frames(), truth.frames());
    assert_eq!(predicted.points(), truth.points());
    for frame in 0..3 {
        let (ours, theirs) = (predicted.frame(frame).unwrap(), truth.frame(frame).unwrap());
        assert_eq!(ours.position, theirs.position, "the first frames are simulated");
    }
    let height = |trajectory: &Trajectory, frame| {
        let position = trajectory.frame(frame).unwrap().position;
        position.iter().map(|x| x[1]).sum::<f64>() / position.len() as f64
    };
    assert!(height(&predicted, 40) < height(&predicted, 0));

    // From the trajectory itself: the very same.
    let from = ["rollout", "run/best.safetensors", "--from", "data/valid/between.h5"];
    succeeds(surrogate(here).args(from).args(["-o", "from.h5"]));
    let again = Trajectory::open(&here.join("from.h5")).unwrap();
    assert_eq!(again.frame(40).unwrap().position, predicted.frame(40).unwrap().position);

    // The evaluation is what validation measured.
    let report = succeeds(surrogate(here).args([
        "eval",
        "run/best.safetensors",
        "--data",
        "data/valid",
        "-o",
        "eval",
        "--noise-floor",
        "data/valid",
    ]));
    assert!(report.contains("between") && report.contains("mean floor"), "{report}");
    let best = column(&here.join("run/validation.csv"), "mse");
    let best = best.into_iter().fold(f64::INFINITY, f64::min);
    let means = column(&here.join("eval/summary.csv"), "mse_mean");
    assert!((means[0] / best - 1.0).abs() < 1e-5, "{means:?} {best}");
    assert_eq!((means[1], means[3]), (0.0, 0.0), "a run does not differ from itself");
    assert_eq!(means[2], means[0], "the mean of one case");
    let mirrored =
        ["eval", "run/best.safetensors", "--data", "data/valid", "-o", "image", "--mirror"];
    succeeds(surrogate(here).args(mirrored));
    let image = column(&here.join("image/summary.csv"), "mse_mean")[0];
    assert!(image != means[0] && image < 2.0 * means[0], "{image} {means:?}");
    assert!(here.join("eval/errors.svg").exists());

    // What is recorded is the error at the end as part of the motion.
    let record = ["eval", "run/best.safetensors", "--data", "data/valid", "-o", "eval", "--record"];
    succeeds(surrogate(here).args(record));
    let truth = Trajectory::open(&here.join("data/valid/between.h5")).unwrap();
    let [first, last] = [0, truth.frames() - 1].map(|frame| truth.frame(frame).unwrap().position);
    let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let motion = first.iter().zip(&last).map(square).sum::<f64>() / first.len() as f64;
    let width = truth.header().domain[0];
    let expected = width * (column(&here.join("eval/summary.csv"), "mse_final")[0] / motion).sqrt();
    let found = Simulator::load(&here.join("run/best.safetensors")).unwrap().training.accuracy;
    let found = found.unwrap();
    assert!((found.mean / expected - 1.0).abs() < 1e-5, "{} {expected}", found.mean);
    assert_eq!((found.runs, found.broken, found.most), (1, 0, found.mean));
}

/// Killed without warning, or with Ctrl-C, a resumed training ends with the weights, the log and
/// the best model of one that was never interrupted.
#[cfg(unix)]
fn resumes_bitwise(device: &str, optimiser: &str) {
    let steps = 300;
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let more = format!(
        "ema = 0.99\noptimiser = \"{optimiser}\"\n[data]\nmirror = true\n\
         [pushforward]\nsteps = 2\nstart = {}",
        steps * 2 / 3
    );
    let config = config(here, steps, &more);
    let train = |output| {
        let mut command = train(here, &config, output);
        command.args(["--device", device]);
        command
    };
    succeeds(&mut train("whole"));

    let cut = here.join("cut/checkpoint.bin");
    let resumable = |more: &[&str]| {
        let mut command = train("cut");
        command.args(["--checkpoint-interval", "0"]).args(more);
        command
    };
    let mut child = resumable(&[]).spawn().unwrap();
    let mut interrupts = 0;
    loop {
        // Let it get on, then stop it: by turns politely and not.
        let start = Instant::now();
        let since = std::fs::metadata(&cut).ok().and_then(|file| file.modified().ok());
        let finished = loop {
            if let Some(status) = child.try_wait().unwrap() {
                assert!(status.success(), "{status}");
                break true;
            }
            let now = std::fs::metadata(&cut).ok().and_then(|file| file.modified().ok());
            if now != since && start.elapsed() > Duration::from_millis(300) {
                break false;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "no progress");
            sleep(Duration::from_millis(5));
        };
        if finished {
            break;
        }
        if interrupts % 2 == 0 {
            child.kill().unwrap();
            child.wait().unwrap();
        } else {
            let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
            assert!(kill.unwrap().success());
            let code = child.wait().unwrap().code();
            assert!(matches!(code, Some(130 | 0)), "{code:?}");
        }
        interrupts += 1;
        child = resumable(&["--resume"]).spawn().unwrap();
    }
    assert!(interrupts > 1, "the training was too short to be interrupted");
    for name in ["last.safetensors", "best.safetensors", "log.csv", "validation.csv"] {
        let [a, b] = ["whole", "cut"].map(|run| std::fs::read(here.join(run).join(name)).unwrap());
        assert!(a == b, "{name} differs after {interrupts} interrupts");
    }
}

#[test]
#[cfg(unix)]
fn an_interrupted_training_resumes_bitwise() {
    resumes_bitwise("cpu", "muon");
}

#[test]
#[cfg(unix)]
fn an_interrupted_training_on_a_gpu_resumes_bitwise() {
    if gpu::for_tests().is_some() {
        resumes_bitwise("cuda", "adam");
    }
}

/// What was learnt stays: a training that starts from a model has its network and normalisation, goes
/// on from its loss, and says what the model was before.
#[test]
fn a_training_starts_from_a_model() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let first = config(here, 600, "ema = 0.9");
    succeeds(&mut train(here, &first, "first"));
    let load = |file: &str| Simulator::load(&here.join(file)).unwrap();
    let before = load("first/last.safetensors");

    let file = here.join("more.toml");
    let more = |text: &str| {
        let text = format!("start = \"first/last.safetensors\"\nlog_every = 10\n{text}");
        std::fs::write(&file, text).unwrap();
    };
    more("steps = 1\n[schedule]\nrate = 1.0e-12\nfinal_rate = 0.0\n[data]\nnoise = 1.0e-3");
    succeeds(&mut train(here, &file, "still"));
    let still = load("still/last.safetensors");
    assert_eq!(still.config, before.config, "the network of the model, though none was asked for");
    assert_eq!(still.normalisation, before.normalisation, "in spite of other noise");
    assert_eq!(still.training.steps, 601);
    let ranges = [&still, &before].map(|simulator| simulator.training.range);
    assert_eq!(ranges[0], ranges[1], "the same data");
    for (a, b) in weights(&still.model).iter().zip(weights(&before.model)) {
        assert!((a - b).abs() <= 1e-7 * b.abs() + 1e-11, "{a} {b}");
    }

    // Frames twice as far apart: twice the velocities, four times the accelerations a frame.
    more("steps = 1\n[schedule]\nrate = 1.0e-12\nfinal_rate = 0.0\n[data]\nstride = 2");
    let said = train(here, &file, "longer").stderr(Stdio::piped()).output().unwrap();
    let said = String::from_utf8(said.stderr).unwrap();
    assert!(said.contains("frames 0.01 s apart, the data have 0.02 s"), "{said}");
    let longer = load("longer/last.safetensors");
    assert!((longer.training.frame_interval - 2.0 * before.training.frame_interval).abs() < 1e-12);
    let [was, is] = [&before, &longer].map(|simulator| &simulator.normalisation);
    let times = |factor: f64, values: &[f64]| -> Vec<f64> {
        values.iter().map(|value| factor * value).collect()
    };
    assert_eq!(is.velocity_std, times(2.0, &was.velocity_std));
    assert_eq!(is.acceleration_std, times(4.0, &was.acceleration_std));

    // Residual layers that the model lacks are added, and begin as nothing.
    let network = "[model]\nwidth = 16\nhidden_layers = 1\nmessage_layers = 1\nframes = 3\n\
                   connection_radius = 0.13\nresidual_layers = 2";
    more(&format!("steps = 1\n[schedule]\nrate = 1.0e-12\nfinal_rate = 0.0\n{network}"));
    succeeds(&mut train(here, &file, "deeper"));
    let Model::Tgnns(deeper) = load("deeper/last.safetensors").model else { panic!("a GNS") };
    assert_eq!(deeper.residual_layers.len(), 2);
    for layer in &deeper.residual_layers {
        let scale = layer.update.norm.as_ref().unwrap().gamma.val().into_data();
        assert!(scale.iter::<f32>().all(|scale| scale.abs() < 1e-6), "{scale}");
    }

    more("steps = 50\n[schedule]\nrate = 1.0e-3");
    succeeds(&mut train(here, &file, "more"));
    let losses = |run: &str| column(&here.join(run).join("log.csv"), "loss");
    let (old, new) = (losses("first"), losses("more"));
    assert!(new[0] < 0.9 * old[0], "{} {}", new[0], old[0]);

    // Once begun, it is the training of that model and of no other.
    succeeds(train(here, &file, "more").arg("--resume"));
    std::fs::copy(here.join("still/last.safetensors"), here.join("first/last.safetensors"))
        .unwrap();
    let error = fails(train(here, &file, "more").arg("--resume"));
    assert!(error.contains("checkpoint.bin") && error.contains("weights of `start`"), "{error}");

    let refused = |text: &str, parts: &[&str]| {
        more(text);
        let error = fails(&mut train(here, &file, "bad"));
        for part in parts {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
    };
    let weights = "first/last.safetensors";
    refused("network = \"msg0\"", &["more.toml", weights, "`width` is 128, not 16"]);
    refused("[data]\nsubtract_gravity = true", &[weights, "data.subtract_gravity", "false"]);
    std::fs::remove_file(here.join(weights)).unwrap();
    refused("", &["more.toml", "`start`", weights]);
    assert!(data.exists() && !here.join("bad").exists(), "nothing is written for a wrong file");
}

/// What would stop a training at its first validation or checkpoint stops it before its first step, with
/// the files of an older training as they were.
#[test]
fn nothing_is_trained_in_vain() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let config = config(here, 20, "");
    succeeds(&mut train(here, &config, "old"));
    let refused = |output: &str, parts: &[&str]| {
        let mut command = train(here, &config, output);
        let error = fails(command.args(["--overwrite", "--checkpoint-interval", "0"]));
        for part in parts {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
    };
    for (text, parts) in [
        (scene(0.0, 1.0, "").replace("0.01", "0.02"), ["0.01 s", "0.02 s"]),
        (
            scene(0.0, 1.0, "").replace("0.4", "0.02"),
            ["other.h5: 3 frames", "starts from 3 frames"],
        ),
        (scene(0.0, 1.0, "").replace("0.4", "0.01"), ["needs 3 initial frames", "there are 2"]),
    ] {
        simulate(&text, &data.join("valid/other.h5"));
        for output in ["old", "new"] {
            refused(output, &[&["other.h5"], &parts[..]].concat());
        }
    }
    assert!(here.join("old/checkpoint.bin").exists() && here.join("old/best.safetensors").exists());
    assert!(!here.join("new").exists());

    std::fs::remove_file(data.join("valid/other.h5")).unwrap();
    refused("training.toml/new", &["training.toml/new: cannot train into this folder"]);
}

/// An old training is gone as soon as another one begins in its folder, and a third one is kept out.
#[test]
fn a_folder_is_that_of_one_training() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let short = config(here, 20, "");
    succeeds(&mut train(here, &short, "run"));
    let run = here.join("run");
    let best = run.join("best.safetensors");

    // Models are not overwritten unasked, be there a checkpoint or not.
    std::fs::rename(run.join("checkpoint.bin"), here.join("aside")).unwrap();
    let error = fails(&mut train(here, &short, "run"));
    assert!(
        error.contains("there is a training already") && error.contains("--overwrite"),
        "{error}"
    );
    std::fs::rename(here.join("aside"), run.join("checkpoint.bin")).unwrap();
    let from = here.join("from.toml");
    std::fs::write(&from, "start = \"run/best.safetensors\"").unwrap();
    let error = fails(train(here, &from, "run").arg("--overwrite"));
    assert!(error.contains("from.toml") && error.contains("`start`"), "{error}");
    assert!(best.exists());

    std::fs::remove_dir_all(data.join("valid")).unwrap();
    let long = config(here, 50_000, "");
    let mut child = train(here, &long, "run").arg("--overwrite").spawn().unwrap();
    let began = Instant::now();
    while best.exists() && began.elapsed() < Duration::from_secs(60) {
        sleep(Duration::from_millis(5));
    }
    let short = config(here, 20, "");
    let error = fails(train(here, &short, "run").arg("--overwrite"));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!best.exists(), "the old training stays");
    assert!(
        error.contains("run/checkpoint.bin: process") && error.contains("is writing it"),
        "{error}"
    );
    // What was killed before its first checkpoint begins.
    succeeds(train(here, &short, "run").arg("--resume"));
    assert!(run.join("last.safetensors").exists());
}

/// A training goes on with less memory or other validations, but not with other data or noise.
#[test]
fn a_training_resumes_unless_its_steps_would_be_others() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let resume = |steps, more: &str| {
        let mut command = train(here, &config(here, steps, more), "run");
        command.arg("--resume");
        command
    };
    succeeds(&mut train(here, &config(here, 20, "[data]\nnoise = 2.0e-4"), "run"));
    succeeds(&mut resume(30, "[data]\nnoise = 2.0e-4\nmemory = 0"));
    // Once more: it is finished, and nothing is written.
    let checkpoint =
        || std::fs::metadata(here.join("run/checkpoint.bin")).unwrap().modified().unwrap();
    let before = checkpoint();
    let said = succeeds(&mut resume(30, "[data]\nnoise = 2.0e-4"));
    assert_eq!(said, "run: finished already\n");
    assert_eq!(checkpoint(), before);
    let error = fails(&mut resume(40, "batch = 3\n[data]\nnoise = 1.0e-4"));
    let expected = "the configuration has changed since the training began: `batch` is 3, not 2, \
                    `data.noise` is 0.0001, not 0.0002";
    assert!(error.contains(expected), "{error}");
    // `best` would mix errors of different files.
    let valid = here.join("data/valid");
    std::fs::copy(valid.join("between.h5"), valid.join("more.h5")).unwrap();
    let error = fails(&mut resume(40, "[data]\nnoise = 2.0e-4"));
    assert!(error.contains("the validation data have changed since"), "{error}");
}

#[test]
fn a_damaged_checkpoint_is_refused_by_name() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    succeeds(&mut train(here, &config(here, 20, ""), "run"));
    let path = here.join("run/checkpoint.bin");
    let whole = std::fs::read(&path).unwrap();
    for place in [10, whole.len() / 3, whole.len() / 2, whole.len() - 1] {
        let mut bytes = whole.clone();
        bytes[place] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let error = fails(train(here, &config(here, 30, ""), "run").arg("--resume"));
        assert!(error.contains("checkpoint.bin: damaged"), "{error}");
    }
    std::fs::write(&path, whole).unwrap();
    succeeds(train(here, &config(here, 30, ""), "run").arg("--resume"));
}

/// Frames from before a run follow from the velocities in its first frame.
#[test]
fn windows_can_begin_before_the_run() {
    let directory = TempDir::new().unwrap();
    let data = data(directory.path());
    let path = data.join("train/left.h5");
    let run = Trajectory::open(&path).unwrap();
    let shape = WindowShape { frames: 4, stride: 2, before: 3 };
    let set = DataSet::open(&[path], shape, 0).unwrap();
    assert_eq!(set.len(), 41 + 6 - 8);
    let first = run.frame(0).unwrap();
    let example = set.example(0).unwrap();
    for (place, positions) in example.positions.chunks(2 * 24).enumerate() {
        let time = (place as f64 - 3.0) * 0.02;
        for ((p, x), v) in
            positions.as_chunks::<2>().0.iter().zip(&first.position).zip(&first.velocity)
        {
            assert!((0..2).all(|k| (p[k] - x[k] - v[k] * time).abs() < 1e-12));
        }
    }
    assert_eq!(example.next, run.frame(2).unwrap().position.as_flattened());
    let last = set.example(set.len() - 1).unwrap();
    assert_eq!(last.positions[..48], *run.frame(32).unwrap().position.as_flattened());
    assert_eq!(last.next, run.frame(40).unwrap().position.as_flattened());
}

#[test]
fn windows_of_every_stride_are_frames_of_the_files() {
    let directory = TempDir::new().unwrap();
    let data = data(directory.path());
    let paths = ["left", "middle"].map(|name| data.join("train").join(name).with_extension("h5"));
    let second = Trajectory::open(&paths[1]).unwrap();
    for stride in [1, 2, 3, 6, 10] {
        let shape = WindowShape { frames: 3, stride, before: 0 };
        for memory in [0, 1 << 14, 1 << 30] {
            let set = DataSet::open(&paths, shape, memory).unwrap();
            let of_one_file = 41 - 3 * stride;
            assert_eq!(set.len(), 2 * of_one_file);
            // The last window of all ends with the last frame of the last file.
            let example = set.example(set.len() - 1).unwrap();
            for (place, positions) in example.positions.chunks(2 * 24).enumerate() {
                let frame = second.frame(40 - (3 - place) * stride).unwrap();
                assert_eq!(positions, frame.position.as_flattened());
            }
            assert_eq!(example.next, second.frame(40).unwrap().position.as_flattened());
            assert!((example.gravity[1] + 9.81 * 1e-4 * (stride * stride) as f64).abs() < 1e-12);
        }
    }
}
