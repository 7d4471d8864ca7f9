//! Preparation of packings: loose cloud, isotropic servo, ladder of loads.

use nalgebra::Matrix2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::cell::Cell;
use crate::disc::PlainDisc;
use crate::element::{Element, Stage, StageError, Until};
use crate::error::Error;
use crate::grains::Grains;
use crate::packing::Packing;
use crate::parameters::RveParameters;

/// A state on the path of compression.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rung {
    /// Measured Cauchy stress (Pa), compression positive.
    pub stress: Matrix2<f64>,
    /// The packing in this state.
    pub packing: Packing<f64>,
}

/// DEM steps between two servo decisions.
const CONTROL_STEPS: f64 = 10.0;

/// Makes a packing from `seed`: a cloud of non-touching discs is compressed by an isotropic servo
/// with the preparation's friction, and then relaxes with the friction of flow, until stresses and
/// forces balance to 1e-3.
///
/// # Errors
/// The discs do not fit in the cloud, or equilibrium is not reached.
pub fn consolidate(p: &RveParameters, seed: u64) -> Result<Packing<f64>, Error> {
    let fail = |reason: String| Error::Preparation { seed, reason };
    let stage = Stage::Isotropic { pressure: p.preparation.pressure, duration: None };
    let mut element = start(p, cloud(p, seed).map_err(fail)?).map_err(|e| fail(e.to_string()))?;
    for friction in [p.grains.preparation_friction, p.grains.friction] {
        element.parameters.grains.friction = friction;
        element.run(&stage, f64::INFINITY, |_| ()).map_err(|e| fail(e.to_string()))?;
    }
    Ok(element.rve.packing)
}

/// Takes a consolidated packing to each vertical stress of `targets` (Pa) by proportional strain
/// (`L_yy` at the ladder rate, `L_xx` at [`lateral_strain`](crate::Preparation::lateral_strain) times
/// that): loading to those above the preparation pressure, unloading to those below it.
///
/// # Errors
/// A target is not reached.
pub fn ladder(
    p: &RveParameters,
    seed: u64,
    isotropic: &Packing<f64>,
    targets: &[f64],
) -> Result<Vec<Rung>, Error> {
    let fail = |e: StageError| Error::Preparation { seed, reason: e.to_string() };
    let friction =
        if p.preparation.rough_ladder { p.grains.friction } else { p.grains.preparation_friction };
    let mut rungs = vec![None; targets.len()];
    for loading in [true, false] {
        let mut order: Vec<usize> = (0..targets.len())
            .filter(|&k| (targets[k] >= p.preparation.pressure) == loading)
            .collect();
        order.sort_by(|&a, &b| targets[a].total_cmp(&targets[b]));
        if !loading {
            order.reverse();
        }
        let rate = p.preparation.ladder_rate;
        let shortening_rate = if loading { rate } else { -rate };
        let mut element = start(p, isotropic.clone()).map_err(fail)?;
        // The friction of flow that follows leaves all contacts as they are.
        element.parameters.grains.friction = friction;
        for k in order {
            let until = Until::Pressure(targets[k]);
            let lateral = p.preparation.lateral_strain;
            let stage = Stage::ProportionalStrain { shortening_rate, lateral, until };
            element.run(&stage, f64::INFINITY, |_| ()).map_err(fail)?;
            let (stress, packing) = (element.state.stress, element.rve.packing.clone());
            rungs[k] = Some(Rung { stress, packing });
        }
    }
    Ok(rungs.into_iter().flatten().collect())
}

/// An element with the damping of preparation, which is never stress-free. It takes the default step, not
/// that of flow: packings would differ with the step, by more than flows do.
fn start(p: &RveParameters, packing: Packing<f64>) -> Result<Element<f64>, StageError> {
    let (p, macro_step) = preparation(p);
    Element::new(packing, &p, macro_step)
}

/// Parameters while a packing is prepared, with the friction of flow, and the time between two servo decisions (s).
pub(crate) fn preparation(p: &RveParameters) -> (RveParameters, f64) {
    let p = RveParameters {
        grains: Grains {
            local_damping: p.preparation.local_damping,
            mass_scale: 1.0,
            ..p.grains.in_preparation()
        },
        free_solid_fraction: 0.0,
        ..p.clone()
    };
    let macro_step = CONTROL_STEPS * p.grains.step();
    (p, macro_step)
}

/// Random non-overlapping discs, radii uniform in `[radius_min, radius_max]`, in a square cell.
pub(crate) fn cloud(p: &RveParameters, seed: u64) -> Result<Packing<f64>, String> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut radii: Vec<f64> =
        (0..p.discs).map(|_| rng.random_range(p.grains.radius_min..=p.grains.radius_max)).collect();
    // Large discs first: they find a place more easily.
    radii.sort_by(|a, b| b.total_cmp(a));
    let solid: f64 = radii.iter().map(|r| std::f64::consts::PI * r * r).sum();
    let side = (solid / p.preparation.cloud_solid_fraction).sqrt();
    let mut discs: Vec<PlainDisc> = Vec::with_capacity(p.discs);
    for r in radii {
        let tries = 100_000;
        let place = (0..tries).find_map(|_| {
            let x = [rng.random_range(0.0..side), rng.random_range(0.0..side)];
            let free = discs.iter().all(|d| {
                let nearest = |k: usize| {
                    let dx = x[k] - d.x[k];
                    dx - side * (dx / side).round()
                };
                nearest(0).hypot(nearest(1)) > r + d.r
            });
            free.then_some(x)
        });
        let x = place.ok_or_else(|| {
            format!(
                "no room for a disc in the cloud; preparation.cloud_solid_fraction = {} is too dense",
                p.preparation.cloud_solid_fraction
            )
        })?;
        discs.push(PlainDisc { x, r });
    }
    Ok(Packing::new(Cell::square(side), &discs, |r| p.grains.disc_mass(r)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packing_does_not_depend_on_the_step_of_flow() {
        let made = |step_factor| {
            let p = RveParameters {
                grains: Grains { step_factor, ..Grains::default() },
                discs: 30,
                ..RveParameters::default()
            };
            let isotropic = consolidate(&p, 1).unwrap();
            (ladder(&p, 1, &isotropic, &[5.0e3]).unwrap(), isotropic)
        };
        assert_eq!(made(0.1), made(0.4));
    }
}
