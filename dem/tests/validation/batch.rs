//! Many RVEs advanced together.

use dem::{Packing, Real, Rve, RveBatch, RveParameters, RveState};
use nalgebra::Matrix2;
use rstest::rstest;

use crate::common::{DENSE, packing, parameters};

/// A batch of `n` RVEs from one packing.
pub fn batch<R: Real>(p: &RveParameters, n: usize) -> RveBatch<R> {
    let fresh: Packing<R> = packing(p, 1).convert();
    RveBatch { parameters: p.clone(), rves: vec![Rve::new(fresh.clone()); n], fresh: vec![fresh] }
}

/// A different motion for every RVE: shear, rotation, expansion to the stress-free state.
pub fn motions(n: usize) -> Vec<Matrix2<f64>> {
    (0..n)
        .map(|k| {
            let x = k as f64;
            Matrix2::new(x, 3.0 - 2.0 * x, x - 1.0, -0.5 * x)
        })
        .collect()
}

/// Advances over 20 macro steps and returns every state.
fn advance<R: Real>(batch: &mut RveBatch<R>, l: &[Matrix2<f64>]) -> Vec<Vec<RveState>> {
    (0..20)
        .map(|_| {
            let mut states = vec![RveState::default(); l.len()];
            batch.advance(1e-4, l, &mut states).unwrap();
            states
        })
        .collect()
}

/// N RVEs together give bit for bit what each gives alone.
#[rstest]
fn together_as_alone(#[values(true, false)] single: bool) {
    fn check<R: Real>() {
        let p = parameters(20.0e3, DENSE);
        let l = motions(9);
        let mut all = batch::<R>(&p, 9);
        let together = advance(&mut all, &l);
        for k in 0..9 {
            let mut alone = batch::<R>(&p, 1);
            let states = advance(&mut alone, &l[k..=k]);
            assert!(states.iter().zip(&together).all(|(a, b)| a[0] == b[k]), "state of RVE {k}");
            assert_eq!(alone.rves[0], all.rves[k], "RVE {k}");
        }
    }
    if single { check::<f32>() } else { check::<f64>() }
}

/// The number of threads changes nothing, bit for bit.
#[test]
fn threads_do_not_matter() {
    let p = parameters(20.0e3, DENSE);
    let l = motions(16);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut batch = batch::<f32>(&p, 16);
            (advance(&mut batch, &l), batch)
        })
    };
    let (states, rves) = with(1);
    for threads in [2, 5] {
        let (other_states, other) = with(threads);
        assert_eq!(states, other_states, "{threads} threads");
        assert_eq!(rves, other, "{threads} threads");
    }
}

/// The error of a batch is that of its first RVE that failed.
#[test]
fn the_first_failure_is_reported() {
    let p = parameters(20.0e3, DENSE);
    let mut batch = batch::<f64>(&p, 4);
    let mut l = motions(4);
    l[2][(0, 0)] = f64::NAN;
    l[3][(0, 0)] = f64::NAN;
    let error = batch.advance(1e-4, &l, &mut [RveState::default(); 4]).unwrap_err();
    assert!(error.to_string().starts_with("RVE 2: "), "{error}");
}
