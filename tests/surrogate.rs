//! `surrogate` as a user meets it: trajectories -> training -> rollout -> evaluation.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;
use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::{Trajectory, TrajectoryWriter};
use surrogate::backend::device;
use surrogate::config::ModelConfig;
use surrogate::data::{DataSet, Shape};
use surrogate::doubts::{doubts, mirror_difference};
use surrogate::features::Normalisation;
use surrogate::model::Model;
use surrogate::simulator::{Simulator, Training};
use surrogate::start::Start;
use surrogate::train::{Precision, TrainConfig, with_weights};
use tempfile::TempDir;

/// A collapse of 24 points with the continuum law: milliseconds to simulate.
fn scene(x: f64, width: f64, more: &str) -> String {
    format!(
        "title = \"Tiny column\"\nduration = 0.4\nframe_interval = 0.01\n\
         [domain]\nsize = [{width:?}, 0.5]\ncell = 0.125\n\
         [[column]]\ncorner = [{x:?}, 0.0]\nsize = [0.25, 0.375]\n\
         [material]\nkind = \"mu-i\"\n[output]\nfields = []\n{more}"
    )
}

/// Simulates a scene into a file.
fn simulate(text: &str, path: &Path) {
    let mut simulation = Simulation::new(Scene::parse(text, "tiny.toml").unwrap()).unwrap();
    let header = simulation.header("2026-11-21T00:00:00Z".to_owned());
    let mut writer = TrajectoryWriter::create(path, &header, &simulation.static_points()).unwrap();
    writer.push(simulation.frame()).unwrap();
    for _ in 0..simulation.scene.frames() {
        for _ in 0..simulation.scene.steps_per_frame() {
            simulation.advance().unwrap();
        }
        writer.push(simulation.frame()).unwrap();
    }
    writer.finish("finished").unwrap();
}

/// A folder with two training files and one to validate.
fn data(directory: &Path) -> PathBuf {
    let data = directory.join("data");
    for (name, x) in [("train/left", 0.0), ("train/middle", 0.375), ("valid/between", 0.125)] {
        simulate(&scene(x, 1.0, ""), &data.join(name).with_extension("h5"));
    }
    data
}

/// A small network. `steps` and what else the test changes.
fn config(directory: &Path, steps: u64, more: &str) -> PathBuf {
    let text = format!(
        "steps = {steps}\nlog_every = 10\n{more}\n\
         [model]\nwidth = 16\nhidden_layers = 1\nmessage_layers = 1\nframes = 3\n\
         connection_radius = 0.13\n\
         [schedule]\nrate = 3.0e-3\n[validation]\nevery = 20\n"
    );
    let path = directory.join("training.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn surrogate(directory: &Path) -> Command {
    let mut command = Command::new(cargo_bin("surrogate"));
    // Between fork and exec a child of another test holds the lock of a file being written here.
    command.current_dir(directory).env("HDF5_USE_FILE_LOCKING", "FALSE");
    command
}

fn train(directory: &Path, config: &Path, output: &str) -> Command {
    let mut command = surrogate(directory);
    command.arg("train").arg(config).args(["--data", "data", "-o", output]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// The standard output of a command that has to succeed.
fn succeeds(command: &mut Command) -> String {
    let output = command.stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The standard error of a command that has to succeed.
fn warns(command: &mut Command) -> String {
    let output = command.stdout(Stdio::null()).stderr(Stdio::piped()).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{error}");
    error
}

/// The standard error of a command that has to fail, as one line.
fn fails(command: &mut Command) -> String {
    let output = command.stdout(Stdio::null()).stderr(Stdio::piped()).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{error}");
    // Reports are wrapped to the width of the terminal.
    error.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A column of a table with a header line.
fn column(path: &Path, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let place = lines.next().unwrap().split(',').position(|title| title == name).unwrap();
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

#[test]
fn trajectories_become_a_model_that_continues_them() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    let data = data(here);
    let stats = succeeds(surrogate(here).arg("stats").arg(&data));
    assert!(stats.contains("2 files to train with, 1 to validate"), "{stats}");

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
    std::fs::write(here.join("scene.toml"), scene(0.125, 1.0, "")).unwrap();
    let rollout = ["rollout", "run/best.safetensors", "--scene", "scene.toml", "-o", "out.h5"];
    let said = warns(surrogate(here).args(rollout));
    assert!(!said.contains("trained on"), "a start like those of the training: {said}");
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
}

/// The model that comes with the program lets a column collapse.
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
    assert!(said.contains("what the network was trained on is not in its file"), "{said}");
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
}

/// The model of the repository believes in a column like those that it learnt from, and in no other
/// start.
#[test]
fn a_start_is_compared_with_the_training_data() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let simulator = Simulator::load(&repository.join("models/tgnns-tiny.safetensors")).unwrap();
    let symmetric = Simulator { mirror: true, ..simulator.clone() };
    let scene = Scene::load(repository.join("scenes/column-mu-i.toml")).unwrap();
    let start = Start::from_scene(scene, &simulator).unwrap();
    assert_eq!(doubts(&symmetric, &start), Vec::<String>::new());

    // A column away from the walls, whose mirror image should move as its mirror image.
    let free = "duration = 1.0\nstep = 4e-4\nframe_interval = 0.02\n[domain]\nsize = [4.0, 2.0]\n\
                [[column]]\ncorner = [1.0, 0.0]\nsize = [0.75, 0.75]\n[material]\nkind = \"mu-i\"\n";
    let free = Start::from_scene(Scene::parse(free, "free.toml").unwrap(), &simulator).unwrap();
    let mirror =
        |simulator: &Simulator| doubts(simulator, &free).iter().any(|d| d.contains("--mirror"));
    assert!(mirror(&simulator) && !mirror(&symmetric));
    assert!(mirror_difference(&symmetric, &free) < 1e-3 * mirror_difference(&simulator, &free));

    let mut noisy = start.clone();
    for (frame, positions) in noisy.positions.iter_mut().enumerate() {
        // Up and down by 1 mm, no two neighbours alike.
        let shift = |p: usize| if (p + frame).is_multiple_of(2) { 1e-3 } else { -1e-3 };
        positions.iter_mut().enumerate().for_each(|(p, x)| x[1] += shift(p));
    }
    let said = doubts(&symmetric, &noisy).concat();
    assert!(said.contains("differences between neighbours' accelerations"), "{said}");

    let mut small = start;
    for positions in &mut small.positions {
        positions.retain(|x| x[0] < 0.5 && x[1] < 0.5);
    }
    let said = doubts(&symmetric, &small).concat();
    for expected in ["points 64, at least 240", "width", "height"] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
}

#[test]
fn the_model_of_the_repository_follows_a_collapse() {
    let directory = TempDir::new().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let output = directory.path().join("out.h5");
    let mut command = surrogate(directory.path());
    command.arg("rollout").arg(root.join("models/tgnns-tiny.safetensors"));
    command.arg("--scene").arg(root.join("scenes/column-mu-i.toml"));
    succeeds(command.arg("-o").arg(&output).args(["--frames", "81"]));
    let budget = |frame| Trajectory::open(&output).unwrap().frame(frame).unwrap().budget;
    let (first, last) = (budget(0), budget(80));
    assert!(last["front"] > 1.5 * first["front"] && last["front"] < 3.5, "{last:?}");
    assert!(last["max_height"] < 0.95 * first["max_height"], "{last:?}");
}

/// Killed without warning, or with Ctrl-C, a resumed training ends with the weights, the log and
/// the best model of one that was never interrupted.
#[test]
#[cfg(unix)]
fn an_interrupted_training_resumes_bitwise() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let more = "ema = 0.99\n[data]\nmirror = true\n[pushforward]\nsteps = 2\nstart = 600";
    let config = config(here, 900, more);
    succeeds(&mut train(here, &config, "whole"));

    let cut = here.join("cut/checkpoint.bin");
    let resumable = |more: &[&str]| {
        let mut command = train(here, &config, "cut");
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

/// Two processes that share the windows of each step learn what one with twice the batch does.
#[test]
fn two_processes_train_like_one() {
    let directory = TempDir::new().unwrap();
    let here = directory.path();
    data(here);
    let more = "[data]\nmirror = true\n[pushforward]\nsteps = 1\nstart = 20";
    let whole = config(here, 40, &format!("batch = 4\n{more}"));
    let whole_text = std::fs::read_to_string(&whole).unwrap();
    succeeds(&mut train(here, &whole, "whole"));
    let half = here.join("half.toml");
    std::fs::write(&half, whole_text.replace("batch = 4", "batch = 2")).unwrap();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let rank = |rank: &str, config: &Path| {
        let mut command = train(here, config, "shared");
        command.env("WORLD_SIZE", "2").env("RANK", rank).env("MASTER_PORT", port.to_string());
        command
    };
    let mut second = rank("1", &half).spawn().unwrap();
    succeeds(&mut rank("0", &half));
    assert!(second.wait().unwrap().success());
    let numbers = |run: &str, file: &str, name: &str| column(&here.join(run).join(file), name);
    // Sums in another order, which rollouts amplify.
    for (file, name, tolerance) in [("log.csv", "loss", 1e-3), ("validation.csv", "mse", 0.05)] {
        let (one, two) = (numbers("whole", file, name), numbers("shared", file, name));
        assert!(!one.is_empty() && one.len() == two.len());
        for (a, b) in one.iter().zip(two) {
            assert!((a / b - 1.0).abs() < tolerance, "{name}: {a} and {b}");
        }
    }

    // Processes that do not belong together say so.
    std::fs::write(&half, whole_text.replace("batch = 4", "batch = 3")).unwrap();
    let mut second = rank("1", &half).arg("--overwrite").spawn().unwrap();
    let error = fails(rank("0", &whole).arg("--overwrite"));
    assert!(error.contains("rank 1 and rank 0 do not train the same"), "{error}");
    assert!(!second.wait().unwrap().success());
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

#[test]
fn windows_of_every_stride_are_frames_of_the_files() {
    let directory = TempDir::new().unwrap();
    let data = data(directory.path());
    let paths = ["left", "middle"].map(|name| data.join("train").join(name).with_extension("h5"));
    let second = Trajectory::open(&paths[1]).unwrap();
    for stride in [1, 2, 3, 6, 10] {
        let shape = Shape { frames: 3, stride };
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
    expect(&refused("precision = \"bf16\""), &["bf16", "CPU"]);
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
    let sick = with_weights(healthy.clone(), &vec![f32::NAN; config.parameter_count()]);
    for (model, size, reason) in
        [(healthy, 1e9, "leaves the domain by"), (sick, 1e-3, "is not finite")]
    {
        let simulator = Simulator {
            model,
            config: config.clone(),
            normalisation: Normalisation {
                velocity_mean: vec![0.0; 2],
                velocity_std: vec![1e-3; 2],
                acceleration_mean: vec![0.0; 2],
                acceleration_std: vec![size; 2],
                ..Normalisation::default()
            },
            training: Training {
                frame_interval: 0.01,
                without_gravity: false,
                steps: 0,
                range: None,
            },
            mirror: false,
            device: device(),
            gpu: None,
            precision: Precision::F32,
        };
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

#[test]
fn the_configurations_that_come_with_the_program_are_valid() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    TrainConfig::load(&configs.join("tiny.toml")).unwrap();
    let mut networks = std::collections::BTreeSet::new();
    for entry in std::fs::read_dir(configs.join("paper")).unwrap() {
        let config = TrainConfig::load(&entry.unwrap().path()).unwrap();
        networks.insert((config.network, config.data.stride));
    }
    assert_eq!(networks.len(), 50, "ten networks on five data sets");
    for set in ["train", "valid", "other-packing"] {
        for entry in std::fs::read_dir(configs.join("tiny").join(set)).unwrap() {
            Scene::load(entry.unwrap().path()).unwrap();
        }
    }
}
