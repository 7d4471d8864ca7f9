//! The findings of reading a scene: problems, places of values, and unknown keys.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::moved::new_place;
use super::problem::Problem;

pub(super) type Place = Range<usize>;

/// The findings of reading a file.
#[derive(Default)]
pub(super) struct Log {
    problems: RefCell<Vec<Problem>>,
    /// Place of the value of each given key, such as `column[0].size`.
    places: RefCell<BTreeMap<String, Place>>,
    /// Every key of the schema, given or not, such as `column.size`.
    keys: RefCell<BTreeSet<String>>,
    /// Unknown keys, reported once all valid keys are known.
    unknown_keys: RefCell<Vec<(String, String, Place)>>,
}

impl Log {
    pub fn report(&self, problem: Problem) {
        self.problems.borrow_mut().push(problem);
    }

    /// Adds a key of the schema, whether the file has it or not.
    pub fn asked(&self, path: String) {
        self.keys.borrow_mut().insert(path);
    }

    /// Adds the place of a given key.
    pub fn found(&self, path: String, place: Place) {
        self.places.borrow_mut().insert(path, place);
    }

    /// Adds an unknown key of a table.
    pub fn unknown(&self, table: String, key: String, place: Place) {
        self.unknown_keys.borrow_mut().push((table, key, place));
    }

    /// The place of the value of a key; `None` if it has its default.
    pub fn place(&self, path: &str) -> Option<Place> {
        self.places.borrow().get(path).cloned()
    }

    /// Every key of the schema, after a document was read.
    #[cfg(test)]
    pub fn keys(&self) -> BTreeSet<String> {
        self.keys.borrow().clone()
    }

    /// All problems so far; unknown keys become problems here.
    pub fn take(&self) -> Vec<Problem> {
        let keys = self.keys.borrow();
        for (table, key, place) in self.unknown_keys.take() {
            self.report(unknown_key(&keys, &table, &key, place));
        }
        self.problems.take()
    }
}

/// The error for an unknown key, with the valid key that was probably meant.
fn unknown_key(keys: &BTreeSet<String>, table: &str, key: &str, place: Place) -> Problem {
    if let Some(moved) = new_place(&format!("{table}.{key}")) {
        return Problem::error(moved)
            .at(Some(place), "no longer here")
            .help("move it there; a trajectory of the old scene has to be made again");
    }
    let here = |path: &&String| parent(path) == table;
    let siblings: Vec<&str> = keys.iter().filter(here).map(|path| leaf(path)).collect();
    let elsewhere: Vec<&String> = keys.iter().filter(|path| leaf(path) == key).collect();
    let name = |table: &str| match table {
        "" => "at the top of the file, above the first [table]".to_owned(),
        table => format!("in [{table}]"),
    };
    let help = if let Some(meant) = nearest(key, &siblings) {
        format!("did you mean `{meant}`?")
    } else if let Some(path) = elsewhere.first() {
        format!("`{key}` belongs {}", name(parent(path)))
    } else {
        let list: Vec<_> = siblings.iter().map(|key| format!("`{key}`")).collect();
        format!("valid keys here are {}", list.join(", "))
    };
    let where_found = if table.is_empty() { String::new() } else { format!(" {}", name(table)) };
    Problem::error(format!("unknown key `{key}`{where_found}"))
        .at(Some(place), "unknown key")
        .help(help)
}

fn parent(path: &str) -> &str {
    path.rsplit_once('.').map_or("", |(table, _)| table)
}

fn leaf(path: &str) -> &str {
    path.rsplit_once('.').map_or(path, |(_, key)| key)
}

/// The candidate that differs from `word` by a few typing errors, if any.
pub(super) fn nearest<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // The cost is the product of the lengths, and no valid word is this long.
    if word.len() > 64 {
        return None;
    }
    let plain = |word: &str| word.to_lowercase().replace(['-', ' '], "_");
    let word = plain(word);
    candidates
        .iter()
        .map(|candidate| (strsim::levenshtein(&word, &plain(candidate)), *candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len() / 4)
        .min()
        .map(|(_, candidate)| candidate)
}
