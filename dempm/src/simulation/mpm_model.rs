//! The material point method as the model of a scene, on the CPU or a GPU.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gpu::ranks::Ranks;
use mpm::{Ledger, Points, Solver};
use serde::{Deserialize, Serialize};

use super::cuda::CudaSimulation;
use super::error::SimulationError;
use super::scene_material::SceneMaterial;
use super::span::Span;
use crate::scene::Scene;

/// Name of the budget scalar with the largest provably stable macro step (s).
pub const STABLE_STEP: &str = "stable_step";

/// Grid and material that move the points of a scene.
pub struct MpmModel {
    /// The material with its internal variables; on a GPU, as of the last checkpoint.
    pub material: SceneMaterial,
    solver: Solver,
    /// The copy that advances on a GPU.
    gpu: Option<CudaSimulation>,
}

/// What a checkpoint holds of it.
#[derive(Clone, Serialize, Deserialize)]
pub struct MpmState {
    /// Impulses and work of walls, obstacles and plate so far.
    pub ledger: Ledger,
    /// The material with its internal variables at every point.
    pub material: SceneMaterial,
}

impl MpmModel {
    /// The model of a scene at time zero.
    pub(super) fn new(scene: &Scene, material: SceneMaterial) -> Result<Self, SimulationError> {
        let solver = scene.solver().map_err(SimulationError::Setup)?;
        Ok(Self { material, solver, gpu: None })
    }

    /// The model in the state of a checkpoint.
    pub(super) fn resume(scene: &Scene, state: MpmState) -> Result<Self, SimulationError> {
        let mut solver = scene.solver().map_err(SimulationError::Setup)?;
        solver.set_ledger(state.ledger).map_err(SimulationError::Setup)?;
        Ok(Self { material: state.material, solver, gpu: None })
    }

    /// The state for a checkpoint, as of the last call of [`Self::record`].
    pub(super) fn state(&self) -> MpmState {
        MpmState { ledger: self.solver.ledger().clone(), material: self.material.clone() }
    }

    /// Advances on a GPU from now on; as one of several ranks, with this rank's share of the packings.
    pub(super) fn move_to(
        &mut self,
        device: &Arc<gpu::Device>,
        ranks: Option<&Arc<Ranks>>,
        scene: &Scene,
        step: usize,
        points: &Points,
    ) -> Result<(), SimulationError> {
        let Self { material, solver, .. } = self;
        self.gpu = Some(CudaSimulation::new(device, solver, material, points, step, scene, ranks)?);
        Ok(())
    }

    /// Advances by a macro step on the CPU, or by a whole span on a GPU. Returns the steps made and the time
    /// they took.
    pub(super) fn advance(
        &mut self,
        span: &Span,
        points: &mut Points,
    ) -> Result<(usize, Duration), SimulationError> {
        let Self { material, solver, gpu } = self;
        match gpu {
            None => {
                let start = Instant::now();
                self.step(span, points)?;
                Ok((1, start.elapsed()))
            }
            Some(gpu) => {
                let time = gpu
                    .advance(span.to_frame, span.ahead, points, material, solver)
                    .map_err(|error| SimulationError::on_gpu(error, span.dt))?;
                Ok((span.to_frame, time))
            }
        }
    }

    /// One macro step on the CPU. [`Solver::advance`] transfers mass and momentum from points to grid,
    /// updates the grid momentum, applies boundaries and obstacles, transfers velocities back to the
    /// points, evaluates their velocity gradients and asks the material for the new stresses: an
    /// [`RveMaterial`](super::RveMaterial) deforms the packings of all points.
    fn step(&mut self, span: &Span, points: &mut Points) -> Result<(), SimulationError> {
        // Not a running sum: a resumed run has the same times.
        self.solver.set_time(span.first as f64 * span.dt);
        let done = self.solver.advance(points, self.material.as_dyn_mut(), span.dt);
        let step = span.first + 1;
        done.map_err(|source| SimulationError::Step { step, time: step as f64 * span.dt, source })
    }

    /// Brings the material at `step` up to date for a checkpoint.
    pub(super) fn record(&mut self, step: usize, dt: f64) -> Result<(), SimulationError> {
        if let Some(gpu) = &mut self.gpu {
            gpu.fetch_material(&mut self.material, step)
                .map_err(|error| SimulationError::on_gpu(error, dt))?;
        }
        Ok(())
    }

    /// The phases of the wall time (s) since the last call.
    pub(super) fn phases(&mut self, advancing: Duration) -> [(&'static str, Duration); 2] {
        let material = match &mut self.material {
            SceneMaterial::Rve(rve) => std::mem::take(&mut rve.time),
            SceneMaterial::MuI(_) | SceneMaterial::Elastic(_) => Duration::ZERO,
        };
        [("rve", material), ("mpm", advancing.saturating_sub(material))]
    }

    /// The states of the packings, if points have packings.
    pub(super) fn rve_states(&self) -> Option<&[dem::RveState]> {
        match &self.material {
            SceneMaterial::Rve(rve) => Some(rve.states()),
            SceneMaterial::MuI(_) | SceneMaterial::Elastic(_) => None,
        }
    }

    /// Energies, contacts and stable step with a macro step of `dt` (s).
    pub(super) fn budget(&self, points: &Points, dt: f64) -> BTreeMap<String, f64> {
        let budget = self.solver.budget(points);
        let mut scalars = BTreeMap::from([
            ("kinetic_energy".to_owned(), budget.kinetic_energy),
            ("potential_energy".to_owned(), budget.potential_energy),
            ("momentum_x".to_owned(), budget.momentum.x),
            ("momentum_y".to_owned(), budget.momentum.y),
            ("plate_work".to_owned(), budget.contact.plate_work),
            ("points_projected".to_owned(), budget.contact.projected as f64),
        ]);
        // There is no stable step for points that the solver would refuse.
        let stable = self.solver.stable_step(points, self.material.as_dyn());
        let (bound, courant) =
            stable.map_or((f64::NAN, f64::NAN), |s| (s.gershgorin, s.courant(dt)));
        scalars.insert(STABLE_STEP.to_owned(), bound);
        scalars.insert("courant".to_owned(), courant);
        if let Some(states) = self.rve_states() {
            let free = states.iter().filter(|state| state.free).count();
            scalars.insert("stress_free_points".to_owned(), free as f64);
        }
        scalars
    }
}
