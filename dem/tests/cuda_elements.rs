//! Element tests side by side on a GPU against single ones on the CPU.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

use dem::cuda::{ElementTest, consolidate_all, run_stages};
use dem::element::{Element, Row, Stage, StageError, Until};
use dem::{Grains, Packing, RveParameters, consolidate};

/// Pressure (Pa) of all packings.
const PRESSURE: f64 = 50.0e3;

/// Grains of different friction, stiffness, density and resistance to rolling, so that steps differ too.
fn materials() -> Vec<RveParameters> {
    [(0.2, 1.0e5, 2650.0, 0.1), (0.5, 3.0e5, 2650.0, 0.2), (0.7, 6.0e4, 2000.0, 0.3)]
        .map(|(friction, normal_stiffness, grain_density, rolling_friction)| {
            let mut p = RveParameters {
                grains: Grains {
                    friction,
                    normal_stiffness,
                    grain_density,
                    rolling_friction,
                    ..Grains::default()
                },
                discs: 60,
                free_solid_fraction: 0.0,
                ..RveParameters::default()
            };
            p.preparation.pressure = PRESSURE;
            p
        })
        .to_vec()
}

fn packings() -> Vec<(RveParameters, Packing<f64>)> {
    materials().into_iter().map(|p| (p.clone(), consolidate(&p, 3).unwrap())).collect()
}

/// Each packing in a stage of its own.
fn tests() -> Vec<ElementTest<f64>> {
    let stages = [
        Stage::Biaxial { pressure: PRESSURE, shortening_rate: 0.4, strain: 2.0e-3 },
        Stage::ConstantPressureShear { pressure: PRESSURE, shear_rate: 1.0, strain: 4.0e-3 },
        Stage::Oedometric { shortening_rate: 0.4, until: Until::Pressure(1.05 * PRESSURE) },
    ];
    let test = |((parameters, packing), stage): ((RveParameters, Packing<f64>), Stage)| {
        let macro_step = 10.0 * parameters.grains.step();
        let sampling = 5.0 * macro_step;
        ElementTest { packing, parameters, stage, sampling, macro_step }
    };
    packings().into_iter().zip(stages).map(test).collect()
}

fn on_cpu(test: &ElementTest<f64>) -> Vec<Row> {
    let mut element =
        Element::<f64>::new(test.packing.clone(), &test.parameters, test.macro_step).unwrap();
    let mut rows = vec![element.row()];
    element.run(&test.stage, test.sampling, |row| rows.push(*row)).unwrap();
    rows
}

/// Some hundred steps in f64: round-off has grown to less than 1e-6 of the pressure.
#[test]
fn stages_side_by_side_have_the_paths_of_single_ones() {
    let Some(device) = gpu::for_tests() else { return };
    let found = run_stages(&device, tests(), &|| false).unwrap().unwrap();
    for (test, found) in tests().iter().zip(found) {
        let (expected, (_, found)) = (on_cpu(test), found.unwrap());
        assert_eq!(found.len(), expected.len(), "{}", test.stage.name());
        for (a, b) in found.iter().zip(&expected) {
            let stage = test.stage.name();
            assert!((a.stress - b.stress).norm() < 1e-6 * PRESSURE, "{stage}: {a:?} {b:?}");
            assert!((a.strain - b.strain).norm() < 1e-9, "{stage}: {a:?} {b:?}");
            assert!((a.t - b.t).abs() < 1e-12);
            assert!((a.solid_fraction - b.solid_fraction).abs() < 1e-9);
        }
    }
}

/// A test that fails does not touch the others, one that is stopped ends.
#[test]
fn one_failure_leaves_the_others() {
    let Some(device) = gpu::for_tests() else { return };
    let mut broken = tests();
    broken[1].stage =
        Stage::VelocityGradient { gradient: [[-300.0, 0.0], [0.0, -300.0]], duration: 0.01 };
    let alone = run_stages(&device, tests(), &|| false).unwrap().unwrap();
    let found = run_stages(&device, broken, &|| false).unwrap().unwrap();
    assert!(matches!(found[1], Err(StageError::FailedOnGpu { .. })));
    for k in [0, 2] {
        assert_eq!(found[k].as_ref().unwrap().1, alone[k].as_ref().unwrap().1);
    }
    assert!(run_stages(&device, tests(), &|| true).unwrap().is_none());
}

/// Forces balance to 1e-3 on both. The discs take different paths once round-off has grown, so that packings of 60
/// discs differ as those of two seeds: by a per cent or two in density.
#[test]
fn packings_are_consolidated_as_on_the_cpu() {
    let Some(device) = gpu::for_tests() else { return };
    let wanted: Vec<_> = materials().into_iter().map(|p| (p, 3)).collect();
    let made = consolidate_all(&device, &wanted, &|| false).unwrap().unwrap();
    for ((parameters, expected), found) in packings().into_iter().zip(made) {
        let found = found.unwrap();
        assert!((found.solid_fraction() - expected.solid_fraction()).abs() < 0.03);
        let macro_step = 10.0 * parameters.grains.step();
        let element = Element::new(found, &parameters, macro_step).unwrap();
        let stress = element.state.stress;
        for k in 0..2 {
            assert!((stress[(k, k)] / PRESSURE - 1.0).abs() < 0.01, "{stress}");
        }
    }
}
