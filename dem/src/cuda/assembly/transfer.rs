//! Discs and contacts between an assembly and the arrays of the device.

use nalgebra::Matrix2;

use super::abi::{Body, Disc, History, Motion, NEAR_BODIES, Output, Place};
use crate::assembly::{Assembly, ContactMemory, GrainState, History as CpuHistory, RigidBox};
use crate::cuda::real::CudaReal;
use crate::disc;

/// Bit of [`Motion::info`] that says that bodies are near, and the first of the rows.
const BODIES_NEAR: u32 = 1 << 5;
const FIRST_ROW: u32 = 8;
/// No body, in a byte of the list of bodies.
const NO_BODY: u32 = 255;

/// Arrays over discs, as on the device.
pub(super) struct Host<R: CudaReal> {
    pub disc: Vec<Disc<R>>,
    pub id: Vec<u32>,
    pub list: Vec<u32>,
    pub history: Vec<History<R>>,
    pub near_bodies: Vec<u32>,
    pub body_history: Vec<History<R>>,
}

impl<R: CudaReal> Host<R> {
    /// The discs of an assembly; lists hold the touching pairs only.
    pub fn from_assembly(assembly: &Assembly<R>, rows: usize) -> Self {
        let count = assembly.discs.len();
        let mut place_of = vec![0; count];
        for (place, &id) in assembly.ids.iter().enumerate() {
            place_of[id as usize] = place as u32;
        }
        let mut info = vec![0_u32; count];
        let mut list = vec![0; rows * count];
        let mut history = vec![History::default(); rows * count];
        let memory = assembly.memory();
        for (a, b, contact) in memory.contacts() {
            for (own, other) in [(a, b), (b, a)] {
                let own = place_of[own as usize] as usize;
                let row = info[own] & 31;
                if (row as usize) < rows {
                    list[row as usize * count + own] = place_of[other as usize];
                    history[row as usize * count + own] = contact.into();
                    info[own] = (info[own] | 1 << (FIRST_ROW + row)) + 1;
                }
            }
        }
        let mut near_bodies = vec![u32::MAX; count];
        let mut body_history = vec![History::default(); NEAR_BODIES * count];
        for (id, body, contact) in memory.body_contacts() {
            let own = place_of[id as usize] as usize;
            let free = (0..NEAR_BODIES).find(|k| near_bodies[own] >> (8 * k) & 255 == NO_BODY);
            if let Some(k) = free {
                near_bodies[own] &= !(255 << (8 * k)) | u32::from(body) << (8 * k);
                body_history[k * count + own] = contact.into();
                info[own] |= BODIES_NEAR;
            }
        }
        let disc = assembly.discs.iter().zip(&info).map(|(d, &info)| Disc {
            place: Place { x: d.s[0], y: d.s[1], r: d.r, inv_mass: d.inv_mass },
            motion: Motion { x: d.u[0], y: d.u[1], w: d.w, info: R::info(info) },
        });
        let (disc, id) = (disc.collect(), assembly.ids.clone());
        Self { disc, id, list, history, near_bodies, body_history }
    }

    /// Puts discs and contacts back into their assembly, and searches its neighbours.
    pub fn write_to(&self, assembly: &mut Assembly<R>) {
        let count = self.disc.len();
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
        let (mut pairs, mut bodies) = (Vec::new(), Vec::new());
        for (i, disc) in self.disc.iter().enumerate() {
            let info = R::info_bits(disc.motion.info);
            for row in (0..info & 31).filter(|row| info >> (FIRST_ROW + row) & 1 == 1) {
                let at = row as usize * count + i;
                let (own, other) = (self.id[i], self.list[at] as usize);
                let fixed = self.disc[other].place.inv_mass == R::default();
                // Both discs have the contact, a fixed one does not.
                if fixed || own < self.id[other] {
                    pairs.push((own, self.id[other], self.history[at].into()));
                }
            }
            if info & BODIES_NEAR == 0 {
                continue;
            }
            for k in 0..NEAR_BODIES {
                let body = self.near_bodies[i] >> (8 * k) & 255;
                if body != NO_BODY {
                    let contact = self.body_history[k * count + i];
                    bodies.push((self.id[i], body as u16, contact.into()));
                }
            }
        }
        let memory = ContactMemory::new(count, &pairs, bodies.into_iter());
        assembly.search_with(|_| memory);
    }
}

impl<R: CudaReal> From<CpuHistory<R>> for History<R> {
    fn from(h: CpuHistory<R>) -> Self {
        Self { tangential: h.tangential, viscous: h.viscous }
    }
}

impl<R: CudaReal> From<History<R>> for CpuHistory<R> {
    fn from(h: History<R>) -> Self {
        Self { tangential: h.tangential, viscous: h.viscous }
    }
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
