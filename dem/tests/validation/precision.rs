//! What working in single precision costs.

use dem::Real;
use dem::element::Element;
use nalgebra::Matrix2;

use crate::common::{DENSE, MEDIUM, mean_and_deviation, packing, parameters};

/// Stress path of a constant-volume shear to a strain of 2 % in 2000 macro steps.
fn path<R: Real>(friction: f64) -> Vec<Matrix2<f64>> {
    let p = parameters(20.0e3, friction);
    let mut element = Element::<R>::new(packing(&p, 1).convert(), &p, 1e-4).unwrap();
    (0..2000)
        .map(|_| {
            element.advance(&Matrix2::new(0.0, 0.1, 0.0, 0.0)).unwrap();
            element.state.stress
        })
        .collect()
}

/// Until the trajectories part (a granular packing is chaotic) f32 follows f64 to 1e-3 of the
/// stress; afterwards both are samples of the same path, and differ by its fluctuations.
#[test]
fn single_follows_double() {
    for friction in [DENSE, MEDIUM] {
        let (double, single) = (path::<f64>(friction), path::<f32>(friction));
        let error = |k: usize| (double[k] - single[k]).norm() / double[k].norm();
        for k in [0, 9, 99, 499, 999, 1999] {
            println!("strain {:.0e}: f32 differs by {:.1e}", (k + 1) as f64 * 1e-5, error(k));
        }
        assert!((0..100).all(|k| error(k) < 1e-3), "within a strain of 1e-3");
        let pressure = |path: &[Matrix2<f64>]| {
            let late: Vec<f64> = path[1000..].iter().map(|s| 0.5 * s.trace()).collect();
            mean_and_deviation(&late).0
        };
        let ratio = pressure(&single) / pressure(&double);
        println!("mean pressure over the second half: f32 / f64 = {ratio:.3}");
        assert!((ratio - 1.0).abs() < 0.05);
    }
}
