//! `dempm import`: data sets of geoelements/gns and LagrangeBench, as a user has them.

#[path = "common/program.rs"]
mod program;
#[path = "../dempm/tests/trajectory/python.rs"]
mod python;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use dempm::scene::Scene;
use dempm::trajectory::Trajectory;
use ndarray::{Array1, Array3, s};
use tempfile::{TempDir, tempdir};

use program::program;

/// Points between a barrier on the floor and a plate that comes down on them.
const SCENE: &str = r#"
title = "Pressed"
duration = 0.2
frame_interval = 0.01
step = 1.0e-4
[domain]
size = [2.0, 1.0]
cell = 0.125
[[column]]
size = [0.5, 0.5]
[[obstacle]]
corner = [1.0, 0.0]
size = [0.25, 0.5]
[plate]
corner = [0.0, 0.5]
size = [0.5, 0.25]
velocity = [0.0, -0.5]
start = 0.05
[material]
kind = "mu-i"
"#;

const METADATA: &str = r#"{"bounds": [[0.1, 0.9], [0.1, 0.7]], "dim": 2, "dt": 0.0025,
    "default_connectivity_radius": 0.015, "sequence_length": 12}"#;

fn dempm(directory: &Path) -> Command {
    program("dempm", directory)
}

fn succeeds(directory: &Path, words: &[&str]) -> Output {
    let output = dempm(directory).args(words).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The standard error of a command that has to fail, as one line.
fn fails(directory: &Path, words: &[&str]) -> String {
    let output = dempm(directory).args(words).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr).replace('\u{2502}', " ");
    assert_eq!(output.status.code(), Some(1), "{error}");
    error.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn an_export_comes_back() {
    let directory = tempdir().unwrap();
    let folder = directory.path();
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
    succeeds(folder, &["run", "scene.toml", "-o", "run.h5"]);
    let original = Trajectory::open(&folder.join("run.h5")).unwrap();
    for (format, walls) in [("gns", ""), ("lagrangebench", "--no-walls")] {
        let mut words = vec!["export", "run.h5", "--to", format, "-o", format];
        words.extend(Some(walls).filter(|option| !option.is_empty()));
        succeeds(folder, &words);
        let output = format!("from-{format}");
        succeeds(folder, &["import", format, "--from", format, "-o", &output]);
        let copy = Trajectory::open(&folder.join(&output).join("train/000.h5")).unwrap();

        assert_eq!(copy.header().domain, original.header().domain);
        assert_eq!((copy.header().grid_cell, copy.header().frame_interval), (0.125, 0.01));
        assert_eq!((copy.header().walls.len(), copy.frames()), (4, 21));
        // Single precision holds 2 m to 1.2e-7 m.
        let near = |a: f64, b: f64| (a - b).abs() < 2e-7;
        let (a, b) = (copy.positions(0..21).unwrap(), original.positions(0..21).unwrap());
        assert!(a.shape() == b.shape() && a.iter().zip(&b).all(|(a, b)| near(*a, *b)));
        let (a, b) = (copy.boxes(0..21).unwrap(), original.boxes(0..21).unwrap());
        assert!(a.shape() == b.shape() && a.iter().zip(&b).all(|(a, b)| near(*a, *b)), "{a} {b}");

        let scene = Scene::parse(&copy.header().scene, "copy").unwrap();
        assert_eq!(scene.obstacles.len(), 1);
        let plate = scene.plate.unwrap();
        let numbers = [plate.velocity[0], plate.velocity[1], plate.start];
        // Velocities over 0.15 s and a start between frames, from positions to 6e-8 m.
        for (found, expected) in numbers.into_iter().zip([0.0, -0.5, 0.05]) {
            assert!((found - expected).abs() < 2e-6, "{numbers:?}");
        }
        let velocity = copy.frame(10).unwrap().velocity[7];
        let mean = [0, 1].map(|k| (b_at(&original, 10, k) - b_at(&original, 9, k)) / 0.01);
        assert!((0..2).all(|k| (velocity[k] - mean[k]).abs() < 5e-5), "{velocity:?} {mean:?}");
        let metadata = fs::read_to_string(folder.join(&output).join("metadata.json")).unwrap();
        assert!(metadata.contains("\"num_trajs_train\": 1"), "{metadata}");
        let info = succeeds(folder, &["info", &format!("{output}/train/000.h5")]);
        let info = String::from_utf8_lossy(&info.stdout).into_owned();
        assert!(info.contains(&format!("imported ({format})")), "{info}");
    }
}

/// Coordinate `axis` of point 7.
fn b_at(trajectory: &Trajectory, frame: usize, axis: usize) -> f64 {
    trajectory.positions(frame..frame + 1).unwrap()[[0, 7, axis]]
}

#[test]
fn numpy_files_are_read() {
    let directory = tempdir().unwrap();
    let script = r#"
import json, pickle, sys, io, zipfile
import numpy as np
folder = sys.argv[1]
metadata = json.loads(sys.argv[2])
# Sections as in ColumnCollapseFrictional.
json.dump({"train": metadata, "rollout": dict(metadata, bounds=[[0.0, 0.9], [0.1, 0.7]])},
          open(f"{folder}/metadata.json", "w"))
def positions(frames, points, seed):
    random = np.random.default_rng(seed)
    x = np.stack([0.2 + 0.005 * (np.arange(points) % 8), 0.2 + 0.005 * (np.arange(points) // 8)], -1)
    return x[None] + 0.001 * np.arange(frames)[:, None, None] * random.random((1, points, 2))
def objects(*items):
    result = np.empty(len(items), dtype=object)
    result[:] = items
    return result
# As in WaterDropSample: an array of objects a trajectory.
np.savez_compressed(f"{folder}/train.npz", **{
    f"simulation_trajectory_{k}": objects(positions(12, 24 + k, k), np.full(24 + k, 5)) for k in range(3)})
# Tuples in one array; a type for all; single precision and Fortran order; friction as third item.
both = objects((np.asfortranarray(positions(9, 16, 7).astype("f4")), 6, np.full(16, 0.5)),
               (positions(7, 8, 8).astype(">f8"), np.int32(6), np.full(8, 0.5)))
np.savez(f"{folder}/valid.npz", gns_data=both)
# Rows of an object array, with an older protocol.
rows = np.empty((2, 2), dtype=object)
for k in range(2):
    rows[k] = objects(positions(5, 4, k), np.full(4, 6, dtype="u1"))
for protocol in [2, 3, 4]:
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": "|O", "fortran_order": False, "shape": (2, 2)})
    pickle.dump(rows, content, protocol=protocol)
    with zipfile.ZipFile(f"{folder}/protocol{protocol}.npz", "w") as archive:
        archive.writestr("gns_data.npy", content.getvalue())
np.save(f"{folder}/expected.npy", np.concatenate([positions(12, 26, 2)[11].ravel(), positions(9, 16, 7)[8].ravel(),
                                                  positions(7, 8, 8)[6].ravel(), positions(5, 4, 1)[4].ravel()]))
"#;
    python::check("numpy", script, &[directory.path(), Path::new(METADATA)]);
    if !directory.path().join("train.npz").exists() {
        return;
    }
    let folder = directory.path();
    succeeds(folder, &["import", ".", "--from", "gns", "-o", "set"]);
    for protocol in [2, 3, 4] {
        let (file, output) = (format!("protocol{protocol}.npz"), format!("p{protocol}"));
        succeeds(folder, &["import", &file, "--from", "gns", "-o", &output]);
    }
    let expected = fs::read(folder.join("expected.npy")).unwrap();
    let expected: Vec<f64> =
        expected[128..].as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
    let mut places = expected.as_chunks::<2>().0.iter();
    for (name, frame, points, tolerance) in [
        ("set/train/002.h5", 11, 26, 1e-15),
        ("set/valid/000.h5", 8, 16, 6e-8),
        ("set/valid/001.h5", 6, 8, 1e-15),
        ("p2/001.h5", 4, 4, 1e-15),
    ] {
        let trajectory = Trajectory::open(&folder.join(name)).unwrap();
        let found = trajectory.frame(frame).unwrap().position;
        assert_eq!((trajectory.frames(), found.len()), (frame + 1, points), "{name}");
        for (found, expected) in found.iter().zip(places.by_ref().take(points)) {
            // The domain begins at the origin.
            let off = [0, 1].map(|k| (found[k] - (expected[k] - 0.1)).abs());
            assert!(off.iter().all(|&off| off <= tolerance), "{name}: {found:?} {expected:?}");
        }
    }
    for name in ["p3/001.h5", "p4/001.h5"] {
        let read = |name| Trajectory::open(&folder.join(name)).unwrap().positions(0..5).unwrap();
        assert_eq!(read("p2/001.h5"), read(name));
    }
    let header = Trajectory::open(&folder.join("set/train/000.h5")).unwrap().header().clone();
    assert_eq!(header.frame_interval, 0.0025);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(near(header.domain[0], 0.8) && near(header.domain[1], 0.6), "{:?}", header.domain);
    assert!(near(header.point_spacing, 0.005), "{}", header.point_spacing);
    let metadata = fs::read_to_string(folder.join("set/metadata.json")).unwrap();
    for (key, count) in [("num_trajs_train", 3), ("num_trajs_valid", 2), ("num_particles_max", 26)]
    {
        assert!(metadata.contains(&format!("\"{key}\": {count}")), "{metadata}");
    }
}

/// A LagrangeBench file with one trajectory of 6 frames and 12 particles, and its metadata.
fn lagrangebench(metadata: &str, change: impl Fn(&mut Array3<f32>, &mut Array1<i64>)) -> TempDir {
    let directory = tempdir().unwrap();
    fs::write(directory.path().join("metadata.json"), metadata).unwrap();
    let place = |k: usize, axis: usize| 0.3 + 0.01 * [k % 4, k / 4][axis] as f32;
    let mut x =
        Array3::from_shape_fn((6, 12, 2), |(frame, k, axis)| place(k, axis) + 0.001 * frame as f32);
    let mut kinds = Array1::from_elem(12, 0);
    change(&mut x, &mut kinds);
    let file = hdf5::File::create(directory.path().join("train.h5")).unwrap();
    let group = file.create_group("00000").unwrap();
    group.new_dataset_builder().with_data(&x).create("position").unwrap();
    group.new_dataset_builder().with_data(&kinds).create("particle_type").unwrap();
    directory
}

const IMPORT: [&str; 6] = ["import", "train.h5", "--from", "lagrangebench", "-o", "set"];

#[test]
fn what_cannot_be_imported_is_explained() {
    let explained =
        |metadata: &str, words: &[&str], change: &dyn Fn(&mut Array3<f32>, &mut Array1<i64>)| {
            let directory = lagrangebench(metadata, change);
            let error = fails(directory.path(), &IMPORT);
            for word in words {
                assert!(error.contains(word), "{word}: {error}");
            }
            assert!(!directory.path().join("set/train/000.h5").exists());
        };
    let keep = |_: &mut Array3<f32>, _: &mut Array1<i64>| {};
    explained(
        &METADATA.replace("\"dim\": 2", "\"dim\": 3"),
        &["metadata.json", "3 dimensions"],
        &keep,
    );
    explained(
        &METADATA.replace("\"dt\": 0.0025,", ""),
        &["metadata.json", "missing field `dt`"],
        &keep,
    );
    explained(&METADATA.replace("0.0025", "-1"), &["metadata.json", "`dt` is -1"], &keep);
    explained(&METADATA.replace("0.9]", "0.05]"), &["`bounds`", "[0.1, 0.05]"], &keep);
    explained("{", &["metadata.json", "no metadata"], &keep);
    let periodic = METADATA.replace("{", "{\"periodic_boundary_conditions\": [true, false], ");
    explained(&periodic, &["`periodic_boundary_conditions`", "walls only"], &keep);
    explained(METADATA, &["train.h5", "00000", "3 dimensions"], &|x, _| {
        *x = Array3::zeros((6, 12, 3))
    });
    explained(METADATA, &["types of shape [11] for 12 particles"], &|_, kinds| {
        *kinds = Array1::zeros(11);
    });
    explained(METADATA, &["1 frames"], &|x, _| *x = x.slice(s![..1, .., ..]).to_owned());
    explained(METADATA, &["particle 5 at frame 2"], &|x, _| x[[2, 5, 1]] = f32::NAN);
    explained(METADATA, &["no particle that moves freely"], &|_, kinds| kinds.fill(1));
    // Two particles of a body go different ways.
    explained(METADATA, &["2 kinematic particles turns or bends"], &|x, kinds| {
        kinds.slice_mut(s![..2]).fill(2);
        x[[5, 1, 0]] += 0.1;
    });

    let directory = lagrangebench(METADATA, keep);
    fs::remove_file(directory.path().join("metadata.json")).unwrap();
    let error = fails(directory.path(), &IMPORT);
    assert!(error.contains("metadata.json") && error.contains("time between frames"), "{error}");
    let words = ["import", "train.h5", "--from", "gns", "-o", "set"];
    fs::write(directory.path().join("metadata.json"), METADATA).unwrap();
    assert!(fails(directory.path(), &words).contains("not an .npz archive"));
    let words = ["import", ".", "--from", "gns", "-o", "set"];
    assert!(fails(directory.path(), &words).contains("no train.npz, valid.npz or test.npz"));
    let words = ["import", "none.h5", "--from", "lagrangebench", "-o", "set"];
    assert!(fails(directory.path(), &words).contains("none.h5"));

    let words = ["import", "train.h5", "--from", "lagrangebench", "-o", "."];
    let error = fails(directory.path(), &words);
    assert!(error.contains("replace its own input") && error.contains("metadata.json"), "{error}");
    succeeds(directory.path(), &IMPORT);
    assert!(fails(directory.path(), &IMPORT).contains("there are trajectories in it"));
}

/// A dam in the middle of the domain, a lattice of particles rather than an outline, and a floor.
#[test]
fn kinematic_particles_become_boxes() {
    let directory = lagrangebench(METADATA, |x, kinds| {
        let still = |x: &mut Array3<f32>, k: usize, place: [f32; 2]| {
            (0..2).for_each(|axis| x.slice_mut(s![.., k, axis]).fill(place[axis]));
        };
        // Floor, then a lattice of 2 x 3 at 0.01 m.
        (0..2).for_each(|k| still(x, k, [0.5 + 0.01 * k as f32, 0.1]));
        (2..8)
            .for_each(|k| still(x, k, [0.6 + 0.01 * (k % 2) as f32, 0.2 + 0.01 * (k / 2) as f32]));
        kinds.slice_mut(s![..8]).fill(1);
    });
    succeeds(directory.path(), &IMPORT);
    let trajectory = Trajectory::open(&directory.path().join("set/train/000.h5")).unwrap();
    assert_eq!(trajectory.points().mass.len(), 4);
    let boxes = trajectory.boxes(0..6).unwrap();
    assert_eq!(boxes.shape(), [6, 1, 4]);
    for (found, expected) in boxes.iter().zip([0.5, 0.11, 0.51, 0.13].into_iter().cycle()) {
        assert!((found - expected).abs() < 1e-7, "{boxes}");
    }
}
