//! Element tests: one RVE driven along a path of strain rates and stresses.
//!
//! Stages take pressures (compression positive); rows of the path hold stresses (tension positive), as
//! the MPM and the output files do.

mod path;
mod servo;
mod stage;

use nalgebra::Matrix2;

use crate::contact::{ContactLaw, Force, Forces};
use crate::error::Failure;
use crate::packing::Packing;
use crate::parameters::RveParameters;
use crate::real::Real;
use crate::rve::{Rve, Substepping};
use crate::state::RveState;

pub use path::{Row, Summary, sin_phi, summary};
pub use stage::{Axis, Control, Stage, Until};

use path::Sampler;
use servo::Servo;
use stage::End;

/// Relative stress error and unbalanced force at which a stage without duration ends.
const TOLERANCE: f64 = 1.0e-3;
/// Give up after this many DEM steps in a stage that ends at a state, not at a time.
const MAX_STEPS: usize = 20_000_000;

/// Why a stage ended early.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The RVE failed.
    #[error("at t = {t:.4} s: {failure}")]
    Failed {
        /// Why.
        failure: Failure,
        /// Time since the start of the path (s).
        t: f64,
    },
    /// The state at which the stage ends was not reached.
    #[error("{wanted} not reached after {MAX_STEPS} DEM steps (reached {:.0} and {:.0} Pa)", .reached[0], .reached[1])]
    Unreached {
        /// That state.
        wanted: String,
        /// Pressures along x and y (Pa).
        reached: [f64; 2],
    },
}

/// One RVE on its path.
#[derive(Clone, Debug)]
pub struct Element<R: Real> {
    /// The RVE.
    pub rve: Rve<R>,
    /// Its parameters.
    pub parameters: RveParameters,
    /// Time between two updates of the servo (s), in which the velocity gradient is constant.
    pub macro_step: f64,
    /// Time since the start of the path (s).
    pub t: f64,
    /// `∫ L dt`: logarithmic strain as long as `L` is diagonal, `gamma` in simple shear.
    pub strain: Matrix2<f64>,
    /// State after the last macro step, compression positive.
    pub state: RveState,
    /// Macro steps in which the RVE was stress-free.
    pub free_steps: usize,
    /// Macro steps in which the cell was too thin to be sheared.
    pub thin_steps: usize,
    fresh: Packing<R>,
    forces: Forces<R>,
}

impl<R: Real> Element<R> {
    /// Starts a path from `packing`. A macro step at rest of a copy gives the initial stress.
    ///
    /// # Errors
    /// The packing is too compressed or not finite.
    pub fn new(
        mut packing: Packing<R>,
        parameters: &RveParameters,
        macro_step: f64,
    ) -> Result<Self, StageError> {
        // A list holds the dashpots of the parameters it was made with, maybe not these.
        let law = ContactLaw::new(&parameters.grains, parameters.grains.step());
        packing.search(parameters.grains.skin * parameters.grains.radius_max, |a, b| {
            law.dashpot(a, b)
        });
        let mut element = Self {
            rve: Rve::new(packing.clone()),
            parameters: parameters.clone(),
            macro_step,
            t: 0.0,
            strain: Matrix2::zeros(),
            state: RveState::default(),
            free_steps: 0,
            thin_steps: 0,
            forces: Forces::default(),
            fresh: packing,
        };
        let mut copy = element.clone();
        copy.advance(&Matrix2::zeros())?;
        element.state = copy.state;
        Ok(element)
    }

    /// The present state as a row of the path.
    pub fn row(&self) -> Row {
        let mut sampler = Sampler::default();
        sampler.add(&self.state, &Matrix2::zeros());
        sampler.row(self.t, self.strain, &self.parameters)
    }

    /// Runs one stage and passes a row to `on_row` every `sampling` seconds and at the end.
    ///
    /// # Errors
    /// The RVE fails, or does not reach the state at which the stage ends.
    pub fn run(
        &mut self,
        stage: &Stage,
        sampling: f64,
        mut on_row: impl FnMut(&Row),
    ) -> Result<(), StageError> {
        let (control, end) = (stage.control(), stage.end());
        let limit = match end {
            End::Duration(duration) => (duration / self.macro_step).round() as usize,
            End::Vertical { .. } | End::Balanced { .. } => {
                MAX_STEPS / self.parameters.grains.substeps(self.macro_step)
            }
        };
        // Infinite sampling saturates: one row, at the end of the stage.
        let per_row = ((sampling / self.macro_step).round() as usize).max(1);
        let mut servo = Servo::default();
        let mut sampler = Sampler::default();
        for n in 0..limit {
            let l = servo.velocity_gradient(
                &control,
                &self.state.stress,
                &self.parameters,
                self.macro_step,
            );
            self.advance(&l)?;
            sampler.add(&self.state, &l);
            let last = n + 1 == limit && matches!(end, End::Duration(_));
            let done = last || self.reached(&end);
            if done || (n + 1) % per_row == 0 {
                on_row(&sampler.row(self.t, self.strain, &self.parameters));
            }
            if done {
                return Ok(());
            }
        }
        match end {
            End::Duration(_) => Ok(()),
            End::Vertical { pressure, .. } => Err(self.unreached(format!("{pressure} Pa"))),
            End::Balanced { pressure } => {
                Err(self.unreached(format!("equilibrium at {pressure} Pa")))
            }
        }
    }

    /// One macro step under a velocity gradient (1/s).
    ///
    /// # Errors
    /// The RVE fails.
    pub fn advance(&mut self, l: &Matrix2<f64>) -> Result<(), StageError> {
        let sub = Substepping::new(&self.parameters, self.macro_step);
        self.state = self
            .rve
            .advance(l, &self.parameters, &sub, &self.fresh, &mut self.forces)
            .map_err(|failure| StageError::Failed { failure, t: self.t })?;
        self.t += self.macro_step;
        self.strain += l * self.macro_step;
        self.free_steps += usize::from(self.state.free);
        self.thin_steps += usize::from(self.state.thin);
        Ok(())
    }

    fn reached(&self, end: &End) -> bool {
        let stress = &self.state.stress;
        match *end {
            End::Duration(_) => false,
            End::Vertical { pressure, loading } => (stress[(1, 1)] >= pressure) == loading,
            End::Balanced { pressure } => {
                let near = |s: f64| (s / pressure - 1.0).abs() < TOLERANCE;
                near(stress[(0, 0)]) && near(stress[(1, 1)]) && self.unbalanced_force() < TOLERANCE
            }
        }
    }

    /// Mean resultant force on a disc over the mean normal contact force.
    pub fn unbalanced_force(&self) -> f64 {
        let length = |f: &Force<R>| f[0].to_f64().hypot(f[1].to_f64());
        let resultant: f64 = self.forces.on_disc.iter().map(length).sum();
        let (mut normal, mut contacts) = (0.0, 0.0);
        for c in self.rve.packing.contacts() {
            normal += self.parameters.grains.normal_stiffness * c.overlap;
            contacts += 1.0;
        }
        if normal == 0.0 {
            return f64::INFINITY;
        }
        (resultant / self.forces.on_disc.len() as f64) / (normal / contacts)
    }

    fn unreached(&self, wanted: String) -> StageError {
        let stress = &self.state.stress;
        StageError::Unreached { wanted, reached: [stress[(0, 0)], stress[(1, 1)]] }
    }
}
