//! Undamaged inputs of every format, made once by the programs themselves.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::Duration;

use crate::campaign::{Finding, Promise, empty, workplace};
use crate::program::{program, signal};

/// A column of packings before a plate and an obstacle, a tenth of a second to run. Its two packings take another.
const SCENE: &str = r#"title = "Tiny column"
duration = 0.04
frame_interval = 0.005
[domain]
size = [1.0, 0.5]
cell = 0.125
walls = { bottom = 0.3, left = "stick" }
[[column]]
corner = [0.0, 0.0]
size = [0.25, 0.25]
[[obstacle]]
corner = [0.5, 0.0]
size = [0.25, 0.25]
[plate]
corner = [0.75, 0.25]
size = [0.25, 0.25]
velocity = [0.0, -0.5]
[grains]
radius_min = 2.5e-3
[material]
packings = 2
[rve]
discs = 20
[rve.preparation]
pressure = 2.0e3
[numerics]
relaxation = 500.0
"#;

/// A column under the continuum law, some milliseconds.
const MU_I: &str = r#"duration = 0.1
frame_interval = 0.005
[domain]
size = [1.0, 0.5]
cell = 0.125
[[column]]
corner = [0.0, 0.0]
size = [0.25, 0.375]
[material]
kind = "mu-i"
[output]
fields = ["stress"]
"#;

/// Discs with grains and fields on a grid.
const DISCS: &str = r#"duration = 0.01
frame_interval = 0.002
[domain]
size = [0.25, 0.125]
cell = 0.0625
[[column]]
corner = [0.0, 0.0]
size = [0.0625, 0.0625]
[material]
kind = "discs"
[output]
fields = ["stress", "solid_fraction", "coordination"]
grains_every = 2
grid = { width = 0.01, spacing = 0.025 }
"#;

const LIST: &str = r#"scene = "mu-i.toml"
[set]
duration = 0.05
[[train]]
grid.column.0.size = [[0.25, 0.25], [0.25, 0.375]]
[[valid]]
list.column.0.corner = [[0.25, 0.0], [0.375, 0.0]]
list.column.0.velocity = [[0.0, 0.0], [1.0, 0.0]]
[[test]]
set.obstacle = [{ corner = [0.75, 0.0], size = [0.25, 0.25] }]
"#;

const ELEMENT: &str = r#"sampling = 0.001
seed = 1
packing = "packing.csv"
[rve]
discs = 20
[rve.preparation]
pressure = 20e3
[[stage]]
kind = "isotropic"
pressure = 20e3
duration = 0.005
[[stage]]
kind = "biaxial"
pressure = 20e3
shortening_rate = 2.0
strain = 0.02
"#;

const TRAINING: &str = r#"steps = 30
batch = 2
log_every = 5
ema = 0.9
[model]
width = 8
hidden_layers = 1
message_layers = 1
frames = 3
connection_radius = 0.13
[data]
noise = 3.0e-4
mirror = true
[schedule]
rate = 3.0e-3
[pushforward]
steps = 1
start = 15
[validation]
every = 10
"#;

/// The folder of the inputs, all of them made by now:
///
/// | | |
/// |---|---|
/// | `scene.toml`, `mu-i.toml`, `discs.toml`, `list.toml`, `element.toml`, `training.toml` | texts |
/// | `packing.csv` | packing of `element.toml` |
/// | `cache/packings/` | packings of `scene.toml` |
/// | `whole.h5`, `whole.npz` | the run of `scene.toml` |
/// | `discs.h5` | the run of `discs.toml` |
/// | `cut.h5`, `cut.h5.ckpt` | the same, killed |
/// | `data/train/`, `data/valid/` | runs of `mu-i.toml` |
/// | `whole/` | the training of `training.toml` |
/// | `cut/` | the same, killed |
pub fn fixtures() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = workplace().join("fixtures");
        make(&folder);
        folder
    })
}

/// A training, but for the folder that it writes.
pub const TRAIN: &str = "surrogate train training.toml --data data --device cpu";
/// A prediction of `out.h5`.
pub const PREDICT: &str =
    "surrogate rollout whole/best.safetensors --from data/valid/middle.h5 -o out.h5 --device cpu";

fn make(folder: &Path) {
    empty(folder);
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    let do_it = |line: &str| {
        let ended = program(line, folder).run();
        assert!(ended.succeeded(), "{}", ended.report("an undamaged input"));
    };
    write("scene.toml", SCENE);
    write("mu-i.toml", MU_I);
    write("discs.toml", DISCS);
    write("list.toml", LIST);
    write("element.toml", &ELEMENT.replace("packing = \"packing.csv\"\n", ""));
    write("training.toml", TRAINING);
    do_it("dempm run scene.toml -o whole.h5 --device cpu");
    do_it("dempm run discs.toml -o discs.h5 --device cpu");
    kill_at(
        folder,
        "dempm run scene.toml -o cut.h5 --device cpu --checkpoint-interval 0",
        "cut.h5.ckpt",
    );
    do_it("dempm element element.toml -o path.csv --dump-packing packing.csv");
    write("element.toml", ELEMENT);
    do_it("dempm run mu-i.toml -o data/train/left.h5 --device cpu");
    write("middle.toml", &MU_I.replace("corner = [0.0, 0.0]", "corner = [0.125, 0.0]"));
    do_it("dempm run middle.toml -o data/valid/middle.h5 --device cpu");
    do_it(&format!("{TRAIN} -o whole"));
    do_it("dempm export whole.h5 --to npz -o whole.npz");
    kill_at(folder, &format!("{TRAIN} -o cut --checkpoint-interval 0"), "cut/checkpoint.bin");
}

/// Kills a program as soon as it has left this file.
fn kill_at(folder: &Path, line: &str, file: &str) {
    let mut child = program(line, folder).command().spawn().unwrap();
    while !folder.join(file).exists() {
        assert!(child.try_wait().unwrap().is_none(), "{line}: ended without {file}");
        sleep(Duration::from_micros(100));
    }
    signal(&child, libc::SIGKILL);
    child.wait().unwrap();
    assert!(folder.join(file).exists(), "{line}: ended before it was killed");
}

/// Copies inputs into a folder, under their own names.
pub fn copy(names: &[&str], folder: &Path) {
    for name in names {
        copy_tree(&fixtures().join(name), &folder.join(name));
    }
}

fn copy_tree(from: &Path, to: &Path) {
    fs::create_dir_all(to.parent().unwrap()).unwrap();
    if from.is_dir() {
        for entry in fs::read_dir(from).unwrap().map(|entry| entry.unwrap()) {
            copy_tree(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        fs::copy(from, to).unwrap_or_else(|error| panic!("{}: {error}", from.display()));
    }
}

/// Every array of a trajectory, as a file for numpy.
pub fn arrays(file: &str, folder: &Path) -> Result<Vec<u8>, Finding> {
    let export = program(&format!("dempm export {file} --to npz -o arrays.npz"), folder).run();
    if !export.succeeded() {
        return Promise::NothingLost.broken(export.report("cannot be read any more"));
    }
    let bytes = fs::read(folder.join("arrays.npz")).expect("an export writes its file");
    fs::remove_file(folder.join("arrays.npz")).expect("it can be removed");
    Ok(bytes)
}
