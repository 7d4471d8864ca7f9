//! What is found while reading: problems, places of values, and keys that nobody knows.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::problem::Problem;

pub(super) type Place = Range<usize>;

/// What reading a file leaves behind besides the values.
#[derive(Default)]
pub(super) struct Log {
    problems: RefCell<Vec<Problem>>,
    /// Where the value of each key given in the file is; arrays of tables by `column[0].size`.
    places: RefCell<BTreeMap<String, Place>>,
    /// Every key that was asked for, given or not, as `column.size`.
    keys: RefCell<BTreeSet<String>>,
    /// Keys in the file that nobody asked for, judged once all valid keys are known.
    unknown: RefCell<Vec<(String, String, Place)>>,
}

impl Log {
    pub fn report(&self, problem: Problem) {
        self.problems.borrow_mut().push(problem);
    }

    /// A key of the schema was asked for, whether the file has it or not.
    pub fn asked(&self, path: String) {
        self.keys.borrow_mut().insert(path);
    }

    /// The file has a value for a key.
    pub fn found(&self, path: String, place: Place) {
        self.places.borrow_mut().insert(path, place);
    }

    /// The file has a key in a table that nobody asked for.
    pub fn nobody_asked(&self, table: String, key: String, place: Place) {
        self.unknown.borrow_mut().push((table, key, place));
    }

    /// Where the value of a key is; `None` if it was left to its default.
    pub fn place(&self, path: &str) -> Option<Place> {
        self.places.borrow().get(path).cloned()
    }

    /// Every key of the schema, once a document was read.
    #[cfg(test)]
    pub fn keys(&self) -> BTreeSet<String> {
        self.keys.borrow().clone()
    }

    /// All problems so far; unknown keys become problems here.
    pub fn take(&self) -> Vec<Problem> {
        let keys = self.keys.borrow();
        for (table, key, place) in self.unknown.take() {
            self.report(unknown_key(&keys, &table, &key, place));
        }
        self.problems.take()
    }
}

/// An unknown key, with the valid key that was probably meant.
fn unknown_key(keys: &BTreeSet<String>, table: &str, key: &str, place: Place) -> Problem {
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

/// The candidate that differs from `word` by few typing errors, if there is one.
pub(super) fn nearest<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // Distances cost the product of the lengths, and no valid word is this long.
    if word.len() > 64 {
        return None;
    }
    let plain = |word: &str| word.to_lowercase().replace(['-', ' '], "_");
    let word = plain(word);
    candidates
        .iter()
        .map(|candidate| (edit_distance(&word, &plain(candidate)), *candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len() / 4)
        .min()
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance: insertions, deletions and replacements of characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
