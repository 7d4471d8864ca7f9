//! Keys that older files have in other tables.

use dem::Grains;

/// Where to write a key of older files now, such as `rve.friction`; `None` for all others.
pub(crate) fn new_place(path: &str) -> Option<String> {
    if path == "rve.preparation.friction" {
        return Some("`friction` of preparation is now `preparation_friction` in [grains]".into());
    }
    let key = path.strip_prefix("rve.")?;
    if key == "grains" {
        return Some("the grains have a table of their own, [grains]".into());
    }
    let grains = toml::Table::try_from(Grains::default()).ok()?;
    grains.contains_key(key).then(|| format!("`{key}` is now in [grains]"))
}
