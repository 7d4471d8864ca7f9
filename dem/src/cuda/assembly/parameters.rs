//! Constants and control of an assembly, and the memory it takes.

use super::abi::{
    Binned, Control, Disc, History, Loss, NEAR_BODIES, Output, Parameters, Position, Rest, STEPS,
};
use super::grid::{Grid, row_length};
use super::losses::units_per_joule;
use crate::assembly::{Assembly, Sleep};
use crate::cuda::real::CudaReal;
use crate::cuda::shape::WARP;

impl<R: CudaReal> Control<R> {
    /// A sequence of `steps` steps from `time` (s) on, after the sequence `last`.
    pub fn sequence(time: f64, steps: u32, last: Option<&Self>) -> Self {
        // Steps of even number read the first buffer.
        let first = last.map_or(0, |last| last.steps & 1);
        Self {
            time,
            failed: u64::MAX,
            skipped: 0,
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
            audit: last.map_or(R::default().to_bits(), |last| last.audit),
            moved: [R::Fraction::default(); STEPS + 1],
        }
    }

    /// Steps that were made.
    pub fn made(&self) -> u32 {
        self.steps - self.first
    }

    /// Largest displacement of a disc that was computed though it would be held (m).
    pub fn audit(&self) -> f64 {
        R::from_bits(self.audit).to_f64().sqrt()
    }

    /// Largest overlap over the smaller radius.
    pub fn overlap(&self) -> f64 {
        R::from_bits(self.overlap).to_f64()
    }
}

impl<R: CudaReal> Parameters<R> {
    /// Sets the part of the skin up to which a disc counts as not moved: so much older than a list may a reference be.
    pub fn set_stayed(&mut self, part: f64) {
        let skin = self.skin.to_f64();
        self.stayed = R::from_f64(part * skin);
        self.allowed = R::from_f64((0.5 - part) * skin);
    }
}

/// The constants of an assembly.
pub(super) fn parameters<R: CudaReal>(
    assembly: &Assembly<R>,
    grid: &Grid,
    bodies: usize,
    sleep: Option<&Sleep>,
) -> Parameters<R> {
    let (grains, dt) = (&assembly.grains, assembly.dt());
    let unit = assembly.region.unit::<R>();
    let (kt, kr) = (grains.tangential_stiffness, grains.rolling_stiffness);
    let moving = assembly.bodies.iter().any(|body| body.velocity != [0.0; 2]);
    let real = R::from_f64;
    let discs = assembly.discs.len();
    let all = [0, discs as u32];
    let mut p = Parameters {
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
        allowed: R::default(),
        stayed: R::default(),
        overlap_limit: real(grains.overlap_limit),
        per_joule: real(units_per_joule(grains)),
        margin: R::Fraction::default(),
        discs: discs as u32,
        row: row_length(discs) as u32,
        ahead: if discs > CACHED { AHEAD } else { 0 },
        ranked: 0,
        own: all,
        window: all,
        bodies: bodies as u32,
        bins: grid.bins,
        tiles: grid.tiles,
        capacity: grid.capacity,
        bodies_move: u32::from(moving),
        rolling_friction: real(grains.rolling_friction),
        rolling_spring: real(kr * dt),
        rolling_compliance: real(0.5 / (kr * dt)),
        rolling_dashpot: real((kr / grains.normal_stiffness).sqrt()),
        sleep_distance: real(sleep.map_or(0.0, |sleep| sleep.distance)),
        sleep_speed: real(sleep.map_or(0.0, |sleep| sleep.speed)),
        sleep_force: real(sleep.map_or(0.0, |sleep| sleep.force)),
        weight: real(assembly.gravity[0].hypot(assembly.gravity[1])),
        sleep_looks: sleep.map_or(0, |sleep| sleep.looks(dt)),
        patches: sleep.map_or(1, |sleep| sleep.patches(assembly.region.side) as u32),
        audited: sleep.map_or(0, Sleep::audited),
        seed: sleep.map_or(0, |sleep| sleep.seed),
    };
    p.set_stayed(if discs > CACHED { STAYED } else { 0.0 });
    p
}

/// Part of the skin up to which a disc counts as not moved. It pays where searches are bound by what they read.
const STAYED: f64 = 0.1;
/// Discs whose state stays in the L2 cache from step to step: 50 MB, at some 200 bytes.
pub(super) const CACHED: usize = 250_000;
/// What the blocks advance in a microsecond, which memory takes to answer, several times over.
const AHEAD: u32 = 32_768;

/// Device memory that `discs` discs take (bytes).
pub(super) fn bytes<R: CudaReal>(discs: usize, grid: &Grid) -> usize {
    let rows = grid.rows as usize;
    let history = grid.histories() * size_of::<History<R>>();
    let contact = size_of::<u32>() + history;
    let bodies = NEAR_BODIES * history + size_of::<u32>();
    let disc = 2 * size_of::<Disc<R>>()
        + size_of::<u32>()
        + rows * contact
        + bodies
        + size_of::<Rest<R>>();
    let discs = row_length(discs);
    let once = size_of::<Position<R>>()
        + size_of::<R::Fraction>()
        + size_of::<Output<R>>()
        + 2 * size_of::<u32>()
        + size_of::<Loss>() / WARP;
    let bin = 3 * size_of::<u32>() + grid.capacity as usize * size_of::<Binned<R>>();
    discs * (2 * disc + once) + grid.count() * bin
}
