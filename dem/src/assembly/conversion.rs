//! Assemblies from grains as plain numbers, and back.

use super::boundary::Boundary;
use super::coordinates::Region;
use super::energy::Losses;
use super::error::{AssemblyError, GrainFailure};
use super::memory::ContactMemory;
use super::packed::{Grain, Packed, PackedContact, Partner};
use super::pairs::{History, Rolling, Sliding};
use super::state::{Assembly, Buffer};
use crate::disc::Disc;
use crate::grains::Grains;
use crate::real::Real;

impl<R: Real> Assembly<R> {
    /// Grains within a boundary under `gravity` (m/s²), to be advanced in steps of `dt` (s).
    ///
    /// # Errors
    /// A grain lies outside of the domain or inside a box.
    pub fn new(
        grains: &Grains,
        boundary: &Boundary,
        gravity: [f64; 2],
        dt: f64,
        packed: &Packed,
    ) -> Result<Self, AssemblyError> {
        let margin = 2.0 * grains.radius_max;
        let region = Region::around(boundary.corner, boundary.upper_corner(), margin);
        let disc = |x: [f64; 2], v: [f64; 2], w: f64, r: f64, mobile: bool| {
            let mass = grains.mass_scale * grains.disc_mass(r);
            let inverse = |m: f64| R::from_f64(if mobile { 1.0 / m } else { 0.0 });
            Disc {
                s: region.encode::<R>(x),
                u: v.map(R::from_f64),
                w: R::from_f64(w),
                r: R::from_f64(r),
                inv_mass: inverse(mass),
                inv_inertia: inverse(0.5 * mass * r * r),
            }
        };
        let bodies = boundary.bodies(grains);
        for (index, grain) in packed.grains.iter().enumerate() {
            let error = |failure| {
                Err(AssemblyError::Grain { step: 0, grain: index, position: grain.x, failure })
            };
            if !grain.x.iter().chain(&grain.v).chain([&grain.w, &grain.r]).all(|x| x.is_finite()) {
                return error(GrainFailure::NotFinite);
            }
            if !region.contains(grain.x) {
                return error(GrainFailure::Outside);
            }
            if bodies.iter().any(|body| body.branch(grain.x, 0.0) == [0.0; 2]) {
                return error(GrainFailure::Leak);
            }
        }
        let mobile = packed.grains.iter().map(|g| disc(g.x, g.v, g.w, g.r, true));
        let fixed = boundary.floor_grains(grains);
        let fixed = fixed.into_iter().map(|(x, r)| disc(x, [0.0; 2], 0.0, r, false));
        let discs: Vec<Disc<R>> = mobile.chain(fixed).collect();
        let mut assembly = Self {
            grains: grains.clone(),
            size: boundary.size,
            bodies,
            gravity,
            dt,
            drag: 0.0,
            region,
            time: 0.0,
            steps: 0,
            ids: (0..discs.len() as u32).collect(),
            discs,
            mobile: packed.grains.len(),
            tiles: Vec::new(),
            reference: Vec::new(),
            travel: 0.0,
            searches: 0,
            losses: Losses::default(),
            max_overlap: 0.0,
            sleep: None,
            rest: Vec::new(),
            skipped: 0,
            audit: 0.0,
            next: Buffer::default(),
        };
        let count = assembly.discs.len();
        assembly.search_with(|_| memory(packed, count));
        Ok(assembly)
    }

    /// Grains and contacts as plain numbers.
    pub fn packed(&self) -> Packed {
        let mut grains = vec![Grain::default(); self.mobile];
        for (disc, &id) in self.discs.iter().zip(&self.ids) {
            if let Some(grain) = grains.get_mut(id as usize) {
                grain.x = self.region.decode::<R>(disc.s);
                grain.v = disc.u.map(R::to_f64);
                grain.w = disc.w.to_f64();
                grain.r = disc.r.to_f64();
            }
        }
        let memory = self.memory();
        let contacts = memory.contacts().map(|(grain, partner, history)| {
            let partner = match (partner.checked_sub(self.mobile as u32), partner) {
                (None, grain) => Partner::Grain(grain),
                (Some(floor), _) => Partner::Floor(floor),
            };
            packed_contact(grain, partner, &history)
        });
        let bodies = memory.body_contacts().into_iter().map(|(grain, body, history)| {
            packed_contact(grain, Partner::Body(u32::from(body)), &history)
        });
        let mut contacts: Vec<PackedContact> = contacts.chain(bodies).collect();
        contacts.sort_by_key(|contact| (contact.grain, contact.partner));
        Packed { grains, contacts }
    }
}

fn packed_contact<R: Real>(grain: u32, partner: Partner, history: &History<R>) -> PackedContact {
    PackedContact {
        grain,
        partner,
        tangential: history.sliding.tangential.to_f64(),
        viscous: history.sliding.viscous.to_f64(),
        rolling: history.rolling.spring.to_f64(),
        rolling_viscous: history.rolling.viscous.to_f64(),
    }
}

/// The contacts of packed grains.
fn memory<R: Real>(packed: &Packed, discs: usize) -> ContactMemory<R> {
    let mobile = packed.grains.len() as u32;
    let real = R::from_f64;
    let history = |contact: &PackedContact| History {
        sliding: Sliding { tangential: real(contact.tangential), viscous: real(contact.viscous) },
        rolling: Rolling { spring: real(contact.rolling), viscous: real(contact.rolling_viscous) },
    };
    let (mut pairs, mut bodies) = (Vec::new(), Vec::new());
    for contact in &packed.contacts {
        match contact.partner {
            Partner::Grain(other) => pairs.push((contact.grain, other, history(contact))),
            Partner::Floor(k) => pairs.push((contact.grain, mobile + k, history(contact))),
            Partner::Body(body) => bodies.push((contact.grain, body as u16, history(contact))),
        }
    }
    ContactMemory::new(discs, &pairs, bodies.into_iter())
}
