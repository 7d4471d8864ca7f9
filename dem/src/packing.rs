//! Discs in a periodic cell: the state that a DEM step advances.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::cell::Cell;
use crate::disc::{Disc, PlainDisc};
use crate::grains::Grains;
use crate::neighbours::{Neighbours, branch};
use crate::real::Real;

/// A periodic packing with its contact history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Packing<R: Real> {
    /// The periodic cell.
    pub cell: Cell,
    /// The discs.
    pub discs: Vec<Disc<R>>,
    /// Pairs that can touch, with the history of their contacts.
    pub neighbours: Neighbours<R>,
    /// Spin `W = (L_yx - L_xy) / 2` (1/s) that the discs' angular velocities contain.
    pub spin: f64,
}

impl<R: Real> Packing<R> {
    /// A packing of discs at rest, without contact history.
    ///
    /// `mass` gives the inertial mass (kg) of a disc of a given radius (m).
    ///
    /// # Panics
    /// The cell is degenerate, or there are more than 65 536 discs.
    pub fn new(cell: Cell, discs: &[PlainDisc], mass: impl Fn(f64) -> f64) -> Self {
        let inverse = cell.inverse().expect("cell vectors are independent");
        assert!(discs.len() <= 1 << 16, "at most 65536 discs");
        let discs = discs
            .iter()
            .map(|d| {
                let s = inverse * Vector2::from(d.x);
                let m = mass(d.r);
                Disc {
                    s: [R::fraction(s.x), R::fraction(s.y)],
                    u: [R::default(); 2],
                    w: R::default(),
                    r: R::from_f64(d.r),
                    inv_mass: R::from_f64(1.0 / m),
                    inv_inertia: R::from_f64(2.0 / (m * d.r * d.r)),
                }
            })
            .collect();
        Self { cell, discs, neighbours: Neighbours::default(), spin: 0.0 }
    }

    /// Positions and radii as plain numbers.
    pub fn plain_discs(&self) -> Vec<PlainDisc> {
        self.discs
            .iter()
            .map(|d| {
                let s = Vector2::from(d.s.map(R::fraction_to_f64));
                PlainDisc { x: (self.cell.h * s).into(), r: d.r.to_f64() }
            })
            .collect()
    }

    /// The same packing in another precision, with its contact history. The next step searches
    /// neighbours anew.
    pub fn convert<Q: Real>(&self) -> Packing<Q> {
        let real = |x: R| Q::from_f64(x.to_f64());
        Packing {
            cell: self.cell,
            discs: self
                .discs
                .iter()
                .map(|d| Disc {
                    s: d.s.map(|s| Q::fraction(R::fraction_to_f64(s))),
                    u: d.u.map(real),
                    w: real(d.w),
                    r: real(d.r),
                    inv_mass: real(d.inv_mass),
                    inv_inertia: real(d.inv_inertia),
                })
                .collect(),
            neighbours: self.neighbours.convert(),
            spin: self.spin,
        }
    }

    /// Sum of the disc areas over the cell area.
    pub fn solid_fraction(&self) -> f64 {
        let solid: f64 =
            self.discs.iter().map(|d| std::f64::consts::PI * d.r.to_f64().powi(2)).sum();
        solid / self.cell.area()
    }

    /// Kinetic energy of the peculiar motion and of the spin relative to the cell (J).
    pub fn kinetic_energy(&self) -> f64 {
        self.discs
            .iter()
            .map(|d| {
                let u2 = d.u[0].to_f64().powi(2) + d.u[1].to_f64().powi(2);
                let w = d.w.to_f64() - self.spin;
                0.5 * (u2 / d.inv_mass.to_f64() + w * w / d.inv_inertia.to_f64())
            })
            .sum()
    }

    /// Elastic energy of all contacts (J): $k_n \delta^2 / 2 + f_t^2 / (2 k_t) + s^2 / (2 k_r)$ each.
    pub fn elastic_energy(&self, grains: &Grains) -> f64 {
        self.contacts()
            .map(|c| {
                0.5 * grains.normal_stiffness * c.overlap.powi(2)
                    + 0.5 * c.tangential.powi(2) / grains.tangential_stiffness
                    + 0.5 * c.rolling.powi(2) / grains.rolling_stiffness
            })
            .sum()
    }

    /// All touching pairs at the present positions.
    pub fn contacts(&self) -> impl Iterator<Item = Contact> + '_ {
        self.neighbours.pairs.iter().enumerate().filter_map(|(index, pair)| {
            let image = self.neighbours.image(index);
            let branch = branch(&self.cell, &self.discs, pair, image);
            let (i, j) = (pair.i as usize, pair.j as usize);
            let overlap = self.discs[i].r.to_f64() + self.discs[j].r.to_f64() - branch.norm();
            let tangential = pair.tangential.to_f64();
            let rolling = self.neighbours.rolling.get(index).map_or(0.0, |x| x.to_f64());
            (overlap > 0.0).then_some(Contact { i, j, branch, overlap, tangential, rolling })
        })
    }

    /// Lists all pairs within `r_i + r_j + skin` (m) anew, after reducing the lattice where it has become
    /// oblique. Touching pairs keep their history.
    pub(crate) fn search(&mut self, skin: f64, dashpot: impl Fn(&Disc<R>, &Disc<R>) -> R) {
        self.neighbours.search(&mut self.cell, &mut self.discs, skin, dashpot);
    }

    /// Adds the change of the cell's spin to all angular velocities, so that a change of the rotation
    /// rate does not load the tangential springs.
    pub fn set_spin(&mut self, velocity_gradient: &Matrix2<f64>) {
        let spin = 0.5 * (velocity_gradient[(1, 0)] - velocity_gradient[(0, 1)]);
        let change = R::from_f64(spin - self.spin);
        if spin != self.spin {
            self.discs.iter_mut().for_each(|d| d.w += change);
            self.spin = spin;
        }
    }

    /// Multiplies the inertial mass of every disc by `factor`.
    pub fn scale_mass(&mut self, factor: f64) {
        let inverse = R::from_f64(1.0 / factor);
        for d in &mut self.discs {
            d.inv_mass = d.inv_mass * inverse;
            d.inv_inertia = d.inv_inertia * inverse;
        }
    }

    /// Removes the mean peculiar velocity, which would carry rattlers away.
    pub fn remove_drift(&mut self) {
        let (mut mass, mut momentum) = (0.0, Vector2::zeros());
        for d in &self.discs {
            let m = 1.0 / d.inv_mass.to_f64();
            mass += m;
            momentum += Vector2::new(d.u[0].to_f64(), d.u[1].to_f64()) * m;
        }
        let mean = (momentum / mass).map(R::from_f64);
        for d in &mut self.discs {
            d.u[0] -= mean.x;
            d.u[1] -= mean.y;
        }
    }
}

/// A touching pair.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Index of one disc.
    pub i: usize,
    /// Index of the other disc.
    pub j: usize,
    /// From `i` to the touching image of `j` (m).
    pub branch: Vector2<f64>,
    /// $r_i + r_j$ minus the length of the branch (m).
    pub overlap: f64,
    /// Tangential spring force on `j` (N).
    pub tangential: f64,
    /// Rolling spring force (N): its torque on `j` over the reduced radius.
    pub rolling: f64,
}
