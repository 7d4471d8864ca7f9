//! Pictures, films and exports of a trajectory.

use std::path::{Path, PathBuf};

use assert_cmd::cargo::cargo_bin_cmd;
use clap::Parser;
use dempm::commands::export::{ExportArgs, export};
use dempm::commands::info::{InfoArgs, info};
use dempm::commands::plot::{PlotArgs, plot};
use dempm::trajectory::{Frame, Header, Points, TrajectoryWriter};
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

/// As `run.h5` of [`trajectory`], with all points `d` (m) to the right from the second frame on, and slower.
fn write_moved(path: &Path, d: f64) {
    let collapse = Collapse::new(8);
    let mut writer =
        TrajectoryWriter::create(path, &collapse.header(), &collapse.points()).unwrap();
    for index in 0..5 {
        let mut frame = collapse.frame(index * 75);
        if index > 0 {
            frame.position.iter_mut().for_each(|x| x[0] += d);
        }
        frame.velocity.iter_mut().flatten().for_each(|v| *v *= 0.5);
        writer.push(frame).unwrap();
    }
    writer.finish("finished").unwrap();
}

/// Pixels of a picture that are about of a colour.
fn pixels_like(path: &Path, colour: [u8; 3]) -> usize {
    let picture = image::open(path).unwrap().to_rgb8();
    let near = |pixel: [u8; 3]| pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 12);
    picture.pixels().filter(|pixel| near(pixel.0)).count()
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
        run_plot(&path, &["--times", "0.007,0.03"]).unwrap();
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

/// The second and third colour of series: the first of the other runs, and the next.
const ORANGE: [u8; 3] = [0xD5, 0x5E, 0x00];
const GREEN: [u8; 3] = [0x00, 0x8F, 0x68];

/// Every way to compare has the distances over time as a curve for each run after the first, in its colour.
#[test]
fn runs_are_compared_in_one_picture() {
    let (directory, path) = trajectory();
    let at = |name: &str| directory.path().join(name);
    write_moved(&at("moved.h5"), 0.25);
    write_moved(&at("far.h5"), 0.5);
    let others = [at("moved.h5"), at("far.h5")];
    let others = others.each_ref().map(|path| path.to_str().unwrap());
    let picture = |options: &[&str]| {
        let words = [&others[..], &["--width", "800"], options].concat();
        run_plot(&path, &words).unwrap();
        image::open(at("run-and-moved-and-far.png")).unwrap().to_rgb8()
    };
    let [side, overlay, difference] =
        ["side", "overlay", "difference"].map(|how| picture(&["--compare", how]));
    // Three runs side by side at four times are higher than four times two by two.
    assert!(side.height() > overlay.height());
    assert!(side != difference);
    for how in ["side", "overlay", "difference"] {
        picture(&["--compare", how]);
        for colour in [ORANGE, GREEN] {
            let found = pixels_like(&at("run-and-moved-and-far.png"), colour);
            assert!(found > 200, "{how}: {found} pixels of {colour:?}");
        }
    }
    // Speeds are halved, so their difference is not the distance.
    assert!(picture(&["--compare", "difference", "--field", "speed"]) != difference);

    let film = at("film.gif");
    let options = ["--compare", "overlay", "--width", "320", "--animate", film.to_str().unwrap()];
    run_plot(&path, &[&others[..1], &options].concat()).unwrap();
    let mut decoder = gif::Decoder::new(std::fs::File::open(&film).unwrap()).unwrap();
    let palette = decoder.global_palette().unwrap().as_chunks::<3>().0.to_vec();
    assert!(palette.contains(&ORANGE), "the colour of the second run is kept");
    assert!(decoder.read_next_frame().unwrap().is_some());
}

#[test]
fn what_cannot_be_compared_is_explained() {
    let (directory, path) = trajectory();
    let at = |name: &str| directory.path().join(name);
    let explained = |options: &[&str], words: &str| {
        let report = format!("{:?}", run_plot(&path, options).unwrap_err());
        assert!(report.replace("\n  │ ", " ").contains(words), "{report}");
    };
    // Only the lower half of the points.
    let collapse = Collapse::new(8);
    let Points { mut mass, mut column } = collapse.points();
    mass.truncate(32);
    column.truncate(32);
    let half = Points { mass, column };
    let mut writer = TrajectoryWriter::create(&at("other.h5"), &collapse.header(), &half).unwrap();
    let Frame { mut position, mut velocity, .. } = collapse.frame(0);
    position.truncate(32);
    velocity.truncate(32);
    writer.push(Frame { position, velocity, ..Frame::default() }).unwrap();
    writer.finish("finished").unwrap();
    let other = at("other.h5");
    let other = other.to_str().unwrap();
    explained(&[other, "--compare", "difference"], "does not start with the material");
    run_plot(&path, &[other]).unwrap();
    let header = Header { title: "Late".to_owned(), ..Collapse::new(8).header() };
    let mut writer =
        TrajectoryWriter::create(&at("late.h5"), &header, &Collapse::new(8).points()).unwrap();
    writer.push(Collapse::new(8).frame(1)).unwrap();
    writer.finish("finished").unwrap();
    explained(&[at("late.h5").to_str().unwrap()], "no time in common");
    write_moved(&at("moved.h5"), 0.1);
    std::fs::write(at("path.csv"), "t\n").unwrap();
    explained(&[at("path.csv").to_str().unwrap()], "do not share a picture");
    assert!(
        run_plot(&at("path.csv"), &[])
            .unwrap_err()
            .chain()
            .any(|e| { e.to_string().contains("no column `exx`") })
    );
}

/// Means over cells of 2 x 2 points: in each cell of the grid one colour.
#[test]
fn an_average_smooths_a_field() {
    let (directory, path) = trajectory();
    let picture = |options: &[&str]| {
        run_plot(&path, &[&["--field", "pressure", "--frames", "0"], options].concat()).unwrap();
        std::fs::read(directory.path().join("run.png")).unwrap()
    };
    assert!(picture(&[]) != picture(&["--average", "cell"]));
}

/// An infinite inertial number is grey, and the key says so.
#[test]
fn grey_points_have_a_legend() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("grey.h5");
    let collapse = Collapse::new(8);
    let mut writer =
        TrajectoryWriter::create(&path, &collapse.header(), &collapse.points()).unwrap();
    let mut frame = collapse.frame(30);
    let grey = |path: &Path| {
        run_plot(path, &["--field", "inertial-number", "--width", "800"]).unwrap();
        pixels_like(&path.with_extension("png"), [150; 3])
    };
    writer.push(frame.clone()).unwrap();
    writer.finish("finished").unwrap();
    let before = grey(&path);
    frame.inertial_number.as_mut().unwrap()[0] = f32::INFINITY;
    let mut writer =
        TrajectoryWriter::create(&path, &collapse.header(), &collapse.points()).unwrap();
    writer.push(frame).unwrap();
    writer.finish("finished").unwrap();
    // A point more than 25 pixels across, and the mark of the legend.
    assert!(grey(&path) > before + 500);
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
    info(&InfoArgs { file: bare, json: false }).unwrap();
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

/// The summary as JSON has the numbers of the file, and nothing else is on the standard output.
#[test]
fn info_is_one_json_object() {
    let (_directory, path) = trajectory();
    let output = cargo_bin_cmd!("dempm").args(["info", "--json"]).arg(&path).assert().success();
    let json: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(json["points"], 64);
    assert_eq!(json["frames"], 5);
    assert_eq!(json["time"], serde_json::json!([0.0, 3.0]));
    assert_eq!(json["status"], "finished");
    let position = &json["fields"][0];
    assert_eq!((&position["name"], &position["unit"]), (&"position".into(), &"m".into()));
    // A heap of 7.5 m ends half a spacing before its front.
    let front = json["end"]["front"].as_f64().unwrap();
    let x = position["components"][0]["max"].as_f64().unwrap();
    assert!((front - x - 0.5 * 3.0 / 8.0).abs() < 1e-6, "{front} {x}");
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
    assert!(
        series
            .contains("timestep=\"0.75\" part=\"0\" name=\"points\" file=\"run_frames/00001.vtp\""),
        "{series}"
    );
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
    for frame in (0, 3):
        reader = vtkXMLPolyDataReader()
        reader.SetFileName(sys.argv[1].replace("00003.vtp", f"0000{frame}_boundary.vtp"))
        reader.Update()
        data = reader.GetOutput()
        boxes = f["boundary/boxes"][frame]
        boxes = boxes[np.isfinite(boxes[:, 0])]
        assert data.GetNumberOfLines() == 3 and data.GetNumberOfPolys() == len(boxes) == (2 if frame == 0 else 1)
        points = vtk_to_numpy(data.GetPoints().GetData())
        assert np.array_equal(points[:6, :2].reshape(3, 4), f["boundary/walls"][:])
        assert np.array_equal(points[6:].reshape(-1, 4, 3)[:, 2, :2], boxes[:, 2:])
        last = data.GetCell(data.GetNumberOfCells() - 1)
        assert [last.GetPointId(k) for k in range(4)] == list(range(len(points) - 4, len(points)))
"#;
    let frame = directory.path().join("run_frames/00003.vtp");
    python::check("h5py, vtk", script, &[&frame, &path]);
}
