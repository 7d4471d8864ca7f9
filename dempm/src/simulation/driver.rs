//! Advancing a scene.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gpu::Device;
use gpu::ranks::Ranks;
use mpm::Points;

use super::cuda::compile_ahead;
use super::discs::DiscModel;
use super::error::SimulationError;
use super::initial::initial_model;
use super::model::Model;
use super::mpm_model::MpmModel;
use super::rve_material::RveMaterial;
use super::scene_material::SceneMaterial;
use super::span::Span;
use super::state::{ModelState, State};
use crate::scene::{Material, Scene};

/// A scene and its present state.
pub struct Simulation {
    /// The scene.
    pub scene: Scene,
    /// Completed macro steps.
    pub step: usize,
    /// The points; on a GPU, and where discs move them, as of the last frame.
    pub points: Points,
    /// What moves the points.
    pub model: Model,
    /// Wall time per phase (s), summed over all sessions of the run.
    pub wall_time: BTreeMap<String, f64>,
    /// Name of the processor, as in [`Header::device`](crate::trajectory::Header::device).
    pub(crate) device: String,
    /// Wall time of steps since it was last recorded.
    advancing: Duration,
    /// Time from which on it stood still (s).
    rest_time: Option<f64>,
}

impl Simulation {
    /// A scene at time zero. Prepares packings and columns of discs, or finds them in the cache.
    ///
    /// # Errors
    /// If a packing or column cannot be prepared or the grid cannot be set up.
    pub fn new(scene: Scene) -> Result<Self, SimulationError> {
        Self::prepare(scene, None, None)
    }

    /// As [`new`](Self::new), but discs are prepared on a GPU, by several ranks together, and kernels are compiled
    /// meanwhile. It is left where it is: [`move_to`](Self::move_to) follows.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn prepare(
        scene: Scene,
        device: Option<&Arc<Device>>,
        ranks: Option<&Ranks>,
    ) -> Result<Self, SimulationError> {
        let start = Instant::now();
        if let Some(device) = device {
            compile_ahead(device, &scene);
        }
        let (model, points) = initial_model(&scene, device, ranks)?;
        let prepared = start.elapsed().as_secs_f64();
        let wall_time = BTreeMap::from([("preparation".to_owned(), prepared)]);
        Ok(Self {
            scene,
            step: 0,
            points,
            model,
            wall_time,
            device: cpu(),
            advancing: Duration::ZERO,
            rest_time: None,
        })
    }

    /// A scene in the state of a checkpoint.
    ///
    /// # Errors
    /// If the state does not fit the scene.
    pub fn resume(scene: Scene, state: State) -> Result<Self, SimulationError> {
        let State { step, points, model, wall_time } = state;
        let model = match (model, &scene.material) {
            (ModelState::Discs(state), Material::Discs(discs)) => {
                Model::Discs(Box::new(DiscModel::resume(&scene, discs, *state)?))
            }
            (ModelState::Mpm(state), _) => Model::Mpm(Box::new(MpmModel::resume(&scene, state)?)),
            (ModelState::Discs(_), _) => return Err(SimulationError::OtherModel),
        };
        let (device, advancing, rest_time) = (cpu(), Duration::ZERO, None);
        Ok(Self { scene, step, points, model, wall_time, device, advancing, rest_time })
    }

    /// The state for a checkpoint, as of the last call of [`Self::record`].
    pub fn state(&self) -> State {
        State {
            step: self.step,
            points: self.points.clone(),
            model: match &self.model {
                Model::Mpm(mpm) => ModelState::Mpm(mpm.state()),
                Model::Discs(discs) => ModelState::Discs(Box::new(discs.state())),
            },
            wall_time: self.wall_time.clone(),
        }
    }

    /// Advances on a GPU from now on; as one of several ranks, with this rank's share of the packings or discs.
    ///
    /// # Errors
    /// If the simulation does not fit into the GPU's memory or a kernel cannot be compiled.
    pub fn move_to(
        &mut self,
        device: &Arc<Device>,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<(), SimulationError> {
        let start = Instant::now();
        // Side by side, unless that has begun before.
        compile_ahead(device, &self.scene);
        match &mut self.model {
            Model::Mpm(mpm) => mpm.move_to(device, ranks, &self.scene, self.step, &self.points)?,
            Model::Discs(discs) => discs.move_to(device, ranks)?,
        }
        let count = ranks.map_or(1, |ranks| ranks.size());
        let gpus = if count > 1 { format!("{count} x ") } else { String::new() };
        self.device = format!("{gpus}{}", device.name());
        let upload = self.wall_time.entry("upload".to_owned()).or_default();
        *upload += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Advances by one macro step on the CPU, or to the next frame on a GPU. Points are then up to
    /// date, but those of discs only after a frame; a material on a GPU only after
    /// [`record`](Self::record).
    ///
    /// # Errors
    /// If a point leaves the grid, or its material or a grain fails; the step is then half done.
    pub fn advance(&mut self) -> Result<(), SimulationError> {
        self.advance_and(false)
    }

    /// As [`advance`](Self::advance). With `go_on`, a GPU already computes the next frame while the
    /// caller processes this one, which then cannot be [recorded](Self::record).
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn advance_and(&mut self, go_on: bool) -> Result<(), SimulationError> {
        let per_frame = self.scene.steps_per_frame();
        let to_frame = per_frame - self.step % per_frame;
        let left = self.scene.steps().saturating_sub(self.step + to_frame);
        let ahead = if go_on { left.min(per_frame) } else { 0 };
        let span = Span { first: self.step, dt: self.scene.step, to_frame, ahead };
        let (steps, time) = match &mut self.model {
            Model::Mpm(mpm) => mpm.advance(&span, &mut self.points)?,
            Model::Discs(discs) => discs.advance(&span, &self.scene, &mut self.points)?,
        };
        self.step += steps;
        self.advancing += time;
        Ok(())
    }

    /// Lets time pass to the next frame without motion: everything is at rest. There is no way back to
    /// [`advance`](Self::advance).
    pub fn stand_still(&mut self) {
        self.rest_time.get_or_insert(self.time());
        self.step += self.scene.steps_per_frame();
    }

    /// Time from which on it stood still (s).
    pub fn rest_time(&self) -> Option<f64> {
        self.rest_time
    }

    /// Macro steps that were computed.
    pub fn computed_steps(&self) -> usize {
        self.rest_time.map_or(self.step, |time| (time / self.scene.step).round() as usize)
    }

    /// Whether [`frame`](Self::frame) is up to date after a frame: of several ranks, only the first has the discs.
    pub fn has_frames(&self) -> bool {
        match &self.model {
            Model::Mpm(_) => true,
            Model::Discs(discs) => discs.has_frames(),
        }
    }

    /// Brings the whole state up to date for a checkpoint.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn record(&mut self) -> Result<(), SimulationError> {
        self.record_wall_time();
        match &mut self.model {
            Model::Mpm(mpm) => mpm.record(self.step, self.scene.step),
            Model::Discs(discs) => discs.record(),
        }
    }

    /// Adds the wall time since the last call to the phases of the model.
    pub fn record_wall_time(&mut self) {
        let advancing = std::mem::take(&mut self.advancing);
        let phases = match &mut self.model {
            Model::Mpm(mpm) => mpm.phases(advancing),
            Model::Discs(discs) => discs.phases(advancing),
        };
        for (phase, time) in phases {
            *self.wall_time.entry(phase.to_owned()).or_default() += time.as_secs_f64();
        }
    }

    /// The packings, if points have packings; on a GPU, as of the last checkpoint.
    pub fn packings(&self) -> Option<&RveMaterial> {
        match &self.model {
            Model::Mpm(mpm) => match &mpm.material {
                SceneMaterial::Rve(rve) => Some(rve),
                SceneMaterial::MuI(_) | SceneMaterial::Elastic(_) => None,
            },
            Model::Discs(_) => None,
        }
    }

    /// Simulated time (s).
    pub fn time(&self) -> f64 {
        self.step as f64 * self.scene.step
    }

    /// Frames up to now, including the initial one.
    pub fn frames_so_far(&self) -> usize {
        self.step / self.scene.steps_per_frame() + 1
    }
}

/// Name of the CPU backend.
fn cpu() -> String {
    format!("cpu, {} threads", rayon::current_num_threads())
}
