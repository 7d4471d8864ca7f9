//! Pictures, films and exports of a trajectory.

use std::path::{Path, PathBuf};

use assert_cmd::cargo::cargo_bin_cmd;
use clap::Parser;
use dempm::commands::export::{ExportArgs, export};
use dempm::commands::info::info;
use dempm::commands::plot::{PlotArgs, plot};
use dempm::trajectory::{Header, TrajectoryWriter};
use tempfile::{TempDir, tempdir};

use crate::python;
use crate::synthetic::Collapse;

#[derive(Parser)]
struct Plot {
    #[command(flatten)]
    args: PlotArgs,
}

#[derive(Parser)]
struct Export {
    #[command(flatten)]
    args: ExportArgs,
}

/// A trajectory of a few frames in a directory of its own.
fn trajectory() -> (TempDir, PathBuf) {
    let directory = tempdir().unwrap();
    let path = directory.path().join("run.h5");
    Collapse::new(8).write(&path, 5);
    (directory, path)
}

fn run_plot(path: &Path, options: &[&str]) -> miette::Result<()> {
    let words = ["plot", path.to_str().unwrap()].into_iter().chain(options.iter().copied());
    plot(&Plot::try_parse_from(words).unwrap().args)
}

fn run_export(path: &Path, format: &str) {
    try_export(path, format, None).unwrap();
}

fn try_export(path: &Path, format: &str, output: Option<&Path>) -> miette::Result<()> {
    let mut words = vec!["export", path.to_str().unwrap(), "--to", format];
    if let Some(output) = output {
        words.extend(["-o", output.to_str().unwrap()]);
    }
    export(&Export::try_parse_from(words).unwrap().args)
}

#[test]
fn every_field_makes_a_picture() {
    let (directory, path) = trajectory();
    for field in [
        "speed",
        "velocity-x",
        "velocity-y",
        "pressure",
        "shear-stress",
        "stress-xx",
        "stress-yy",
        "solid-fraction",
        "coordination",
        "inertial-number",
        "displacement",
        "column",
    ] {
        for log in [&[][..], &["--log"]] {
            let mut options = vec!["--field", field, "--width", "640"];
            options.extend(log);
            run_plot(&path, &options).unwrap();
            let picture = image::open(directory.path().join("run.png")).unwrap().to_rgb8();
            assert_eq!(picture.width(), 640);
            // Something other than white and grey: the points.
            let coloured = picture.pixels().filter(|p| p.0[0].abs_diff(p.0[2]) > 20).count();
            assert!(coloured > 500, "{field}: {coloured} coloured pixels");
        }
    }
}

#[test]
fn same_trajectory_same_picture() {
    let (directory, path) = trajectory();
    let picture = || {
        run_plot(&path, &["--times", "0.7,3"]).unwrap();
        std::fs::read(directory.path().join("run.png")).unwrap()
    };
    assert!(picture() == picture());
}

#[test]
fn a_film_has_a_picture_for_every_frame() {
    let (directory, path) = trajectory();
    let film = directory.path().join("film.gif");
    run_plot(&path, &["--animate", film.to_str().unwrap(), "--width", "320"]).unwrap();
    assert!(!directory.path().join("run.png").exists(), "nobody asked for a picture");
    let mut decoder = gif::Decoder::new(std::fs::File::open(&film).unwrap()).unwrap();
    let mut frames = 0;
    while decoder.read_next_frame().unwrap().is_some() {
        frames += 1;
    }
    // And one that keeps the last picture in sight.
    assert_eq!(frames, 5 + 1);
}

#[test]
fn what_cannot_be_drawn_is_explained() {
    let (directory, path) = trajectory();
    let explained = |options: &[&str], words: &str| {
        let report = format!("{:?}", run_plot(&path, options).unwrap_err());
        assert!(report.contains(words), "{report}");
    };
    explained(&["--frames", "5"], "there is no frame 5");
    explained(&["--frames", "fifth"], "`fifth`");
    explained(&["--animate", "film.mkv"], ".gif or an .mp4");

    let bare = directory.path().join("bare.h5");
    let collapse = Collapse::new(3);
    let mut writer =
        TrajectoryWriter::create(&bare, &collapse.header(), &collapse.points()).unwrap();
    writer.commit().unwrap();
    assert!(format!("{:?}", run_plot(&bare, &[]).unwrap_err()).contains("no frames"));
    let mut frame = collapse.frame(0);
    frame.stress = None;
    writer.push(frame).unwrap();
    writer.commit().unwrap();
    let report = format!("{:?}", run_plot(&bare, &["--field", "pressure"]).unwrap_err());
    assert!(report.contains("no stress"), "{report}");
    info(&bare).unwrap();
}

#[test]
fn points_lost_to_nan_do_not_stop_a_picture() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("lost.h5");
    let collapse = Collapse::new(4);
    let mut writer =
        TrajectoryWriter::create(&path, &collapse.header(), &collapse.points()).unwrap();
    let mut frame = collapse.frame(3);
    frame.position[0] = [f64::NAN; 2];
    frame.position[1] = [f64::INFINITY, 1e300];
    frame.position[2] = [1e300, -1e300];
    frame.velocity[3] = [f64::NAN; 2];
    writer.push(frame).unwrap();
    writer.finish("a point left the grid").unwrap();
    for options in [&[][..], &["--log"], &["--field", "displacement"]] {
        run_plot(&path, options).unwrap();
    }
    let words = |command: &str| {
        let output = cargo_bin_cmd!("dempm").arg(command).arg(&path).assert().success();
        let output = output.get_output();
        String::from_utf8([&output.stdout[..], &output.stderr[..]].concat()).unwrap()
    };
    let (told, seen) = (words("info"), words("plot"));
    let first = "the first at frame 0, point 0";
    assert!(told.contains(&format!("3 values are not finite, {first}")), "{told}");
    assert!(seen.contains(&format!("2 positions are not finite and not drawn, {first}")), "{seen}");
    for format in ["npz", "vtk", "gns", "lagrangebench"] {
        // The formats of data sets take finished runs only.
        let mut writer = TrajectoryWriter::resume(&path, 1).unwrap();
        writer.set_wall_time("rve", 1.0);
        writer.finish("finished").unwrap();
        let error = try_export(&path, format, None).unwrap_err().to_string();
        let named = "the position of point 0 at frame 0 is not";
        assert!(error.contains(named), "{error}");
    }
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2, "an export was begun");
}

#[test]
fn a_long_title_costs_no_time() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("title.h5");
    let title = "\u{1b}]0;owned\u{7}\n".to_owned() + &"i".repeat(60_000);
    let header = Header { title, ..Collapse::new(4).header() };
    Collapse::new(4).write_with(&path, &header, 2);
    let begin = std::time::Instant::now();
    run_plot(&path, &[]).unwrap();
    assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
    let info = cargo_bin_cmd!("dempm").arg("info").arg(&path).assert().success();
    let text = String::from_utf8(info.get_output().stdout.clone()).unwrap();
    assert!(text.contains("\nscene         "), "{text}");
    assert!(!text.contains(['\u{1b}', '\u{7}']) && !text.contains("\niii"));
}

/// By whatever path and link, nothing that is read is written to, nor one output over another.
#[test]
fn inputs_are_never_replaced() {
    let (directory, path) = trajectory();
    let at = |name: &str| directory.path().join(name);
    std::os::unix::fs::symlink(&path, at("link.png")).unwrap();
    std::fs::create_dir(at("x_frames")).unwrap();
    let as_frame = at("x_frames/00003.vtp");
    std::fs::hard_link(&path, &as_frame).unwrap();
    std::fs::create_dir_all(at("set/train")).unwrap();
    let case = at("set/train/train.h5");
    std::fs::copy(&path, &case).unwrap();
    let before = std::fs::read(&path).unwrap();

    let explained = |result: miette::Result<()>| {
        let report = result.unwrap_err().to_string();
        assert!(report.contains("replace its own input"), "{report}");
    };
    explained(run_plot(&path, &["-o", at("link.png").to_str().unwrap()]));
    explained(run_plot(&path, &["--animate", path.to_str().unwrap()]));
    explained(try_export(&path, "npz", Some(&at("./run.h5"))));
    explained(try_export(&as_frame, "vtk", Some(&at("x.pvd"))));
    for format in ["gns", "lagrangebench"] {
        for folder in ["set", "set/train", "./set/../set"] {
            explained(try_export(&at("set"), format, Some(&at(folder))));
        }
    }
    explained(try_export(&case, "lagrangebench", Some(&at("set/train"))));
    let film = at("film.gif");
    std::os::unix::fs::symlink(&film, at("film.png")).unwrap();
    let picture = at("film.png");
    let words = ["--animate", film.to_str().unwrap(), "-o", picture.to_str().unwrap()];
    let report = run_plot(&path, &words).unwrap_err().to_string();
    assert!(report.contains("two outputs in one file"), "{report}");

    assert!(std::fs::read(&path).unwrap() == before && std::fs::read(&case).unwrap() == before);
    assert_eq!(std::fs::read_dir(at("set")).unwrap().count(), 1);
    assert!(!film.exists());
}

#[test]
fn numpy_reads_the_npz_export() {
    let (directory, path) = trajectory();
    run_export(&path, "npz");
    let script = r#"
import sys, h5py, numpy as np
a = np.load(sys.argv[1])
with h5py.File(sys.argv[2], "r") as f:
    for name in ["position", "velocity", "stress", "solid_fraction", "coordination",
                 "inertial_number", "time"]:
        assert a[name].dtype == f[name].dtype and np.array_equal(a[name], f[name][:]), name
    assert np.array_equal(a["boundary_boxes"], f["boundary/boxes"][:], equal_nan=True)
    assert np.array_equal(a["boundary_walls"], f["boundary/walls"][:])
    assert np.array_equal(a["column"], f["points/column"][:])
    assert np.array_equal(a["budget_front"], f["budget/front"][:])
"#;
    python::check("h5py, numpy", script, &[&directory.path().join("run.npz"), &path]);
}

#[test]
fn vtk_reads_the_vtk_export() {
    let (directory, path) = trajectory();
    run_export(&path, "vtk");
    let series = std::fs::read_to_string(directory.path().join("run.pvd")).unwrap();
    assert!(series.contains("timestep=\"0.75\" file=\"run_frames/00001.vtp\""), "{series}");
    let script = r#"
import sys, h5py, numpy as np
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
from vtkmodules.util.numpy_support import vtk_to_numpy
reader = vtkXMLPolyDataReader()
reader.SetFileName(sys.argv[1])
reader.Update()
data = reader.GetOutput()
with h5py.File(sys.argv[2], "r") as f:
    assert data.GetNumberOfVerts() == 64
    points = vtk_to_numpy(data.GetPoints().GetData())
    assert np.array_equal(points[:, :2], f["position"][3])
    arrays = data.GetPointData()
    assert np.array_equal(vtk_to_numpy(arrays.GetArray("stress"))[:, [0, 1, 3, 4]], f["stress"][3])
    assert np.array_equal(vtk_to_numpy(arrays.GetArray("column")), f["points/column"][:])
"#;
    let frame = directory.path().join("run_frames/00003.vtp");
    python::check("h5py, vtk", script, &[&frame, &path]);
}
