//! An assembly on several GPUs, a rank for each: what ranks send each other.
//!
//! Every rank holds all discs in the same order and advances its own [slab](Slabs). After every step it receives
//! the discs of its window, at the end of a sequence all of them. All ranks search at the same steps, so that
//! results have the same bits for any number of them.

use std::mem::offset_of;
use std::ops::Range;
use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaStream};
use gpu::ranks::{Ranks, RanksError, Reduction};
use gpu::{Device, DeviceRepr, Pointer};

use super::abi::{Arrays, Control, Disc, Loss, NEAR_BODIES, Parameters};
use super::error::CudaAssemblyError;
use super::grid::{Grid, TILE, row_length};
use super::slabs::{Message, Slabs, displacement_within, margin_for};
use crate::cuda::real::CudaReal;

/// Displacements that new windows allow over the one that needs them.
const AHEAD: f64 = 1.5;

/// One of several ranks.
pub(super) struct Shared {
    ranks: Arc<Ranks>,
    slabs: Slabs,
    grid: Grid,
    /// Columns of tiles in the window on either side of the own ones.
    margin: usize,
    /// Discs before each column of tiles at the last sort, and all discs.
    columns: Vec<usize>,
    column: CudaSlice<u32>,
    /// For the discs that no other rank receives.
    beside: Arc<CudaStream>,
    /// Whether all ranks have the discs of rank 0.
    equal: bool,
}

/// One row of an array over discs.
struct Row {
    first: Pointer<u8>,
    /// Size of an entry.
    bytes: usize,
}

fn rows<T: DeviceRepr>(
    array: Pointer<T>,
    length: usize,
    count: usize,
) -> impl Iterator<Item = Row> {
    let row = move |k| Row { first: array.offset(k * length).cast(), bytes: size_of::<T>() };
    (0..count).map(row)
}

impl Shared {
    /// The share of a rank in `discs` discs.
    pub fn new(
        device: &Device,
        ranks: &Arc<Ranks>,
        grid: &Grid,
        discs: usize,
    ) -> Result<Self, CudaAssemblyError> {
        connect(device, ranks)?;
        Ok(Self {
            ranks: ranks.clone(),
            slabs: Slabs { discs, ranks: ranks.size(), halo: discs },
            grid: *grid,
            margin: 1,
            columns: vec![0, discs],
            column: device.zeros(grid.tiles[0] as usize)?,
            beside: device.context().new_stream()?,
            equal: false,
        })
    }

    pub fn is_first(&self) -> bool {
        self.ranks.is_first()
    }

    /// Room for the number of discs before each column of tiles.
    pub fn column(&self) -> &CudaSlice<u32> {
        &self.column
    }

    /// Divides the discs anew after a sort, by the number of them before each column of tiles.
    pub fn divide(&mut self, columns: &[u32]) {
        self.columns = columns.iter().map(|&first| first as usize).collect();
        self.columns.push(self.slabs.discs);
        self.fit_halo();
    }

    /// Widens windows for displacements since the sort of so many bins.
    pub fn widen(&mut self, displacement: f64) {
        self.margin = margin_for(AHEAD * displacement, TILE as usize).max(self.margin + 1);
        self.fit_halo();
    }

    /// A halo that is enough, and not twice as large: graphs hold it, and are to last for many sequences.
    fn fit_halo(&mut self) {
        let needed = self.slabs.needed_halo(&self.columns, self.margin);
        if needed > self.slabs.halo || self.slabs.halo > 2 * needed {
            self.slabs.halo = needed + needed / 4;
        }
    }

    /// The constants of this rank.
    pub fn parameters<R: CudaReal>(&self, p: &Parameters<R>) -> Parameters<R> {
        let rank = self.ranks.rank();
        let bins = displacement_within(self.margin, TILE as usize) as f64;
        // No difference of two positions is more than half a period.
        let margin = (bins / f64::from(self.grid.bins)).min(0.5);
        Parameters {
            ranked: 1,
            own: bounds(self.slabs.own(rank)),
            window: bounds(self.slabs.window(rank)),
            margin: R::fraction(margin),
            ..*p
        }
    }

    /// A stream beside that of the device.
    pub fn beside(&self) -> &Arc<CudaStream> {
        &self.beside
    }

    /// The own discs that no other rank receives, and those before and after them.
    pub fn parts(&self) -> (Range<usize>, [Range<usize>; 2]) {
        let rank = self.ranks.rank();
        let (own, inner) = (self.slabs.own(rank), self.slabs.inner(rank));
        let outer = [own.start..inner.start, inner.end..own.end];
        (inner, outer)
    }

    /// Queues that own discs go to the windows of other ranks, and theirs come to this one, after step `k` of a
    /// round.
    pub fn exchange<R: CudaReal>(&self, a: &Arrays<R>, k: usize) -> Result<(), RanksError> {
        let ranks = &self.ranks;
        let buffer: Pointer<Disc<R>> = a.disc.offset((k + 1) % 2 * self.slabs.discs);
        ranks.group(|| {
            // SAFETY: parts of the discs, which live as long as the assembly. Nobody else writes those received.
            unsafe {
                for Message { peer, sent, received } in self.slabs.messages(ranks.rank()) {
                    if !sent.is_empty() {
                        ranks.send(buffer.offset(sent.start).into(), sent.len(), peer)?;
                    }
                    if !received.is_empty() {
                        ranks.receive(buffer.offset(received.start), received.len(), peer)?;
                    }
                }
            }
            Ok(())
        })
    }

    /// Queues that all ranks learn whether lists are outdated after step `k` of a round.
    pub fn agree_on_moves<R: CudaReal>(&self, a: &Arrays<R>, k: usize) -> Result<(), RanksError> {
        let moved = offset_of!(Control<R>, moved) + (k + 1) * size_of::<R::Fraction>();
        // SAFETY: a field of the control, which lives as long as the assembly.
        self.ranks.group(|| unsafe {
            self.ranks.reduce(field::<R, R::Fraction>(a, moved), Reduction::Largest)
        })
    }

    /// Queues that all ranks learn of failures, of the largest overlap, and how far discs have moved since the sort.
    pub fn agree<R: CudaReal>(&self, a: &Arrays<R>) -> Result<(), RanksError> {
        let ranks = &self.ranks;
        ranks.group(|| {
            // SAFETY: fields of the control, which lives as long as the assembly.
            unsafe {
                let failed = field::<R, u64>(a, offset_of!(Control<R>, failed));
                ranks.reduce(failed, Reduction::Least)?;
                for offset in [offset_of!(Control<R>, overlap), offset_of!(Control<R>, drift)] {
                    ranks.reduce(field::<R, R::Fraction>(a, offset), Reduction::Largest)?;
                }
            }
            Ok(())
        })
    }

    /// Queues that all ranks get all discs at the end of a round.
    pub fn gather_discs<R: CudaReal>(&self, a: &Arrays<R>) -> Result<(), RanksError> {
        self.gather(rows(a.disc, self.slabs.discs, 1))
    }

    /// Queues that all ranks get all that a rank has of its discs, at the end of a round.
    pub fn gather_all<R: CudaReal>(&self, a: &Arrays<R>) -> Result<(), RanksError> {
        self.gather(self.state(a))
    }

    /// Queues that the totals of all ranks are added up.
    pub fn reduce_losses(&self, total: Pointer<Loss>) -> Result<(), RanksError> {
        let fields = [
            offset_of!(Loss, dashpots),
            offset_of!(Loss, friction),
            offset_of!(Loss, damping),
            offset_of!(Loss, boxes),
        ];
        self.ranks.group(|| {
            fields.iter().try_for_each(|&offset| {
                let number = Pointer::<u64>::from_address(total.address() + offset as u64);
                // SAFETY: a field of the totals, which live as long as the assembly.
                unsafe { self.ranks.reduce(number, Reduction::Sum) }
            })
        })
    }

    /// At the first call, gives all ranks the discs of rank 0: preparations elsewhere may differ in round-off.
    pub fn make_equal<R: CudaReal>(&mut self, a: &Arrays<R>) -> Result<(), CudaAssemblyError> {
        if std::mem::replace(&mut self.equal, true) {
            return Ok(());
        }
        let discs = self.slabs.discs;
        let counts = self.ranks.numbers(discs as u64)?;
        if counts.iter().any(|&count| count != discs as u64) {
            return Err(CudaAssemblyError::Differ(counts));
        }
        self.ranks.group(|| {
            self.state(a).chain(rows(a.id, discs, 1)).try_for_each(|row| {
                // SAFETY: all entries of a row, which live as long as the assembly.
                unsafe { self.ranks.broadcast(row.first, discs * row.bytes) }
            })
        })?;
        Ok(())
    }

    /// What discs have between two rounds, but for their identities, which all ranks know.
    fn state<R: CudaReal>(&self, a: &Arrays<R>) -> impl Iterator<Item = Row> {
        let (discs, contacts) = (self.slabs.discs, self.grid.rows as usize);
        let row = row_length(discs);
        let histories = self.grid.histories();
        rows(a.disc, discs, 1)
            .chain(rows(a.list, row, contacts))
            .chain(rows(a.history, row, histories * contacts))
            .chain(rows(a.near_bodies, discs, 1))
            .chain(rows(a.body_history, row, histories * NEAR_BODIES))
    }

    /// Sends the own part of each row to all other ranks, and receives theirs.
    fn gather(&self, mut rows: impl Iterator<Item = Row>) -> Result<(), RanksError> {
        let (ranks, rank) = (&self.ranks, self.ranks.rank());
        let own = self.slabs.own(rank);
        ranks.group(|| {
            rows.try_for_each(|Row { first, bytes }| {
                for peer in (0..ranks.size()).filter(|&peer| peer != rank) {
                    let theirs = self.slabs.own(peer);
                    // SAFETY: entries of the row, which live as long as the assembly; nobody else uses them.
                    unsafe {
                        if !own.is_empty() {
                            let from = first.offset(own.start * bytes);
                            ranks.send(from.into(), own.len() * bytes, peer)?;
                        }
                        if !theirs.is_empty() {
                            let to = first.offset(theirs.start * bytes);
                            ranks.receive(to, theirs.len() * bytes, peer)?;
                        }
                    }
                }
                Ok(())
            })
        })
    }
}

/// Makes the connections of the ranks, which takes NCCL part of a second at the first message between two of them.
fn connect(device: &Device, ranks: &Ranks) -> Result<(), CudaAssemblyError> {
    let (stream, own) = (device.stream(), device.zeros::<u8>(1)?);
    let theirs = device.zeros::<u8>(ranks.size())?;
    let (from, to) = (Pointer::to(&own, stream), Pointer::to(&theirs, stream));
    ranks.group(|| {
        (0..ranks.size()).filter(|&peer| peer != ranks.rank()).try_for_each(|peer| {
            // SAFETY: both live until the stream is done with them.
            unsafe {
                ranks.send(from.into(), 1, peer)?;
                ranks.receive(to.offset(peer), 1, peer)
            }
        })
    })?;
    Ok(stream.synchronize()?)
}

/// A range of discs as kernels take it.
pub(super) fn bounds(range: Range<usize>) -> [u32; 2] {
    [range.start as u32, range.end as u32]
}

/// A field of the control.
fn field<R: CudaReal, T>(a: &Arrays<R>, offset: usize) -> Pointer<T> {
    Pointer::from_address(a.control.address() + offset as u64)
}
