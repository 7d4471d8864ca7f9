//! The CUDA C++ of all kernels: one module, in which every file sees the ones before it.

use super::solver::SUM_THREADS;
use super::view::{DeviceView, OBSTACLE, PLACED, stencil_bytes};
use crate::basis::GIMP_HALF_SIZE;
use crate::grid::GHOSTS;
use crate::{Basis, Numerics, WallContact};

macro_rules! concatenated {
    ($($file:literal),*) => {
        concat!($("#line 1 \"", $file, "\"\n", include_str!($file)),*)
    };
}

/// Types and functions that kernels of other crates may use; needs [`defines`].
pub const HEADER: &str = concatenated!("mpm.cuh");

/// The kernels of the solver and of the materials of this crate.
pub const SOURCE: &str = concatenated!(
    "mpm.cuh",
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
    "budget.cu",
    "material.cu",
    "elastic.cu",
    "drucker_prager.cu"
);

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
        ("POINTS_MEET_WALLS", usize::from(numerics.wall_contact == WallContact::Points)),
        ("GHOSTS", GHOSTS),
        ("SUM_THREADS", SUM_THREADS),
        ("STENCIL_BYTES", stencil_bytes(width)),
        ("OBSTACLE_BYTES", OBSTACLE * size_of::<f64>()),
        ("PLACED_BYTES", PLACED * size_of::<f64>()),
        ("MPM_BYTES", size_of::<DeviceView>()),
    ]
    .map(|(name, value)| format!("{name}={value}"))
    .into_iter()
    .chain([format!("GIMP_HALF_SIZE={GIMP_HALF_SIZE:?}")])
    .collect()
}
