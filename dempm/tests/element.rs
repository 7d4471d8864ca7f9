//! `dempm element` on the command line.

use std::fs;
use std::path::Path;

use assert_cmd::cargo::cargo_bin_cmd;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;

/// Few discs and a short path: well under a second.
const TEST: &str = r#"
sampling = 1e-3

[rve]
discs = 40

[rve.preparation]
pressure = 20e3

[[stage]]
kind = "constant-volume-shear"
shear_rate = 1.0
strain = 0.005
"#;

fn element(folder: &Path) -> assert_cmd::Command {
    let mut command = cargo_bin_cmd!("dempm");
    command.current_dir(folder).arg("element");
    command
}

/// Columns of a path, header first.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// The path has a row at the start and one per sampling interval; stress is tension positive.
#[test]
fn writes_the_path() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("test.toml"), TEST).unwrap();
    element(folder.path()).args(["test.toml", "--precision", "f32"]).assert().success();
    let rows = rows(&folder.path().join("test.csv"));
    assert_eq!(rows.len(), 1 + 1 + 5);
    let column = |name: &str| rows[0].iter().position(|c| c == name).unwrap();
    let number = |row: usize, name: &str| rows[row][column(name)].parse::<f64>().unwrap();
    assert!((number(1, "syy") + 20e3).abs() < 200.0);
    assert!((number(6, "exy") - 0.005).abs() < 1e-12);
    assert!(number(6, "sxy") > 1e3);
}

/// Paths of several tests share a picture, whose name says so; the second line is in the second colour.
#[test]
fn paths_are_charted() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("a", 1), ("b", 2)] {
        let test = format!("seed = {seed}\n{TEST}");
        fs::write(folder.path().join(format!("{name}.toml")), test).unwrap();
        element(folder.path()).arg(format!("{name}.toml")).assert().success();
    }
    let mut plot = cargo_bin_cmd!("dempm");
    plot.current_dir(folder.path()).args(["plot", "a.csv", "b.csv", "--width", "800"]);
    plot.assert().success().stdout("a-and-b.png\n");
    let picture = image::open(folder.path().join("a-and-b.png")).unwrap().to_rgb8();
    assert_eq!(picture.width(), 800);
    for colour in [[0x00, 0x72, 0xB2], [0xD5, 0x5E, 0x00]] {
        let near = |p: &image::Rgb<u8>| p.0.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 12);
        assert!(picture.pixels().filter(|p| near(p)).count() > 200, "{colour:?}");
    }
}

/// Without a name the path lies where the command was given, not beside the test; a place that
/// takes no file is refused before anything is computed.
#[test]
fn the_path_is_written_here_or_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir_all(path("tests")).unwrap();
    fs::create_dir_all(path("here")).unwrap();
    fs::write(path("tests/slow-0.5.toml"), TEST).unwrap();
    element(&path("here")).arg("../tests/slow-0.5.toml").assert().success();
    assert!(path("here/slow-0.5.csv").exists());
    assert_eq!(fs::read_dir(path("tests")).unwrap().count(), 1);
    for more in [["-o", "here"], ["-o", "tests/slow-0.5.toml/x.csv"], ["--dump-packing", "here"]] {
        let refused = element(folder.path()).arg("tests/slow-0.5.toml").args(more).assert();
        // No packing was made.
        let refused = refused.failure().stderr(contains("packing:").not());
        refused.stderr(contains(more[1]));
    }
}

/// A dumped packing, read again and dumped again, is the same file; a path from it starts with
/// the same discs under nearly the same stress (only the contact history is lost).
#[test]
fn a_dumped_packing_can_be_driven() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("make.toml"), TEST).unwrap();
    element(folder.path()).args(["make.toml", "--dump-packing", "a.csv"]).assert().success();
    fs::write(path("drive.toml"), format!("packing = \"a.csv\"\n{TEST}")).unwrap();
    element(folder.path()).args(["drive.toml", "--dump-packing", "b.csv"]).assert().success();
    let [a, b] = ["a.csv", "b.csv"].map(|name| fs::read_to_string(path(name)).unwrap());
    assert!(a.starts_with("H,"));
    assert_eq!(a.lines().count(), 41);
    // Positions pass through fractions of the cell, which costs a rounding.
    for (a, b) in a.lines().zip(b.lines()) {
        let numbers = |line: &str| -> Vec<f64> {
            line.trim_start_matches("H,").split(',').map(|x| x.parse().unwrap()).collect()
        };
        assert!(numbers(a).iter().zip(numbers(b)).all(|(a, b)| (a - b).abs() < 1e-15), "{a} {b}");
    }
    let pressure = |name: &str| -> f64 { rows(&path(name))[1][8].parse().unwrap() };
    assert!((pressure("make.csv") / pressure("drive.csv") - 1.0).abs() < 0.01);
}

/// By whatever path and link, and before anything is computed.
#[test]
fn inputs_are_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let packing = "H,0.1,0,0,0.1\n0.05,0.05,0.04\n";
    fs::write(path("p.csv"), packing).unwrap();
    fs::write(path("drive.toml"), format!("packing = \"p.csv\"\n{TEST}")).unwrap();
    std::os::unix::fs::symlink("p.csv", path("link.csv")).unwrap();
    let names = ["p.csv", "./p.csv", "link.csv", "drive.toml"];
    let outputs = names.into_iter().flat_map(|name| [["-o", name], ["--dump-packing", name]]);
    for words in outputs {
        let refused = contains("replace its own input").and(contains("packing:").not());
        element(folder.path()).arg("drive.toml").args(words).assert().failure().stderr(refused);
    }
    for words in [
        ["-o", "a.csv", "--dump-packing", "./a.csv"],
        ["-o", "b/../a.csv", "--dump-packing", "a.csv"],
    ] {
        let refused = contains("two outputs in one file").and(contains("packing:").not());
        element(folder.path()).arg("drive.toml").args(words).assert().failure().stderr(refused);
    }
    // The path's default name.
    let words = ["drive.toml", "--dump-packing", "drive.csv"];
    element(folder.path()).args(words).assert().failure().stderr(contains("two outputs"));
    assert_eq!(fs::read_to_string(path("p.csv")).unwrap(), packing);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
}

/// Errors name the file and the key.
#[test]
fn errors_name_file_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |text: &str, messages: [&str; 2]| {
        fs::write(folder.path().join("test.toml"), text).unwrap();
        let result = element(folder.path()).arg("test.toml").assert().failure();
        messages.iter().fold(result, |result, message| result.stderr(contains(*message)));
        assert!(!folder.path().join("test.csv").exists());
    };
    fails(&TEST.replace("discs", "disks"), ["test.toml", "disks"]);
    fails(&TEST.replace("shear_rate = 1.0", "shear_rate = 0.0"), ["test.toml", "shear_rate"]);
    fails(&TEST.replace("constant-volume-shear", "torsion"), ["test.toml", "torsion"]);
    fails(&TEST.replace("sampling = 1e-3", "sampling = -1.0"), ["test.toml", "sampling"]);
    let (keys, _) = TEST.split_once("[[stage]]").unwrap();
    fails(&format!("stage = []\n{keys}"), ["test.toml", "stage is empty"]);
    fails(keys, ["test.toml", "missing field `stage`"]);
    fails(&format!("packing = \"none.csv\"\n{TEST}"), ["none.csv", "cannot read"]);
    fs::write(folder.path().join("bad.csv"), "H,0.1,0,0,0.1\n0.05,0.05\n").unwrap();
    fails(&format!("packing = \"bad.csv\"\n{TEST}"), ["bad.csv", "line 2"]);
}

/// Keys of older files are told where they are now.
#[test]
fn keys_that_have_moved_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (key, place) in [
        ("discs = 40\nfriction = 0.5", "`friction` is now in [grains]"),
        ("discs = 40\npreparation.friction = 0.5", "`preparation_friction` in [grains]"),
        ("discs = 40\ngrains = {}", "a table of their own, [grains]"),
    ] {
        let text =
            TEST.replace("discs = 40", key).replace("[rve.preparation]\npressure = 20e3\n", "");
        fs::write(folder.path().join("test.toml"), text).unwrap();
        element(folder.path()).arg("test.toml").assert().failure().stderr(contains(place));
    }
}

/// Packings have the limits that those of scenes have.
#[test]
fn a_packing_that_cannot_be_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (key, number) in
        [("rve.discs", "discs = 0"), ("grains.friction", "discs = 40\n[grains]\nfriction = -1.0")]
    {
        fs::write(folder.path().join("test.toml"), TEST.replace("discs = 40", number)).unwrap();
        let refused = contains("test.toml").and(contains(key)).and(contains("must be"));
        element(folder.path()).arg("test.toml").assert().failure().stderr(refused);
    }
}
