//! Fields on a grid in a trajectory.

use std::fs;
use std::path::Path;

use dempm::trajectory::{Frame, GridFrame, StaticGrid, Trajectory, TrajectoryWriter};
use hdf5::File;
use tempfile::tempdir;

use crate::python;
use crate::synthetic::Collapse;

const ROWS: usize = 2;
const COLUMNS: usize = 3;

fn grid() -> StaticGrid {
    StaticGrid { width: 0.01, x: vec![0.0, 0.5, 1.0], y: vec![0.25, 0.75] }
}

fn fields(index: usize) -> GridFrame {
    let number = |k: usize| (100 * index + k) as f32;
    let nodes = 0..ROWS * COLUMNS;
    GridFrame {
        density: nodes.clone().map(number).collect(),
        velocity: nodes.clone().map(|k| [number(k), -number(k)]).collect(),
        stress: nodes.map(|k| [number(k), 1.0, 2.0, -number(k)]).collect(),
    }
}

fn write(path: &Path, frames: usize) {
    let collapse = Collapse::new(3);
    let (header, points) = (collapse.header(), collapse.points());
    let mut writer =
        TrajectoryWriter::create_with(path, &header, &points, None, Some(&grid())).unwrap();
    for index in 0..frames {
        writer.push(Frame { grid: Some(fields(index)), ..collapse.frame(index) }).unwrap();
    }
    writer.finish("finished").unwrap();
}

#[test]
fn fields_are_read_as_written() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("run.h5");
    write(&path, 4);
    let file = Trajectory::open(&path).unwrap();
    assert_eq!(file.grid(), Some(&grid()));
    for index in 0..4 {
        assert_eq!(file.grid_frame(index).unwrap(), Some(fields(index)));
    }
    assert!(file.grid_frame(4).is_err());
}

/// Links out of the file, missing and misshapen datasets, and numbers that cannot be.
#[test]
fn a_damaged_grid_is_refused() {
    let folder = tempdir().unwrap();
    let whole = folder.path().join("whole.h5");
    write(&whole, 4);
    let spoiled = |spoil: &dyn Fn(&File)| {
        let path = folder.path().join("spoiled.h5");
        fs::copy(&whole, &path).unwrap();
        let file = File::open_rw(&path).unwrap();
        spoil(&file);
        file.close().unwrap();
        let error = Trajectory::open(&path).and_then(|file| file.grid_frame(0)).unwrap_err();
        let reason = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
        format!("{error}: {reason}")
    };
    let outside = whole.to_str().unwrap();
    for path in ["grid", "grid/x", "grid/y", "grid/density", "grid/velocity", "grid/stress"] {
        let error = spoiled(&|file| {
            file.unlink(path).unwrap();
            file.link_external(outside, path, path).unwrap();
        });
        assert!(error.contains("spoiled.h5") && error.contains("not followed"), "{error}");
        if path != "grid" {
            let error = spoiled(&|file| file.unlink(path).unwrap());
            assert!(error.contains("it is missing"), "{path}: {error}");
        }
    }
    let error = spoiled(&|file| file.dataset("grid/stress").unwrap().resize([3, 2, 3, 4]).unwrap());
    assert!(error.contains("grid/stress has shape [3, 2, 3, 4], expected [4, 2, 3, 4]"), "{error}");
    for width in [0.0, -1.0, f64::NAN] {
        let error = spoiled(&|file| {
            let group = file.group("grid").unwrap();
            group.attr("width").unwrap().write_scalar(&width).unwrap();
        });
        assert!(error.contains("spoiled.h5: grid.width is"), "{error}");
    }
    for (axis, nodes) in [("grid/x", [0.0, f64::NAN, 1.0]), ("grid/x", [0.0, 1.0, 1.0])] {
        let error = spoiled(&|file| file.dataset(axis).unwrap().write_raw(&nodes).unwrap());
        assert!(error.contains("spoiled.h5: grid/x of node"), "{error}");
    }
}

#[test]
fn numpy_reads_the_exported_grid() {
    let folder = tempdir().unwrap();
    let (path, archive) = (folder.path().join("run.h5"), folder.path().join("run.npz"));
    write(&path, 4);
    let file = Trajectory::open(&path).unwrap();
    dempm::export::write_npz(&file, &archive).unwrap();
    let script = r#"
import sys, h5py, numpy as np
a = np.load(sys.argv[1])
with h5py.File(sys.argv[2], "r") as f:
    for name in ["x", "y", "density", "velocity", "stress"]:
        exported, stored = a[f"grid_{name}"], f[f"grid/{name}"][:]
        assert exported.dtype == stored.dtype and np.array_equal(exported, stored), name
"#;
    python::check("h5py, numpy", script, &[&archive, &path]);
}
