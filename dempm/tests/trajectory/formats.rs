//! Reading back what was written, through our reader and through others.

use std::fs;

use dempm::trajectory::{Field, Trajectory, TrajectoryError, TrajectoryWriter};
use tempfile::tempdir;

use crate::python;
use crate::synthetic::Collapse;

#[test]
fn what_is_written_is_read() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("made/on demand/run.h5");
    let collapse = Collapse::new(6);
    collapse.write(&path, 7);

    let trajectory = Trajectory::open(&path).unwrap();
    let mut header = collapse.header();
    header.created.clone_from(&trajectory.header().created);
    assert_eq!(trajectory.header(), &header);
    assert_eq!(trajectory.points(), &collapse.points());
    assert_eq!(trajectory.frames(), 7);
    assert_eq!(trajectory.status(), "finished");
    assert_eq!(trajectory.wall_time()["rve"], 12.5);
    assert_eq!(trajectory.fields().count(), Field::ALL.len());
    for index in 0..7 {
        let (read, written) = (trajectory.frame(index).unwrap(), collapse.frame(50 * index));
        // Debug text, as absent boxes are NaN.
        assert_eq!(format!("{read:?}"), format!("{written:?}"));
    }
    let window = trajectory.positions(2..5).unwrap();
    assert_eq!(window.shape(), [3, 36, 2]);
    assert_eq!(window[[1, 7, 0]], collapse.frame(150).position[7][0]);
    assert_eq!(trajectory.boxes(0..7).unwrap().shape(), [7, 2, 4]);
    assert_eq!(trajectory.velocities(7..7).unwrap().shape(), [0, 36, 2]);
    let stress = trajectory.field::<f32>(Field::Stress, 1..2).unwrap().unwrap();
    assert_eq!(stress.shape(), [1, 36, 4]);
    assert!(matches!(trajectory.frame(7), Err(TrajectoryError::NoSuchFrame { .. })));
    assert!(matches!(trajectory.positions(5..8), Err(TrajectoryError::NoSuchFrame { .. })));
}

#[test]
fn optional_things_may_be_absent() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("bare.h5");
    let collapse = Collapse::new(3);
    let mut header = collapse.header();
    header.walls.clear();
    let mut frame = collapse.frame(10);
    frame.stress = None;
    frame.solid_fraction = None;
    frame.coordination = None;
    frame.boxes.clear();
    frame.budget.clear();
    let mut writer = TrajectoryWriter::create(&path, &header, &collapse.points()).unwrap();
    assert_eq!(Trajectory::open(&path).unwrap().frames(), 0);
    writer.push(frame.clone()).unwrap();
    let refused = writer.push(collapse.frame(11)).unwrap_err();
    assert!(refused.to_string().contains("frame 1: fields"), "{refused}");
    writer.finish("finished").unwrap();
    let trajectory = Trajectory::open(&path).unwrap();
    assert_eq!(trajectory.frame(0).unwrap(), frame);
    assert_eq!(trajectory.boxes(0..1).unwrap().shape(), [1, 0, 4]);
    assert!(trajectory.field::<f32>(Field::Stress, 0..1).unwrap().is_none());
}

#[test]
fn a_resumed_trajectory_is_the_uninterrupted_one() {
    let directory = tempdir().unwrap();
    let collapse = Collapse::new(4);
    let whole = directory.path().join("whole.h5");
    collapse.write(&whole, 11);
    let whole = Trajectory::open(&whole).unwrap();

    for kept in [0, 1, 5, 8] {
        let path = directory.path().join("resumed.h5");
        let mut writer =
            TrajectoryWriter::create(&path, &collapse.header(), &collapse.points()).unwrap();
        // Eight frames are safe, two more are lost with the process.
        for index in 0..8 {
            writer.push(collapse.frame(30 * index)).unwrap();
        }
        writer.set_wall_time("rve", 1.0);
        writer.commit().unwrap();
        writer.push(collapse.frame(240)).unwrap();
        writer.draft().unwrap();
        writer.push(collapse.frame(270)).unwrap();
        drop(writer);
        let interrupted = Trajectory::open(&path).unwrap();
        assert_eq!((interrupted.frames(), interrupted.status()), (8, "running"));

        let mut writer = TrajectoryWriter::resume(&path, kept).unwrap();
        assert_eq!(writer.wall_time()["rve"], 1.0);
        for index in kept..11 {
            assert_eq!(writer.frames(), index);
            writer.push(collapse.frame(30 * index)).unwrap();
            // Written ahead of the commit or not.
            if index % 2 == 0 {
                writer.draft().unwrap();
            }
            if index % 3 == 0 {
                writer.commit().unwrap();
            }
        }
        writer.finish("finished").unwrap();
        let resumed = Trajectory::open(&path).unwrap();
        assert_eq!(resumed.frames(), 11);
        assert_eq!(resumed.time(), whole.time());
        for index in 0..11 {
            let frames = [&resumed, &whole].map(|file| format!("{:?}", file.frame(index).unwrap()));
            assert_eq!(frames[0], frames[1]);
        }
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 2);
    }
    let path = directory.path().join("resumed.h5");
    let refused = TrajectoryWriter::resume(&path, 12).unwrap_err();
    assert!(refused.to_string().contains("there is no frame 11"), "{refused}");
}

#[test]
fn truncation_gives_the_same_file() {
    let directory = tempdir().unwrap();
    let collapse = Collapse::new(4);
    let bytes = |frames: usize| {
        let path = directory.path().join("run.h5");
        let header = dempm::trajectory::Header { created: String::new(), ..collapse.header() };
        let mut writer = TrajectoryWriter::create(&path, &header, &collapse.points()).unwrap();
        for index in 0..frames {
            writer.push(collapse.frame(index)).unwrap();
        }
        writer.finish("finished").unwrap();
        fs::read(&path).unwrap()
    };
    assert!(bytes(5) == bytes(5), "two equal runs leave different files");
}

#[test]
fn frames_of_other_points_are_refused() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("run.h5");
    let collapse = Collapse::new(4);
    let mut writer =
        TrajectoryWriter::create(&path, &collapse.header(), &collapse.points()).unwrap();
    let refused = writer.push(Collapse::new(5).frame(0)).unwrap_err();
    assert!(refused.to_string().contains("position has 25 entries"), "{refused}");

    let no_points = dempm::trajectory::Points::default();
    let refused = TrajectoryWriter::create(&path, &collapse.header(), &no_points).unwrap_err();
    assert!(refused.to_string().contains("0 masses"), "{refused}");
}

#[test]
fn h5py_reads_it_without_our_code() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("run.h5");
    Collapse::new(8).write(&path, 5);
    let script = r#"
import sys, h5py, numpy as np
with h5py.File(sys.argv[1], "r") as f:
    a = f.attrs
    assert a["format"] == "DEMPM trajectory" and a["format_version"] == 1
    assert "µ, σ" in a["scene"] and a["seed"] == 42 and list(a["domain"]) == [10, 4]
    assert f["versions"].attrs["dempm"] == "0.1.0" and a["status"] == "finished"
    assert f["parameters"].attrs["thickness"] == 0.0075
    assert f["wall_time"].attrs["rve"] == 12.5
    n = f["points/mass"].shape[0]
    assert n == 64 and f["points/column"].dtype == np.uint32
    assert f["position"].shape == (5, n, 2) and f["position"].dtype == np.float64
    assert f["velocity"].shape == (5, n, 2) and f["stress"].shape == (5, n, 4)
    assert f["stress"].dtype == np.float32 and f["solid_fraction"].shape == (5, n)
    assert f["position"].chunks == (1, n, 2) and f["position"].compression == "gzip"
    assert f["boundary/boxes"].shape == (5, 2, 4) and f["boundary/walls"].shape == (3, 4)
    assert np.allclose(f["budget/front"][:], f["position"][:, :, 0].max(axis=1))
    assert np.allclose(f["time"][:], np.linspace(0, 3, 5))
    # Every dataset says what it is, and is where its name says.
    def described(name, item):
        if isinstance(item, h5py.Dataset) and not name.startswith("VTKHDF"):
            units, description = item.attrs["units"], item.attrs["description"]
            assert isinstance(units, str) and units not in ("", "unknown"), (name, units)
            assert isinstance(description, str) and len(description) > 10, (name, description)
    f.visititems(described)
    assert f["points/mass"].attrs["units"] == "kg/m" and f["stress"].attrs["units"] == "Pa"
    # The views for ParaView show the same numbers, by links to them.
    for place, target in [("points/Steps/Values", "/time"), ("walls/Steps/Values", "/time"),
                          ("points/PointData/mass", "/points/mass")]:
        assert f["VTKHDF"].get(place, getlink=True).path == target
    v = f["VTKHDF/points"]
    assert np.array_equal(v["Points"][:, :2].reshape(5, n, 2), f["position"][:])
    assert not v["Points"][:, 2].any()
    assert np.array_equal(v["PointData/stress"][:][:, [0, 1, 3, 4]].reshape(5, n, 4), f["stress"][:])
    assert np.array_equal(v["PointData/coordination"][:].reshape(5, n), f["coordination"][:])
    corners = f["VTKHDF/boxes/Points"][:].reshape(5, 2, 4, 3)
    assert np.array_equal(corners[:, :, 0, :2], f["boundary/boxes"][:, :, :2], equal_nan=True)
    assert np.array_equal(corners[:, :, 2, :2], f["boundary/boxes"][:, :, 2:], equal_nan=True)
    ends = f["VTKHDF/walls/Points"][:].reshape(3, 2, 3)
    assert np.array_equal(ends[:, :, :2].reshape(3, 4), f["boundary/walls"][:]) and not ends[:, :, 2].any()
"#;
    python::check("h5py", script, &[&path]);
}

#[test]
fn vtk_reads_it_as_a_time_series() {
    let directory = tempdir().unwrap();
    // VTK goes by the suffix as little as ParaView does once told to use its VTKHDF reader.
    let path = directory.path().join("run.h5");
    Collapse::new(8).write(&path, 5);
    let script = r#"
import sys, h5py, numpy as np
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.util.numpy_support import vtk_to_numpy
reader = vtkHDFReader()
assert reader.CanReadFile(sys.argv[1])
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
assert reader.GetNumberOfSteps() == 5, reader.GetNumberOfSteps()
with h5py.File(sys.argv[1], "r") as f:
    for step in (0, 4, 2, 1, 3):
        reader.SetStep(step)
        reader.Update()
        blocks = reader.GetOutputDataObject(0)
        assert blocks.GetClassName() == "vtkPartitionedDataSetCollection"
        assert blocks.GetNumberOfPartitionedDataSets() == 3
        data, walls, boxes = (blocks.GetPartition(k, 0) for k in range(3))
        ends = vtk_to_numpy(walls.GetPoints().GetData())
        assert walls.GetNumberOfLines() == 3 and walls.GetCell(1).GetPointId(1) == 3
        assert np.array_equal(ends[:, :2].reshape(3, 4), f["boundary/walls"][:])
        corners = vtk_to_numpy(boxes.GetPoints().GetData()).reshape(2, 4, 3)
        assert boxes.GetNumberOfPolys() == 2 and boxes.GetCell(1).GetPointIds().GetNumberOfIds() == 4
        low, high = f["boundary/boxes"][step, :, :2], f["boundary/boxes"][step, :, 2:]
        assert np.array_equal(corners[:, 0, :2], low, equal_nan=True)
        assert np.array_equal(corners[:, 2, :2], high, equal_nan=True)
        assert data.GetClassName() == "vtkPolyData" and data.GetNumberOfVerts() == 64
        points = vtk_to_numpy(data.GetPoints().GetData())
        assert np.array_equal(points[:, :2], f["position"][step])
        assert data.GetCell(63).GetPointId(0) == 63
        arrays = data.GetPointData()
        for name in ["solid_fraction", "coordination", "inertial_number"]:
            assert np.array_equal(vtk_to_numpy(arrays.GetArray(name)), f[name][step])
        assert np.array_equal(vtk_to_numpy(arrays.GetArray("velocity"))[:, :2], f["velocity"][step])
        assert np.array_equal(vtk_to_numpy(arrays.GetArray("stress"))[:, 4], f["stress"][step, :, 3])
        assert np.array_equal(vtk_to_numpy(arrays.GetArray("column")), f["points/column"][:])
"#;
    python::check("h5py, vtk", script, &[&path]);
}
