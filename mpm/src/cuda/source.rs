//! The CUDA C++ of all kernels: one module, in which every file sees the ones before it.

use gpu::{checks, definitions, files};

use super::abi::{
    Approach, Bins, Clock, Fault, Matrix, Mpm, Obstacle, Phase, Placed, Stencil, Vector,
};
use super::bins::{EvaluateBasis, SortBins};
use super::budget::{SUM_THREADS, SumLedger};
use super::cell_average::{CellAverage, CellPush, CellSort, CellSums};
use super::density::CorrectDensity;
use super::drucker_prager::{DruckerPragerLaw, DruckerPragerUpdate};
use super::elastic::ElasticUpdate;
use super::g2p::G2p;
use super::obstacle::BeginStep;
use super::p2g::{P2g, P2gInternalForce, P2gMassAndMomentum, P2gVelocity};
use super::velocity_gradient::VelocityGradient;
use crate::basis::{Basis, GIMP_HALF_SIZE};
use crate::density::SLACK;
use crate::grid::GHOSTS;
use crate::numerics::{Numerics, WallContact};

const FILES: &str = files!(
    "basis.cu",
    "bins.cu",
    "obstacle.cu",
    "boundary.cu",
    "grid_update.cu",
    "p2g.cu",
    "confine.cu",
    "g2p.cu",
    "velocity_gradient.cu",
    "cell_average.cu",
    "density.cu",
    "budget.cu",
    "material.cu",
    "elastic.cu",
    "drucker_prager.cu"
);

/// Types and functions that kernels of other crates may use; needs [`defines`].
pub fn header() -> String {
    let structs = definitions![
        Vector, Matrix, Stencil, Obstacle, Placed, Approach, Bins, Clock, Phase, Fault, Mpm
    ];
    structs + files!("mpm.cuh")
}

/// The kernels of the solver and of the materials of this crate.
pub fn source() -> String {
    let checks = checks![
        BeginStep,
        EvaluateBasis,
        SortBins,
        P2g,
        P2gMassAndMomentum,
        P2gInternalForce,
        P2gVelocity,
        G2p,
        VelocityGradient,
        CellPush,
        CellSort,
        CellSums,
        CellAverage,
        CorrectDensity,
        SumLedger,
        ElasticUpdate,
        DruckerPragerUpdate,
    ];
    [&header(), &definitions![DruckerPragerLaw], FILES, &checks].concat()
}

/// Preprocessor definitions for the sources.
pub fn defines(numerics: &Numerics) -> Vec<String> {
    let basis = numerics.basis;
    let number = match basis {
        Basis::Linear => 0,
        Basis::Gimp => 1,
        Basis::Quadratic => 2,
        Basis::Cubic => 3,
    };
    let width = basis.width();
    [
        ("BASIS", number),
        ("WIDTH", width),
        ("WALLS_WAIT", usize::from(numerics.wall_contact == WallContact::Points)),
        ("GHOSTS", GHOSTS),
        ("SUM_THREADS", SUM_THREADS as usize),
        ("STENCIL_BYTES", super::abi::stencil_bytes(width)),
    ]
    .map(|(name, value)| format!("{name}={value}"))
    .into_iter()
    .chain([format!("GIMP_HALF_SIZE={GIMP_HALF_SIZE:?}"), format!("DENSITY_SLACK={SLACK:?}")])
    .collect()
}
