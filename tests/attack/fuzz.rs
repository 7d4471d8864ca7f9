//! The readers of every input format within this process: thousands of mutated inputs a second, where
//! programs would see dozens.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};

use dempm::device::Device;
use dempm::element::ElementTest;
use dempm::export::{Format, write_data_set, write_npz, write_vtk};
use dempm::figures::{self, Compare, Quantity, Selection};
use dempm::run::checkpoint;
use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::Trajectory;
use miette::bail;
use rand::RngExt;
use surrogate::data::{DataSet, Statistics, WindowShape};
use surrogate::diagnostics::TrainingRange;
use surrogate::network::parameters::weights;
use surrogate::rollout::{InitialFrames, Rollout};
use surrogate::simulator::Simulator;
use surrogate::train::{Session, SessionOptions, TrainConfig};

use crate::campaign::{self, Attack, Finding, Promise};
use crate::fixtures::{copy, fixtures};
use crate::in_process::read;
use crate::mutation::{damage, mutate};
use crate::structure::{damage_sealed, mutate_hdf5, mutate_header, without_hash};

/// Attacks readers; the inputs are not made on the test's time.
fn fuzz(name: &str, attack: impl Fn(&mut Attack) -> Result<(), Finding>) {
    fixtures();
    campaign::fuzz(name, attack);
}

/// Writes the mutated text of an input into the attack's folder.
fn mutated_text(attack: &mut Attack, from: &Path, name: &str) -> PathBuf {
    let text = fs::read_to_string(from).unwrap();
    let path = attack.folder.join(name);
    fs::write(&path, mutate(&text, &mut attack.rng)).unwrap();
    path
}

/// One of some.
fn one<'a>(names: &[&'a str], attack: &mut Attack) -> &'a str {
    names[attack.rng.random_range(0..names.len())]
}

#[test]
fn fuzz_scenes() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    fuzz("fuzz_scenes", |attack| {
        let own = ["scene.toml", "mu-i.toml"].map(|name| fixtures().join(name));
        let others =
            ["column.toml", "paper/test/col3x3barriers.toml"].map(|name| shipped.join(name));
        let all = [own, others].concat();
        let from = &all[attack.rng.random_range(0..all.len())];
        let path = mutated_text(attack, from, "scene.toml");
        read("a scene", "scene.toml", move || {
            let scene = Scene::load(path)?;
            drop(scene.warning_report());
            Ok((scene.steps(), scene.frames(), scene.point_count(), scene.step_limit()))
        })
        .map(drop)
    });
}

#[test]
fn fuzz_lists_of_scenes() {
    fuzz("fuzz_lists_of_scenes", |attack| {
        copy(&["list.toml", "mu-i.toml"], &attack.folder);
        let name = one(&["list.toml", "list.toml", "mu-i.toml"], attack);
        mutated_text(attack, &fixtures().join(name), name);
        let path = attack.folder.join("list.toml");
        // The file that is missing may be one of a mutated name.
        let cases = move || Ok(dempm::dataset::cases(&path)?.len());
        read("a list of scenes", "fuzz_lists_of_scenes-", cases).map(drop)
    });
}

#[test]
fn fuzz_element_tests() {
    fuzz("fuzz_element_tests", |attack| {
        copy(&["element.toml", "packing.csv"], &attack.folder);
        let name = one(&["element.toml", "packing.csv"], attack);
        mutated_text(attack, &fixtures().join(name), name);
        let folder = attack.folder.clone();
        let test = move || {
            let test = ElementTest::load(&folder.join("element.toml"))?;
            // Without a packing one would be consolidated.
            if test.packing_file(&folder).is_some() {
                test.prepare(&folder)?;
            }
            Ok(test.stages().count())
        };
        read("an element test", "fuzz_element_tests-", test).map(drop)
    });
}

#[test]
fn fuzz_training_files() {
    fuzz("fuzz_training_files", |attack| {
        let path = mutated_text(attack, &fixtures().join("training.toml"), "training.toml");
        let load = move || Ok(TrainConfig::load(&path)?.model().parameter_count());
        read("a training file", "training.toml", load).map(drop)
    });
}

#[test]
fn fuzz_weights() {
    let accepted = Cell::new(0);
    fuzz("fuzz_weights", |attack| {
        let hashed = fs::read(fixtures().join("whole/best.safetensors")).unwrap();
        let mut bytes =
            if attack.rng.random_bool(0.7) { without_hash(&hashed) } else { hashed.clone() };
        let original = bytes.clone();
        let how = match attack.rng.random_bool(0.5) {
            true => damage(&mut bytes, &mut attack.rng),
            false => mutate_header(&mut bytes, &mut attack.rng),
        };
        let (changed, sealed) = (bytes != original, original == hashed);
        let path = attack.folder.join("w.safetensors");
        fs::write(&path, bytes).unwrap();
        let values = move || Ok(weights(&Simulator::load(&path)?.model));
        let ended = read(&how, "w.safetensors", values)?;
        accepted.set(accepted.get() + u32::from(ended.is_ok()));
        match ended {
            Ok(values) if values.iter().any(|value| !value.is_finite()) => {
                Promise::NothingLost.broken(format!("{how}: weights that are not finite"))
            }
            Ok(_) if changed && sealed && !how.starts_with("mutated") => {
                Promise::NamedError.broken(format!("{how}: not seen"))
            }
            _ => Ok(()),
        }
    });
    println!("fuzz_weights: {} accepted", accepted.get());
}

#[test]
fn fuzz_trajectories() {
    let (formed, accepted) = (Cell::new(0), Cell::new(0));
    fuzz("fuzz_trajectories", |attack| {
        let original = one(&["whole.h5", "data/valid/middle.h5", "discs.h5"], attack);
        let path = attack.folder.join("t.h5");
        let mut bytes = fs::read(fixtures().join(original)).unwrap();
        let how = if attack.rng.random_bool(0.3) {
            let how = damage(&mut bytes, &mut attack.rng);
            fs::write(&path, bytes).unwrap();
            how
        } else {
            fs::write(&path, bytes).unwrap();
            match mutate_hdf5(&path, &mut attack.rng) {
                Ok(how) => {
                    formed.set(formed.get() + 1);
                    how
                }
                // Not every change is possible.
                Err(_) => return Ok(()),
            }
        };
        let consumer = attack.rng.random_range(0..8);
        let how = format!("{original}, consumer {consumer}: {how}");
        let folder = attack.folder.clone();
        let ended = read(&how, "t.h5", move || consume(&path, consumer, &folder))?;
        accepted.set(accepted.get() + u32::from(ended.is_ok()));
        Ok(())
    });
    let (formed, accepted) = (formed.get(), accepted.get());
    println!("fuzz_trajectories: {formed} with other contents, {accepted} accepted");
}

/// Does what a command would do with a trajectory.
fn consume(path: &Path, consumer: usize, folder: &Path) -> miette::Result<()> {
    match consumer {
        0..3 => read_all(path),
        3 => {
            let options = figures::Options {
                grains: false,
                quantity: Some(Quantity::Speed),
                average: None,
                log: false,
                frames: Selection::Default,
                width: Some(320),
                compare: Compare::Side,
            };
            figures::draw(&[Trajectory::open(path)?], &options, &folder.join("out.png"))?;
            Ok(())
        }
        4 => Ok(write_npz(&Trajectory::open(path)?, &folder.join("out.npz"))?),
        5 => Ok(write_vtk(&Trajectory::open(path)?, &folder.join("out.pvd"))?),
        6 => {
            write_data_set(path, &folder.join("out"), Format::Gns, true)?;
            let shape = WindowShape { frames: 3, stride: 1, before: 1 };
            let set = DataSet::open(&[path.to_owned()], shape, 1 << 20)?.with_obstacles(true)?;
            Statistics::measure(&set, true)?;
            TrainingRange::of(&set, 0.13)?;
            Ok(())
        }
        _ => {
            let simulator = Simulator::load(&fixtures().join("whole/best.safetensors"))?;
            let initial = InitialFrames::from_trajectory(path, 0, &simulator)?;
            let mut rollout = Rollout::new(&simulator, &initial);
            // A prediction may fail, which the command reports.
            drop(rollout.advance().map(<[_]>::len));
            Ok(())
        }
    }
}

fn read_all(path: &Path) -> miette::Result<()> {
    let file = Trajectory::open(path)?;
    let all = 0..file.frames();
    for frame in all.clone() {
        file.frame(frame)?;
    }
    file.positions(all.clone())?;
    file.velocities(all.clone())?;
    file.boxes(all.clone())?;
    for field in file.fields() {
        file.field::<f64>(field, all.clone())?;
    }
    file.grains()?;
    for frame in all {
        file.grain_frame(frame)?;
        file.grid_frame(frame)?;
    }
    Ok(())
}

/// Damages a sealed file; whether the damage has to be seen.
fn damaged_seal(attack: &mut Attack, from: &str, name: &str) -> (String, bool) {
    let original = fs::read(fixtures().join(from)).unwrap();
    let mut bytes = original.clone();
    let is_sealed = attack.rng.random_bool(0.75);
    let how = match is_sealed {
        true => damage_sealed(&mut bytes, &mut attack.rng),
        false => damage(&mut bytes, &mut attack.rng),
    };
    fs::write(attack.folder.join(name), &bytes).unwrap();
    (how, !is_sealed && bytes != original)
}

#[test]
fn fuzz_run_checkpoints() {
    fuzz("fuzz_run_checkpoints", |attack| {
        let (how, is_damaged) = damaged_seal(attack, "cut.h5.ckpt", "c.ckpt");
        let path = attack.folder.join("c.ckpt");
        let resume = move || {
            let scene = Scene::load(fixtures().join("scene.toml"))?;
            let (state, _) = match checkpoint::read(&path, &scene.text) {
                Ok(read) => read,
                Err(error) => bail!(miette::Report::new(error)),
            };
            // What has the right hash is the state of a run: it is not simulated here.
            Ok(Simulation::resume(scene, state).is_ok())
        };
        refused_if(is_damaged, &how, read(&how, "c.ckpt", resume)?)
    });
}

#[test]
fn fuzz_training_checkpoints() {
    fuzz("fuzz_training_checkpoints", |attack| {
        fs::create_dir(attack.folder.join("run")).unwrap();
        let name = "run/checkpoint.bin";
        let (how, is_damaged) = damaged_seal(attack, "cut/checkpoint.bin", name);
        let options = SessionOptions {
            config_file: fixtures().join("training.toml"),
            data: fixtures().join("data"),
            folder: attack.folder.join("run"),
            resume: true,
            device: Device::Cpu,
        };
        let resume = move || {
            let config = TrainConfig::load(&options.config_file)?;
            let session = Session::open(config, &options, |_| ())?;
            Ok(session.summary().step)
        };
        refused_if(is_damaged, &how, read(&how, "checkpoint.bin", resume)?)
    });
}

fn refused_if<T>(is_damaged: bool, how: &str, read: Result<T, String>) -> Result<(), Finding> {
    match read {
        Ok(_) if is_damaged => Promise::WholeCheckpoint.broken(format!("{how}: not seen")),
        _ => Ok(()),
    }
}
