//! Grains in a trajectory.

use std::fs;
use std::path::Path;

use dempm::export::write_vtkhdf;
use dempm::trajectory::{Frame, GrainFrame, StaticGrains, Trajectory, TrajectoryWriter};
use hdf5::File;
use tempfile::tempdir;

use crate::python;
use crate::synthetic::Collapse;

const COUNT: usize = 5;

fn grains(every: usize) -> StaticGrains {
    let radius = (1..=COUNT).map(|k| 1e-3 * k as f32).collect();
    StaticGrains { every, radius, column: vec![0, 0, 0, 1, 1], point: vec![0, 1, 2, 3, 3] }
}

fn grain_frame(index: usize) -> GrainFrame {
    let number = |k: usize| (10 * index + k) as f32;
    GrainFrame {
        position: (0..COUNT).map(|k| [number(k), -number(k)]).collect(),
        velocity: (0..COUNT).map(|k| [0.5 * number(k), 1.0]).collect(),
        pressure: (0..COUNT).map(|k| 100.0 * number(k)).collect(),
    }
}

/// Frame `index` with grains if it is one of every `every`-th.
fn frame(collapse: &Collapse, index: usize, every: usize) -> Frame {
    let grains = index.is_multiple_of(every).then(|| grain_frame(index));
    Frame { grains, ..collapse.frame(index) }
}

fn write(path: &Path, frames: usize, every: usize) {
    let collapse = Collapse::new(3);
    let (header, points) = (collapse.header(), collapse.points());
    let mut writer =
        TrajectoryWriter::create_with(path, &header, &points, Some(&grains(every)), None).unwrap();
    for index in 0..frames {
        writer.push(frame(&collapse, index, every)).unwrap();
    }
    writer.finish("finished").unwrap();
}

fn check(path: &Path, frames: usize, every: usize) {
    let file = Trajectory::open(path).unwrap();
    assert_eq!((file.frames(), file.grain_count()), (frames, Some(COUNT)));
    assert_eq!(file.grains().unwrap(), Some(grains(every)));
    for index in 0..frames {
        let expected = index.is_multiple_of(every).then(|| grain_frame(index));
        assert_eq!(file.grain_frame(index).unwrap(), expected, "{index}");
    }
    assert!(file.grain_frame(frames).is_err());
}

#[test]
fn what_is_written_is_read() {
    let folder = tempdir().unwrap();
    for (frames, every) in [(7, 3), (6, 3), (1, 1), (4, 100)] {
        let path = folder.path().join("run.h5");
        write(&path, frames, every);
        check(&path, frames, every);
    }
    let path = folder.path().join("bare.h5");
    Collapse::new(3).write(&path, 3);
    let bare = Trajectory::open(&path).unwrap();
    assert_eq!((bare.grain_count(), bare.grains().unwrap()), (None, None));
    assert_eq!(bare.grain_frame(0).unwrap(), None);
}

/// A resumed run drops the grains after its checkpoint too.
#[test]
fn a_resumed_run_has_the_same_grains() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let collapse = Collapse::new(3);
    for kept in 0..=7 {
        write(&path, 7, 3);
        let mut writer = TrajectoryWriter::resume(&path, kept).unwrap();
        for index in kept..10 {
            writer.push(frame(&collapse, index, 3)).unwrap();
            if index % 2 == 0 {
                writer.commit().unwrap();
            }
        }
        writer.finish("finished").unwrap();
        check(&path, 10, 3);
    }
}

#[test]
fn frames_with_other_grains_are_refused() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let collapse = Collapse::new(3);
    let (header, points) = (collapse.header(), collapse.points());
    let mut writer =
        TrajectoryWriter::create_with(&path, &header, &points, Some(&grains(2)), None).unwrap();
    let error = writer.push(collapse.frame(0)).unwrap_err().to_string();
    assert!(error.contains("run.h5: frame 0: it has no grains"), "{error}");
    let mut few = frame(&collapse, 0, 2);
    few.grains.as_mut().unwrap().pressure.pop();
    let error = writer.push(few).unwrap_err().to_string();
    assert!(error.contains("[5, 5, 4] grains, but there are 5"), "{error}");
    writer.push(frame(&collapse, 0, 2)).unwrap();
    let error = writer.push(frame(&collapse, 1, 1)).unwrap_err().to_string();
    assert!(error.contains("frame 1: it has grains, but none are expected"), "{error}");
}

/// Links out of the file, missing and misshapen datasets, and numbers that cannot be.
#[test]
fn damaged_grains_are_refused() {
    let folder = tempdir().unwrap();
    let whole = folder.path().join("whole.h5");
    write(&whole, 7, 3);
    let spoiled = |spoil: &dyn Fn(&File)| {
        let path = folder.path().join("spoiled.h5");
        fs::copy(&whole, &path).unwrap();
        let file = File::open_rw(&path).unwrap();
        spoil(&file);
        file.close().unwrap();
        let read = || {
            let file = Trajectory::open(&path)?;
            file.grains()?;
            file.grain_frame(0)
        };
        let error = read().map(drop).unwrap_err();
        let reason = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
        format!("{error}: {reason}")
    };
    let outside = whole.to_str().unwrap();
    for path in ["grains", "grains/radius", "grains/column", "grains/position", "grains/pressure"] {
        let error = spoiled(&|file| {
            file.unlink(path).unwrap();
            file.link_external(outside, path, path).unwrap();
        });
        assert!(error.contains("spoiled.h5") && error.contains("not followed"), "{error}");
        if path != "grains" {
            assert!(
                spoiled(&|file| file.unlink(path).unwrap()).contains("it is missing"),
                "{path}"
            );
        }
    }
    let error =
        spoiled(&|file| file.dataset("grains/velocity").unwrap().resize([2, 5, 2]).unwrap());
    assert!(error.contains("grains/velocity has shape [2, 5, 2], expected [3, 5, 2]"), "{error}");
    let error = spoiled(&|file| {
        let group = file.group("grains").unwrap();
        group.attr("every").unwrap().write_scalar(&0_u64).unwrap();
    });
    assert!(error.contains("grains.every is 0, it must be 1 or more"), "{error}");
    for radius in [0.0, -1.0, f32::NAN] {
        let error = spoiled(&|file| {
            let radii = file.dataset("grains/radius").unwrap();
            radii.write_slice(&[radius], ndarray::s![2..3]).unwrap();
        });
        assert!(error.contains("grains/radius of grain 2 is"), "{error}");
    }
}

#[test]
fn h5py_reads_grains() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("run.h5");
    write(&path, 7, 3);
    let script = r#"
import sys, h5py, numpy
grains = h5py.File(sys.argv[1])["grains"]
every = int(grains.attrs["every"])
assert every == 3 and grains["position"].shape == (3, 5, 2)
assert grains["position"].dtype == grains["pressure"].dtype == numpy.float32
assert grains["position"][2, 4].tolist() == [64.0, -64.0]
assert grains["velocity"][1, 0].tolist() == [15.0, 1.0] and grains["pressure"][0, 3] == 300.0
assert grains["radius"][1] == numpy.float32(2e-3) and grains["column"][:].tolist() == [0, 0, 0, 1, 1]
"#;
    python::check("h5py", script, &[&path]);
}

#[test]
fn vtk_reads_exported_grains() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("run.h5");
    write(&path, 7, 3);
    let output = folder.path().join("run.vtkhdf");
    write_vtkhdf(&Trajectory::open(&path).unwrap(), &output).unwrap();
    // Python that another test starts may have inherited the lock.
    let file = File::with_options().with_fapl(|p| p.file_locking(false)).open(&output).unwrap();
    let points: ndarray::Array2<f32> =
        file.dataset("VTKHDF/grains/Points").unwrap().read_2d().unwrap();
    assert_eq!((points.dim(), points[[2 * COUNT + 1, 1]]), ((3 * COUNT, 3), -61.0));
    let times: Vec<f64> = file.dataset("VTKHDF/grains/Steps/Values").unwrap().read_raw().unwrap();
    assert_eq!(times, [0.0, 0.03, 0.06]);
    let script = r#"
import sys, numpy
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.util.numpy_support import vtk_to_numpy
reader = vtkHDFReader()
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
assert reader.GetNumberOfSteps() == 3, reader.GetNumberOfSteps()
for step in (2, 0, 1):
    reader.SetStep(step)
    reader.Update()
    blocks = reader.GetOutputDataObject(0)
    data, walls, boxes = (blocks.GetPartition(k, 0) for k in range(3))
    assert walls.GetNumberOfLines() == 3 and boxes.GetNumberOfPolys() == 2
    # The gate of the synthetic collapse goes up; frames are 0.03 s apart.
    gate = vtk_to_numpy(boxes.GetPoints().GetData())[4]
    assert abs(gate[1] - 3.0 * 0.03 * step) < 1e-12, gate
    assert data.GetNumberOfPoints() == data.GetNumberOfVerts() == 5
    x = vtk_to_numpy(data.GetPoints().GetData())
    arrays = data.GetPointData()
    number = numpy.arange(5) + 30 * step
    assert numpy.array_equal(x, numpy.stack([number, -number, 0 * number], 1)), x
    assert numpy.array_equal(vtk_to_numpy(arrays.GetArray("pressure")), 100 * number)
    assert numpy.array_equal(vtk_to_numpy(arrays.GetArray("velocity"))[:, 0], 0.5 * number)
    assert vtk_to_numpy(arrays.GetArray("column")).tolist() == [0, 0, 0, 1, 1]
    assert vtk_to_numpy(arrays.GetArray("id")).tolist() == [0, 1, 2, 3, 4]
    radius = vtk_to_numpy(arrays.GetArray("radius"))
    assert numpy.allclose(radius, 1e-3 * numpy.arange(1, 6)), radius
"#;
    python::check("vtk", script, &[&output]);

    let bare = folder.path().join("bare.h5");
    Collapse::new(3).write(&bare, 3);
    let error = write_vtkhdf(&Trajectory::open(&bare).unwrap(), &output).unwrap_err().to_string();
    assert!(error.contains("bare.h5: the file has no grains"), "{error}");
    let error = write_vtkhdf(&Trajectory::open(&path).unwrap(), &path).unwrap_err().to_string();
    assert!(error.contains("run.h5"), "{error}");
    check(&path, 7, 3);
}
