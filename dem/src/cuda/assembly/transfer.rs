//! Discs and contacts between an assembly and the arrays of the device.

use nalgebra::Matrix2;

use super::abi::{Body, Disc, History, Motion, NEAR_BODIES, Output, Place, Rest};
use super::grid::{Grid, row_length};
use crate::assembly::{
    Assembly, ContactMemory, GrainState, History as CpuHistory, Rest as CpuRest, RigidBox, Rolling,
    Sliding, State,
};
use crate::cuda::real::CudaReal;
use crate::disc;

/// Bit of [`Motion::info`] that says that bodies are near, and the first of the rows.
const BODIES_NEAR: u32 = 1 << 5;
const FIRST_ROW: u32 = 8;
/// First of the two bits of the state of rest.
const STATE_SHIFT: u32 = 6;
/// No body, in a byte of the list of bodies.
const NO_BODY: u32 = 255;

/// Arrays over discs, as on the device.
pub(super) struct Host<R: CudaReal> {
    pub disc: Vec<Disc<R>>,
    pub id: Vec<u32>,
    pub list: Vec<u32>,
    /// Of sliding, then of rolling; as [`Self::body_history`].
    pub history: Vec<History<R>>,
    pub near_bodies: Vec<u32>,
    pub body_history: Vec<History<R>>,
    /// Empty where discs do not sleep.
    pub rest: Vec<Rest<R>>,
}

impl<R: CudaReal> Host<R> {
    /// The discs of an assembly, which go on to sleep if it `sleeps`; lists hold the touching pairs only.
    pub fn from_assembly(assembly: &Assembly<R>, grid: &Grid, sleeps: bool) -> Self {
        let (count, rows) = (assembly.discs.len(), grid.rows as usize);
        let length = row_length(count);
        let mut place_of = vec![0; count];
        for (place, &id) in assembly.ids.iter().enumerate() {
            place_of[id as usize] = place as u32;
        }
        let mut info = vec![0_u32; count];
        let mut list = vec![0; rows * length];
        let mut history = vec![History::default(); grid.histories() * rows * length];
        let memory = assembly.memory();
        for (a, b, contact) in memory.contacts() {
            for (own, other, contact) in [(a, b, contact), (b, a, contact.reversed())] {
                let own = place_of[own as usize] as usize;
                let row = info[own] & 31;
                if (row as usize) < rows {
                    let at = row as usize * length + own;
                    list[at] = place_of[other as usize];
                    put(&contact, &mut history, at, grid);
                    info[own] = (info[own] | 1 << (FIRST_ROW + row)) + 1;
                }
            }
        }
        let mut near_bodies = vec![u32::MAX; count];
        let mut body_history = vec![History::default(); grid.histories() * NEAR_BODIES * length];
        for (id, body, contact) in memory.body_contacts() {
            let own = place_of[id as usize] as usize;
            let free = (0..NEAR_BODIES).find(|k| near_bodies[own] >> (8 * k) & 255 == NO_BODY);
            if let Some(k) = free {
                near_bodies[own] &= !(255 << (8 * k)) | u32::from(body) << (8 * k);
                put(&contact, &mut body_history, k * length + own, grid);
                info[own] |= BODIES_NEAR;
            }
        }
        let mut rest = Vec::new();
        if sleeps {
            for (info, of_disc) in info.iter_mut().zip(&assembly.rest) {
                *info |= bits_of(of_disc.state) << STATE_SHIFT;
                rest.push(Rest::from(of_disc));
            }
        }
        let disc = assembly.discs.iter().zip(&info).map(|(d, &info)| Disc {
            place: Place { x: d.s[0], y: d.s[1], r: d.r, inv_mass: d.inv_mass },
            motion: Motion { x: d.u[0], y: d.u[1], w: d.w, info: R::info(info) },
        });
        let (disc, id) = (disc.collect(), assembly.ids.clone());
        Self { disc, id, list, history, near_bodies, body_history, rest }
    }

    /// Puts discs and contacts back into their assembly, and searches its neighbours.
    pub fn write_to(&self, assembly: &mut Assembly<R>, grid: &Grid) {
        let (count, length) = (self.disc.len(), row_length(self.disc.len()));
        let mut inertia = vec![R::default(); count];
        for (d, &id) in assembly.discs.iter().zip(&assembly.ids) {
            inertia[id as usize] = d.inv_inertia;
        }
        let discs = self.disc.iter().zip(&self.id).map(|(d, &id)| disc::Disc {
            s: [d.place.x, d.place.y],
            u: [d.motion.x, d.motion.y],
            w: d.motion.w,
            r: d.place.r,
            inv_mass: d.place.inv_mass,
            inv_inertia: inertia[id as usize],
        });
        assembly.discs = discs.collect();
        assembly.ids.clone_from(&self.id);
        if assembly.sleep.is_some() {
            assembly.rest = self.rest();
        }
        let (mut pairs, mut bodies) = (Vec::new(), Vec::new());
        for (i, disc) in self.disc.iter().enumerate() {
            let info = R::info_bits(disc.motion.info);
            for row in (0..info & 31).filter(|row| info >> (FIRST_ROW + row) & 1 == 1) {
                let at = row as usize * length + i;
                let (own, other) = (self.id[i], self.list[at] as usize);
                let fixed = self.disc[other].place.inv_mass == R::default();
                // Both discs have the contact, a fixed one does not.
                if fixed || own < self.id[other] {
                    let contact = get(&self.history, at, grid);
                    pairs.push((own, self.id[other], contact));
                }
            }
            if info & BODIES_NEAR == 0 {
                continue;
            }
            for k in 0..NEAR_BODIES {
                let body = self.near_bodies[i] >> (8 * k) & 255;
                if body != NO_BODY {
                    let contact = get(&self.body_history, k * length + i, grid);
                    bodies.push((self.id[i], body as u16, contact));
                }
            }
        }
        let memory = ContactMemory::new(count, &pairs, bodies.into_iter());
        assembly.search_with(|_| memory);
    }

    /// What is known of the rest of each disc; all are awake where none slept.
    fn rest(&self) -> Vec<CpuRest<R>> {
        let pairs = self.disc.iter().enumerate();
        let of_disc = |(i, disc): (usize, &Disc<R>)| match self.rest.get(i) {
            Some(rest) => rest.of_disc(R::info_bits(disc.motion.info)),
            None => CpuRest { place: [disc.place.x, disc.place.y], ..CpuRest::default() },
        };
        pairs.map(of_disc).collect()
    }
}

/// The two bits of a state, as in `sleep.cu`.
fn bits_of(state: State) -> u32 {
    match state {
        State::Awake => 0,
        State::Drowsy => 1,
        State::Asleep => 2,
        State::Watched => 3,
    }
}

impl<R: CudaReal> From<&CpuRest<R>> for Rest<R> {
    fn from(rest: &CpuRest<R>) -> Self {
        let CpuRest { place: [x, y], looks, force, allowed, disturbed, .. } = *rest;
        Self { x, y, force, allowed, looks, disturbed: u32::from(disturbed) }
    }
}

impl<R: CudaReal> Rest<R> {
    /// The same of a disc of this `info`.
    fn of_disc(&self, info: u32) -> CpuRest<R> {
        let Self { x, y, force, allowed, looks, disturbed } = *self;
        let states = [State::Awake, State::Drowsy, State::Asleep, State::Watched];
        let state = states[(info >> STATE_SHIFT & 3) as usize];
        let (place, disturbed) = ([x, y], disturbed != 0);
        CpuRest { state, place, looks, force, allowed, disturbed, quiet: false }
    }
}

/// Puts a contact into its rows of sliding and of rolling.
fn put<R: CudaReal>(contact: &CpuHistory<R>, rows: &mut [History<R>], at: usize, grid: &Grid) {
    let CpuHistory { sliding, rolling } = contact;
    rows[at] = History { spring: sliding.tangential, viscous: sliding.viscous };
    if grid.rolling {
        rows[rows.len() / 2 + at] = History { spring: rolling.spring, viscous: rolling.viscous };
    }
}

/// The contact in these rows.
fn get<R: CudaReal>(rows: &[History<R>], at: usize, grid: &Grid) -> CpuHistory<R> {
    let History { spring, viscous } = rows[at];
    let sliding = Sliding { tangential: spring, viscous };
    let rolling = if grid.rolling { rows[rows.len() / 2 + at] } else { History::default() };
    let History { spring, viscous } = rolling;
    CpuHistory { sliding, rolling: Rolling { spring, viscous } }
}

impl From<&RigidBox> for Body {
    fn from(b: &RigidBox) -> Self {
        let f = b.faces;
        Self {
            min: b.min,
            max: b.max,
            velocity: b.velocity,
            start: b.start,
            friction: [f.left, f.right, f.bottom, f.top],
        }
    }
}

impl<R: CudaReal> Output<R> {
    /// The state of a grain of an assembly.
    pub fn state(&self, assembly: &Assembly<R>) -> GrainState {
        GrainState {
            x: assembly.region.decode::<R>([self.x, self.y]),
            v: [self.vx.to_f64(), self.vy.to_f64()],
            w: self.w.to_f64(),
            r: self.r.to_f64(),
            mass: assembly.mass_of(self.inv_mass),
            contacts: self.contacts,
            virial: Matrix2::from_row_slice(&self.virial.map(|x| x.to_f64())),
        }
    }
}
