//! Sizes of bins and lists.

use super::abi::MOST_ROWS;
use super::error::CudaAssemblyError;
use crate::assembly::Assembly;
use crate::cuda::shape::WARP;
use crate::grains::Grains;
use crate::real::Real;

/// Skin over that on the CPU: here a search costs more steps, and an entry of a list less.
const SKIN: f64 = 2.0;
/// Bins per disc, at most: larger bins in sparse domains.
const BINS_PER_DISC: f64 = 8.0;
/// Side of a tile in bins, as `TILE` in `assembly.cuh`.
pub(super) const TILE: u32 = 8;
/// Room beyond what undeformed discs need.
const PRESSED: f64 = 1.3;

/// Length of a row of lists and histories of so many discs: each warp begins with a line of memory of its own.
pub(super) fn row_length(discs: usize) -> usize {
    discs.next_multiple_of(WARP)
}

/// How far lists reach beyond touch (m).
fn skin(grains: &Grains) -> f64 {
    SKIN * grains.skin * grains.radius_max
}

/// Most neighbours of a disc among such grains.
pub(super) fn rows(grains: &Grains) -> Result<usize, CudaAssemblyError> {
    let (small, large) = (grains.radius_min, grains.radius_max);
    // Around the largest disc, side by side.
    let apart = (small / (large + small + skin(grains))).asin();
    let rows = (PRESSED * std::f64::consts::PI / apart).ceil() as usize;
    if rows > MOST_ROWS {
        return Err(CudaAssemblyError::TooUnequal {
            rows,
            most: MOST_ROWS,
            radius_min: small,
            radius_max: large,
        });
    }
    Ok(rows)
}

/// Bins of a domain, and room for neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// How far lists reach beyond touch (m).
    pub skin: f64,
    /// Bins along a side of the region.
    pub bins: u32,
    /// Tiles in a row, and rows of tiles.
    pub tiles: [u32; 2],
    /// Most discs in a bin.
    pub capacity: u32,
    /// Most neighbours of a disc.
    pub rows: u32,
    /// Whether contacts resist rolling.
    pub rolling: bool,
}

impl Grid {
    /// For the discs of an assembly in its domain.
    pub fn of<R: Real>(assembly: &Assembly<R>) -> Result<Self, CudaAssemblyError> {
        let Assembly { grains, region, size, discs, .. } = assembly;
        let discs = discs.len();
        let skin = skin(grains);
        let (small, large) = (grains.radius_min, grains.radius_max);
        let area = (size[0] + 4.0 * large) * (size[1] + 4.0 * large);
        let sparse = (area / (BINS_PER_DISC * (discs as f64).max(1000.0))).sqrt();
        let bins = (region.side / sparse.max(2.0 * large + skin)).floor().clamp(1.0, 65_535.0);
        let side = region.side / bins;
        let tiles = size.map(|length| {
            let used = ((length + 4.0 * large) / side).ceil().min(bins) as u32;
            used.div_ceil(TILE)
        });
        // Discs of the smallest radius, packed as densely as a lattice.
        let lattice = 2.0 * 3.0_f64.sqrt() * small * small;
        let capacity = (PRESSED * (side + 2.0 * small).powi(2) / lattice).ceil() as u32;
        let (bins, rolling) = (bins as u32, grains.resist_rolling());
        Ok(Self { skin, bins, tiles, capacity, rows: rows(grains)? as u32, rolling })
    }

    /// Histories of a contact: of sliding, and maybe of rolling.
    pub fn histories(&self) -> usize {
        1 + usize::from(self.rolling)
    }

    /// Number of bins.
    pub fn count(&self) -> usize {
        (self.tiles[0] * self.tiles[1] * TILE * TILE) as usize
    }
}
