//! Element tests: one RVE driven along a path of strain rates and stresses.
//!
//! Stages take pressures (compression positive); rows of the path hold stresses (tension positive), as
//! the MPM and the output files do.

mod drive;
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

pub(crate) use drive::Drive;

use drive::MAX_STEPS;

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
    /// The RVE failed on a GPU.
    #[error("at t = {t:.4} s: {failure}")]
    FailedOnGpu {
        /// Why.
        failure: String,
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

impl StageError {
    /// The state in which a stage was given up.
    pub(crate) fn unreached(wanted: String, state: &RveState) -> Self {
        Self::Unreached { wanted, reached: [state.stress[(0, 0)], state.stress[(1, 1)]] }
    }
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
        Row::at(&self.state, self.t, self.strain, &self.parameters)
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
        let mut drive = Drive::new(stage, sampling, &self.parameters, self.macro_step);
        while !drive.is_over() {
            let l = drive.velocity_gradient(&self.state, &self.parameters);
            self.advance(&l)?;
            let due = drive.after(&self.state, &l, || self.unbalanced_force());
            if due.row {
                on_row(&drive.row(self.t, self.strain, &self.parameters));
            }
            if due.end {
                return Ok(());
            }
        }
        match drive.unreached() {
            None => Ok(()),
            Some(wanted) => Err(StageError::unreached(wanted, &self.state)),
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
}
