//! D5. Energy of a frictionless, undamped packing in a fixed cell.

use crate::common::{DENSE, packing, parameters, stepwise};
use dem::{Grains, RveParameters};
use nalgebra::Matrix2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;

/// Leapfrog conserves a shadow energy that differs from the energy by O(dt²), without drift.
/// Largest relative deviation over 0.2 s: 1.1e-3 / 4.4e-3 / 1.8e-2 at 0.1 / 0.2 / 0.4 of
/// sqrt(m_min / kn), measured on another code; within a factor of 2.
#[rstest]
#[case(0.1, 1.1e-3)]
#[case(0.2, 4.4e-3)]
#[case(0.4, 1.8e-2)]
fn leapfrog_conserves_energy(#[case] step_factor: f64, #[case] reference: f64) {
    let prepared = parameters(20.0e3, DENSE);
    let p = RveParameters {
        grains: Grains { friction: 0.0, damping_ratio: 0.0, step_factor, ..prepared.grains },
        ..prepared.clone()
    };
    let mut packing = packing(&prepared, 1);
    // A tenth of the elastic energy as kinetic energy. No history: without friction it has no energy.
    let only_normal = Grains { tangential_stiffness: f64::INFINITY, ..p.grains.clone() };
    let elastic = packing.elastic_energy(&only_normal);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for d in &mut packing.discs {
        d.u = [rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)];
        d.w = 0.0;
    }
    packing.remove_drift();
    let scale = (0.1 * elastic / packing.kinetic_energy()).sqrt();
    packing.discs.iter_mut().for_each(|d| d.u = d.u.map(|u| u * scale));

    // Velocities live half a step before the positions: the kinetic energy at the positions' time
    // is the mean of two.
    let mut element = stepwise(packing, &p);
    let still = Matrix2::zeros();
    let mut deviation: f64 = 0.0;
    let (mut first, mut last) = (None, 0.0);
    for _ in 0..(0.2 / element.macro_step) as usize / 5 {
        for _ in 0..4 {
            element.advance(&still).unwrap();
        }
        let potential = element.rve.packing.elastic_energy(&p.grains);
        let before = element.rve.packing.kinetic_energy();
        element.advance(&still).unwrap();
        let energy = potential + 0.5 * (before + element.rve.packing.kinetic_energy());
        let first = *first.get_or_insert(energy);
        last = energy / first - 1.0;
        deviation = deviation.max(last.abs());
    }
    println!("dt = {step_factor} sqrt(m/k): max |dE/E| {deviation:.2e}, at the end {last:.2e}");
    assert!(deviation < 2.0 * reference, "{deviation:.2e}");
}
