//! Files that somebody made by hand: links out of the file, and numbers that cannot be.

use std::fs;

use dempm::trajectory::{Header, TrajectoryWriter};
use hdf5::{Extents, File};
use tempfile::tempdir;

use crate::damage::spoiled;
use crate::synthetic::Collapse;

/// An export of such a file would hold bytes of another file of this machine.
#[test]
fn nothing_is_read_from_another_place() {
    let folder = tempdir().unwrap();
    let secret = folder.path().join("secret.h5");
    Collapse::new(3).write(&secret, 3);
    let raw = folder.path().join("secret.raw");
    fs::write(&raw, [7; 4096]).unwrap();
    let (secret, raw) = (secret.to_str().unwrap(), raw.to_str().unwrap());
    let paths = ["points/mass", "boundary/walls", "boundary/boxes", "position", "stress", "time"];
    for path in
        paths.into_iter().chain(["budget/front", "points", "budget", "versions", "wall_time"])
    {
        let refused = |what: &str, craft: &dyn Fn(&File)| {
            let error = spoiled(|file| {
                file.unlink(path).unwrap();
                craft(file);
            });
            let named = error.contains("spoiled.h5") && error.contains("which is not followed");
            assert!(named, "{what} at {path}: {error}");
        };
        refused("external link", &|file| file.link_external(secret, path, path).unwrap());
        refused("soft link", &|file| file.link_soft("/VTKHDF", path).unwrap());
        if paths.contains(&path) {
            refused("external storage", &|file| {
                let dataset = file.new_dataset::<f64>().external(raw, 0, 72).shape(9);
                dataset.create(path).unwrap();
            });
            refused("virtual dataset", &|file| {
                let all = || Extents::from(9);
                let dataset = file.new_dataset::<f64>();
                let mapped = dataset.virtual_map(secret, "points/mass", all(), .., all(), ..);
                mapped.shape(all()).create(path).unwrap();
            });
        }
    }
}

#[test]
fn numbers_that_cannot_be_are_refused() {
    let number = |name: &'static str, value: f64| {
        spoiled(move |file| file.attr(name).unwrap().write_scalar(&value).unwrap())
    };
    let pair = |name: &'static str, value: [f64; 2]| {
        spoiled(move |file| file.attr(name).unwrap().write(&value).unwrap())
    };
    for value in [0.0, 1e-300, -0.5, f64::NAN, f64::INFINITY] {
        let error = number("point_spacing", value);
        assert!(error.contains("spoiled.h5: point_spacing"), "{error}");
    }
    for (name, value) in [("grid_cell", 1e9), ("time_step", f64::NAN), ("frame_interval", 0.0)] {
        let error = number(name, value);
        assert!(error.contains(&format!("spoiled.h5: {name}")), "{error}");
    }
    for value in [[1e300, 1.0], [1e9, 1e-3], [f64::NAN; 2], [0.0, 4.0], [-1.0, 4.0]] {
        let error = pair("domain", value);
        assert!(error.contains("spoiled.h5: domain"), "{error}");
    }
    assert!(pair("gravity", [f64::NAN, 0.0]).contains("spoiled.h5: gravity"));
    let dataset = |name: &'static str, values: [f64; 3]| {
        spoiled(move |file| {
            file.dataset(name).unwrap().write_slice(&values, ndarray::s![0..3]).unwrap();
        })
    };
    let error = dataset("time", [0.0, f64::NAN, 1.0]);
    assert!(error.contains("spoiled.h5: time of frame 1 is NaN s"), "{error}");
    assert!(dataset("time", [0.0, 1.0, 1.0]).contains("time of frame 2 is 1 s"));
    let error = dataset("points/mass", [1.0, -1.0, 1.0]);
    assert!(error.contains("spoiled.h5: points/mass of point 1 is -1 kg/m"), "{error}");
}

/// What cannot be opened is not written either.
#[test]
fn a_writer_has_the_same_limits() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let collapse = Collapse::new(3);
    let header = Header { point_spacing: 0.0, ..collapse.header() };
    let error = TrajectoryWriter::create(&path, &header, &collapse.points()).unwrap_err();
    assert!(error.to_string().contains("run.h5: point_spacing"), "{error}");
    assert!(!path.exists());
}
