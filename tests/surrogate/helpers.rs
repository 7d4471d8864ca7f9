//! What the tests have in common: tiny trajectories, configurations, and commands that have to
//! succeed or to fail.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use assert_cmd::cargo::cargo_bin;
use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::TrajectoryWriter;

/// A collapse of 24 points with the continuum law: milliseconds to simulate.
pub fn scene(x: f64, width: f64, more: &str) -> String {
    format!(
        "title = \"Tiny column\"\nduration = 0.4\nframe_interval = 0.01\n\
         [domain]\nsize = [{width:?}, 0.5]\ncell = 0.125\npoint_layout = \"square\"\n\
         [[column]]\ncorner = [{x:?}, 0.0]\nsize = [0.25, 0.375]\n\
         [material]\nkind = \"mu-i\"\n[output]\nfields = []\n{more}"
    )
}

/// Simulates a scene into a file.
pub fn simulate(text: &str, path: &Path) {
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

/// A law, whatever the default is: trainings and their errors stay those of the same data.
pub const LAW: &str = "[mu-i]\ndensity = 2173.0\nbulk_modulus = 6.0e6\nshear_modulus = 4.7e6\n\
                   static_friction = 0.28\ndynamic_friction = 0.8\ninertial_number = 0.35\n";

/// A folder with two training files and one to validate.
pub fn data(directory: &Path) -> PathBuf {
    let data = directory.join("data");
    for (name, x) in [("train/left", 0.0), ("train/middle", 0.375), ("valid/between", 0.125)] {
        simulate(&scene(x, 1.0, LAW), &data.join(name).with_extension("h5"));
    }
    data
}

/// A small network. `steps` and what else the test changes.
pub fn config(directory: &Path, steps: u64, more: &str) -> PathBuf {
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

pub fn surrogate(directory: &Path) -> Command {
    let mut command = Command::new(cargo_bin("surrogate"));
    // Between fork and exec a child of another test holds the lock of a file being written here.
    command.current_dir(directory).env("HDF5_USE_FILE_LOCKING", "FALSE");
    command
}

pub fn train(directory: &Path, config: &Path, output: &str) -> Command {
    let mut command = surrogate(directory);
    command.arg("train").arg(config).args(["--data", "data", "-o", output]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// The standard output of a command that has to succeed.
pub fn succeeds(command: &mut Command) -> String {
    let output = command.stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The standard error of a command that has to succeed.
pub fn warns(command: &mut Command) -> String {
    let output = command.stdout(Stdio::null()).stderr(Stdio::piped()).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{error}");
    error
}

/// The standard error of a command that has to fail, as one line.
pub fn fails(command: &mut Command) -> String {
    let output = command.stdout(Stdio::null()).stderr(Stdio::piped()).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{error}");
    // Reports are wrapped to the width of the terminal.
    error.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A column of a table with a header line.
pub fn column(path: &Path, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let place = lines.next().unwrap().split(',').position(|title| title == name).unwrap();
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}
