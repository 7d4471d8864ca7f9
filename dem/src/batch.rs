//! Batches of independent RVEs.

use nalgebra::Matrix2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::contact::Forces;
use crate::error::Error;
use crate::packing::Packing;
use crate::parameters::RveParameters;
use crate::real::Real;
use crate::rve::{Rve, Substepping};
use crate::state::RveState;

/// RVEs of equal parameters on the CPU, advanced in parallel. The result of an RVE does not
/// depend on the others nor on the number of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct RveBatch<R: Real> {
    /// Parameters of all RVEs.
    pub parameters: RveParameters,
    /// The RVEs.
    pub rves: Vec<Rve<R>>,
    /// Packings from which stress-free RVEs restart, one for each [kind](Rve::kind). One for all would bias the
    /// flow: it is denser or looser, stronger or weaker than the mean.
    pub fresh: Vec<Packing<R>>,
}

impl<R: Real> RveBatch<R> {
    /// Advances RVE `p` by `dt` (s) under `velocity_gradient[p]` (1/s) into `states[p]`.
    ///
    /// # Errors
    /// The first RVE (lowest index) that failed. The batch is then not usable further.
    pub fn advance(
        &mut self,
        dt: f64,
        velocity_gradient: &[Matrix2<f64>],
        states: &mut [RveState],
    ) -> Result<(), Error> {
        let substepping = Substepping::new(&self.parameters, dt);
        let Self { parameters, rves, fresh } = self;
        let failure = rves
            .par_iter_mut()
            .zip(velocity_gradient)
            .zip(states)
            .enumerate()
            .map_init(Forces::<R>::default, |forces, (index, ((rve, l), state))| {
                let fresh = &fresh[rve.kind as usize];
                match rve.advance(l, parameters, &substepping, fresh, forces) {
                    Ok(new) => {
                        *state = new;
                        None
                    }
                    Err(failure) => Some((index, failure)),
                }
            })
            .flatten()
            .min_by_key(|(index, _)| *index);
        match failure {
            None => Ok(()),
            Some((rve, failure)) => Err(Error::Rve { rve, failure }),
        }
    }
}
