//! The RVE batch as a material of the MPM: every point carries its own packing.

use std::sync::Arc;
use std::time::{Duration, Instant};

use dem::{Packing, Real, Rve, RveBatch, RveParameters, RveState};
use mpm::{Mat2, Material, MaterialError};
use serde::{Deserialize, Serialize};

use crate::scene::Precision;

/// One packing per material point.
#[derive(Clone, Serialize, Deserialize)]
pub struct RveMaterial {
    /// The packings; on a GPU, as of the last checkpoint. Shared with the thread that writes it.
    #[serde(with = "shared")]
    pub(crate) batch: Arc<Batch>,
    /// State of each RVE after the last step.
    pub(crate) states: Vec<RveState>,
    /// Volume of a point (m² per metre of depth) over the area of its cell (m²).
    pub(crate) volume_per_area: Vec<f64>,
    /// Events at the limits of the method so far.
    pub tally: Tally,
    /// Wall time spent in the RVEs.
    #[serde(skip)]
    pub time: Duration,
}

/// The batch in the precision of the scene.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) enum Batch {
    F32(RveBatch<f32>),
    F64(RveBatch<f64>),
}

/// Serialises shared packings as the packings themselves.
mod shared {
    use super::{Arc, Batch, Deserialize, Serialize};

    pub fn serialize<S: serde::Serializer>(batch: &Arc<Batch>, to: S) -> Result<S::Ok, S::Error> {
        batch.as_ref().serialize(to)
    }

    pub fn deserialize<'de, D>(from: D) -> Result<Arc<Batch>, D::Error>
    where
        D: serde::Deserializer<'de>,
    {
        Batch::deserialize(from).map(Arc::new)
    }
}

/// Counts over all RVE steps (one RVE in one macro step) of events at the limits of the method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// RVE steps.
    pub steps: u64,
    /// RVE steps of stress-free packings.
    pub free_steps: u64,
    /// RVE steps in which a cell was too thin to be sheared further.
    pub thin_steps: u64,
    /// RVE steps in which a cell was too dense to be compressed further.
    pub dense_steps: u64,
    /// RVE steps with an overlap above the warning threshold.
    pub overlap_steps: u64,
    /// Neighbour searches.
    pub searches: u64,
    /// Largest overlap, in units of the smaller radius.
    pub max_overlap: f64,
    /// Smallest perpendicular cell width (m).
    pub min_width: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            steps: 0,
            free_steps: 0,
            thin_steps: 0,
            dense_steps: 0,
            overlap_steps: 0,
            searches: 0,
            max_overlap: 0.0,
            min_width: f64::INFINITY,
        }
    }
}

impl RveMaterial {
    /// RVEs that start as `packings[p]`, a packing and its kind, for points of `volume[p]` (m² per metre of depth).
    /// A stress-free RVE that is compressed again restarts from the packing in `fresh` of its kind.
    pub fn new(
        parameters: &RveParameters,
        precision: Precision,
        packings: &[(&Packing<f64>, usize)],
        fresh: &[&Packing<f64>],
        volume: &[f64],
    ) -> Self {
        let area = packings.iter().map(|(packing, _)| packing.cell.area());
        Self {
            volume_per_area: volume.iter().zip(area).map(|(v, a)| v / a).collect(),
            states: packings
                .iter()
                .map(|(packing, _)| RveState {
                    area: packing.cell.area(),
                    solid_fraction: packing.solid_fraction(),
                    coordination: 2.0 * packing.contacts().count() as f64
                        / packing.discs.len() as f64,
                    ..RveState::default()
                })
                .collect(),
            batch: Arc::new(match precision {
                Precision::F32 => Batch::F32(batch(parameters, packings, fresh)),
                Precision::F64 => Batch::F64(batch(parameters, packings, fresh)),
            }),
            tally: Tally::default(),
            time: Duration::ZERO,
        }
    }

    fn advance(&mut self, dt: f64, velocity_gradient: &[Mat2]) -> Result<(), MaterialError> {
        let states = &mut self.states;
        let failed = |point, reason: String| Err(MaterialError::Point { point, reason });
        let advanced = match Arc::make_mut(&mut self.batch) {
            Batch::F32(batch) => batch.advance(dt, velocity_gradient, states),
            Batch::F64(batch) => batch.advance(dt, velocity_gradient, states),
        };
        match advanced {
            Ok(()) => Ok(()),
            Err(dem::Error::Rve { rve, failure }) => failed(rve, failure.to_string()),
            Err(other) => Err(MaterialError::Other(Box::new(other))),
        }
    }

    /// Parameters of the packings.
    pub fn parameters(&self) -> &RveParameters {
        match self.batch.as_ref() {
            Batch::F32(batch) => &batch.parameters,
            Batch::F64(batch) => &batch.parameters,
        }
    }

    /// State of each RVE after the last step, compression positive.
    pub fn states(&self) -> &[RveState] {
        &self.states
    }
}

fn batch<R: Real>(
    parameters: &RveParameters,
    packings: &[(&Packing<f64>, usize)],
    fresh: &[&Packing<f64>],
) -> RveBatch<R> {
    let inertial = |packing: &Packing<f64>| {
        let mut packing: Packing<R> = packing.convert();
        packing.scale_mass(parameters.grains.mass_scale);
        packing
    };
    RveBatch {
        parameters: parameters.clone(),
        rves: packings
            .iter()
            .map(|&(packing, kind)| Rve { kind: kind as u32, ..Rve::new(inertial(packing)) })
            .collect(),
        fresh: fresh.iter().map(|packing| inertial(packing)).collect(),
    }
}

impl Material for RveMaterial {
    fn update(
        &mut self,
        dt: f64,
        velocity_gradient: &[Mat2],
        stress: &mut [Mat2],
        volume: &mut [f64],
    ) -> Result<(), MaterialError> {
        let start = Instant::now();
        self.advance(dt, velocity_gradient)?;
        for (p, state) in self.states.iter().enumerate() {
            // Compression is positive in the RVE, tension in the MPM.
            stress[p] = -state.stress;
            // The RVE's cell is the one source of truth for volume.
            volume[p] = self.volume_per_area[p] * state.area;
        }
        let warning = self.parameters().grains.overlap_warning;
        self.states.iter().for_each(|state| self.tally.add(state, warning));
        self.time += start.elapsed();
        Ok(())
    }

    /// Mean-field (Voigt) P-wave modulus of isotropic fabric (Pa):
    /// `M = (2 Z phi / pi) (3 kn + kt) / (8 t)`. The relaxed modulus is lower, but within one
    /// step the packing answers with this one.
    fn wave_modulus(&self, point: usize) -> f64 {
        let p = self.parameters();
        let state = &self.states[point];
        let contacts = 2.0 * state.coordination * state.solid_fraction / std::f64::consts::PI;
        contacts * (3.0 * p.grains.normal_stiffness + p.grains.tangential_stiffness)
            / (8.0 * p.grains.thickness)
    }
}

impl Tally {
    fn add(&mut self, state: &RveState, overlap_warning: f64) {
        self.steps += 1;
        self.searches += u64::from(state.searches);
        if state.free {
            self.free_steps += 1;
            return;
        }
        self.thin_steps += u64::from(state.thin);
        self.dense_steps += u64::from(state.dense);
        self.overlap_steps += u64::from(state.relative_overlap > overlap_warning);
        self.max_overlap = self.max_overlap.max(state.relative_overlap);
        self.min_width = self.min_width.min(state.min_width);
    }
}
