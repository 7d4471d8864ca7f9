//! Dotted keys of a scene: `column.0.size`.

use toml::{Table, Value};

/// A dotted key and a value for it.
pub(super) type Assignment = (String, Value);

/// All values of a table that are not tables themselves, with their dotted keys.
pub(super) fn leaves(table: &Table) -> Vec<Assignment> {
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
pub(super) fn assign(table: &mut Table, key: &str, value: Value) -> Result<(), String> {
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
}
