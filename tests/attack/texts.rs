//! Mutated texts of every kind that people write: an answer in time, whatever they say.

use std::fs;
use std::time::Duration;

use rand::RngExt;

use crate::campaign::campaign;
use crate::fixtures::{TRAIN, copy};
use crate::mutation::mutate;
use crate::program::program;

/// A mutated text may ask for much work: after this time Ctrl-C has to end it.
const PATIENCE: Duration = Duration::from_secs(2);

#[test]
fn mutated_texts() {
    let train = format!("{TRAIN} -o out");
    // What is mutated, what reads it, and what else that needs.
    let readers: [(&str, &str, &[&str]); 8] = [
        ("scene.toml", "dempm check scene.toml", &[]),
        ("scene.toml", "dempm check scene.toml", &[]),
        ("mu-i.toml", "dempm run mu-i.toml -o out.h5 --device cpu", &[]),
        ("list.toml", "dempm dataset list.toml -o out --device cpu", &["mu-i.toml"]),
        ("mu-i.toml", "dempm dataset list.toml -o out --device cpu", &["list.toml"]),
        ("element.toml", "dempm element element.toml -o out.csv", &["packing.csv"]),
        ("packing.csv", "dempm element element.toml -o out.csv", &["element.toml"]),
        ("training.toml", &train, &["data"]),
    ];
    campaign("mutated_texts", |attack| {
        let (file, line, others) = readers[attack.rng.random_range(0..readers.len())];
        copy(others, &attack.folder);
        copy(&[file], &attack.folder);
        let text = fs::read_to_string(attack.folder.join(file)).unwrap();
        fs::write(attack.folder.join(file), mutate(&text, &mut attack.rng)).unwrap();
        program(line, &attack.folder).interrupted_after(PATIENCE).run().is_sound()
    });
}
