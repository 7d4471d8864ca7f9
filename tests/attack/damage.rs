//! Damaged files: each is refused by name, or read as if it were whole.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;

use rand::RngExt;

use crate::campaign::{Attack, Finding, Promise, campaign, empty, workplace};
use crate::fixtures::{PREDICT, TRAIN, arrays, copy, fixtures};
use crate::mutation::damage;
use crate::program::{Ended, program};

#[test]
fn damaged_files() {
    campaign("damaged_files", |attack| match attack.rng.random_range(0..10) {
        0..4 => trajectory(attack),
        4 | 5 => run_checkpoint(attack),
        6 => cut_trajectory(attack),
        7 => cache(attack),
        8 => training_checkpoint(attack),
        _ => weights(attack),
    });
}

/// Damages a file of the attack's folder.
fn damage_file(attack: &mut Attack, file: &str) -> String {
    let path = attack.folder.join(file);
    let mut bytes = fs::read(&path).unwrap();
    let how = damage(&mut bytes, &mut attack.rng);
    fs::write(&path, bytes).unwrap();
    format!("{file}: {how}")
}

/// Commands that read the trajectory `in/t.h5`, and whether what they write and print is the same
/// each time.
const READERS: [(&str, bool); 10] = [
    ("dempm info in/t.h5", true),
    ("dempm export in/t.h5 --to npz -o out.npz", true),
    ("dempm export in/t.h5 --to vtk -o out.pvd", true),
    ("dempm export in/t.h5 --to gns -o out", true),
    ("dempm plot in/t.h5 -o out.png --width 320", true),
    ("dempm plot in/t.h5 --animate out.gif --width 320", true),
    ("validation compare whole.h5 in/t.h5", true),
    ("surrogate stats in", true),
    ("surrogate rollout whole/best.safetensors --from in/t.h5 -o out.h5 --device cpu", false),
    ("surrogate eval whole/best.safetensors --data in -o out --device cpu", false),
];

/// The first of them also read a run of discs, with grains and a grid.
const OF_DISCS: usize = 3;

fn trajectory(attack: &mut Attack) -> Result<(), Finding> {
    let original = ["whole.h5", "data/valid/middle.h5", "discs.h5"][attack.rng.random_range(0..3)];
    let readers = if original == "discs.h5" { OF_DISCS } else { READERS.len() };
    let reader = attack.rng.random_range(0..readers);
    let (line, repeats) = READERS[reader];
    prepare_reader(original, &attack.folder);
    let how = damage_file(attack, "in/t.h5");
    let ended = program(line, &attack.folder).run();
    ended.is_sound()?;
    if ended.succeeded() {
        if repeats && outcome(&ended, &attack.folder) != *expected(reader, original) {
            return Promise::WholeTrajectory.broken(ended.report(&how));
        }
    } else if !ended.refuses("t.h5") {
        return Promise::NamedError.broken(ended.report(&how));
    }
    Ok(())
}

fn prepare_reader(original: &str, folder: &Path) {
    copy(&["whole.h5", "whole/best.safetensors"], folder);
    fs::create_dir(folder.join("in")).unwrap();
    fs::copy(fixtures().join(original), folder.join("in/t.h5")).unwrap();
}

/// What a command printed, but for the size of the file, and all that it wrote.
type Outcome = BTreeMap<String, Vec<u8>>;

fn outcome(ended: &Ended, folder: &Path) -> Outcome {
    fn collect(folder: &Path, found: &mut Outcome) {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                collect(&path, found);
            } else {
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    let printed: Vec<&str> =
        ended.stdout.lines().filter(|line| !line.starts_with("file size")).collect();
    let mut found = Outcome::from([("printed".to_owned(), printed.join("\n").into_bytes())]);
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with("out") {
            if path.is_dir() {
                collect(&path, &mut found);
            } else {
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// What a reader makes of the undamaged file.
fn expected(reader: usize, original: &'static str) -> &'static Outcome {
    static KNOWN: Mutex<BTreeMap<(usize, &str), &Outcome>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap();
    known.entry((reader, original)).or_insert_with(|| {
        let folder = workplace().join("expected");
        empty(&folder);
        prepare_reader(original, &folder);
        let ended = program(READERS[reader].0, &folder).run();
        assert!(ended.succeeded(), "{}", ended.report("an undamaged file"));
        Box::leak(Box::new(outcome(&ended, &folder)))
    })
}

const RESUME: &str = "dempm run scene.toml -o cut.h5 --resume --device cpu";

fn run_checkpoint(attack: &mut Attack) -> Result<(), Finding> {
    copy(&["scene.toml", "cut.h5", "cut.h5.ckpt", "cache"], &attack.folder);
    let how = damage_file(attack, "cut.h5.ckpt");
    let ended = program(RESUME, &attack.folder).run();
    ended.is_sound()?;
    if ended.refuses("cut.h5.ckpt") {
        return kept(attack, "cut.h5");
    }
    same_run(attack, &ended, "cut.h5", Promise::WholeCheckpoint, &how)
}

fn cut_trajectory(attack: &mut Attack) -> Result<(), Finding> {
    copy(&["scene.toml", "cut.h5", "cut.h5.ckpt", "cache"], &attack.folder);
    let how = damage_file(attack, "cut.h5");
    let ended = program(RESUME, &attack.folder).run();
    ended.is_sound()?;
    if ended.refuses("cut.h5") {
        return kept(attack, "cut.h5.ckpt");
    }
    same_run(attack, &ended, "cut.h5", Promise::WholeTrajectory, &how)
}

fn cache(attack: &mut Attack) -> Result<(), Finding> {
    copy(&["scene.toml", "cache"], &attack.folder);
    let mut entries: Vec<String> = fs::read_dir(attack.folder.join("cache/packings"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.contains('.'))
        .collect();
    entries.sort();
    let entry = &entries[attack.rng.random_range(0..entries.len())];
    let how = damage_file(attack, &format!("cache/packings/{entry}"));
    let ended = program("dempm run scene.toml -o new.h5 --device cpu", &attack.folder).run();
    ended.is_sound()?;
    same_run(attack, &ended, "new.h5", Promise::WholeCache, &how)
}

/// The file is as it was.
fn kept(attack: &Attack, file: &str) -> Result<(), Finding> {
    let [before, after] =
        [fixtures(), &attack.folder].map(|folder| fs::read(folder.join(file)).ok());
    if before == after {
        return Ok(());
    }
    Promise::NothingLost
        .broken(format!("{file} was changed by a command that refused its neighbour"))
}

/// The run ended well, with the numbers of the undamaged one.
fn same_run(
    attack: &Attack,
    ended: &Ended,
    file: &str,
    promise: Promise,
    how: &str,
) -> Result<(), Finding> {
    if !ended.succeeded() {
        return promise.broken(ended.report(how));
    }
    if arrays(file, &attack.folder)? == fs::read(fixtures().join("whole.npz")).unwrap() {
        return Ok(());
    }
    promise.broken(ended.report(&format!("{how}: another result")))
}

fn training_checkpoint(attack: &mut Attack) -> Result<(), Finding> {
    copy(&["training.toml", "data", "cut"], &attack.folder);
    let how = damage_file(attack, "cut/checkpoint.bin");
    let ended = program(&format!("{TRAIN} -o cut --resume"), &attack.folder).run();
    ended.is_sound()?;
    if ended.refuses("checkpoint.bin") {
        return Ok(());
    }
    let differs = |name: &&str| {
        let [a, b] =
            [fixtures().join("whole"), attack.folder.join("cut")].map(|f| fs::read(f.join(name)));
        !matches!((a, b), (Ok(a), Ok(b)) if a == b)
    };
    let names = ["last.safetensors", "best.safetensors", "log.csv", "validation.csv"];
    if !ended.succeeded() || names.iter().any(differs) {
        return Promise::WholeCheckpoint.broken(ended.report(&how));
    }
    Ok(())
}

fn weights(attack: &mut Attack) -> Result<(), Finding> {
    copy(&["whole/best.safetensors", "data/valid/middle.h5"], &attack.folder);
    let how = damage_file(attack, "whole/best.safetensors");
    let ended = program(PREDICT, &attack.folder).run();
    ended.is_sound()?;
    if ended.refuses("best.safetensors") {
        return Ok(());
    }
    if !ended.succeeded() {
        return Promise::NamedError.broken(ended.report(&how));
    }
    // There is no hash, and a weight may be any number; but what comes out of it has to be one.
    let info = program("dempm info out.h5", &attack.folder).run();
    if !info.succeeded() || info.stdout.contains("NaN") || info.stdout.contains("inf") {
        return Promise::NothingLost.broken(info.report(&how));
    }
    Ok(())
}
