//! The ledger of contacts as the kernels have it: a list of quantities.

use crate::{Ledger, Vec2};

/// Impulses by the walls and by each obstacle, work of the obstacles, number of projections.
pub(super) fn flat(ledger: &Ledger) -> Vec<f64> {
    let impulses = [ledger.wall_impulse].into_iter().chain(ledger.obstacle_impulse.iter().copied());
    let last = [ledger.plate_work, ledger.projected as f64];
    impulses.flat_map(<[f64; 2]>::from).chain(last).collect()
}

/// The inverse of [`flat`].
pub(super) fn from_flat(flat: &[f64]) -> Ledger {
    let (impulses, last) = flat.split_at(flat.len() - 2);
    let mut impulses = impulses.chunks_exact(2).map(Vec2::from_column_slice);
    Ledger {
        wall_impulse: impulses.next().unwrap_or_default(),
        obstacle_impulse: impulses.collect(),
        plate_work: last[0],
        // A count: exact in f64 up to 2^53.
        projected: last[1] as u64,
    }
}
