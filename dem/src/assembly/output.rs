//! What an assembly reports: states of its grains and its energy.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::boundary::Body;
use super::energy::Energy;
use super::packed::GrainState;
use super::pairs::History;
use super::state::Assembly;
use super::tile::Tile;
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::grains::Grains;
use crate::real::Real;

/// Grains whose energy is added up at a time.
const CHUNK: usize = 4096;

/// A touching pair at the present positions.
struct Contact {
    /// Force on the partner (N).
    force: Vector2<f64>,
    /// From the grain to the partner.
    normal: Vector2<f64>,
    overlap: f64,
    tangential: f64,
    /// Force of the rolling spring (N).
    rolling: f64,
}

impl<R: Real> Assembly<R> {
    /// The state of each grain, in the order of [`Packed::grains`](super::Packed::grains).
    pub fn states(&self) -> Vec<GrainState> {
        self.states_of(&self.listed())
    }

    /// The energy of the grains (J).
    pub fn energy(&self) -> Energy {
        self.states_and_energy().1
    }

    /// [`states`](Self::states) and [`energy`](Self::energy), from one listing of contacts.
    pub fn states_and_energy(&self) -> (Vec<GrainState>, Energy) {
        let tiles = self.listed();
        let states = self.states_of(&tiles);
        let energy = Energy { elastic: self.elastic_energy(&tiles), ..self.energy_of(&states) };
        (states, energy)
    }

    /// States of the grains of listed tiles.
    fn states_of(&self, tiles: &[Tile<R>]) -> Vec<GrainState> {
        let law = self.law();
        let bodies = self.bodies_now();
        let tiles: Vec<Vec<GrainState>> =
            tiles.par_iter().map(|tile| self.tile_states(tile, &law, &bodies)).collect();
        let mut states = vec![GrainState::default(); self.mobile];
        for (state, &id) in tiles.into_iter().flatten().zip(&self.ids) {
            if let Some(place) = states.get_mut(id as usize) {
                *place = state;
            }
        }
        states
    }

    /// States of the own discs of a tile.
    fn tile_states(
        &self,
        tile: &Tile<R>,
        law: &ContactLaw<R>,
        bodies: &[Body<R>],
    ) -> Vec<GrainState> {
        let own = &self.discs[tile.first as usize..tile.end as usize];
        let mut states: Vec<GrainState> = own
            .iter()
            .map(|disc| GrainState {
                x: self.region.decode::<R>(disc.s),
                v: disc.u.map(R::to_f64),
                w: disc.w.to_f64(),
                r: disc.r.to_f64(),
                mass: self.mass_of(disc.inv_mass),
                ..GrainState::default()
            })
            .collect();
        for pair in tile.inner.iter().chain(tile.outer.iter()) {
            let (a, b) = (&self.discs[pair.i as usize], &self.discs[pair.j as usize]);
            let Some(contact) = self.contact(law, a, b, pair.contact, pair.dashpot) else {
                continue;
            };
            for (k, r) in [(pair.i, a.r), (pair.j, b.r)] {
                if let Some(state) = states.get_mut(k.wrapping_sub(tile.first) as usize) {
                    state.add(&contact, r.to_f64() - 0.5 * contact.overlap);
                }
            }
        }
        for pair in &tile.bodies {
            let disc = &self.discs[pair.disc as usize];
            let body = &bodies[usize::from(pair.body)];
            if let Some(contact) = self.body_contact(law, disc, body, pair.contact, pair.dashpot) {
                let arm = disc.r.to_f64() - contact.overlap;
                states[(pair.disc - tile.first) as usize].add(&contact, arm);
            }
        }
        states
    }

    fn contact(
        &self,
        law: &ContactLaw<R>,
        a: &Disc<R>,
        b: &Disc<R>,
        history: History<R>,
        dashpot: R,
    ) -> Option<Contact> {
        let unit = self.region.unit::<R>();
        let branch = Vector2::from([0, 1].map(|k| R::nearest(a.s[k], b.s[k]).to_f64() * unit));
        let velocity = Vector2::from([0, 1].map(|k| (b.u[k] - a.u[k]).to_f64()));
        let reach = a.r.to_f64() + b.r.to_f64();
        Contact::new(law, branch, reach, velocity, history, dashpot)
    }

    fn body_contact(
        &self,
        law: &ContactLaw<R>,
        disc: &Disc<R>,
        body: &Body<R>,
        history: History<R>,
        dashpot: R,
    ) -> Option<Contact> {
        let unit = self.region.unit::<R>();
        let branch = Vector2::from(body.branch(disc.s).map(|x| x.to_f64() * unit));
        let velocity = Vector2::from([0, 1].map(|k| (body.velocity[k] - disc.u[k]).to_f64()));
        Contact::new(law, branch, disc.r.to_f64(), velocity, history, dashpot)
    }

    /// Mass (kg) of a disc of this inverse inertial mass.
    pub(crate) fn mass_of(&self, inverse: R) -> f64 {
        1.0 / (inverse.to_f64() * self.grains.mass_scale)
    }

    /// Kinetic and potential energy of grains in these states (J). The same bits for any number of threads.
    pub(crate) fn energy_of(&self, states: &[GrainState]) -> Energy {
        let parts: Vec<[f64; 2]> =
            states.par_chunks(CHUNK).map(|part| self.kinetic_and_potential(part)).collect();
        let mut energy = Energy { losses: self.losses, ..Energy::default() };
        for [kinetic, potential] in parts {
            energy.kinetic += kinetic;
            energy.potential += potential;
        }
        energy
    }

    fn kinetic_and_potential(&self, states: &[GrainState]) -> [f64; 2] {
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for grain in states {
            let mass = self.grains.mass_scale * grain.mass;
            let [u, v] = grain.v;
            let spin = 0.5 * (grain.r * grain.w).powi(2);
            kinetic += 0.5 * mass * (u * u + v * v + spin);
            let [x, y] = grain.x;
            potential -= mass * (self.gravity[0] * x + self.gravity[1] * y);
        }
        [kinetic, potential]
    }

    /// Elastic energy of all contacts of listed tiles (J).
    fn elastic_energy(&self, tiles: &[Tile<R>]) -> f64 {
        let mut energy = 0.0;
        let law = self.law();
        let bodies = self.bodies_now();
        let stored = |contact: &Contact| {
            let Grains { normal_stiffness, tangential_stiffness, rolling_stiffness, .. } =
                self.grains;
            0.5 * normal_stiffness * contact.overlap.powi(2)
                + 0.5 * contact.tangential.powi(2) / tangential_stiffness
                + 0.5 * contact.rolling.powi(2) / rolling_stiffness
        };
        for tile in tiles {
            for (pairs, weight) in [(&tile.inner, 1.0), (&tile.outer, 0.5)] {
                for pair in pairs.iter() {
                    let a = &self.discs[pair.i as usize];
                    let b = &self.discs[pair.j as usize];
                    let contact = self.contact(&law, a, b, pair.contact, pair.dashpot);
                    energy += weight * contact.as_ref().map_or(0.0, stored);
                }
            }
            for pair in &tile.bodies {
                let disc = &self.discs[pair.disc as usize];
                let body = &bodies[usize::from(pair.body)];
                let contact = self.body_contact(&law, disc, body, pair.contact, pair.dashpot);
                energy += contact.as_ref().map_or(0.0, stored);
            }
        }
        energy
    }
}

impl Contact {
    fn new<R: Real>(
        law: &ContactLaw<R>,
        branch: Vector2<f64>,
        reach: f64,
        velocity: Vector2<f64>,
        history: History<R>,
        dashpot: R,
    ) -> Option<Self> {
        let length = branch.norm();
        let overlap = reach - length;
        if overlap <= 0.0 || length == 0.0 {
            return None;
        }
        let normal = branch / length;
        let tangent = Vector2::new(-normal.y, normal.x);
        let elastic = law.normal_stiffness.to_f64() * overlap;
        let force = (elastic - dashpot.to_f64() * velocity.dot(&normal)).max(0.0);
        let tangential = history.sliding.tangential.to_f64();
        let rolling = history.rolling.spring.to_f64();
        let force = force * normal + tangential * tangent;
        Some(Self { force, normal, overlap, tangential, rolling })
    }
}

impl GrainState {
    /// Adds a contact at the end of an arm of this length (m). Seen from either disc, force and arm have
    /// the same sign.
    fn add(&mut self, contact: &Contact, arm: f64) {
        self.contacts += 1;
        let virial: Matrix2<f64> = contact.force * (arm * contact.normal).transpose();
        self.virial += virial;
    }
}
