//! Layout of a thread block for a given number of discs.

use gpu::Limits;

use super::error::CudaError;
use super::real::CudaReal;
use crate::parameters::RveParameters;
use crate::real::Real;

/// The compile-time constants of the kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Discs in an RVE.
    pub discs: usize,
    /// Threads: one per disc, in whole warps.
    pub threads: usize,
    /// Most neighbours in one disc's list.
    pub rows: usize,
    /// Room for listed pairs.
    pub slots: usize,
    /// Thread blocks (RVEs) at a time on one multiprocessor.
    pub blocks: usize,
    /// Shared memory of a block (bytes).
    pub shared_bytes: usize,
    /// Whether contacts resist rolling.
    pub rolling: bool,
    /// Whether each RVE has parameters of its own.
    pub unequal: bool,
    real_bits: usize,
}

pub(super) const WARP: usize = 32;
/// One thread per disc: the largest thread block.
const MOST_DISCS: usize = 1024;
const REGISTERS_PER_MULTIPROCESSOR: usize = 65_536;
const BLOCKS_PER_MULTIPROCESSOR: usize = 32;
/// Shared memory that CUDA keeps of each block (bytes).
const SYSTEM_SHARED: usize = 1024;
/// Most rows: `list.cuh` marks them in a 32-bit mask.
const MOST_ROWS: usize = 31;

/// Rows of slots per warp, on average. Near pairs form a planar network, so a disc owns less than 3
/// of them on average, 2 to 2.7 in dense packings; a warp has as many rows as its busiest disc
/// needs.
struct Rows {
    per_warp: f64,
    /// As many more, for warps of unequal discs in small packings.
    more: usize,
}

/// Room for the lists of neighbours of a packing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Room {
    /// As much as leaves place for the most packings at a time: enough for most collapses.
    #[default]
    Usual,
    /// Enough for packings that an impact compresses strongly, if need be with fewer at a time.
    Ample,
}

/// Enough for any packing.
const AMPLE: Rows = Rows { per_warp: 4.5, more: 16 };
/// Enough for packings of a collapse: fewer blocks at a time rather than fewer rows.
const USUAL: Rows = Rows { per_warp: 3.0, more: 8 };
/// The least for a block alone on a multiprocessor.
const LEAST: Rows = Rows { per_warp: 2.65, more: 2 };

impl Shape {
    /// The layout for RVEs of `discs` discs on a GPU.
    ///
    /// A block alone on a multiprocessor may have to be content with less room than asked for.
    ///
    /// # Errors
    /// More discs than fit one thread block.
    pub fn new<R: CudaReal>(
        p: &RveParameters,
        discs: usize,
        limits: Limits,
        room: Room,
    ) -> Result<Self, CudaError> {
        Self::checked::<R>(p, discs, limits, room, false)
    }

    /// The same, with ample room, for RVEs that have parameters of their own.
    ///
    /// # Errors
    /// More discs than fit one thread block.
    pub fn unequal<R: CudaReal>(
        p: &RveParameters,
        discs: usize,
        limits: Limits,
    ) -> Result<Self, CudaError> {
        Self::checked::<R>(p, discs, limits, Room::Ample, true)
    }

    fn checked<R: CudaReal>(
        p: &RveParameters,
        discs: usize,
        limits: Limits,
        room: Room,
        unequal: bool,
    ) -> Result<Self, CudaError> {
        Self::try_new::<R>(p, discs, limits, room, unequal).ok_or_else(|| {
            let fits = |n: &usize| Self::try_new::<R>(p, *n, limits, room, unequal).is_some();
            CudaError::TooManyDiscs {
                discs,
                most: (0..discs).rev().find(fits).unwrap_or(0),
                precision: <R as Real>::NAME,
            }
        })
    }

    fn try_new<R: CudaReal>(
        p: &RveParameters,
        discs: usize,
        limits: Limits,
        room: Room,
        unequal: bool,
    ) -> Option<Self> {
        if discs > MOST_DISCS {
            return None;
        }
        let threads = discs.div_ceil(WARP).max(1) * WARP;
        // Fewer registers than these would spill in the loop over contacts.
        let registers = if R::BITS == 32 { 48 } else { 72 };
        let by_registers = REGISTERS_PER_MULTIPROCESSOR / (threads * registers);
        let wanted = by_registers.clamp(1, BLOCKS_PER_MULTIPROCESSOR);

        // Lasting data of a pair, and its reaction, whose memory a search takes.
        let rolling = p.grains.resist_rolling();
        let springs = 1 + usize::from(rolling);
        let listed = (2 + springs) * size_of::<R>() + size_of::<u32>() + 2 * size_of::<u16>();
        let reaction = 3 * size_of::<R>();
        let fixed = fixed_shared::<R>(threads);
        let rows = rows(p);
        let fit = |blocks: usize, fewest: &Rows| {
            let share = limits.shared_per_multiprocessor / blocks - SYSTEM_SHARED;
            let share = share.min(limits.shared_per_block);
            let room = share.checked_sub(fixed)? / (listed + reaction);
            let warps = threads / WARP;
            let slot_rows =
                |r: &Rows| ((r.per_warp * warps as f64) as usize + r.more).min(rows * warps);
            let slots = WARP * slot_rows(&AMPLE).min(room / WARP);
            let shared_bytes = fixed
                + slots * listed
                + (slots * reaction)
                    .max(search_shared::<R>(threads, rows))
                    .max(sums_shared::<R>(threads, unequal));
            let enough = slots >= WARP * slot_rows(fewest) && shared_bytes <= share;
            enough.then_some(Self {
                discs,
                threads,
                rows,
                slots,
                blocks,
                shared_bytes,
                rolling,
                unequal,
                real_bits: R::BITS,
            })
        };
        let fewest = match room {
            Room::Usual => &USUAL,
            Room::Ample => &AMPLE,
        };
        (1..=wanted).rev().find_map(|blocks| fit(blocks, fewest)).or_else(|| fit(1, &LEAST))
    }

    /// Room for listed pairs at the discs that do not own them.
    pub(super) fn incoming_slots(&self) -> usize {
        2 * self.slots
    }

    /// Springs of a pair: the tangential one, and maybe the rolling one.
    pub(super) fn springs(&self) -> usize {
        1 + usize::from(self.rolling)
    }

    /// Preprocessor definitions for the kernel.
    pub fn defines(&self) -> Vec<String> {
        [
            ("REAL_BITS", self.real_bits),
            ("DISCS", self.discs),
            ("THREADS", self.threads),
            ("ROWS", self.rows),
            ("SLOTS", self.slots),
            ("BLOCKS", self.blocks),
            ("SHARED_BYTES", self.shared_bytes),
            ("ROLLING", usize::from(self.rolling)),
            ("UNEQUAL", usize::from(self.unequal)),
        ]
        .map(|(name, value)| format!("{name}={value}"))
        .to_vec()
    }
}

/// Neighbours that one disc can have in its list: discs of the smallest radius, packed as densely
/// as a lattice, around one of the largest.
fn rows(p: &RveParameters) -> usize {
    let reach =
        p.grains.radius_max + 2.0 * p.grains.radius_min + p.grains.skin * p.grains.radius_max;
    let around = reach * reach - p.grains.radius_max * p.grains.radius_max;
    let most = (0.907 * around / (p.grains.radius_min * p.grains.radius_min)).ceil() as usize;
    most.clamp(8, MOST_ROWS)
}

/// Shared memory besides the slots (bytes): `Shared` in `shared.cuh`, which checks it.
fn fixed_shared<R: Real>(threads: usize) -> usize {
    let real = size_of::<R>();
    let per_thread = 6 * real + 6 * size_of::<u16>();
    let substeps = WARP * (12 * real + 4 * size_of::<f64>());
    let control = 704;
    threads * per_thread + substeps + control
}

/// Shared memory of the sums over the discs (bytes).
fn sums_shared<R: Real>(threads: usize, unequal: bool) -> usize {
    let sums = if unequal { 9 } else { 7 };
    sums * threads * size_of::<R>()
}

/// Shared memory of a search (bytes): discs by bins or who is near them, bins, a census and rows.
fn search_shared<R: Real>(threads: usize, rows: usize) -> usize {
    const BINS: usize = 32;
    let near = rows * size_of::<u16>();
    let per_thread = near.max(4 * size_of::<R>()) + size_of::<u16>();
    let bins = (BINS * BINS * size_of::<u32>()).max(2 * threads * size_of::<R>());
    bins + 4 * WARP * size_of::<u32>() + WARP * size_of::<R>() + threads * per_thread
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_of_a_block_is_never_exceeded() {
        let plain = RveParameters::default();
        let mut rolling = plain.clone();
        rolling.grains.rolling_friction = 0.1;
        for limits in [Limits::SM_80, Limits::SM_90] {
            for discs in 1..=MOST_DISCS {
                for p in [&plain, &rolling] {
                    let shapes = [
                        Shape::new::<f32>(p, discs, limits, Room::Ample),
                        Shape::new::<f64>(p, discs, limits, Room::Usual),
                        Shape::unequal::<f32>(p, discs, limits),
                        Shape::unequal::<f64>(p, discs, limits),
                    ];
                    for shape in shapes.into_iter().flatten() {
                        assert!(shape.shared_bytes <= limits.shared_per_block, "{shape:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn ample_room_is_4_5_rows_a_warp_and_more() {
        let p = RveParameters::default();
        for limits in [Limits::SM_80, Limits::SM_90] {
            let usual = Shape::new::<f32>(&p, 400, limits, Room::Usual).unwrap();
            let ample = Shape::new::<f32>(&p, 400, limits, Room::Ample).unwrap();
            assert_eq!(ample.slots, WARP * ((4.5 * 13.0) as usize + 16));
            assert!(usual.slots < ample.slots && usual.blocks >= ample.blocks);
        }
    }
}
