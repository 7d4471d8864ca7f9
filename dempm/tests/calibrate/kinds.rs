//! Every kind of target finds the parameter that it depends on.

use dem::Grains;

use super::{Table, Test, calibrated, head, laboratory, synthetic};

/// Calibrates one parameter against measurements of grains whose value is `truth`: its prior is narrowed by a fifth or
/// more, and the truth is within 99 % of the posterior.
fn finds(key: &str, range: [f64; 2], truth: f64, tests: &[Test]) {
    let folder = tempfile::tempdir().unwrap();
    let [low, high] = range;
    let head = head(5, 10, 1, &format!("[free.{key}]\nrange = [{low:e}, {high:e}]\n"));
    let mut grains = toml::Table::try_from(Grains::default()).unwrap();
    grains[key] = truth.into();
    let grains: Grains = grains.try_into().unwrap();
    let targets = synthetic(folder.path(), &head, tests, &grains, 5);
    let (_, posterior) = calibrated(&targets, &laboratory());
    let (mean, sd) = (posterior.mean[0], posterior.sd[0]);
    let level = posterior.level(&targets, &[truth]);
    println!("{key}: {mean:.3e} ± {sd:.1e} for {truth:.3e}, level {level:.2}");
    println!("{:?}", posterior.identifiability(&targets));
    assert!(level < 0.99, "{level}");
    // A uniform prior has the standard deviation of its range over sqrt(12).
    assert!(sd < 0.8 * (high - low) / 12.0_f64.sqrt(), "{sd}");
}

#[test]
fn an_oedometer_finds_the_stiffness() {
    let test = Test {
        target: "kind = \"oedometer\"\ndata = \"oedometer.csv\"\nsd = { axial_strain = 5e-4 }\n",
        table: Some(Table {
            name: "oedometer.csv",
            title: "axial_stress [Pa],axial_strain [-]",
            x: &[2.0e4, 5.0e4, 1.0e5, 2.0e5, 4.0e5],
            columns: 1,
        }),
    };
    finds("normal_stiffness", [5.0e4, 5.0e5], 2.0e5, &[test]);
}

#[test]
fn the_bulk_density_finds_that_of_the_grains() {
    let target = "kind = \"bulk-density\"\npressure = 1e5\ndensity = @\nsd = 5.0\n";
    finds("grain_density", [2000.0, 3200.0], 2650.0, &[Test { target, table: None }]);
}

#[test]
fn the_critical_friction_finds_the_resistance_to_rolling() {
    let target = "kind = \"critical-friction\"\npressure = 1e5\nangle = @\nsd = 1.0\n";
    finds("rolling_friction", [0.0, 0.6], 0.2, &[Test { target, table: None }]);
}

#[test]
fn a_shear_test_finds_the_friction() {
    finds("friction", [0.05, 0.9], 0.3, &[super::SHEAR]);
}

/// Columns of some hundred grains, of which run-out and slope scatter by much.
#[test]
fn run_out_and_repose_find_the_resistance_to_rolling() {
    let run_out = "kind = \"run-out\"\nsize = [0.08, 0.08]\nrun_out = @\nsd = 0.05\n";
    let repose = "kind = \"repose\"\nsize = [0.12, 0.06]\nangle = @\nsd = 1.0\n";
    let tests = [run_out, repose].map(|target| Test { target, table: None });
    finds("rolling_friction", [0.0, 0.8], 0.3, &tests);
}
