//! Grains as plain numbers, with the history of their contacts.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

/// A grain as plain numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grain {
    /// Position (m).
    pub x: [f64; 2],
    /// Velocity (m/s).
    pub v: [f64; 2],
    /// Angular velocity (1/s), counter-clockwise.
    pub w: f64,
    /// Radius (m).
    pub r: f64,
}

/// What a grain is in contact with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Partner {
    /// A grain, by its index.
    Grain(u32),
    /// A fixed grain of a rough floor, by its index from the left.
    Floor(u32),
    /// A rigid body: the left, right, bottom and top wall, then the boxes.
    Body(u32),
}

/// The springs of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PackedContact {
    /// Index of the grain.
    pub grain: u32,
    /// What it touches.
    pub partner: Partner,
    /// Tangential force (N): positive acts on the partner counter-clockwise around the grain.
    pub tangential: f64,
    /// Normal force (N) less that of the spring.
    pub viscous: f64,
    /// Rolling spring force (N): its torque on the partner over the reduced radius.
    pub rolling: f64,
    /// Rolling force (N) less that of the spring.
    pub rolling_viscous: f64,
}

/// Grains and their contacts: what an [`Assembly`](super::Assembly) starts from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Packed {
    /// The grains.
    pub grains: Vec<Grain>,
    /// Contacts with a history, each once.
    pub contacts: Vec<PackedContact>,
}

impl Packed {
    /// Adds the grains of `other`, which keep their contacts with each other, the floor and bodies.
    pub fn append(&mut self, other: &Self) {
        let offset = self.grains.len() as u32;
        self.grains.extend_from_slice(&other.grains);
        self.contacts.extend(other.contacts.iter().map(|contact| PackedContact {
            grain: contact.grain + offset,
            partner: match contact.partner {
                Partner::Grain(k) => Partner::Grain(k + offset),
                fixed => fixed,
            },
            ..*contact
        }));
    }

    /// Keeps the grains that `keep` returns true for, and the contacts among them.
    pub fn retain(&mut self, keep: impl Fn(&Grain) -> bool) {
        let mut new = Vec::with_capacity(self.grains.len());
        let mut count = 0;
        for grain in &self.grains {
            let kept = keep(grain);
            new.push(kept.then_some(count));
            count += u32::from(kept);
        }
        self.grains.retain(|grain| keep(grain));
        self.contacts = std::mem::take(&mut self.contacts)
            .into_iter()
            .filter_map(|contact| {
                let grain = new[contact.grain as usize]?;
                let partner = match contact.partner {
                    Partner::Grain(k) => Partner::Grain(new[k as usize]?),
                    fixed => fixed,
                };
                Some(PackedContact { grain, partner, ..contact })
            })
            .collect();
    }
}

/// The state of a grain for output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GrainState {
    /// Position (m).
    pub x: [f64; 2],
    /// Velocity (m/s).
    pub v: [f64; 2],
    /// Angular velocity (1/s).
    pub w: f64,
    /// Radius (m).
    pub r: f64,
    /// Mass (kg).
    pub mass: f64,
    /// Number of contacts with grains and bodies.
    pub contacts: u32,
    /// $\sum_c \mathbf f^c \otimes \mathbf a^c$ (N m) over its contacts, with the arm $\mathbf a$ from the centre
    /// to the contact and the force on the partner: compression is positive. Over an area that holds several
    /// grains the sum is that of Love (1927) and Weber (1966).
    pub virial: Matrix2<f64>,
}
