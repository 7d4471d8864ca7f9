//! Tables of material parameters, read key by key against the defaults of their type.

use dem::RveParameters;
use serde::{Serialize, de::DeserializeOwned};
use toml::Value;

use super::log::Log;
use super::problem::Problem;
use super::range::{Limits, between, from_zero, positive, within};
use super::reader::Table;

/// Reads `[rve]` and `[grains]`.
pub(super) fn read_rve(log: &Log, root: &Table<'_>, defaults: &RveParameters) -> RveParameters {
    let grains = read(log, root.table("grains"), &defaults.grains, &[]);
    RveParameters { grains, ..read(log, root.table("rve"), defaults, &["grains"]) }
}

/// Reads a table whose keys, types and defaults are those of `defaults`, but for some `left_out`: a
/// parameter is declared in one place only.
pub(super) fn read<T>(log: &Log, table: Table<'_>, defaults: &T, left_out: &[&str]) -> T
where
    T: Clone + Serialize + DeserializeOwned,
{
    let path = table.path();
    let parameters = toml::Table::try_from(defaults).and_then(|mut values| {
        values.retain(|key, _| !left_out.contains(&key));
        fill(table, &mut values);
        values.try_into().map_err(serde::ser::Error::custom)
    });
    parameters.unwrap_or_else(|error| {
        log.report(Problem::error(format!("[{path}]: {error}")));
        defaults.clone()
    })
}

/// Replaces the defaults in `values` by the values of the file.
fn fill(table: Table<'_>, values: &mut toml::Table) {
    for (key, value) in values.iter_mut() {
        let limits = limits(&format!("{}.{key}", table.path()));
        match value {
            Value::Float(number) => *number = table.number(key, Some(*number), limits),
            Value::Integer(number) => {
                let default = u64::try_from(*number).unwrap_or(0);
                let given = table.integer(key, default, limits);
                *number = i64::try_from(given).unwrap_or(*number);
            }
            Value::Boolean(flag) => *flag = table.boolean(key, *flag),
            Value::String(text) => *text = table.text(key, text),
            Value::Table(values) => fill(table.table(key), values),
            Value::Array(_) | Value::Datetime(_) => {}
        }
    }
    table.finish();
}

/// The first parameter outside its limits: key, value and limits.
pub(crate) fn outside(path: &str, parameters: &impl Serialize) -> Option<String> {
    fn first(path: &str, values: &toml::Table) -> Option<String> {
        values.iter().find_map(|(key, value)| {
            let path = format!("{path}.{key}");
            let number = match value {
                Value::Table(values) => return first(&path, values),
                Value::Float(number) => *number,
                Value::Integer(number) => *number as f64,
                _ => return None,
            };
            let problem = limits(&path).check(number).err()?;
            Some(format!("`{path}` is {number}, it {problem}"))
        })
    }
    first(path, &toml::Table::try_from(parameters).ok()?)
}

fn limits(path: &str) -> Limits {
    let listed = LIMITS.iter().find(|(name, _)| *name == path);
    listed.map_or(within(f64::MAX, ""), |(_, limits)| *limits)
}

const DISC: Limits = positive(0.5, "m").with_hint("metres: 2.5 mm is 2.5e-3");
const STIFFNESS: Limits = positive(1.0e12, "N/m");
const DENSITY: Limits = positive(1.0e5, "kg/m³").with_hint("quartz is 2650 kg/m³");
const FRICTION: Limits =
    from_zero(10.0, "").with_hint("a coefficient, the tangent of the angle: 30 degrees are 0.577");
const SINE: Limits =
    between(0.0, 0.99, "").with_hint("the sine of the friction angle: 16 degrees are 0.28");
const MODULUS: Limits = positive(1.0e12, "Pa").with_hint("pascal: 6 MPa is 6.0e6");
const LOCAL_DAMPING: Limits = between(0.0, 0.9, "");

/// Limits of every number among the parameters; a test keeps this complete.
const LIMITS: &[(&str, Limits)] = &[
    ("grains.radius_min", DISC),
    ("grains.radius_max", DISC),
    ("grains.grain_density", DENSITY),
    (
        "grains.thickness",
        positive(10.0, "m").with_hint("one layer of grains is the mean disc diameter, 7.5e-3 m"),
    ),
    ("grains.normal_stiffness", STIFFNESS),
    ("grains.tangential_stiffness", STIFFNESS),
    ("grains.friction", FRICTION),
    (
        "grains.rolling_friction",
        from_zero(10.0, "").with_hint("a coefficient; sand as discs has about 0.1 to 0.3"),
    ),
    ("grains.rolling_stiffness", STIFFNESS),
    ("grains.damping_ratio", between(0.0, 1.0, "").with_hint("a fraction of critical damping")),
    ("grains.local_damping", LOCAL_DAMPING),
    ("grains.mass_scale", between(1.0, 1.0e6, "")),
    (
        "grains.step_factor",
        between(0.005, 0.5, "").with_hint("packings become unstable near 0.55; 0.2 is safe"),
    ),
    ("grains.skin", between(0.01, 2.0, "largest radii")),
    ("grains.overlap_warning", positive(2.0, "radii")),
    ("grains.overlap_limit", positive(2.0, "radii")),
    ("grains.preparation_friction", FRICTION),
    ("rve.discs", between(4.0, 65_536.0, "discs")),
    ("rve.stress_window", positive(1.0, "").with_hint("1 averages over the whole macro step")),
    ("rve.free_solid_fraction", between(0.0, 0.78, "").with_hint("loose packings jam near 0.79")),
    ("rve.thin_width", between(0.0, 20.0, "mean diameters")),
    (
        "rve.max_solid_fraction",
        between(0.9, 100.0, "").with_hint("falls reach 0.92; 100 compresses without limit"),
    ),
    ("rve.preparation.pressure", between(1.0, 1.0e9, "Pa").with_hint("pascal: 2 kPa is 2.0e3")),
    (
        "rve.preparation.cloud_solid_fraction",
        between(0.01, 0.45, "").with_hint("discs placed at random without touching jam near 0.54"),
    ),
    ("rve.preparation.local_damping", LOCAL_DAMPING),
    ("rve.preparation.ladder_rate", positive(1.0, "1/s")),
    ("rve.preparation.lateral_strain", from_zero(1.0, "").with_hint("0 is one-dimensional")),
    ("mu-i.density", DENSITY),
    ("mu-i.bulk_modulus", MODULUS),
    ("mu-i.shear_modulus", MODULUS),
    ("mu-i.static_friction", SINE),
    ("mu-i.dynamic_friction", SINE),
    ("mu-i.inertial_number", positive(1.0e3, "")),
    ("mu-i.grain_diameter", DISC),
    ("mu-i.grain_density", DENSITY),
    ("elastic.density", DENSITY),
    ("elastic.young_modulus", MODULUS),
    (
        "elastic.poisson_ratio",
        between(-0.99, 0.49, "")
            .with_hint("0.5 would be incompressible, which is not possible here"),
    ),
];

#[cfg(test)]
mod tests {
    use mpm::DruckerPragerParameters;

    use super::*;
    use crate::scene::Elastic;

    fn numbers(path: &str, values: &toml::Table, found: &mut Vec<String>) {
        for (key, value) in values {
            let path = format!("{path}.{key}");
            match value {
                Value::Table(values) => numbers(&path, values, found),
                Value::Float(_) | Value::Integer(_) => found.push(path),
                _ => {}
            }
        }
    }

    #[test]
    fn every_number_has_limits_that_its_default_keeps() {
        let mut found = Vec::new();
        let mut rve = toml::Table::try_from(RveParameters::default()).unwrap();
        rve.remove("grains");
        for (path, values) in [
            ("grains", toml::Table::try_from(dem::Grains::default()).unwrap()),
            ("rve", rve),
            ("mu-i", toml::Table::try_from(DruckerPragerParameters::default()).unwrap()),
            ("elastic", toml::Table::try_from(Elastic::default()).unwrap()),
        ] {
            numbers(path, &values, &mut found);
        }
        found.sort();
        let mut listed: Vec<String> = LIMITS.iter().map(|(path, _)| path.to_string()).collect();
        listed.sort();
        assert_eq!(found, listed);
    }
}
