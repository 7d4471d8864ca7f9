//! `dempm dataset` and the exports for other learned simulators, as a user meets them.

#[path = "common/program.rs"]
mod program;
#[path = "../dempm/tests/trajectory/python.rs"]
mod python;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use dempm::trajectory::Trajectory;
use tempfile::TempDir;

use program::program;

const BASE: &str = r#"
title = "Heap"
duration = 0.2
frame_interval = 0.01
step = 1.0e-4
[domain]
size = [2.0, 1.0]
cell = 0.125
[[column]]
size = [0.5, 0.5]
[material]
kind = "mu-i"
"#;

const LIST: &str = r#"
scene = "base.toml"
[set]
mu-i.static_friction = 0.3
[[train]]
grid.column.0.corner = [[0.0, 0.0], [1.0, 0.25]]
grid.mu-i.dynamic_friction = [0.6, 0.8]
[[train]]
list.column.0.size = [[0.25, 0.5], [0.5, 0.25]]
list.column.0.velocity = [[1.0, 0.0], [0.0, 1.0]]
[[valid]]
set.duration = 0.1
[[test]]
set.obstacle = [{ corner = [1.0, 0.0], size = [0.25, 0.25] }]
list.duration = [0.3, 0.2]
list.column.0.size = [[0.5, 0.5], [0.5, 0.75]]
"#;

/// A folder with a base scene and a list of it.
fn folder(base: &str, list: &str) -> TempDir {
    let directory = TempDir::new().unwrap();
    std::fs::write(directory.path().join("base.toml"), base).unwrap();
    std::fs::write(directory.path().join("list.toml"), list).unwrap();
    directory
}

fn dempm(directory: &Path, words: &[&str]) -> Command {
    let mut command = program("dempm", directory);
    command.args(words);
    command
}

fn succeeds(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The standard error of a command that has to fail.
fn fails(command: &mut Command) -> String {
    fails_with(1, command)
}

/// The standard error of a command that has to end with an exit code.
fn fails_with(code: i32, command: &mut Command) -> String {
    let output = command.output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{error}");
    error
}

/// Positions of all frames, frame by frame, x and y of every point.
fn positions(path: &Path) -> Vec<Vec<f64>> {
    let t = Trajectory::open(path).unwrap();
    let frame = |k| t.positions(k..k + 1).unwrap().into_raw_vec_and_offset().0;
    (0..t.frames()).map(frame).collect()
}

fn bits(path: &Path) -> Vec<u64> {
    positions(path).into_iter().flatten().map(f64::to_bits).collect()
}

fn trajectories(set: &Path) -> Vec<PathBuf> {
    let names = ["train/000", "train/001", "train/002", "train/003", "train/004", "train/005"];
    let others = ["valid/000", "test/000", "test/001"];
    names.iter().chain(&others).map(|name| set.join(format!("{name}.h5"))).collect()
}

#[test]
fn a_list_becomes_a_data_set_that_is_not_made_twice() {
    let directory = folder(BASE, LIST);
    let run = ["dataset", "list.toml", "-o", "set", "--jobs", "2"];
    let output = succeeds(&mut dempm(directory.path(), &run));
    let set = directory.path().join("set");

    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    let csv = std::fs::read_to_string(set.join("scenes.csv")).unwrap();
    assert_eq!(csv.lines().count(), 10);
    for line in csv.lines().skip(1) {
        assert!(line.contains(",ok,"), "{csv}");
    }
    assert!(
        csv.contains("\"column.0.corner = [1.0, 0.25], mu-i.dynamic_friction = 0.6\""),
        "{csv}"
    );
    assert!(table.contains("train/005") && table.contains("metadata.json"), "{table}");

    // The list says what the scenes are: values for all, products, side by side.
    let files = trajectories(&set);
    let scene = |file: &Path| {
        let text = Trajectory::open(file).unwrap().header().scene.clone();
        dempm::scene::Scene::parse(&text, "case").unwrap()
    };
    for (file, corner, friction) in [
        (&files[0], [0.0, 0.0], 0.6),
        (&files[1], [0.0, 0.0], 0.8),
        (&files[2], [1.0, 0.25], 0.6),
        (&files[3], [1.0, 0.25], 0.8),
    ] {
        let scene = scene(file);
        assert_eq!(scene.columns[0].place.corner, corner);
        let dempm::scene::Material::MuI(law) = scene.material else { panic!("mu(I)") };
        assert_eq!((law.static_friction, law.dynamic_friction), (0.3, friction));
    }
    assert_eq!(scene(&files[5]).columns[0].velocity, [0.0, 1.0]);
    assert_eq!(positions(&files[6]).len(), 11);
    assert_eq!(scene(&files[7]).obstacles.len(), 1);
    let titles: Vec<String> = files.iter().map(|file| scene(file).title).collect();
    assert_eq!(titles[8], "Heap, test 001");

    statistics_are_those_of_the_training_set(&set);

    let before: Vec<_> = files.iter().map(|f| f.metadata().unwrap().modified().unwrap()).collect();
    let error = fails(&mut dempm(directory.path(), &run));
    assert!(
        error.contains("train/000.h5: is there already") && error.contains("--resume"),
        "{error}"
    );
    let resume = [&run[..], &["--resume"]].concat();
    let again = succeeds(&mut dempm(directory.path(), &resume));
    assert!(String::from_utf8_lossy(&again.stderr).contains("9 of 9 scenes are complete"));
    let after: Vec<_> = files.iter().map(|f| f.metadata().unwrap().modified().unwrap()).collect();
    assert_eq!(before, after);

    // Another scene under the name of one that is there.
    let changed = LIST.replace("[1.0, 0.25]", "[1.0, 0.5]");
    std::fs::write(directory.path().join("list.toml"), changed).unwrap();
    let error = fails(&mut dempm(directory.path(), &resume));
    assert!(error.contains("002.h5") && error.contains("--overwrite"), "{error}");
}

/// `metadata.json` against sums taken in two passes.
fn statistics_are_those_of_the_training_set(set: &Path) {
    let text = std::fs::read_to_string(set.join("metadata.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (mut velocity, mut acceleration) = ([vec![], vec![]], [vec![], vec![]]);
    for file in &trajectories(set)[..6] {
        let x = positions(file);
        for (k, now) in x.iter().enumerate().skip(1) {
            for place in 0..now.len() {
                velocity[place % 2].push(now[place] - x[k - 1][place]);
                if k > 1 {
                    let change = now[place] - 2.0 * x[k - 1][place] + x[k - 2][place];
                    acceleration[place % 2].push(change);
                }
            }
        }
    }
    for (name, values) in [("vel", velocity), ("acc", acceleration)] {
        for (axis, values) in values.iter().enumerate() {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            let deviation = (square / values.len() as f64).sqrt();
            let found = |what: &str| json[format!("{name}_{what}")][axis].as_f64().unwrap();
            assert!((found("mean") - mean).abs() < 1e-10 * deviation, "{name} {axis}");
            assert!((found("std") / deviation - 1.0).abs() < 1e-10, "{name} {axis}");
        }
    }
    assert_eq!(json["bounds"], serde_json::json!([[0.0, 2.0], [0.0, 1.0]]));
    assert_eq!(json["dt"], 0.01);
    assert_eq!(json["default_connectivity_radius"], 0.25);
    for (key, value) in
        [("dim", 2), ("sequence_length", 21), ("sequence_length_test", 21), ("num_trajs_train", 6)]
    {
        assert_eq!(json[key], value, "{key}");
    }
    assert_eq!(json["num_particles_max"], 96);
}

#[test]
#[cfg(unix)]
fn an_interrupted_data_set_goes_on_bitwise() {
    let base = BASE.replace("duration = 0.2", "duration = 1.0");
    let list = "scene = \"base.toml\"\n[[train]]\nlist.column.0.size = [[0.5, 0.5], [0.5, 0.75]]\n\
                [[test]]\n";
    let directory = folder(&base, list);
    let run = |output: &str, more: &[&str]| {
        let words =
            ["dataset", "list.toml", "-o", output, "--checkpoint-interval", "0", "--resume"];
        let mut command = dempm(directory.path(), &words);
        command.args(more).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    assert!(run("whole", &[]).status().unwrap().success());
    let cut = directory.path().join("cut");
    let mut signals = ["-INT", "-KILL"].into_iter();
    let names = ["train/000.h5", "train/001.h5", "test/000.h5"];
    let frames = || -> usize {
        let count = |name: &&str| Trajectory::open(&cut.join(name)).map_or(0, |t| t.frames());
        names.iter().map(count).sum()
    };
    loop {
        let before = frames();
        let mut child = run("cut", &["--jobs", "2"]).spawn().unwrap();
        let Some(signal) = signals.next() else {
            assert!(child.wait().unwrap().success());
            break;
        };
        let start = Instant::now();
        while frames() < before + 5 {
            assert!(start.elapsed() < Duration::from_secs(60), "no progress");
            assert!(child.try_wait().unwrap().is_none(), "the run was too short to be interrupted");
            sleep(Duration::from_millis(2));
        }
        Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
        let status = child.wait().unwrap();
        if signal == "-INT" {
            assert_eq!(status.code(), Some(130));
        }
    }
    for name in names {
        assert_eq!(bits(&cut.join(name)), bits(&directory.path().join("whole").join(name)));
    }
}

#[test]
fn only_some_splits_and_metadata_when_the_training_set_is_there() {
    let directory = folder(BASE, LIST);
    let run = ["dataset", "list.toml", "-o", "set", "--only", "valid"];
    let output = succeeds(&mut dempm(directory.path(), &run));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(table.contains("not begun") && table.contains("no metadata.json yet"), "{table}");
    let set = directory.path().join("set");
    assert!(set.join("valid/000.h5").exists() && !set.join("train").exists());
    assert!(!set.join("metadata.json").exists());
}

/// A file cut short, and one that shows its damage only to who reads all of it.
#[test]
fn a_damaged_file_does_not_stop_the_others() {
    let list = "scene = \"base.toml\"\n[[train]]\ngrid.column.0.corner = [[0.0, 0.0], [1.0, 0.0]]\n\
                [[test]]\n";
    let directory = folder(BASE, list);
    let run = || dempm(directory.path(), &["dataset", "list.toml", "-o", "set", "--resume"]);
    succeeds(&mut run());
    let file = |name: &str| directory.path().join("set").join(name);
    let whole = bits(&file("train/001.h5"));
    let bytes = std::fs::read(file("train/001.h5")).unwrap();
    std::fs::write(file("train/001.h5"), &bytes[..bytes.len() / 2]).unwrap();
    std::fs::remove_file(file("test/000.h5")).unwrap();

    let output = run().output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    let table = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("001.h5") && error.contains("delete it"), "{error}");
    assert!(error.contains("failed: train/001") && error.contains("test/000 done"), "{error}");
    let damaged = table.lines().find(|line| line.starts_with("train/001")).unwrap();
    assert!(damaged.contains("damaged, delete it"), "{table}");
    assert!(table.contains("no metadata.json yet"), "{table}");

    // With the damage comes at times a checkpoint, which is of no use without its trajectory.
    std::fs::remove_file(file("train/001.h5")).unwrap();
    std::fs::write(file("train/001.ckpt"), "old").unwrap();
    std::fs::write(file("train/001.h5.ckpt"), "old").unwrap();
    succeeds(&mut run());
    assert_eq!(bits(&file("train/001.h5")), whole);

    // The values of one frame: the header is as it was.
    let mut bytes = std::fs::read(file("train/001.h5")).unwrap();
    let chunk = chunk_of_frame(&file("train/001.h5"), 7);
    bytes[chunk].iter_mut().for_each(|byte| *byte ^= 0x55);
    std::fs::write(file("train/001.h5"), bytes).unwrap();
    let output = run().output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    let table = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("failed: train/001"), "{error}");
    assert!(table.contains("damaged, delete it") && table.contains("HDF5 cannot read"), "{table}");
}

/// Where the positions of a frame lie in a file.
fn chunk_of_frame(path: &Path, frame: usize) -> std::ops::Range<usize> {
    let file = hdf5::File::open(path).unwrap();
    let chunk = file.dataset("position").unwrap().chunk_info(frame).unwrap();
    chunk.addr as usize..chunk.addr as usize + chunk.size as usize
}

#[test]
fn training_runs_of_different_intervals_are_refused_before_they_run() {
    let list = "scene = \"base.toml\"\n[[train]]\ngrid.column.0.corner = [[0.0, 0.0], [1.0, 0.0]]\n\
                grid.frame_interval = [0.01, 0.02]\n";
    let directory = folder(BASE, list);
    let error = fails(&mut dempm(directory.path(), &["dataset", "list.toml", "-o", "set"]));
    for part in ["list.toml", "train/000", "train/001", "frame_interval", "0.02"] {
        assert!(error.contains(part), "{part}: {error}");
    }
    assert!(!directory.path().join("set").exists());
}

#[test]
fn wrong_lists_are_refused_with_file_and_key() {
    for (list, parts) in [
        (
            "scene = \"base.toml\"\n[[train]]\nlist.column.3.size = [[0.5, 0.5]]\n",
            &["column.3.size"][..],
        ),
        ("scene = \"base.toml\"\n[[train]]\nlist.frictoin = [0.5]\n", &["train/000", "frictoin"]),
        ("scene = \"base.toml\"\n[[trian]]\n", &["trian"]),
        ("scene = \"nowhere.toml\"\n[[train]]\n", &["nowhere.toml"]),
        ("scene = \"base.toml\"\n", &["train"]),
        ("scene = \"base.toml\"\n[[test]]\ngrid.duration = 3.0\n", &["test[0].grid.duration"]),
    ] {
        let directory = folder(BASE, list);
        let error = fails(&mut dempm(directory.path(), &["dataset", "list.toml", "-o", "set"]));
        for part in parts {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert!(error.contains("list.toml") || error.contains("nowhere.toml"), "{error}");
        assert!(!directory.path().join("set").exists());
    }
}

/// A data set with test runs of different lengths and sizes.
fn data_set() -> TempDir {
    let directory = folder(BASE, LIST);
    succeeds(&mut dempm(directory.path(), &["dataset", "list.toml", "-o", "set"]));
    directory
}

/// The rules by which `lagrangebench/data/data.py` and `runner.py` of LagrangeBench 0.2 read a data set.
const LAGRANGEBENCH_RULES: &str = r#"
import bisect, json, os, sys
import h5py, numpy as np
folder, window = sys.argv[1], 6
metadata = json.load(open(os.path.join(folder, "metadata.json")))
bounds = np.array(metadata["bounds"])
assert not np.array(metadata["periodic_boundary_conditions"]).any()
for key in ["default_connectivity_radius", "num_particles_max", "dim", "dt", "write_every", "dx",
            "acc_mean", "acc_std", "vel_mean", "vel_std"]:
    metadata[key]
for split in ["train", "valid", "test"]:
    with h5py.File(os.path.join(folder, split + ".h5"), "r") as f:
        keys = list(f.keys())
        frames = f["00000/position"].shape[0]
        lengths = np.cumsum([frames - window - 1 for _ in keys]).tolist()
        for index in range(lengths[-1]):
            which = bisect.bisect(lengths, index)
            start = index - (lengths[which - 1] if which else 0)
            trajectory = f[keys[which]]
            part = trajectory["position"][start : start + window + 1].transpose((1, 0, 2))
            kind = trajectory["particle_type"][:]
            assert part.shape == (len(kind), window + 1, 2) and part.dtype == np.float32
            assert kind.dtype == np.int64 and set(kind) <= {0, 1, 2}
            # Cells of the search for neighbours: (0, 0) to the size of the box.
            assert (part >= 0).all() and (part < bounds[:, 1] - bounds[:, 0]).all()
            padding = metadata["num_particles_max"] - part.shape[0]
            assert padding >= 0
            np.pad(part, ((0, padding), (0, 0), (0, 0)))
"#;

#[test]
fn lagrangebench_reads_the_export() {
    let directory = data_set();
    let output =
        succeeds(&mut dempm(directory.path(), &["export", "set", "--to", "lagrangebench"]));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("matscipy"), "{told}");
    let export = directory.path().join("set-lagrangebench");

    let file = hdf5::File::open(export.join("test.h5")).unwrap();
    // The shorter one first; 96 points a row of 6 m / 62.5 mm on walls and 16 on the obstacle.
    let shapes =
        ["00000", "00001"].map(|name| file.dataset(&format!("{name}/position")).unwrap().shape());
    assert_eq!(shapes, [[21, 96 + 96 + 16, 2], [31, 64 + 96 + 16, 2]]);
    let written: Vec<f32> = file.dataset("00001/position").unwrap().read_raw().unwrap();
    let source = positions(&directory.path().join("set/test/000.h5"));
    for (written, expected) in written.chunks(2 * shapes[1][1]).zip(&source) {
        let expected: Vec<f32> = expected.iter().map(|&x| x as f32).collect();
        assert_eq!(written[..2 * 64], expected);
    }
    let kinds: Vec<i64> = file.dataset("00001/particle_type").unwrap().read_raw().unwrap();
    assert_eq!(kinds, [vec![0; 64], vec![1; 96 + 16]].concat());

    python::check("h5py, numpy", LAGRANGEBENCH_RULES, &[&export]);
    python::check(
        "lagrangebench",
        r#"
import sys
from lagrangebench.data import H5Dataset
from lagrangebench.utils import NodeType
sizes = {"train": 6 * 15, "valid": 1, "test": 2 * 2}
for split, size in sizes.items():
    extra = 0 if split == "train" else 4
    data = H5Dataset(split, sys.argv[1], extra_seq_length=extra, nl_backend="matscipy")
    assert len(data) == size, (split, len(data))
    for x, kind in (data[k] for k in range(size)):
        assert x.shape == (data.metadata["num_particles_max"], 7 if extra == 0 else x.shape[1], 2)
        assert set(kind.tolist()) <= {NodeType.PAD_VALUE, NodeType.FLUID, NodeType.SOLID_WALL}
        assert (kind == NodeType.SOLID_WALL).sum() == 96 + (16 if split == "test" else 0)
"#,
        &[&export],
    );
}

#[test]
fn gns_reads_the_export() {
    let directory = data_set();
    succeeds(&mut dempm(directory.path(), &["export", "set", "--to", "gns", "-o", "gns"]));
    let export = directory.path().join("gns");

    // What is in the pickle, after an opcode and the number of bytes: positions of the points and then
    // of the walls, types and tan phi of sin phi = 0.3.
    let file = std::fs::File::open(export.join("valid.npz")).unwrap();
    let mut archive = zip::ZipArchive::new(file).unwrap();
    let mut pickle = Vec::new();
    archive.by_name("gns_data.npy").unwrap().read_to_end(&mut pickle).unwrap();
    let source = positions(&directory.path().join("set/valid/000.h5"));
    let first: Vec<u8> = source[0].iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    let count = first.len() / 8 + 96;
    let announced = |bytes: usize| [&[0x8e][..], &(bytes as u64).to_le_bytes()].concat();
    let kinds = [[6_i64].repeat(first.len() / 8), [3].repeat(96)].concat();
    let kinds: Vec<u8> = kinds.iter().flat_map(|kind| kind.to_le_bytes()).collect();
    let friction = (0.3_f64 / (1.0 - 0.09_f64).sqrt()) as f32;
    let parts = [
        [announced(8 * count * source.len()), first].concat(),
        [announced(8 * count), kinds].concat(),
        [announced(4 * count), friction.to_le_bytes().repeat(count)].concat(),
    ];
    let places = parts.map(|part| pickle.windows(part.len()).position(|bytes| bytes == part));
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{places:?}");

    // The rules of `gns/data_loader.py`, `reading_utils.py` and `train.py` of geoelements/gns.
    let script = r#"
import json, os, sys
import h5py, numpy as np
folder, source, window = sys.argv[1], sys.argv[2], 6
metadata = json.load(open(os.path.join(folder, "metadata.json")))
rollout = metadata["rollout"]
for key in ["bounds", "default_connectivity_radius", "dim", "vel_mean", "vel_std", "acc_mean", "acc_std"]:
    assert metadata[key] == rollout[key]
assert metadata["nnode_in"] == rollout["nnode_in"] == 31 and metadata["nedge_in"] == 3
assert rollout["sequence_length"] is None
sizes = {"train": 6, "valid": 1, "test": 2}
for split, size in sizes.items():
    with np.load(os.path.join(folder, split + ".npz"), allow_pickle=True) as archive:
        assert "gns_data" in archive
        data = archive["gns_data"]
    assert len(data) == size and len(data[0]) == 3 and data[0][0].shape[-1] == 2
    lengths = [x.shape[0] - window for x, _, _ in data]
    ends = np.array([sum(lengths[:k]) for k in range(1, len(lengths) + 1)], dtype=int)
    for index in range(sum(lengths)):
        which = np.searchsorted(ends - 1, index, side="left")
        time = window + index - (ends[which - 1] if which else 0)
        part = np.transpose(data[which][0][time - window : time], (1, 0, 2))
        kind = np.full(part.shape[0], data[which][1], dtype=int)
        friction = np.full(part.shape[0], data[which][2], dtype=float)
        label = data[which][0][time]
        assert part.shape == (len(kind), window, 2) and label.shape == (len(kind), 2)
        assert set(kind) == {3, 6} and part.dtype == np.float32
        assert np.allclose(friction, np.tan(np.arcsin(0.3)), rtol=1e-6)
        rigid = part[kind == 3]
        assert len(rigid) == 96 + (16 if split == "test" else 0) and (rigid == rigid[:, :1]).all()
    names = sorted(os.listdir(os.path.join(source, split)))
    sources = [h5py.File(os.path.join(source, split, n))["position"][:] for n in names if n.endswith(".h5")]
    sources.sort(key=len)
    for x, (written, kind, _) in zip(sources, data):
        assert (x.astype(np.float32) == written[:, kind == 6]).all()
assert data[0][0].shape[0] == metadata["sequence_length"]
"#;
    python::check("h5py, numpy", script, &[&export, &directory.path().join("set")]);
    // Their own loader, where PYTHONPATH names a clone of github.com/geoelements/gns.
    python::check(
        "gns.data_loader",
        r#"
import sys
from gns import data_loader, reading_utils
for split, windows in {"train": 6 * 15, "valid": 5, "test": 15 + 25}.items():
    path = f"{sys.argv[1]}/{split}.npz"
    samples = data_loader.SamplesDataset(path, 6)
    assert len(samples) == windows, (split, len(samples))
    (x, kind, friction, counts), label = data_loader.collate_fn([samples[0], samples[windows - 1]])
    assert x.shape == (counts.sum(), 6, 2) and len(kind) == len(friction) == len(label) == len(x)
    for x, kind, friction, count in data_loader.TrajectoriesDataset(path):
        assert len(x) == len(kind) == len(friction) == count and set(kind.tolist()) == {3, 6}
        break
assert reading_utils.read_metadata(sys.argv[1], "rollout")["sequence_length"] is None
assert reading_utils.read_metadata(sys.argv[1], "train")["sequence_length"] == 21
"#,
        &[&export],
    );
}

/// A plate that goes down from 0.05 s on.
#[test]
fn a_plate_moves_as_particles() {
    let scene = format!(
        "{BASE}[plate]\ncorner = [0.0, 0.6]\nsize = [0.5, 0.25]\nvelocity = [0.0, -0.5]\nstart = 0.05\n"
    );
    let directory = folder(&scene, LIST);
    succeeds(&mut dempm(directory.path(), &["run", "base.toml", "-o", "plate.h5"]));
    let words = ["export", "plate.h5", "--to", "lagrangebench", "--no-walls", "-o", "out"];
    succeeds(&mut dempm(directory.path(), &words));
    let file = hdf5::File::open(directory.path().join("out/train.h5")).unwrap();
    let x: ndarray::Array3<f32> = file.dataset("00000/position").unwrap().read().unwrap();
    let kinds: Vec<i64> = file.dataset("00000/particle_type").unwrap().read_raw().unwrap();
    // 64 points, and on the outline of the plate 24.
    assert_eq!(kinds, [vec![0; 64], vec![2; 24]].concat());
    for (frame, time) in [(0, 0.0), (5, 0.05), (6, 0.06), (20, 0.2)] {
        let bottom = 0.6 - 0.5 * (time - 0.05_f32).max(0.0);
        let first = [x[[frame, 64, 0]], x[[frame, 64, 1]]];
        assert!((first[0] - 0.03125).abs() < 1e-6 && (first[1] - bottom).abs() < 1e-6, "{first:?}");
    }
    let text = std::fs::read_to_string(directory.path().join("out/metadata.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["bounds"], serde_json::json!([[0.0, 2.0], [0.0, 1.0]]));
    assert_eq!(json["num_particles_max"], 88);
    let error =
        fails(&mut dempm(directory.path(), &["export", "plate.h5", "--to", "npz", "--no-walls"]));
    assert!(error.contains("--no-walls"), "{error}");
}

#[test]
fn one_trajectory_is_exported_as_a_training_set_and_an_unfinished_one_is_refused() {
    let directory = data_set();
    let valid = directory.path().join("set/valid/000.h5");
    succeeds(&mut dempm(directory.path(), &["export", "set/valid/000.h5", "--to", "gns"]));
    assert!(directory.path().join("set/valid/000-gns/train.npz").exists());
    let metadata = directory.path().join("set/valid/000-gns/metadata.json");
    assert!(std::fs::read_to_string(metadata).unwrap().contains("\"sequence_length\": 11"));

    let file = hdf5::File::open_rw(&valid).unwrap();
    let status: hdf5::types::FixedUnicode<8> = "running".parse().unwrap();
    let texts = file.group("texts").unwrap();
    texts.delete_attr("status").unwrap();
    texts
        .new_attr::<hdf5::types::FixedUnicode<8>>()
        .create("status")
        .unwrap()
        .write_scalar(&status)
        .unwrap();
    // An open group keeps the file open.
    drop(texts);
    file.close().unwrap();
    let words = ["export", "set", "--to", "lagrangebench"];
    let error = fails(&mut dempm(directory.path(), &words));
    assert!(error.contains("000.h5") && error.contains("running"), "{error}");
}

/// Scenes drawn at random are listed with their cost before anything runs, and run like others.
#[test]
fn random_scenes_are_listed_and_run() {
    let list = "scene = \"base.toml\"\nseed = 3\n[[random]]\nclass = \"heap\"\n\
                train = { scenes = 2, seeds = 2, every = 2 }\n[random.draw]\nduration = 0.05\n\
                [[random.draw.column]]\ncorner = [{ uniform = [0.0, 1.4] }, 0.0]\nsize = [0.5, 0.5]\n";
    let directory = folder(BASE, list);
    let listed = ["dataset", "list.toml", "--list"];
    let output = succeeds(&mut dempm(directory.path(), &listed));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("train/heap-000-seed-2") && text.contains("3 runs: 3 train"), "{text}");
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
    let error = fails_with(2, &mut dempm(directory.path(), &listed[..2]));
    assert!(error.contains("--output"), "{error}");

    succeeds(&mut dempm(directory.path(), &["dataset", "list.toml", "-o", "set"]));
    let set = directory.path().join("set");
    let csv = std::fs::read_to_string(set.join("scenes.csv")).unwrap();
    let line = csv.lines().find(|line| line.starts_with("train,heap-000-seed-2,")).unwrap();
    assert!(line.ends_with(",heap,heap-000"), "{csv}");
    let [one, other] = ["heap-000", "heap-001"].map(|name| set.join(format!("train/{name}.h5")));
    assert_ne!(positions(&one)[0], positions(&other)[0]);
}

/// As behind `| head`: the list is longer than what a pipe holds.
#[test]
fn a_list_that_is_cut_off_ends_without_a_message() {
    let list = "scene = \"base.toml\"\nseed = 3\n[[random]]\nclass = \"heap\"\ntrain = 2000\n\
                [random.draw.domain.walls]\nbottom = { uniform = [0.2, 0.8] }\n";
    let directory = folder(BASE, list);
    let mut command = dempm(directory.path(), &["dataset", "list.toml", "--list"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut out = child.stdout.take().unwrap();
    out.read_exact(&mut [0; 100]).unwrap();
    drop(out);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}
