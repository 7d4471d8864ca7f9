//! Constants and control of an assembly, and the memory it takes.

use super::abi::{
    Binned, Control, Disc, History, Loss, NEAR_BODIES, Output, Parameters, Position, RareLoss,
    STEPS,
};
use super::grid::{Grid, row_length};
use crate::assembly::Assembly;
use crate::cuda::real::CudaReal;

impl<R: CudaReal> Control<R> {
    /// A sequence of `steps` steps from `time` (s) on, after the sequence `last`.
    pub fn sequence(time: f64, steps: u32, last: Option<&Self>) -> Self {
        // Steps of even number read the first buffer.
        let first = last.map_or(0, |last| last.steps & 1);
        Self {
            time,
            failed: u64::MAX,
            steps: first,
            target: first + steps,
            done: 0,
            // Which set of counts is empty.
            searches: last.map_or(0, |last| last.searches & 1),
            searched: first,
            first,
            rounds: 0,
            unused: 0,
            overlap: last.map_or(R::default().to_bits(), |last| last.overlap),
            drift: R::Fraction::default(),
            moved: [R::Fraction::default(); STEPS + 1],
        }
    }

    /// Steps that were made.
    pub fn made(&self) -> u32 {
        self.steps - self.first
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
    let (kt, kr) = (grains.tangential_stiffness, grains.rolling_stiffness);
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
        margin: R::Fraction::default(),
        discs: assembly.discs.len() as u32,
        row: row_length(assembly.discs.len()) as u32,
        ahead: if assembly.discs.len() > CACHED { AHEAD } else { 0 },
        ranked: 0,
        own: [0, assembly.discs.len() as u32],
        window: [0, assembly.discs.len() as u32],
        bodies: bodies as u32,
        bins: grid.bins,
        tiles: grid.tiles,
        capacity: grid.capacity,
        bodies_move: u32::from(moving),
        rolling_friction: real(grains.rolling_friction),
        rolling_spring: real(kr * dt),
        rolling_compliance: real(0.5 / (kr * dt)),
        rolling_dashpot: real((kr / grains.normal_stiffness).sqrt()),
    }
}

/// Discs whose state stays in the L2 cache from step to step: 50 MB, at some 200 bytes.
const CACHED: usize = 250_000;
/// What the blocks advance in a microsecond, which memory takes to answer, several times over.
const AHEAD: u32 = 32_768;

/// Device memory that `discs` discs take (bytes).
pub(super) fn bytes<R: CudaReal>(discs: usize, grid: &Grid) -> usize {
    let rows = grid.rows as usize;
    let history = grid.histories() * size_of::<History<R>>();
    let contact = size_of::<u32>() + history;
    let bodies = NEAR_BODIES * history + size_of::<u32>();
    let disc = 2 * size_of::<Disc<R>>() + size_of::<u32>() + rows * contact + bodies;
    let discs = row_length(discs);
    let losses = size_of::<Loss<R>>() + size_of::<RareLoss<R>>();
    let once = size_of::<Position<R>>()
        + size_of::<R::Fraction>()
        + size_of::<Output<R>>()
        + 2 * size_of::<u32>()
        + losses;
    let bin = 3 * size_of::<u32>() + grid.capacity as usize * size_of::<Binned<R>>();
    discs * (2 * disc + once) + grid.count() * bin
}
