//! Constants and control of an assembly, and the memory it takes.

use super::abi::{
    Binned, Control, Disc, History, Loss, NEAR_BODIES, Output, Parameters, Position, RareLoss,
    STEPS,
};
use super::grid::Grid;
use crate::assembly::Assembly;
use crate::cuda::real::CudaReal;

impl<R: CudaReal> Control<R> {
    /// A sequence of `target` steps from `time` (s) on.
    pub fn sequence(time: f64, target: u32, searches: u32, overlap: f64) -> Self {
        Self {
            time,
            failed: u64::MAX,
            steps: 0,
            target,
            done: 0,
            searches,
            searched: 0,
            unused: 0,
            overlap: R::from_f64(overlap).to_bits(),
            moved: [R::Fraction::default(); STEPS + 1],
        }
    }

    /// Largest overlap over the smaller radius.
    pub fn overlap(&self) -> f64 {
        R::from_bits(self.overlap).to_f64()
    }
}

/// The constants of an assembly.
pub(super) fn parameters<R: CudaReal>(
    assembly: &Assembly<R>,
    grid: &Grid,
    bodies: usize,
) -> Parameters<R> {
    let (grains, dt) = (&assembly.grains, assembly.dt());
    let unit = assembly.region.unit::<R>();
    let kt = grains.tangential_stiffness;
    let moving = assembly.bodies.iter().any(|body| body.velocity != [0.0; 2]);
    let real = R::from_f64;
    Parameters {
        dt,
        origin: assembly.region.origin,
        side: assembly.region.side,
        step: real(dt),
        normal_stiffness: real(grains.normal_stiffness),
        spring: real(kt * dt),
        compliance: real(0.5 / (kt * dt)),
        dashpot: real(2.0 * grains.damping_ratio * grains.normal_stiffness.sqrt()),
        friction: real(grains.friction),
        local_damping: real(grains.local_damping),
        drag: real(assembly.drag),
        gravity: assembly.gravity.map(real),
        unit: real(unit),
        per_unit: real(dt / unit),
        skin: real(grid.skin),
        allowed: real(0.5 * grid.skin),
        overlap_limit: real(grains.overlap_limit),
        discs: assembly.discs.len() as u32,
        bodies: bodies as u32,
        bins: grid.bins,
        tiles: grid.tiles,
        capacity: grid.capacity,
        bodies_move: u32::from(moving),
    }
}

/// Device memory that `discs` discs take (bytes).
pub(super) fn bytes<R: CudaReal>(discs: usize, grid: &Grid) -> usize {
    let rows = grid.rows as usize;
    let contact = size_of::<u32>() + size_of::<History<R>>();
    let bodies = NEAR_BODIES * size_of::<History<R>>() + size_of::<u32>();
    let disc = 2 * size_of::<Disc<R>>() + size_of::<u32>() + rows * contact + bodies;
    let losses = size_of::<Loss<R>>() + size_of::<RareLoss<R>>();
    let once = size_of::<Position<R>>() + size_of::<Output<R>>() + 2 * size_of::<u32>() + losses;
    let bin = 3 * size_of::<u32>() + grid.capacity as usize * size_of::<Binned<R>>();
    discs * (2 * disc + once) + grid.count() * bin
}
