//! D6. The largest stable DEM step of a packing.

use crate::common::{DENSE, packing, parameters, stepwise};
use dem::{Grains, RveParameters};
use nalgebra::Matrix2;
use rstest::rstest;

/// The fastest mode is the rotation of the lightest disc, `omega² = 2 Z kt / m`: a linear packing
/// (sticking contacts, no damping) is stable up to about 0.55 sqrt(m_min / kn); theory with Z = 6
/// gives 0.577, and the lightest disc seldom has six contacts.
#[rstest]
#[case(0.50, true)]
#[case(0.65, false)]
fn stability_limit(#[case] step_factor: f64, #[case] stable: bool) {
    let prepared = parameters(20.0e3, DENSE);
    let p = RveParameters {
        grains: Grains { friction: 1e6, damping_ratio: 0.0, step_factor, ..prepared.grains },
        ..prepared.clone()
    };
    let mut element = stepwise(packing(&prepared, 1), &p);
    let energy = |e: &dem::element::Element<f64>| {
        let packing = &e.rve.packing;
        packing.kinetic_energy() + packing.elastic_energy(&p.grains)
    };
    let start = energy(&element);
    // An unstable mode grows by a fixed factor per step, from round-off: 20 000 steps are enough.
    let blew_up = (0..20_000).any(|n| {
        element.advance(&Matrix2::zeros()).is_err()
            || n % 100 == 0 && energy(&element) > 2.0 * start
    });
    assert_eq!(blew_up, !stable, "energy {:.3e} from {start:.3e}", energy(&element));
}
