//! Lists of scenes: base scenes with values for some of their keys, as lists or grids, or drawn at random.

use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use super::case::Case;
use super::error::DatasetError;
use super::keys::{Assignment, assign, leaves};
use super::random::{Class, Random, Source, read_toml};
use super::split::Split;
use crate::scene::Scene;

/// A list file; `docs/datasets.md` describes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ListFile {
    /// Base scene, relative to the list file.
    scene: Option<String>,
    /// Values for all cases.
    #[serde(default)]
    set: Table,
    #[serde(default)]
    train: Vec<Block>,
    #[serde(default)]
    valid: Vec<Block>,
    #[serde(default)]
    test: Vec<Block>,
    /// Seed of the scenes that are drawn at random.
    seed: Option<u64>,
    /// Classes of scenes that are drawn at random.
    #[serde(default)]
    random: Vec<Random>,
}

/// Cases that vary the same keys.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Block {
    /// Base scene instead of that of the file.
    scene: Option<String>,
    #[serde(default)]
    set: Table,
    /// Keys whose lists of values run side by side.
    #[serde(default)]
    list: Table,
    /// Keys of which all combinations are run.
    #[serde(default)]
    grid: Table,
}

/// Lists that draw from each other can be so many.
const DEEPEST: usize = 8;

/// Reads a list file and the scenes of all its cases.
///
/// # Errors
/// If a file cannot be read or has another form, or a case is not a valid scene.
pub(super) fn read(path: &Path) -> Result<Vec<Case>, DatasetError> {
    let file = read_toml::<ListFile>(path)?;
    let classes = file.classes(path, 0)?;
    let error = |key: &str, reason: &str| {
        let (path, key, reason) = (path.to_owned(), key.to_owned(), reason.to_owned());
        Err(DatasetError::Key { path, key, reason })
    };
    let seed = match file.seed {
        None if !classes.is_empty() => {
            return error(
                "seed",
                "is missing: a whole number from which [[random]] scenes are drawn",
            );
        }
        seed => seed.unwrap_or(0),
    };
    let mut cases = Vec::new();
    for (split, blocks) in
        [(Split::Train, &file.train), (Split::Valid, &file.valid), (Split::Test, &file.test)]
    {
        let mut number = 0;
        for (index, block) in blocks.iter().enumerate() {
            let here = Place { path, block: format!("{}[{index}]", split.name()) };
            let name = block.scene.as_ref().or(file.scene.as_ref());
            let Some(name) = name else {
                return error("scene", "is missing: the base scene of all cases");
            };
            let base = path.with_file_name(name);
            let base_table: Table = read_toml(&base)?;
            let fixed: Vec<Assignment> =
                [&file.set, &block.set].into_iter().flat_map(leaves).collect();
            for varied in here.combinations(block)? {
                let name = format!("{number:03}");
                number += 1;
                let mut table = base_table.clone();
                let title = table.get("title").and_then(Value::as_str);
                let title = title.map_or_else(|| stem(&base), str::to_owned);
                let title = format!("{title}, {} {name}", split.name());
                table.insert("title".to_owned(), Value::String(title));
                for (key, value) in fixed.iter().chain(&varied) {
                    assign(&mut table, key, value.clone())
                        .map_err(|reason| here.error(key, reason))?;
                }
                let text = toml::to_string(&table)
                    .map_err(|error| here.error("scene", error.to_string()))?;
                let shown = format!("{}: {}/{name}", path.display(), split.name());
                let scene = Scene::parse(&text, &shown)?;
                cases.push(Case::new(split, name, scene, values(block, &varied)));
            }
        }
        for (random, class) in file.random.iter().zip(&classes) {
            cases.extend(random.cases(class, path, seed, split)?);
        }
    }
    if cases.is_empty() {
        let reason = "is missing, as are `valid`, `test` and `random`: there is nothing to run";
        return error("train", reason);
    }
    Ok(cases)
}

impl ListFile {
    /// What its random scenes are drawn from, in their order. Lists draw from lists, `depth` deep so far.
    fn classes(&self, path: &Path, depth: usize) -> Result<Vec<Class>, DatasetError> {
        let source = Source { path, scene: self.scene.as_deref(), set: &self.set };
        let like = |other: &Path, class: &str| {
            let key = |reason: String| {
                let (path, key) = (path.to_owned(), "random.like".to_owned());
                DatasetError::Key { path, key, reason }
            };
            if depth == DEEPEST {
                return Err(key("leads from list to list without end".to_owned()));
            }
            let file = read_toml::<Self>(other)?;
            let index = file.random.iter().position(|random| random.is(class));
            let missing = || key(format!("finds no class {class} in {}", other.display()));
            let index = index.ok_or_else(missing)?;
            Ok(file.classes(other, depth + 1)?.swap_remove(index))
        };
        let of = |(index, random): (usize, &Random)| random.class(&source, index, &like);
        let classes: Vec<Class> =
            self.random.iter().enumerate().map(of).collect::<Result<_, _>>()?;
        for (index, random) in self.random.iter().enumerate() {
            if let Some(twice) = self.random[..index].iter().position(|other| random.shares(other))
            {
                let (path, key) = (path.to_owned(), format!("random[{index}].class"));
                let reason = format!("is that of random[{twice}], and names the same files");
                return Err(DatasetError::Key { path, key, reason });
            }
        }
        Ok(classes)
    }
}

/// The assignments of a case, each key once: varied keys come after `set` and replace it.
fn values(block: &Block, varied: &[Assignment]) -> String {
    let scene = block.scene.iter().map(|name| ("scene".to_owned(), Value::String(name.clone())));
    let mut fixed: Vec<Assignment> = scene.chain(leaves(&block.set)).collect();
    fixed.retain(|(key, _)| !varied.iter().any(|(other, _)| other == key));
    let all = fixed.iter().chain(varied).map(|(key, value)| format!("{key} = {value}"));
    all.collect::<Vec<_>>().join(", ")
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// A block of the list file, for error messages.
struct Place<'a> {
    path: &'a Path,
    block: String,
}

impl Place<'_> {
    fn error(&self, key: &str, reason: String) -> DatasetError {
        let key = format!("{}.{key}", self.block);
        DatasetError::Key { path: self.path.to_owned(), key, reason }
    }

    /// The assignments of each case of a block: every row of the list with every combination of
    /// the grid, the last key of the grid running fastest.
    fn combinations(&self, block: &Block) -> Result<Vec<Vec<Assignment>>, DatasetError> {
        let mut cases = self.rows(&block.list)?;
        for (key, values) in self.varied("grid", &block.grid)? {
            cases = cases
                .iter()
                .flat_map(|case| {
                    values.iter().map(|value| {
                        let with = (key.clone(), value.clone());
                        case.iter().cloned().chain([with]).collect()
                    })
                })
                .collect();
        }
        Ok(cases)
    }

    /// The k-th values of all keys, for each k; one empty row without keys.
    fn rows(&self, list: &Table) -> Result<Vec<Vec<Assignment>>, DatasetError> {
        let varied = self.varied("list", list)?;
        let Some((first, values)) = varied.first() else { return Ok(vec![Vec::new()]) };
        for (key, others) in &varied {
            if others.len() != values.len() {
                let (one, other) = (others.len(), values.len());
                let reason = format!(
                    "has {one} values, but `{first}` has {other}; those of a list run side by side"
                );
                return Err(self.error(&format!("list.{key}"), reason));
            }
        }
        let row = |k: usize| varied.iter().map(|(key, v)| (key.clone(), v[k].clone())).collect();
        Ok((0..values.len()).map(row).collect())
    }

    /// The keys of a table with their values.
    fn varied(
        &self,
        table: &str,
        entries: &Table,
    ) -> Result<Vec<(String, Vec<Value>)>, DatasetError> {
        leaves(entries)
            .into_iter()
            .map(|(key, value)| match value {
                Value::Array(values) if !values.is_empty() => Ok((key, values)),
                Value::Array(_) => Err(self.error(&format!("{table}.{key}"), "is empty".into())),
                other => {
                    let reason = format!(
                        "is one value; it must be a list of values, such as [{other}], or stand in \
                         `set`"
                    );
                    Err(self.error(&format!("{table}.{key}"), reason))
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(text: &str) -> Result<Vec<Vec<Assignment>>, DatasetError> {
        let place = Place { path: Path::new("list.toml"), block: "train[0]".to_owned() };
        place.combinations(&toml::from_str(text).unwrap())
    }

    #[test]
    fn lists_run_side_by_side_and_grids_combine() {
        let cases = block("list.a = [1, 2]\nlist.b = [3, 4]\ngrid.c.d = [5, 6, 7]\n").unwrap();
        let values: Vec<Vec<i64>> = cases
            .iter()
            .map(|case| case.iter().map(|(_, value)| value.as_integer().unwrap()).collect())
            .collect();
        let expected = [[1, 3, 5], [1, 3, 6], [1, 3, 7], [2, 4, 5], [2, 4, 6], [2, 4, 7]];
        assert_eq!(values, expected);
        assert_eq!(cases[0][2].0, "c.d");
        assert_eq!(block("").unwrap(), [Vec::new()]);
    }

    #[test]
    fn cases_are_distinguished_by_set_too() {
        let block: Block = toml::from_str(
            "scene = \"wide.toml\"\nset.column.0.size = [1.0, 1.25]\nset.duration = 1.0\n\
             list.duration = [2.0]\n",
        )
        .unwrap();
        let varied = [("duration".to_owned(), Value::Float(2.0))];
        let expected = "scene = \"wide.toml\", column.0.size = [1.0, 1.25], duration = 2.0";
        assert_eq!(values(&block, &varied), expected);
    }

    #[test]
    fn errors_name_file_and_key() {
        for (text, key) in [
            ("list.a = [1, 2]\nlist.b = [3]\n", "train[0].list.b"),
            ("grid.c = 1\n", "train[0].grid.c"),
            ("grid.c = []\n", "train[0].grid.c"),
        ] {
            let error = block(text).unwrap_err().to_string();
            assert!(error.contains("list.toml") && error.contains(key), "{error}");
        }
    }
}
