//! A batch as the arrays that the kernel works on.

use std::collections::HashMap;

use rayon::prelude::*;

use super::abi::{self, Header, Motion, Position, Rows, State, Status, Vector};
use super::error::{CudaError, RveFailure};
use super::list::SlotList;
use super::real::CudaReal;
use super::shape::Shape;
use crate::batch::RveBatch;
use crate::cell::Cell;
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::neighbours::Neighbours;
use crate::packing::Packing;
use crate::parameters::RveParameters;
use crate::rve::Rve;

/// Arrays of [`Batch`](abi::Batch): over RVEs and, after them, the fresh packings.
pub(super) struct Arrays<R: CudaReal> {
    pub header: Vec<Header>,
    pub position: Vec<Position<R>>,
    pub motion: Vec<Motion<R>>,
    pub reference: Vec<Position<R>>,
    pub seated: Vec<u16>,
    pub rows: Vec<Rows>,
    pub neighbour: Vec<u32>,
    pub pair: Vec<Vector<R>>,
    pub spring: Vec<R>,
    pub incoming: Vec<u16>,
    /// Constants of discs, once for all RVEs that have the same discs.
    pub disc: Vec<abi::Disc<R>>,
}

impl<R: CudaReal> Arrays<R> {
    /// Bytes of the arrays of `rves` RVEs, fresh packings included.
    pub fn bytes(shape: &Shape, rves: usize) -> usize {
        let real = size_of::<R>();
        let slot = size_of::<u32>() + (2 + shape.springs()) * real + 2 * size_of::<u16>();
        let thread = 8 * real + 5 * size_of::<u16>();
        let rve = size_of::<Header>() + size_of::<State>();
        rves * (shape.slots * slot + shape.threads * thread + rve)
    }

    pub fn from_batch(batch: &RveBatch<R>, shape: &Shape) -> Result<Self, CudaError> {
        let fresh: Vec<Rve<R>> = (0..)
            .zip(&batch.fresh)
            .map(|(kind, packing)| Rve { kind, ..Rve::new(packing.clone()) })
            .collect();
        let rves: Vec<&Rve<R>> = batch.rves.iter().chain(&fresh).collect();
        let expected = shape.discs;
        if let Some(rve) = rves.iter().position(|r| r.packing.discs.len() != expected) {
            let found = rves[rve].packing.discs.len();
            return Err(CudaError::Unequal { rve, found, expected });
        }

        let (gradings, disc) = gradings(&rves, shape);
        let threads = rves.len() * shape.threads;
        let slots = rves.len() * shape.slots;
        let mut state = Self {
            header: vec![Header::default(); rves.len()],
            position: vec![Position::default(); threads],
            motion: vec![Motion::default(); threads],
            reference: vec![Position::default(); threads],
            seated: vec![0; threads],
            rows: vec![Rows::default(); threads],
            neighbour: vec![0; slots],
            pair: vec![Vector::default(); slots],
            spring: vec![R::default(); shape.springs() * slots],
            incoming: vec![0; rves.len() * shape.incoming_slots()],
            disc,
        };
        state.chunks_mut(shape).zip(rves).zip(gradings).enumerate().try_for_each(
            |(index, ((mut chunk, rve), grading))| {
                chunk.put(rve, grading, shape).map_err(|failure| CudaError::Rve {
                    rve: index,
                    step: 0,
                    failure,
                })
            },
        )?;
        Ok(state)
    }

    /// The batch of so many RVEs.
    pub fn make_batch(
        &mut self,
        parameters: &RveParameters,
        shape: &Shape,
        count: usize,
    ) -> RveBatch<R> {
        let law = ContactLaw::new(&parameters.grains, 0.0);
        let disc = std::mem::take(&mut self.disc);
        let mut rves: Vec<Rve<R>> =
            self.chunks_mut(shape).map(|chunk| chunk.get(&disc, shape, &law)).collect();
        self.disc = disc;
        let fresh = rves.split_off(count).into_iter().map(|rve| rve.packing).collect();
        RveBatch { parameters: parameters.clone(), rves, fresh }
    }

    /// Each RVE's part.
    fn chunks_mut(&mut self, shape: &Shape) -> impl IndexedParallelIterator<Item = Chunk<'_, R>> {
        let (threads, slots) = (shape.threads, shape.slots);
        (
            (
                &mut self.header,
                self.position.par_chunks_mut(threads),
                self.motion.par_chunks_mut(threads),
                self.reference.par_chunks_mut(threads),
            ),
            (
                self.seated.par_chunks_mut(threads),
                self.rows.par_chunks_mut(threads),
                self.neighbour.par_chunks_mut(slots),
                self.pair.par_chunks_mut(slots),
                self.spring.par_chunks_mut(shape.springs() * slots),
                self.incoming.par_chunks_mut(shape.incoming_slots()),
            ),
        )
            .into_par_iter()
            .map(move |((header, position, motion, reference), list)| {
                let (seated, rows, neighbour, pair, spring, incoming) = list;
                let (tangential, rolling) = spring.split_at_mut(slots);
                let list =
                    SlotList { seated, rows, neighbour, pair, tangential, rolling, incoming };
                Chunk { header, position, motion, reference, list }
            })
    }
}

/// One RVE's part of the arrays.
struct Chunk<'a, R: CudaReal> {
    header: &'a mut Header,
    position: &'a mut [Position<R>],
    motion: &'a mut [Motion<R>],
    reference: &'a mut [Position<R>],
    list: SlotList<'a, R>,
}

impl<R: CudaReal> Chunk<'_, R> {
    fn put(&mut self, rve: &Rve<R>, grading: u32, shape: &Shape) -> Result<(), RveFailure> {
        let packing = &rve.packing;
        let list = &packing.neighbours;
        let [owned, incoming] = self.list.put(list, &packing.discs, shape)?;
        for (seat, &i) in self.list.seated[..shape.discs].iter().enumerate() {
            let d = &packing.discs[usize::from(i)];
            let half_w = R::from_f64(0.5) * d.w;
            let position = |[x, y]: [R::Fraction; 2]| Position { x, y };
            self.position[seat] = position(d.s);
            self.motion[seat] = Motion { x: d.u[0], y: d.u[1], half_w, unused: R::default() };
            let reference = list.reference.get(usize::from(i)).copied().unwrap_or(d.s);
            self.reference[seat] = position(reference);
        }

        let r_max = packing.discs.iter().fold(0.0, |r: f64, d| r.max(d.r.to_f64()));
        *self.header = Header {
            cell: (&packing.cell.h).into(),
            reference_cell: (&list.reference_cell).into(),
            skin: list.skin,
            reach: 2.0 * r_max,
            solid: packing.solid_fraction() * packing.cell.area(),
            mass: packing.discs.iter().map(|d| 1.0 / d.inv_mass.to_f64()).sum(),
            spin: packing.spin,
            drift_x: f64::NAN,
            drift_y: f64::NAN,
            free_area: rve.free_area.unwrap_or(-1.0),
            grading,
            kind: rve.kind,
            imaged: u32::from(!list.images.is_empty()),
            status: Status::OK,
            steps: 0,
            owned,
            incoming,
        };
        Ok(())
    }

    fn get(&self, disc: &[abi::Disc<R>], shape: &Shape, law: &ContactLaw<R>) -> Rve<R> {
        let header = &*self.header;
        let constants = &disc[header.grading as usize * shape.threads..][..shape.discs];
        let mut seat = vec![0; shape.discs];
        for (k, &i) in self.list.seated[..shape.discs].iter().enumerate() {
            seat[usize::from(i)] = k;
        }
        let discs: Vec<Disc<R>> = constants
            .iter()
            .zip(&seat)
            .map(|(&abi::Disc { r, inv_mass, inv_inertia, .. }, &seat)| {
                let Motion { x, y, half_w, .. } = self.motion[seat];
                Disc {
                    s: fractions(self.position[seat]),
                    u: [x, y],
                    w: R::from_f64(2.0) * half_w,
                    r,
                    inv_mass,
                    inv_inertia,
                }
            })
            .collect();
        let (pairs, images, rolling) = self.list.get(header.imaged != 0, &discs, law);

        let mut neighbours = Neighbours {
            pairs,
            images,
            rolling,
            reference_cell: header.reference_cell.into(),
            reference: seat.iter().map(|&seat| fractions(self.reference[seat])).collect(),
            reach: header.reach,
            skin: header.skin,
            ..Neighbours::default()
        };
        neighbours.travel = neighbours.displacement(&discs);
        let cell = Cell { h: header.cell.into() };
        let packing = Packing { cell, discs, neighbours, spin: header.spin };
        let free_area = (header.free_area >= 0.0).then_some(header.free_area);
        Rve { packing, free_area, kind: header.kind }
    }
}

/// The distinct tables of discs, one after the other, and which one each RVE has.
fn gradings<R: CudaReal>(rves: &[&Rve<R>], shape: &Shape) -> (Vec<u32>, Vec<abi::Disc<R>>) {
    let mut known: HashMap<Vec<u64>, u32> = HashMap::new();
    let mut table = Vec::new();
    let index = rves
        .iter()
        .map(|rve| {
            let constants = rve.packing.discs.iter().map(|d| [d.r, d.inv_mass, d.inv_inertia]);
            let key = constants.clone().flatten().map(|x| x.to_f64().to_bits()).collect();
            let next = known.len() as u32;
            *known.entry(key).or_insert_with(|| {
                // Threads without a disc compute on harmless numbers.
                let one = R::from_f64(1.0);
                let harmless = abi::Disc { r: one, inv_mass: one, inv_inertia: one, mass: one };
                let rest = std::iter::repeat_n(harmless, shape.threads - shape.discs);
                let disc = |[r, inv_mass, inv_inertia]: [R; 3]| {
                    let mass = R::from_f64(1.0 / inv_mass.to_f64());
                    abi::Disc { r, inv_mass, inv_inertia, mass }
                };
                table.extend(constants.map(disc).chain(rest));
                next
            })
        })
        .collect();
    (index, table)
}

fn fractions<R: CudaReal>(p: Position<R>) -> [R::Fraction; 2] {
    [p.x, p.y]
}
