//! Defaults of scenes, chosen by their distance from the same scenes computed grain by grain
//! (`docs/notes/2026-11-23-truth.md`).

use dem::{Grains, RveParameters};
use mpm::{Transfer, WallContact};

use super::model::Material;

/// Edge of a cell of the grid (m).
const CELL: f64 = 0.03125;
/// The same with discs, whose points are means over squares of half of it: eight mean diameters of the default grains.
const CELL_OF_DISCS: f64 = 0.125;
/// Different packings in a scene.
pub(super) const PACKINGS: u64 = 64;
/// Discs in a packing: fewer than a packing needs that stands alone, as cells average over several.
const DISCS: usize = 64;
/// DEM step over `sqrt(m_min / kn)`: 2.5e-5 s for the default grains. Half of it gives the same flow.
const STEP_FACTOR: f64 = 0.401;
/// Largest overlap (radii) of discs in packings.
const OVERLAP_LIMIT: f64 = 2.0;
/// Solid fraction above which packings are not compressed further: splashes press those of single points together,
/// which meet others on the grid before they touch them.
const MAX_SOLID_FRACTION: f64 = 1.0;
/// MPM step (s) of laws; with discs, the time between two positions of a plate.
const STEP: f64 = 1.0e-4;
/// Part of a cell that a wave crosses in a step of packings, of 0.5 that are allowed.
const CROSSED: f64 = 0.45;
/// Longest step (s) of packings by default, however large the cells.
const LONGEST: f64 = 2.0e-4;

/// Parameters of packings and their grains.
pub(super) fn packings() -> RveParameters {
    let grains =
        Grains { step_factor: STEP_FACTOR, overlap_limit: OVERLAP_LIMIT, ..Grains::default() };
    RveParameters {
        grains,
        discs: DISCS,
        max_solid_fraction: MAX_SOLID_FRACTION,
        ..RveParameters::default()
    }
}

/// Transfer of packings. The continuum laws keep the default of the MPM: they are nearer to the grains with more
/// dissipation.
pub(super) const TRANSFER: Transfer = Transfer::FlipApic { rate: 10.0 };

/// Rate (1/s) at which overlaps of the volumes of packings are corrected.
pub(super) const DENSITY_CORRECTION: f64 = 20.0;

/// When packings feel walls.
pub(super) const WALL_CONTACT: WallContact = WallContact::Points;

/// Width of shocks in packings (cells).
pub(super) const SHOCK_WIDTH: f64 = 4.0;

/// Edge of a cell of the grid (m).
pub(super) fn cell(material: &Material) -> f64 {
    match material {
        Material::Discs(_) => CELL_OF_DISCS,
        Material::Rve(_) | Material::MuI(_) | Material::Elastic(_) => CELL,
    }
}

/// MPM step (s): of packings a whole part of a frame with whole substeps, in which a wave crosses [`CROSSED`] of a cell and
/// which is no longer than [`LONGEST`]. Packings take as many substeps in all, and less of what each step costs besides.
pub(super) fn step(material: &Material, cell: f64, frame_interval: f64) -> f64 {
    let Material::Rve(rve) = material else { return STEP };
    let longest = LONGEST.min(CROSSED * cell / material.wave_speed());
    let substep = rve.parameters.grains.step();
    let step = if substep < longest { substep * (longest / substep).floor() } else { longest };
    frame_interval / (frame_interval / step).ceil()
}

/// Grains of whole scenes.
pub(super) fn discs() -> Grains {
    Grains { step_factor: STEP_FACTOR, ..Grains::default() }
}
