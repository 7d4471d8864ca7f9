//! The limits of loading: stress-free and over-compressed RVEs.

use dem::element::{Element, StageError};
use dem::{Failure, Grains, Packing, Rve, RveBatch, RveParameters, RveState};
use nalgebra::Matrix2;

use crate::common::{DENSE, packing, parameters};

fn element(p: &RveParameters) -> Element<f64> {
    Element::new(packing(p, 1), p, 1e-4).unwrap()
}

/// Expanded below `free_solid_fraction` an RVE has no stress and only keeps its area, exactly
/// `exp(∫ tr L dt)`, shear or not; compressed again it carries stress at the density where it did
/// before.
#[test]
fn a_free_rve_keeps_its_area_and_recompacts() {
    let p = parameters(20.0e3, DENSE);
    let mut element = element(&p);
    let (start, dense) = (element.state.area, element.state.solid_fraction);
    for _ in 0..200 {
        element.advance(&Matrix2::new(20.0, 7.0, -3.0, 20.0)).unwrap();
    }
    assert!(element.state.free && element.free_steps > 100);
    assert_eq!(element.state.stress, Matrix2::zeros());
    let expected = start * element.strain.trace().exp();
    assert!((element.state.area / expected - 1.0).abs() < 1e-12);
    assert!((element.state.solid_fraction * expected / (dense * start) - 1.0).abs() < 1e-12);

    let mut first_loaded = None;
    while element.strain.trace() > 0.0 {
        element.advance(&(Matrix2::identity() * -5.0)).unwrap();
        if element.state.stress.trace() > 2.0 * 1e3 {
            first_loaded.get_or_insert(element.state.solid_fraction);
        }
    }
    let first = first_loaded.expect("the recompacted packing carries stress");
    println!("1 kPa again at a solid fraction of {first:.4}; {dense:.4} at 20 kPa before");
    assert!((dense - first).abs() < 0.01);
    assert!((element.state.area / start - 1.0).abs() < 1e-3);
}

/// Compression beyond what the stiffness can carry ends with an error that says so.
#[test]
fn over_compression_is_an_error() {
    let p = RveParameters {
        grains: Grains { overlap_limit: 0.3, ..parameters(20.0e3, DENSE).grains },
        ..parameters(20.0e3, DENSE)
    };
    let mut element = element(&p);
    let failure = (0..2000).find_map(|_| {
        element.advance(&(Matrix2::identity() * -5.0)).err().map(|e| match e {
            StageError::Failed { failure, .. } => failure,
            e => panic!("{e}"),
        })
    });
    assert!(matches!(failure, Some(Failure::Overlap(x)) if x > 0.3 && x < 0.4), "{failure:?}");
}

/// Not a number is found at once, in the motion as in the packing.
#[test]
fn nan_is_an_error() {
    let p = parameters(20.0e3, DENSE);
    let mut element = element(&p);
    assert!(element.advance(&Matrix2::new(0.0, f64::NAN, 0.0, 0.0)).is_err());
    element.rve.packing.discs[17].u[1] = f64::NAN;
    assert!(element.advance(&Matrix2::zeros()).is_err());
}

/// However long it expands, an RVE fills a hundredth of its cell: its area stays finite, and it carries stress again
/// after a compression by the same factor.
#[test]
fn a_free_rve_does_not_expand_without_bound() {
    let p = parameters(20.0e3, DENSE);
    let mut element = element(&p);
    for _ in 0..400 {
        element.advance(&(Matrix2::identity() * 500.0)).unwrap();
    }
    assert!(element.state.free && element.state.area.is_finite());
    assert!((element.state.solid_fraction - 0.01).abs() < 1e-9, "{:?}", element.state);
    // From 0.01 to 0.84 at 2 * 500 1/s: ln 84 / 1000 = 4.4 ms.
    for _ in 0..46 {
        element.advance(&(Matrix2::identity() * -500.0)).unwrap();
    }
    assert!(!element.state.free && element.state.stress.trace() > 0.0, "{:?}", element.state);
}

/// Loosened and compressed to the area that it had, an RVE is as dense as before: it restarts from a packing of its own
/// discs, whose area differs between packings by some per cent.
#[test]
fn a_free_rve_restarts_with_its_own_discs() {
    let p = parameters(20.0e3, DENSE);
    let fresh = vec![packing(&p, 1), packing(&p, 2)];
    let rves = (0..).zip(&fresh).map(|(kind, own)| Rve { kind, ..Rve::new(own.clone()) }).collect();
    let mut batch = RveBatch { parameters: p, rves, fresh: fresh.clone() };
    let mut states = [RveState::default(); 2];
    for rate in [60.0, -60.0] {
        for _ in 0..40 {
            batch.advance(1e-4, &[Matrix2::identity() * rate; 2], &mut states).unwrap();
        }
        assert!(states.iter().all(|state| state.free == (rate > 0.0)), "{states:?}");
    }
    let radii = |packing: &Packing<f64>| packing.discs.iter().map(|d| d.r).collect::<Vec<_>>();
    for ((rve, own), state) in batch.rves.iter().zip(&fresh).zip(states) {
        assert_eq!(radii(&rve.packing), radii(own));
        assert!((state.solid_fraction - own.solid_fraction()).abs() < 1e-9, "{state:?}");
    }
}

/// Denser than `max_solid_fraction` a cell takes no compression, but still shear and expansion. One macro step at
/// 100 1/s compresses by 2 %.
#[test]
fn a_dense_rve_is_not_compressed_further() {
    let p = RveParameters { max_solid_fraction: 0.95, ..parameters(20.0e3, DENSE) };
    let mut element = element(&p);
    for _ in 0..20 {
        element.advance(&Matrix2::new(-100.0, 0.0, 0.0, -100.0)).unwrap();
    }
    let held = element.state;
    assert!(held.dense && (0.95..0.97).contains(&held.solid_fraction), "{held:?}");
    assert!(held.relative_overlap < 0.5, "{held:?}");
    let cell = element.rve.packing.cell;
    element.advance(&Matrix2::new(-100.0, 50.0, 0.0, -100.0)).unwrap();
    let sheared = element.rve.packing.cell.h * cell.h.try_inverse().unwrap();
    // exp(0.005 [0 1; 0 0])
    assert!((sheared - Matrix2::new(1.0, 5e-3, 0.0, 1.0)).norm() < 1e-9, "{sheared}");
    element.advance(&Matrix2::new(100.0, 0.0, 0.0, 100.0)).unwrap();
    assert!(!element.state.dense && element.state.solid_fraction < held.solid_fraction);
}
