//! Packings and paths that several tests share.

use std::collections::HashMap;
use std::sync::Mutex;

use dem::element::{Element, Row, Stage};
use dem::{Packing, Real, RveParameters, consolidate};
use nalgebra::Matrix2;

/// Preparation friction: dense, medium and loose packings.
pub const DENSE: f64 = 1.0e-3;
pub const MEDIUM: f64 = 0.1;
pub const LOOSE: f64 = 0.5;

/// Default grains, prepared at `pressure` (Pa) with the given friction.
pub fn parameters(pressure: f64, preparation_friction: f64) -> RveParameters {
    let mut p = RveParameters::default();
    p.preparation.pressure = pressure;
    p.grains.preparation_friction = preparation_friction;
    p
}

/// A consolidated packing; made once for all tests of the process.
pub fn packing(p: &RveParameters, seed: u64) -> Packing<f64> {
    static MADE: Mutex<Option<HashMap<String, Packing<f64>>>> = Mutex::new(None);
    let key = format!("{seed} {p:?}");
    // The lock is held while preparing: tests that wait need the same packing most of the time.
    let mut made = MADE.lock().unwrap();
    made.get_or_insert_default().entry(key).or_insert_with(|| consolidate(p, seed).unwrap()).clone()
}

/// An element that starts from a packing and advances one DEM step at a time.
pub fn stepwise<R: Real>(packing: Packing<R>, p: &RveParameters) -> Element<R> {
    Element::new(packing, p, p.grains.step()).unwrap()
}

/// Rows of one stage from a fresh packing, sampled every `sampling` (s), macro step 1e-4 s.
pub fn path(p: &RveParameters, seed: u64, stage: &Stage, sampling: f64) -> Vec<Row> {
    let mut element = Element::new(packing(p, seed), p, 1.0e-4).unwrap();
    let mut rows = Vec::new();
    element.run(stage, sampling, |row| rows.push(*row)).unwrap();
    rows
}

/// Rest under strong local damping until the peculiar motion has died out.
pub fn settle(element: &mut Element<f64>, duration: f64) {
    let damping = std::mem::replace(&mut element.parameters.grains.local_damping, 0.5);
    let steps = (duration / element.macro_step).ceil() as usize;
    for _ in 0..steps {
        element.advance(&Matrix2::zeros()).unwrap();
    }
    element.parameters.grains.local_damping = damping;
}

/// Mean and standard deviation of a sample.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, variance.sqrt())
}

/// Fails unless `value` is within `tolerance` of `target`, both absolute; prints it otherwise.
#[track_caller]
pub fn expect(what: &str, value: f64, target: f64, tolerance: f64) {
    println!("{what}: {value:.6} (target {target} ± {tolerance})");
    assert!(
        (value - target).abs() <= tolerance,
        "{what} is {value}, expected {target} ± {tolerance}"
    );
}
