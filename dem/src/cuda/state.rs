//! A batch as the arrays that `rve.cu` works on.

use std::collections::HashMap;

use cudarc::driver::DeviceRepr;
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::error::{CudaError, RveFailure};
use super::list::{self, Entry};
use super::real::CudaReal;
use super::shape::Shape;
use crate::batch::RveBatch;
use crate::cell::Cell;
use crate::contact::ContactLaw;
use crate::neighbours::Neighbours;
use crate::packing::{Disc, Packing};
use crate::parameters::RveParameters;
use crate::rve::{Rve, RveState};

/// `Header` of `rve.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Header {
    cell: [f64; 4],
    reference_cell: [f64; 4],
    skin: f64,
    reach: f64,
    solid: f64,
    mass: f64,
    spin: f64,
    free_area: f64,
    pub reference_area: f64,
    grading: u32,
    imaged: u32,
    pub status: u32,
    pub steps: u32,
}

// SAFETY: plain numbers without padding, laid out as in `rve.cu`.
unsafe impl DeviceRepr for Header {}

/// [`RveState`] in device memory: `State` of `rve.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    stress: [f64; 4],
    area: f64,
    solid_fraction: f64,
    coordination: f64,
    pub(super) relative_overlap: f64,
    min_width: f64,
    searches: u32,
    free: u32,
    thin: u32,
    unused: u32,
}

// SAFETY: plain numbers without padding, laid out as in `rve.cu`.
unsafe impl DeviceRepr for State {}

impl From<State> for RveState {
    fn from(s: State) -> Self {
        Self {
            stress: matrix(s.stress),
            area: s.area,
            solid_fraction: s.solid_fraction,
            coordination: s.coordination,
            relative_overlap: s.relative_overlap,
            min_width: s.min_width,
            searches: s.searches,
            free: s.free != 0,
            thin: s.thin != 0,
        }
    }
}

/// `Disc` of `rve.cu`: radius, inverse mass, inverse inertia.
type DiscConstants<R> = [R; 4];

/// Arrays over RVEs and, last, the fresh packing. Within each by thread, or by row and thread.
pub(super) struct HostState<R: CudaReal> {
    pub header: Vec<Header>,
    pub position: Vec<[R::Fraction; 2]>,
    pub velocity: Vec<[R; 2]>,
    pub spin: Vec<R>,
    pub reference: Vec<[R::Fraction; 2]>,
    pub listed: Vec<u8>,
    pub neighbour: Vec<u16>,
    pub image: Vec<u16>,
    pub tangential: Vec<R>,
    /// What does not change, once for all RVEs that have the same discs.
    pub disc: Vec<DiscConstants<R>>,
}

impl<R: CudaReal> HostState<R> {
    /// Bytes of the arrays of `rves` RVEs and the fresh packing.
    pub fn bytes(shape: &Shape, rves: usize) -> usize {
        let real = size_of::<R>();
        let row = 2 * size_of::<u16>() + real;
        let thread = 7 * real + size_of::<u8>() + shape.rows * row;
        (rves + 1) * (shape.threads * thread + size_of::<Header>() + size_of::<State>())
    }

    pub fn from_batch(batch: &RveBatch<R>, shape: &Shape) -> Result<Self, CudaError> {
        let fresh = Rve::new(batch.fresh.clone());
        let rves: Vec<&Rve<R>> = batch.rves.iter().chain([&fresh]).collect();
        let expected = shape.discs;
        if let Some(rve) = rves.iter().position(|r| r.packing.discs.len() != expected) {
            let found = rves[rve].packing.discs.len();
            return Err(CudaError::Unequal { rve, found, expected });
        }

        let (gradings, disc) = gradings(&rves, shape);
        let threads = rves.len() * shape.threads;
        let rows = threads * shape.rows;
        let zero = R::Fraction::default();
        let mut state = Self {
            header: vec![Header::default(); rves.len()],
            position: vec![[zero; 2]; threads],
            velocity: vec![[R::default(); 2]; threads],
            spin: vec![R::default(); threads],
            reference: vec![[zero; 2]; threads],
            listed: vec![0; threads],
            neighbour: vec![0; rows],
            image: vec![0; rows],
            tangential: vec![R::default(); rows],
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

    pub fn make_batch(&mut self, parameters: &RveParameters, shape: &Shape) -> RveBatch<R> {
        let law = ContactLaw::new(parameters, 0.0);
        let disc = std::mem::take(&mut self.disc);
        let mut rves: Vec<Rve<R>> =
            self.chunks_mut(shape).map(|chunk| chunk.get(&disc, shape, &law)).collect();
        self.disc = disc;
        let fresh = rves.pop().expect("the fresh packing is the last").packing;
        RveBatch { parameters: parameters.clone(), rves, fresh }
    }

    /// Each RVE's part.
    fn chunks_mut(&mut self, shape: &Shape) -> impl IndexedParallelIterator<Item = Chunk<'_, R>> {
        let (threads, rows) = (shape.threads, shape.threads * shape.rows);
        (
            &mut self.header,
            self.position.par_chunks_mut(threads),
            self.velocity.par_chunks_mut(threads),
            self.spin.par_chunks_mut(threads),
            self.reference.par_chunks_mut(threads),
            self.listed.par_chunks_mut(threads),
            self.neighbour.par_chunks_mut(rows),
            self.image.par_chunks_mut(rows),
            self.tangential.par_chunks_mut(rows),
        )
            .into_par_iter()
            .map(
                |(
                    header,
                    position,
                    velocity,
                    spin,
                    reference,
                    listed,
                    neighbour,
                    image,
                    tangential,
                )| Chunk {
                    header,
                    position,
                    velocity,
                    spin,
                    reference,
                    listed,
                    neighbour,
                    image,
                    tangential,
                },
            )
    }
}

/// One RVE's part of the arrays.
struct Chunk<'a, R: CudaReal> {
    header: &'a mut Header,
    position: &'a mut [[R::Fraction; 2]],
    velocity: &'a mut [[R; 2]],
    spin: &'a mut [R],
    reference: &'a mut [[R::Fraction; 2]],
    listed: &'a mut [u8],
    neighbour: &'a mut [u16],
    image: &'a mut [u16],
    tangential: &'a mut [R],
}

impl<R: CudaReal> Chunk<'_, R> {
    fn put(&mut self, rve: &Rve<R>, grading: u32, shape: &Shape) -> Result<(), RveFailure> {
        let packing = &rve.packing;
        let list = &packing.neighbours;
        let full = RveFailure::ListFull { rows: shape.rows };
        if !list.images.iter().all(|&image| list::fits_code(image)) {
            return Err(full);
        }
        let sides = list::two_sided(list, packing.discs.len());
        let discs = packing.discs.iter().enumerate();
        for ((i, d), side) in discs.zip(&sides) {
            self.position[i] = d.s;
            self.velocity[i] = d.u;
            self.spin[i] = d.w;
            self.reference[i] = list.reference.get(i).copied().unwrap_or(d.s);
            if side.len() > shape.rows {
                return Err(full);
            }
            self.listed[i] = side.len() as u8;
            for (row, entry) in side.iter().enumerate() {
                let k = row * shape.threads + i;
                self.neighbour[k] = entry.packed();
                self.image[k] = entry.image;
                self.tangential[k] = entry.tangential;
            }
        }

        let r_max = packing.discs.iter().fold(0.0, |r: f64, d| r.max(d.r.to_f64()));
        *self.header = Header {
            cell: row_major(&packing.cell.h),
            reference_cell: row_major(&list.reference_cell),
            skin: list.skin,
            reach: 2.0 * r_max,
            solid: packing.solid_fraction() * packing.cell.area(),
            mass: packing.discs.iter().map(|d| 1.0 / d.inv_mass.to_f64()).sum(),
            spin: packing.spin,
            free_area: rve.free_area.unwrap_or(-1.0),
            reference_area: rve.area(),
            grading,
            imaged: u32::from(!list.images.is_empty()),
            status: 0,
            steps: 0,
        };
        Ok(())
    }

    fn get(&self, disc: &[DiscConstants<R>], shape: &Shape, law: &ContactLaw<R>) -> Rve<R> {
        let header = &*self.header;
        let constants = &disc[header.grading as usize * shape.threads..][..shape.discs];
        let discs: Vec<Disc<R>> = constants
            .iter()
            .enumerate()
            .map(|(i, &[r, inv_mass, inv_inertia, _])| Disc {
                s: self.position[i],
                u: self.velocity[i],
                w: self.spin[i],
                r,
                inv_mass,
                inv_inertia,
            })
            .collect();
        let sides: Vec<Vec<Entry<R>>> = (0..shape.discs)
            .map(|i| {
                (0..self.listed[i] as usize)
                    .map(|row| row * shape.threads + i)
                    .map(|k| Entry::unpack(self.neighbour[k], self.image[k], self.tangential[k]))
                    .collect()
            })
            .collect();
        let (pairs, images) = list::one_sided(&sides, header.imaged != 0, &discs, law);

        let mut neighbours = Neighbours {
            pairs,
            images,
            reference_cell: matrix(header.reference_cell),
            reference: self.reference[..shape.discs].to_vec(),
            reach: header.reach,
            skin: header.skin,
            ..Neighbours::default()
        };
        neighbours.travel = neighbours.displacement(&discs);
        let cell = Cell { h: matrix(header.cell) };
        let packing = Packing { cell, discs, neighbours, spin: header.spin };
        Rve { packing, free_area: (header.free_area >= 0.0).then_some(header.free_area) }
    }
}

/// The distinct tables of discs, one after the other, and which one each RVE has.
fn gradings<R: CudaReal>(rves: &[&Rve<R>], shape: &Shape) -> (Vec<u32>, Vec<DiscConstants<R>>) {
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
                let rest = std::iter::repeat_n([one; 4], shape.threads - shape.discs);
                table.extend(constants.map(|[r, m, j]| [r, m, j, R::default()]).chain(rest));
                next
            })
        })
        .collect();
    (index, table)
}

fn row_major(m: &Matrix2<f64>) -> [f64; 4] {
    [m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)]]
}

fn matrix(row_major: [f64; 4]) -> Matrix2<f64> {
    Matrix2::from_row_slice(&row_major)
}
