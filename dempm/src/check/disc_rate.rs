//! Speed of the DEM on this machine.

use std::time::{Duration, Instant};

use dem::{Packing, Rve, RveBatch, RveParameters, RveState};
use nalgebra::Matrix2;

/// Duration of the measurement: long enough to average over scheduling.
const MEASURED: Duration = Duration::from_millis(300);

/// Disc-steps per second of all threads together, including neighbour searches, measured on small
/// packings in steady shear in single precision.
///
/// # Errors
/// If the packing cannot be prepared.
pub fn disc_steps_per_second() -> Result<f64, dem::Error> {
    let p = RveParameters { discs: 100, ..RveParameters::default() };
    let packing: Packing<f32> = dem::consolidate(&p, 1)?.convert();
    let count = 16 * rayon::current_num_threads();
    let mut batch = RveBatch {
        rves: vec![Rve::new(packing.clone()); count],
        fresh: vec![packing],
        parameters: p.clone(),
    };
    let shear = vec![Matrix2::new(0.0, 5.0, 0.0, 0.0); count];
    let mut states = vec![RveState::default(); count];
    let dt = 1.0e-4;
    // Warm-up: the first step searches neighbours.
    batch.advance(dt, &shear, &mut states)?;
    let (start, mut steps) = (Instant::now(), 0);
    while start.elapsed() < MEASURED {
        batch.advance(dt, &shear, &mut states)?;
        steps += count * p.discs * p.grains.substeps(dt);
    }
    Ok(steps as f64 / start.elapsed().as_secs_f64())
}
