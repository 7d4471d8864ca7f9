//! Discs as the model of a scene.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use dem::assembly::{Assembly, Boundary};
use dem::{Grains, Real};
use mpm::{Points, Vec2};
use serde::{Deserialize, Serialize};

use super::columns::filled;
use super::means::{PointMeans, Surroundings};
use super::members::Members;
use super::scene_assembly::SceneAssembly;
use crate::scene::{Discs, Precision, Scene};
use crate::simulation::error::SimulationError;
use crate::simulation::span::Span;

/// The discs of a scene.
pub struct DiscModel {
    state: DiscState,
    grains: Grains,
    substeps: usize,
    /// Wall time spent on means.
    averaging: Duration,
}

/// What a checkpoint holds of them.
#[derive(Clone, Serialize, Deserialize)]
pub struct DiscState {
    assembly: SceneAssembly,
    members: Members,
    /// Means over the grains of points, as of the last frame.
    means: PointMeans,
    /// Energy at time zero (J).
    start_energy: f64,
}

impl DiscModel {
    /// Fills the columns of a scene with discs at time zero, and sets the points to the means over them.
    pub(in crate::simulation) fn new(
        scene: &Scene,
        discs: &Discs,
        points: &mut Points,
    ) -> Result<Self, SimulationError> {
        let boundary = scene.boundary(discs);
        let (assembly, members) = match discs.precision {
            Precision::F32 => {
                let (assembly, members) = assemble(scene, discs, &boundary)?;
                (SceneAssembly::F32(assembly), members)
            }
            Precision::F64 => {
                let (assembly, members) = assemble(scene, discs, &boundary)?;
                (SceneAssembly::F64(assembly), members)
            }
        };
        if let Some(point) = members.first_empty() {
            let position = points.position[point].into();
            return Err(SimulationError::Empty { point, position });
        }
        let start_energy = assembly.energy().total();
        let state = DiscState { assembly, members, means: PointMeans::default(), start_energy };
        let mut model = Self::with(scene, discs.grains.clone(), state);
        model.update(scene, 0, points);
        Ok(model)
    }

    /// The discs in the state of a checkpoint.
    pub(in crate::simulation) fn resume(scene: &Scene, discs: &Discs, state: DiscState) -> Self {
        Self::with(scene, discs.grains.clone(), state)
    }

    fn with(scene: &Scene, grains: Grains, state: DiscState) -> Self {
        let substeps = grains.substeps(scene.step);
        Self { state, grains, substeps, averaging: Duration::ZERO }
    }

    /// The state for a checkpoint.
    pub(in crate::simulation) fn state(&self) -> &DiscState {
        &self.state
    }

    /// Means over the grains of points, as of the last frame.
    pub(in crate::simulation) fn means(&self) -> &PointMeans {
        &self.state.means
    }

    /// Advances by a macro step; at a frame, points follow. Returns the steps made and the time they took.
    pub(in crate::simulation) fn advance(
        &mut self,
        span: &Span,
        scene: &Scene,
        points: &mut Points,
    ) -> Result<(usize, Duration), SimulationError> {
        let start = Instant::now();
        self.state.assembly.advance(span.first as f64 * span.dt, self.substeps)?;
        if span.to_frame == 1 {
            self.update(scene, span.first + 1, points);
        }
        Ok((1, start.elapsed()))
    }

    /// Brings points up to date at a step.
    fn update(&mut self, scene: &Scene, step: usize, points: &mut Points) {
        let start = Instant::now();
        let time = step as f64 * scene.step;
        let corners = |o: mpm::Obstacle| [o.min.into(), o.max.into()];
        let around = Surroundings {
            size: scene.domain.size,
            boxes: scene.rigid_boxes().into_iter().map(|o| corners(o.at(time))).collect(),
            thickness: self.grains.thickness,
            width: self.grains.mean_diameter(),
        };
        let states = self.state.assembly.states();
        self.state.means = PointMeans::update(&self.state.members, &states, &around, points);
        self.averaging += start.elapsed();
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
        let discs = self.state.assembly.len() as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let total = |k: usize| points.stress.iter().map(|s| s[(k, k)]).sum::<f64>();
        BTreeMap::from([
            ("discs".to_owned(), discs),
            ("discs_thickness".to_owned(), self.grains.thickness),
            ("discs_substeps".to_owned(), self.substeps as f64),
            ("start_solid_fraction".to_owned(), mean(&self.state.means.solid_fraction)),
            ("start_coordination".to_owned(), mean(&self.state.means.coordination)),
            ("start_K0".to_owned(), total(0) / total(1)),
        ])
    }

    /// Energies per metre of depth and momentum.
    pub(in crate::simulation) fn budget(&self, points: &Points) -> BTreeMap<String, f64> {
        let energy = self.state.assembly.energy();
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
            ("energy_drift", energy.total() - self.state.start_energy),
        ];
        let per_metre = energies.map(|(name, e)| (name.to_owned(), e / self.grains.thickness));
        let mut scalars = BTreeMap::from(per_metre);
        scalars.insert("momentum_x".to_owned(), momentum.x);
        scalars.insert("momentum_y".to_owned(), momentum.y);
        scalars
    }

    /// Number of discs.
    pub fn discs(&self) -> usize {
        self.state.assembly.len()
    }

    /// The grains and their contact law.
    pub fn grains(&self) -> &Grains {
        &self.grains
    }

    /// DEM steps so far.
    pub fn steps(&self) -> u64 {
        self.state.assembly.steps()
    }

    /// Searches for neighbours so far.
    pub fn searches(&self) -> u64 {
        self.state.assembly.searches()
    }

    /// Largest overlap so far, over the smaller radius.
    pub fn max_overlap(&self) -> f64 {
        self.state.assembly.max_overlap()
    }
}

/// All columns filled, and which grains belong to which point.
fn assemble<R: Real>(
    scene: &Scene,
    discs: &Discs,
    boundary: &Boundary,
) -> Result<(Assembly<R>, Members), SimulationError> {
    let (packed, columns) = filled::<R>(scene, discs, boundary)?;
    let dt = scene.step / discs.grains.substeps(scene.step) as f64;
    let assembly = Assembly::new(&discs.grains, boundary, scene.gravity, dt, &packed)?;
    Ok((assembly, Members::new(scene, &columns)))
}
