//! The kernels of a step, loaded.

use std::sync::Arc;

use gpu::{Device, Function};

use super::bins::{EvaluateBasis, SortBins};
use super::budget::SumLedger;
use super::cell_average::{CellAverage, CellPush, CellSort, CellSums};
use super::density::CorrectDensity;
use super::error::CudaError;
use super::g2p::G2p;
use super::obstacle::BeginStep;
use super::p2g::{P2g, P2gInternalForce, P2gMassAndMomentum, P2gVelocity};
use super::source::{defines, source};
use super::velocity_gradient::VelocityGradient;
use crate::Numerics;

/// All kernels of the solver for one choice of [`Numerics`].
pub(super) struct Kernels {
    pub begin_step: Function<BeginStep>,
    pub evaluate_basis: Function<EvaluateBasis>,
    pub sort_bins: Function<SortBins>,
    pub p2g: Function<P2g>,
    pub p2g_mass_and_momentum: Function<P2gMassAndMomentum>,
    pub p2g_internal_force: Function<P2gInternalForce>,
    pub p2g_velocity: Function<P2gVelocity>,
    pub g2p: Function<G2p>,
    pub velocity_gradient: Function<VelocityGradient>,
    pub cell_push: Function<CellPush>,
    pub cell_sort: Function<CellSort>,
    pub cell_sums: Function<CellSums>,
    pub cell_average: Function<CellAverage>,
    pub correct_density: Function<CorrectDensity>,
    pub sum_ledger: Function<SumLedger>,
}

impl Kernels {
    pub fn load(device: &Arc<Device>, numerics: &Numerics) -> Result<Self, CudaError> {
        let module = device.module("mpm.cu", &source(), &defines(numerics))?;
        Ok(Self {
            begin_step: Function::load(device, &module)?,
            evaluate_basis: Function::load(device, &module)?,
            sort_bins: Function::load(device, &module)?,
            p2g: Function::load(device, &module)?,
            p2g_mass_and_momentum: Function::load(device, &module)?,
            p2g_internal_force: Function::load(device, &module)?,
            p2g_velocity: Function::load(device, &module)?,
            g2p: Function::load(device, &module)?,
            velocity_gradient: Function::load(device, &module)?,
            cell_push: Function::load(device, &module)?,
            cell_sort: Function::load(device, &module)?,
            cell_sums: Function::load(device, &module)?,
            cell_average: Function::load(device, &module)?,
            correct_density: Function::load(device, &module)?,
            sum_ledger: Function::load(device, &module)?,
        })
    }
}
