//! Reads keys from TOML with their places and collects all problems.

use std::cell::RefCell;
use std::collections::BTreeSet;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::log::{Log, Place, nearest};
use super::problem::Problem;
use super::range::Limits;

/// A table of the file, or the defaults of a table that is not in it.
///
/// Reading methods take the default of a key (`None` for a required key), report problems and continue
/// with some value, so that one pass finds all problems.
pub(super) struct Table<'a> {
    log: &'a Log,
    /// With indices, as in `column[0]`; empty at the top.
    path: String,
    entries: Option<&'a DeTable<'a>>,
    place: Option<Place>,
    asked: RefCell<BTreeSet<String>>,
}

impl<'a> Table<'a> {
    pub fn root(log: &'a Log, entries: &'a DeTable<'a>) -> Self {
        Self::new(log, String::new(), Some(entries), None)
    }

    fn new(
        log: &'a Log,
        path: String,
        entries: Option<&'a DeTable<'a>>,
        place: Option<Place>,
    ) -> Self {
        Self { log, path, entries, place, asked: RefCell::default() }
    }

    /// Whether the file has this table.
    pub fn is_given(&self) -> bool {
        self.entries.is_some()
    }

    /// The path of the table without indices, as in `column`.
    pub fn path(&self) -> String {
        without_indices(&self.path)
    }

    /// Reports unknown keys.
    pub fn finish(self) {
        let asked = self.asked.borrow();
        for key in self.entries.into_iter().flat_map(|entries| entries.keys()) {
            let name: &str = key.get_ref();
            if !asked.contains(name) {
                let table = without_indices(&self.path);
                self.log.unknown(table, name.to_owned(), key.span());
            }
        }
    }

    pub fn text(&self, key: &str, default: &str) -> String {
        let Some(value) = self.get(key) else { return default.to_owned() };
        match value.get_ref().as_str() {
            Some(text) => text.to_owned(),
            None => {
                self.wrong_type(key, value, "text in quotes", &format!("\"{default}\""));
                default.to_owned()
            }
        }
    }

    pub fn boolean(&self, key: &str, default: bool) -> bool {
        let Some(value) = self.get(key) else { return default };
        value.get_ref().as_bool().unwrap_or_else(|| {
            self.wrong_type(key, value, "true or false", &default.to_string());
            default
        })
    }

    pub fn integer(&self, key: &str, default: u64, limits: Limits) -> u64 {
        let Some(value) = self.get(key) else { return default };
        let Some(number) = integer(value.get_ref()) else {
            self.wrong_type(key, value, "a whole number", &default.to_string());
            return default;
        };
        self.in_limits(key, value.span(), number as f64, limits);
        u64::try_from(number).unwrap_or(default)
    }

    pub fn number(&self, key: &str, default: Option<f64>, limits: Limits) -> f64 {
        let fallback = default.unwrap_or(limits.example());
        let example = format!("{fallback:?}");
        let Some(value) = self.get_or_require(key, default.is_some(), &example) else {
            return fallback;
        };
        let Some(number) = number(value.get_ref()) else {
            self.wrong_type(key, value, &limits.a_number(), &example);
            return fallback;
        };
        self.in_limits(key, value.span(), number, limits);
        number
    }

    /// A pair `[x, y]`.
    pub fn vector(&self, key: &str, default: Option<[f64; 2]>, limits: Limits) -> [f64; 2] {
        let fallback = default.unwrap_or([limits.example(); 2]);
        let example = format!("{fallback:?}");
        let Some(value) = self.get_or_require(key, default.is_some(), &example) else {
            return fallback;
        };
        let components: Option<Vec<f64>> = value
            .get_ref()
            .as_array()
            .filter(|array| array.len() == 2)
            .map(|array| array.iter().filter_map(|item| number(item.get_ref())).collect());
        match components.as_deref() {
            Some(&[x, y]) => {
                for (component, item) in
                    [x, y].into_iter().zip(value.get_ref().as_array().into_iter().flatten())
                {
                    self.in_limits(key, item.span(), component, limits);
                }
                [x, y]
            }
            _ => {
                self.wrong_type(key, value, "two numbers [x, y]", &example);
                fallback
            }
        }
    }

    /// One of some words.
    pub fn choice<T: Copy>(&self, key: &str, default: Option<T>, options: &[(&str, T)]) -> T {
        let first = options[0];
        let example = format!("{:?}", first.0);
        let fallback = default.unwrap_or(first.1);
        let Some(value) = self.get_or_require(key, default.is_some(), &example) else {
            return fallback;
        };
        let Some(word) = value.get_ref().as_str() else {
            self.wrong_type(key, value, "a word in quotes", &example);
            return fallback;
        };
        self.option(key, word, value.span(), options).unwrap_or(fallback)
    }

    /// A list of some words, each at most once.
    pub fn choices<T: Copy + PartialEq>(
        &self,
        key: &str,
        default: &[T],
        options: &[(&str, T)],
    ) -> Vec<T> {
        let Some(value) = self.get(key) else { return default.to_vec() };
        let example = format!("[{:?}]", options[0].0);
        let Some(items) = value.get_ref().as_array() else {
            self.wrong_type(key, value, "a list of words", &example);
            return default.to_vec();
        };
        let mut chosen = Vec::new();
        for item in items.iter() {
            match item.get_ref().as_str() {
                Some(word) => {
                    let option = self.option(key, word, item.span(), options);
                    chosen.extend(option.filter(|option| !chosen.contains(option)));
                }
                None => self.wrong_type(key, item, "a list of words", &example),
            }
        }
        chosen
    }

    /// One of the words in `options`, or a number.
    pub fn word_or_number<T: Copy>(
        &self,
        key: &str,
        default: T,
        options: &[(&str, T)],
        from_number: impl Fn(f64) -> T,
        limits: Limits,
    ) -> T {
        let Some(value) = self.get(key) else { return default };
        if let Some(word) = value.get_ref().as_str() {
            return self.option(key, word, value.span(), options).unwrap_or(default);
        }
        match number(value.get_ref()) {
            Some(number) => {
                self.in_limits(key, value.span(), number, limits);
                from_number(number)
            }
            None => {
                let words: Vec<_> = options.iter().map(|(word, _)| format!("{word:?}")).collect();
                let expected = format!("{} or {}", words.join(", "), limits.a_number());
                self.wrong_type(key, value, &expected, &format!("{:?}", limits.example()));
                default
            }
        }
    }

    /// A table within this one.
    pub fn table(&self, key: &str) -> Table<'a> {
        let given = self.get(key);
        let entries = given.and_then(|value| value.get_ref().as_table());
        if let (Some(value), None) = (given, entries) {
            let hint = match value.get_ref().as_array() {
                Some(_) => format!("there is only one: write [{}]", self.full(key)),
                None => format!("write [{}] and its keys below", self.full(key)),
            };
            self.report(value, &format!("`{}` is a table", self.full(key)), hint);
        }
        Table::new(self.log, self.full(key), entries, given.map(Spanned::span))
    }

    /// Reads every table of the form `[[key]]`.
    pub fn tables<T>(&self, key: &str, read: impl Fn(Table<'a>) -> T) -> Vec<T> {
        let path = self.full(key);
        // Reading an absent table makes its keys known even if the file has none.
        read(Table::new(self.log, path.clone(), None, None));
        let Some(value) = self.get(key) else { return Vec::new() };
        let message = format!("`{path}` is a list of tables");
        let help = format!("there can be several: write [[{path}]] and the keys below it");
        let Some(items) = value.get_ref().as_array() else {
            self.report(value, &message, help);
            return Vec::new();
        };
        let mut tables = Vec::new();
        for item in items.iter() {
            let Some(entries) = item.get_ref().as_table() else {
                self.report(item, &message, help.clone());
                continue;
            };
            let path = format!("{path}[{}]", tables.len());
            self.log.found(path.clone(), item.span());
            tables.push(read(Table::new(self.log, path, Some(entries), Some(item.span()))));
        }
        tables
    }

    /// Reports a missing key or table without a default.
    pub fn missing(&self, what: &str, example: &str) {
        let message = match self.path.as_str() {
            "" => format!("{what} is missing"),
            path => format!("{what} is missing in [{}]", without_indices(path)),
        };
        self.log.report(
            Problem::error(message)
                .at(self.place.clone(), "in this table")
                .help(format!("there is no default; give it, for instance: {example}")),
        );
    }

    /// Whether the file has a key, which becomes part of the schema.
    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    fn get(&self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.asked.borrow_mut().insert(key.to_owned());
        let path = self.full(key);
        self.log.asked(without_indices(&path));
        let value = self.entries?.get(key)?;
        self.log.found(path, value.span());
        Some(value)
    }

    fn get_or_require(
        &self,
        key: &str,
        optional: bool,
        example: &str,
    ) -> Option<&'a Spanned<DeValue<'a>>> {
        let value = self.get(key);
        if value.is_none() && !optional && self.is_given() {
            self.missing(&format!("`{key}`"), &format!("{key} = {example}"));
        }
        value
    }

    fn option<T: Copy>(
        &self,
        key: &str,
        word: &str,
        place: Place,
        options: &[(&str, T)],
    ) -> Option<T> {
        if let Some((_, option)) = options.iter().find(|(name, _)| *name == word) {
            return Some(*option);
        }
        let names: Vec<&str> = options.iter().map(|(name, _)| *name).collect();
        let list: Vec<_> = names.iter().map(|name| format!("{name:?}")).collect();
        let meant = nearest(word, &names)
            .map_or_else(String::new, |meant| format!("did you mean {meant:?}? "));
        self.log.report(
            Problem::error(format!("`{}` cannot be {word:?}", self.full(key)))
                .at(Some(place), "not a valid word here")
                .help(format!("{meant}valid: {}", list.join(", "))),
        );
        None
    }

    fn in_limits(&self, key: &str, place: Place, number: f64, limits: Limits) {
        if let Err(expected) = limits.check(number) {
            let path = without_indices(&self.full(key));
            let problem = Problem::error(format!("`{path}` = {number} is out of range"))
                .at(Some(place), expected);
            let hint = limits.hint();
            self.log.report(if hint.is_empty() { problem } else { problem.help(hint) });
        }
    }

    fn wrong_type(&self, key: &str, value: &Spanned<DeValue<'_>>, expected: &str, example: &str) {
        let found = match value.get_ref() {
            DeValue::Integer(_) => "whole number",
            DeValue::Float(_) => "number",
            DeValue::String(_) => "text",
            other => other.type_str(),
        };
        let path = without_indices(&self.full(key));
        self.log.report(
            Problem::error(format!("`{path}` must be {expected}"))
                .at(Some(value.span()), format!("this is: {found}"))
                .help(format!("for instance: {key} = {example}")),
        );
    }

    fn report(&self, value: &Spanned<DeValue<'_>>, message: &str, help: String) {
        self.log.report(Problem::error(message).at(Some(value.span()), "here").help(help));
    }

    fn full(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
}

/// `column[0].size` -> `column.size`
fn without_indices(path: &str) -> String {
    let mut inside = false;
    path.chars()
        .filter(|&c| {
            inside = (inside || c == '[') && c != ']';
            !inside && c != ']'
        })
        .collect()
}

/// A whole number that fits 64 bits.
fn integer(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// A number with or without a decimal point; `inf` and `nan` are numbers in TOML.
fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(_) => integer(value).map(|number| number as f64),
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}
