//! Discs as the model of a scene.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;
use std::time::{Duration, Instant};

use dem::Grains;
use dem::assembly::{Assembly, Energy, GrainState, Members, Sleep, Surroundings};
use dem::cuda::CudaReal;
use gpu::Device;
use gpu::ranks::Ranks;
use mpm::{Points, Vec2};
use serde::{Deserialize, Serialize};

use super::columns::filled;
use super::grid;
use super::means::PointMeans;
use super::members::members;
use super::running::{Frame, Running, SceneAssembly, extents, front_of};
use crate::memory;
use crate::scene::{Discs, Precision, Scene};
use crate::simulation::error::SimulationError;
use crate::simulation::span::Span;
use crate::trajectory::{GrainFrame, GridFrame, StaticGrains, StaticGrid};

/// The discs of a scene.
pub struct DiscModel {
    discs: Box<dyn Running>,
    members: Members,
    grains: Grains,
    /// DEM steps in a macro step.
    substeps: usize,
    /// Means over the grains of points, as of the last frame.
    means: PointMeans,
    /// Grains as of the last frame; on a GPU, if the scene asks for them or for their fields.
    states: Vec<GrainState>,
    /// The foremost x (m) connected to the pile, as of the last frame.
    connected_front: f64,
    /// Energy at time zero, and as of the last frame (J).
    start_energy: f64,
    energy: Energy,
    /// DEM steps up to the last frame.
    steps: usize,
    /// Wall time spent on means.
    averaging: Duration,
}

/// What a checkpoint holds of them.
#[derive(Clone, Serialize, Deserialize)]
pub struct DiscState {
    assembly: SceneAssembly,
    members: Members,
    means: PointMeans,
    start_energy: f64,
}

impl DiscModel {
    /// Fills the columns of a scene with discs at time zero, on a GPU if one is given, together
    /// with other ranks, and sets the points to
    /// the means over them.
    pub(in crate::simulation) fn new(
        scene: &Scene,
        discs: &Discs,
        points: &mut Points,
        device: Option<&Arc<Device>>,
        ranks: Option<&Ranks>,
    ) -> Result<Self, SimulationError> {
        check_memory(discs, discs.count_in(scene.point_area() * points.len() as f64))?;
        let (assembly, members) = match discs.precision {
            Precision::F32 => assemble::<f32>(scene, discs, device, ranks)?,
            Precision::F64 => assemble::<f64>(scene, discs, device, ranks)?,
        };
        if let Some(point) = members.first_empty() {
            let position = points.position[point].into();
            return Err(SimulationError::Empty { point, position });
        }
        let (means, start_energy) = (PointMeans::default(), 0.0);
        let mut model =
            Self::of(scene, discs, DiscState { assembly, members, means, start_energy });
        model.update(scene, 0, points)?;
        model.start_energy = model.energy.total();
        // A part of the preparation.
        model.averaging = Duration::ZERO;
        Ok(model)
    }

    /// The discs in the state of a checkpoint.
    pub(in crate::simulation) fn resume(
        scene: &Scene,
        discs: &Discs,
        state: DiscState,
    ) -> Result<Self, SimulationError> {
        let mut model = Self::of(scene, discs, state);
        (model.states, model.energy) = model.discs.states();
        model.connected_front = front_of(extents(&model.states), discs.grains.mean_diameter());
        Ok(model)
    }

    /// The discs in a state, before their means are known.
    fn of(scene: &Scene, discs: &Discs, state: DiscState) -> Self {
        Self {
            discs: state.assembly.running(),
            members: state.members,
            grains: discs.grains.clone(),
            substeps: discs.grains.substeps(scene.step),
            means: state.means,
            states: Vec::new(),
            connected_front: f64::NAN,
            start_energy: state.start_energy,
            energy: Energy::default(),
            steps: 0,
            averaging: Duration::ZERO,
        }
    }

    /// The state for a checkpoint, as of the last call of [`Self::record`].
    pub(in crate::simulation) fn state(&self) -> DiscState {
        DiscState {
            assembly: self.discs.recorded(),
            members: self.members.clone(),
            means: self.means.clone(),
            start_energy: self.start_energy,
        }
    }

    /// Brings the state up to date for a checkpoint.
    pub(in crate::simulation) fn record(&mut self) -> Result<(), SimulationError> {
        self.discs.record()
    }

    /// Advances on a GPU from now on; as one of several ranks, a part of the discs.
    pub(in crate::simulation) fn move_to(
        &mut self,
        device: &Arc<Device>,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<(), SimulationError> {
        self.discs.move_to(device, ranks, &self.members)
    }

    /// Whether points and frames follow the discs; of several ranks only those of the first do.
    pub(in crate::simulation) fn has_frames(&self) -> bool {
        self.discs.has_states()
    }

    /// Means over the grains of points, as of the last frame.
    pub(in crate::simulation) fn means(&self) -> &PointMeans {
        &self.means
    }

    /// Advances by a macro step on the CPU, or to the next frame on a GPU; at a frame, points follow. Returns the
    /// steps made and the time they took.
    pub(in crate::simulation) fn advance(
        &mut self,
        span: &Span,
        scene: &Scene,
        points: &mut Points,
    ) -> Result<(usize, Duration), SimulationError> {
        let start = Instant::now();
        let frame = self.frame(scene, span.first + span.to_frame);
        let steps = self.discs.advance(span, self.substeps, &frame)?;
        if steps == span.to_frame && self.has_frames() {
            self.update(scene, span.first + steps, points)?;
        }
        Ok((steps, start.elapsed()))
    }

    /// Brings points and energy up to date at a step.
    fn update(
        &mut self,
        scene: &Scene,
        step: usize,
        points: &mut Points,
    ) -> Result<(), SimulationError> {
        let start = Instant::now();
        let summary = self.discs.summary(&self.members, &self.frame(scene, step))?;
        self.means = PointMeans::update(&summary.means, points);
        self.connected_front = summary.front;
        self.states = summary.states;
        self.energy = summary.energy;
        self.steps = step * self.substeps;
        self.averaging += start.elapsed();
        Ok(())
    }

    /// What is wanted of the grains after a step.
    fn frame(&self, scene: &Scene, step: usize) -> Frame {
        let kept = scene.grains_every > 0 || scene.grid.is_some();
        Frame { around: self.surroundings(scene, step), kept }
    }

    /// What surrounds the grains at a step.
    fn surroundings(&self, scene: &Scene, step: usize) -> Surroundings {
        let time = step as f64 * scene.step;
        let corners = |o: mpm::Obstacle| [o.min.into(), o.max.into()];
        Surroundings {
            size: scene.domain.size,
            boxes: scene.rigid_boxes().into_iter().map(|o| corners(o.at(time))).collect(),
            thickness: self.grains.thickness,
            width: self.grains.mean_diameter(),
        }
    }

    /// Properties of the grains that never change, with the column of every point.
    pub(in crate::simulation) fn static_grains(
        &self,
        every: usize,
        column: &[u32],
    ) -> StaticGrains {
        let point = self.members.point_of();
        StaticGrains {
            every,
            radius: self.states.iter().map(|grain| grain.r as f32).collect(),
            column: point.iter().map(|&p| column[p as usize]).collect(),
            point,
        }
    }

    /// The grains as of the last frame.
    pub(in crate::simulation) fn grain_frame(&self) -> GrainFrame {
        let volume = |r: f64| PI * r * r * self.grains.thickness;
        let pressure = |g: &GrainState| (0.5 * g.virial.trace() / volume(g.r)) as f32;
        GrainFrame {
            position: self.states.iter().map(|grain| grain.x.map(|x| x as f32)).collect(),
            velocity: self.states.iter().map(|grain| grain.v.map(|v| v as f32)).collect(),
            pressure: self.states.iter().map(pressure).collect(),
        }
    }

    /// The foremost x (m) connected to the pile, as of the last frame.
    pub(in crate::simulation) fn connected_front(&self) -> f64 {
        self.connected_front
    }

    /// The continuum fields at the nodes of a grid, as of the last frame.
    pub(in crate::simulation) fn grid_frame(&self, nodes: &StaticGrid) -> GridFrame {
        grid::fields(&self.states, self.grains.thickness, nodes)
    }

    /// The phases of the wall time since the last call.
    pub(in crate::simulation) fn phases(
        &mut self,
        advancing: Duration,
    ) -> [(&'static str, Duration); 2] {
        let averaging = std::mem::take(&mut self.averaging);
        [("dem", advancing.saturating_sub(averaging)), ("means", averaging)]
    }

    /// Numbers of the header: discs, their steps, and their state at the start.
    pub(in crate::simulation) fn parameters(&self, points: &Points) -> BTreeMap<String, f64> {
        let discs = self.discs.len() as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let total = |k: usize| points.stress.iter().map(|s| s[(k, k)]).sum::<f64>();
        BTreeMap::from([
            ("discs".to_owned(), discs),
            ("discs_thickness".to_owned(), self.grains.thickness),
            ("discs_substeps".to_owned(), self.substeps as f64),
            ("start_solid_fraction".to_owned(), mean(&self.means.solid_fraction)),
            ("start_coordination".to_owned(), mean(&self.means.coordination)),
            ("start_K0".to_owned(), total(0) / total(1)),
        ])
    }

    /// Energies per metre of depth and momentum.
    pub(in crate::simulation) fn budget(&self, points: &Points) -> BTreeMap<String, f64> {
        let energy = self.energy;
        let losses = energy.losses;
        let momentum: Vec2 = points.velocity.iter().zip(&points.mass).map(|(v, m)| v * *m).sum();
        let energies = [
            ("kinetic_energy", energy.kinetic),
            ("potential_energy", energy.potential),
            ("elastic_energy", energy.elastic),
            ("dashpot_loss", losses.dashpots),
            ("friction_loss", losses.friction),
            ("damping_loss", losses.damping),
            ("plate_work", losses.boxes),
            ("energy_drift", energy.total() - self.start_energy),
        ];
        let per_metre = energies.map(|(name, e)| (name.to_owned(), e / self.grains.thickness));
        let mut scalars = BTreeMap::from(per_metre);
        scalars.insert("disc_steps".to_owned(), self.disc_steps());
        scalars.insert("sleep_audit".to_owned(), self.audit());
        scalars.insert("momentum_x".to_owned(), momentum.x);
        scalars.insert("momentum_y".to_owned(), momentum.y);
        scalars
    }

    /// Number of discs.
    pub fn discs(&self) -> usize {
        self.discs.len()
    }

    /// The grains and their contact law.
    pub fn grains(&self) -> &Grains {
        &self.grains
    }

    /// DEM steps in a macro step.
    pub fn substeps(&self) -> usize {
        self.substeps
    }

    /// Searches for neighbours so far.
    pub fn searches(&self) -> u64 {
        self.discs.searches()
    }

    /// DEM steps of single discs up to the last frame, without those left out where grains sleep.
    pub fn disc_steps(&self) -> f64 {
        (self.steps * self.discs.len()) as f64 - self.discs.skipped() as f64
    }

    /// Largest displacement (m) of a grain that was computed to see what sleep misses.
    pub fn audit(&self) -> f64 {
        self.discs.audit()
    }

    /// Largest overlap so far, over the smaller radius.
    pub fn max_overlap(&self) -> f64 {
        self.discs.max_overlap()
    }
}

/// All columns filled, and which grains belong to which point.
fn assemble<R: CudaReal>(
    scene: &Scene,
    discs: &Discs,
    device: Option<&Arc<Device>>,
    ranks: Option<&Ranks>,
) -> Result<(SceneAssembly, Members), SimulationError>
where
    SceneAssembly: From<Assembly<R>>,
{
    let boundary = scene.boundary(discs);
    let (packed, columns) = filled::<R>(scene, discs, &boundary, device, ranks)?;
    let dt = scene.step / discs.grains.substeps(scene.step) as f64;
    let mut assembly = Assembly::<R>::new(&discs.grains, &boundary, scene.gravity, dt, &packed)?;
    if discs.sleep {
        assembly.set_sleep(Sleep::of(&discs.grains, scene.gravity, scene.seed as u32));
    }
    Ok((assembly.into(), members(scene, &columns)))
}

/// Refuses more discs than the memory of this machine holds.
fn check_memory(discs: &Discs, count: f64) -> Result<(), SimulationError> {
    let needed = discs.memory(count);
    match memory::available() {
        Some(available) if needed > available => {
            Err(SimulationError::Memory { discs: count, needed, available })
        }
        _ => Ok(()),
    }
}
