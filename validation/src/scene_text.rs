//! Scene files of the report, as text with some keys changed.

use toml::{Table, Value};

/// The text of a scene file with some keys set, such as `("rve.discs", 100.into())`.
///
/// # Panics
/// If `base` is not TOML or a key leads through something that is no table: scenes of the report
/// are part of the program.
pub fn with(base: &str, changes: &[(&str, Value)]) -> String {
    let mut scene: Table = base.parse().expect("scenes of the report are TOML");
    for (key, value) in changes {
        let mut names = key.split('.');
        let last = names.next_back().unwrap_or_default();
        let place = names.fold(&mut scene, |table, name| {
            let entry = table.entry(name).or_insert_with(|| Value::Table(Table::new()));
            entry.as_table_mut().expect("keys lead through tables")
        });
        place.insert(last.to_owned(), value.clone());
    }
    scene.to_string()
}

/// The text of a scene file with the keys of `changes` set, such as `rve.discs = 100`.
///
/// # Panics
/// If one of the two is not TOML: scenes of the report are part of the program.
pub fn merged(base: &str, changes: &str) -> String {
    let [mut scene, changes]: [Table; 2] =
        [base, changes].map(|text| text.parse().expect("scenes of the report are TOML"));
    merge(&mut scene, changes);
    scene.to_string()
}

fn merge(scene: &mut Table, changes: Table) {
    for (key, value) in changes {
        if let (Some(Value::Table(table)), Value::Table(changes)) = (scene.get_mut(&key), &value) {
            merge(table, changes.clone());
        } else {
            scene.insert(key, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_set_in_tables_old_and_new() {
        let text = with(
            "seed = 1\n[rve]\ndiscs = 400\n",
            &[("seed", 2.into()), ("rve.discs", 100.into()), ("material.kind", "mu-i".into())],
        );
        let table: Table = text.parse().unwrap();
        assert_eq!(table["seed"].as_integer(), Some(2));
        assert_eq!(table["rve"]["discs"].as_integer(), Some(100));
        assert_eq!(table["material"]["kind"].as_str(), Some("mu-i"));
    }

    #[test]
    fn tables_are_merged() {
        let changes = "seed = 2\nrve.discs = 100\ngrains.preparation_friction = 0.5";
        let text = merged("seed = 1\n[rve]\ndiscs = 400\n[grains]\nthickness = 0.1\n", changes);
        let table: Table = text.parse().unwrap();
        assert_eq!(table["seed"].as_integer(), Some(2));
        assert_eq!(table["rve"]["discs"].as_integer(), Some(100));
        assert_eq!(table["grains"]["thickness"].as_float(), Some(0.1));
        assert_eq!(table["grains"]["preparation_friction"].as_float(), Some(0.5));
    }
}
