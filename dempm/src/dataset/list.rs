//! Lists of scenes: base scenes with values for some of their keys, as lists or grids.

use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use super::case::Case;
use super::error::DatasetError;
use super::split::Split;
use crate::scene::Scene;

/// A list file; `docs/datasets.md` describes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ListFile {
    /// Base scene, relative to the list file.
    scene: String,
    /// Values for all cases.
    #[serde(default)]
    set: Table,
    #[serde(default)]
    train: Vec<Block>,
    #[serde(default)]
    valid: Vec<Block>,
    #[serde(default)]
    test: Vec<Block>,
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

/// A dotted key and a value for it.
type Assignment = (String, Value);

/// Reads a list file and the scenes of all its cases.
///
/// # Errors
/// If a file cannot be read or has another form, or a case is not a valid scene.
pub(super) fn read(path: &Path) -> Result<Vec<Case>, DatasetError> {
    let file: ListFile = toml::from_str(&text_of(path)?)
        .map_err(|source| DatasetError::Syntax { path: path.to_owned(), source })?;
    let mut cases = Vec::new();
    for (split, blocks) in
        [(Split::Train, &file.train), (Split::Valid, &file.valid), (Split::Test, &file.test)]
    {
        let mut number = 0;
        for (index, block) in blocks.iter().enumerate() {
            let here = Place { path, block: format!("{}[{index}]", split.name()) };
            let base = path.with_file_name(block.scene.as_ref().unwrap_or(&file.scene));
            let base_table: Table = toml::from_str(&text_of(&base)?)
                .map_err(|source| DatasetError::Syntax { path: base.clone(), source })?;
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
                cases.push(Case { split, name, scene, values: values(block, &varied) });
            }
        }
    }
    if cases.is_empty() {
        let (path, key) = (path.to_owned(), "train".to_owned());
        let reason = "is missing, as are `valid` and `test`: there is nothing to run".to_owned();
        return Err(DatasetError::Key { path, key, reason });
    }
    Ok(cases)
}

/// The assignments of a case, each key once: varied keys come after `set` and replace it.
fn values(block: &Block, varied: &[Assignment]) -> String {
    let scene = block.scene.iter().map(|name| ("scene".to_owned(), Value::String(name.clone())));
    let mut fixed: Vec<Assignment> = scene.chain(leaves(&block.set)).collect();
    fixed.retain(|(key, _)| !varied.iter().any(|(other, _)| other == key));
    let all = fixed.iter().chain(varied).map(|(key, value)| format!("{key} = {value}"));
    all.collect::<Vec<_>>().join(", ")
}

fn text_of(path: &Path) -> Result<String, DatasetError> {
    std::fs::read_to_string(path)
        .map_err(|source| DatasetError::Read { path: path.to_owned(), source })
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

/// All values of a table that are not tables themselves, with their dotted keys.
fn leaves(table: &Table) -> Vec<Assignment> {
    let mut found = Vec::new();
    for (key, value) in table {
        match value {
            Value::Table(inner) => {
                found.extend(leaves(inner).into_iter().map(|(k, v)| (format!("{key}.{k}"), v)));
            }
            other => found.push((key.clone(), other.clone())),
        }
    }
    found
}

/// Sets a dotted key, in which numbers index lists: `column.0.size`. Creates missing tables.
fn assign(table: &mut Table, key: &str, value: Value) -> Result<(), String> {
    let (path, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut place: &mut Table = table;
    let mut rest = path.split('.').filter(|part| !part.is_empty());
    while let Some(part) = rest.next() {
        let entry = place.entry(part).or_insert_with(|| Value::Table(Table::new()));
        place = match entry {
            Value::Table(inner) => inner,
            Value::Array(items) => {
                let count = items.len();
                rest.next()
                    .and_then(|index| index.parse::<usize>().ok())
                    .and_then(|index| items.get_mut(index))
                    .and_then(Value::as_table_mut)
                    .ok_or_else(|| {
                        format!(
                            "names no entry of [[{part}]]: the scene has {count}, counted from 0"
                        )
                    })?
            }
            _ => return Err(format!("reaches into `{part}`, which is a value and not a table")),
        };
    }
    place.insert(last.to_owned(), value);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        toml::from_str(text).unwrap()
    }

    fn block(text: &str) -> Result<Vec<Vec<Assignment>>, DatasetError> {
        let place = Place { path: Path::new("list.toml"), block: "train[0]".to_owned() };
        place.combinations(&toml::from_str(text).unwrap())
    }

    #[test]
    fn keys_reach_tables_lists_and_what_is_not_there_yet() {
        let mut scene = table("duration = 1.0\n[[column]]\nsize = [1.0, 1.0]\n");
        assign(&mut scene, "duration", Value::Float(2.0)).unwrap();
        assign(&mut scene, "column.0.velocity", Value::Integer(3)).unwrap();
        assign(&mut scene, "rve.preparation.pressure", Value::Float(0.5)).unwrap();
        let expected = "duration = 2.0\n[[column]]\nsize = [1.0, 1.0]\nvelocity = 3\n\
                        [rve.preparation]\npressure = 0.5\n";
        assert_eq!(scene, table(expected));
        for (key, part) in [
            ("column.1.size", "column"),
            ("column.x.size", "column"),
            ("column.0", "column"),
            ("duration.x", "duration"),
        ] {
            let reason = assign(&mut scene, key, Value::Float(0.0)).unwrap_err();
            assert!(reason.contains(part), "{reason}");
        }
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
