//! Rolling resistance: spring, dashpot and slider against closed forms, and its history through searches.

use dem::element::Element;
use dem::{Cell, ContactLaw, Forces, Grains, Packing, PlainDisc, RveParameters, contact_forces};
use nalgebra::Matrix2;
use rstest::rstest;

use crate::common::{DENSE, expect, packing, parameters, stepwise};

const R: f64 = 3.75e-3;
const OVERLAP: f64 = 1.0e-5;

/// Grains in steps of 0.02 sqrt(m / kn), with a rolling spring of its own stiffness.
fn grains(rolling_friction: f64, damping_ratio: f64) -> Grains {
    Grains {
        radius_min: R,
        radius_max: 2.0 * R,
        rolling_friction,
        rolling_stiffness: 3.0e4,
        damping_ratio,
        step_factor: 0.02,
        ..Grains::default()
    }
}

/// Two discs pressed together whose centres are held: only their spins move.
struct Pair {
    packing: Packing<f64>,
    law: ContactLaw<f64>,
    forces: Forces<f64>,
}

impl Pair {
    fn new(grains: &Grains, radii: [f64; 2], spins: [f64; 2]) -> Self {
        let p = RveParameters {
            grains: grains.clone(),
            free_solid_fraction: 0.0,
            ..RveParameters::default()
        };
        let disc = |x: f64, r: f64| PlainDisc { x: [x, 0.05], r };
        let apart = radii[0] + radii[1] - OVERLAP;
        let discs = [disc(0.05, radii[0]), disc(0.05 + apart, radii[1])];
        let packing = Packing::new(Cell::square(0.2), &discs, |r| grains.disc_mass(r));
        // One step at rest lists the pair; then the start again.
        let mut element = stepwise(packing.clone(), &p);
        element.advance(&Matrix2::zeros()).unwrap();
        let neighbours = element.rve.packing.neighbours;
        let mut packing = Packing { neighbours, ..packing };
        packing.neighbours.pairs[0].tangential = 0.0;
        packing.neighbours.rolling.clear();
        for (disc, w) in packing.discs.iter_mut().zip(spins) {
            disc.w = w;
        }
        Self { packing, law: ContactLaw::new(grains, grains.step()), forces: Forces::default() }
    }

    /// Torques (N m) on both discs.
    fn torques(&mut self) -> [f64; 2] {
        contact_forces(&mut self.packing, &self.law, &Matrix2::zeros(), &mut self.forces);
        [0, 1].map(|k| self.forces.on_disc[k][2])
    }

    fn spin_up(&mut self) {
        for (disc, torque) in self.torques().into_iter().enumerate() {
            let disc = &mut self.packing.discs[disc];
            disc.w += self.law.dt * torque * disc.inv_inertia;
        }
    }
}

/// Two equal discs of opposite spins roll on each other without slip, v_r = -r w. Each feels -kr r² / 2 per
/// radian against J = m r² / 2: an oscillation of w0 = sqrt(kr / m), damped by c_r / (2 m w0) = zeta / sqrt(2),
/// as m_eff = m / 2. 1e-3 of the amplitude for half a step between spins and angles.
#[rstest]
fn a_pair_rolls_to_and_fro(#[values(0.0, 0.1, 0.5)] zeta: f64) {
    let p = grains(1.0e6, zeta);
    let mut pair = Pair::new(&p, [R, R], [1.0, -1.0]);
    let w0 = (p.rolling_stiffness / p.disc_mass(R)).sqrt();
    let xi = zeta / 2.0_f64.sqrt();
    let wd = w0 * (1.0 - xi * xi).sqrt();
    // Spins are those of half a step before the forces.
    let spin = |t: f64| (-xi * w0 * t).exp() * ((wd * t).cos() - xi * w0 / wd * (wd * t).sin());
    let start = spin(0.5 * pair.law.dt);
    let steps = (3.0 * std::f64::consts::TAU / w0 / pair.law.dt) as usize;
    let mut largest: f64 = 0.0;
    for n in 1..=steps {
        pair.spin_up();
        let expected = spin((n as f64 + 0.5) * pair.law.dt) / start;
        let [a, b] = [0, 1].map(|k| pair.packing.discs[k].w);
        assert!((a + b).abs() < 1.0e-9, "discs turn against each other");
        largest = largest.max((a - expected).abs());
    }
    expect("largest difference of spins", largest, 0.0, 0.02 * (0.1 + zeta));
}

/// Discs of 1 : 2 that go on rolling: torques of mu_r f_n r_i r_j / (r_i + r_j) against both, whatever the dashpot.
/// Turned back, the torque falls by kr R² per radian.
#[test]
fn the_slider_and_the_spring() {
    let p = grains(0.1, 0.0);
    let mut pair = Pair::new(&p, [R, 2.0 * R], [5.0, -5.0]);
    let reduced = 2.0 / 3.0 * R;
    let limit = p.rolling_friction * p.normal_stiffness * OVERLAP * reduced;
    // The sliding spring would add torques of its own.
    pair.law.friction = 0.0;
    let until = limit / (p.rolling_stiffness * reduced * reduced * 10.0);
    let steps = (1.2 * until / pair.law.dt) as usize;
    let early = (0.5 * until / pair.law.dt) as usize;
    for n in 1..=steps {
        let torques = pair.torques();
        if n == early {
            let turned = 10.0 * pair.law.dt * n as f64;
            let spring = p.rolling_stiffness * reduced * reduced * turned;
            expect("spring / theory", torques[1] / spring, 1.0, 1.0e-9);
        }
    }
    let [a, b] = pair.torques();
    expect("torque on i / limit", a / limit, -1.0, 1.0e-9);
    expect("torque on j / limit", b / limit, 1.0, 1.0e-9);
    for disc in &mut pair.packing.discs {
        disc.w = -disc.w;
    }
    let back = pair.torques()[1];
    let step = p.rolling_stiffness * reduced * reduced * 10.0 * pair.law.dt;
    expect("turned back", (b - back) / step, 1.0, 1.0e-6);
}

/// Two discs that turn as one rigid body do not roll.
#[test]
fn a_rigid_rotation_is_no_rolling() {
    let p = grains(0.1, 0.5);
    let mut pair = Pair::new(&p, [R, 2.0 * R], [7.0, 7.0]);
    pair.law.friction = 0.0;
    for _ in 0..100 {
        assert_eq!(pair.torques(), [0.0; 2]);
    }
}

/// A packing sheared with short-lived lists and with long-lived ones: searches keep the springs, so that stresses
/// differ by the round-off of other orders of summation only. Lost springs would change them by per cents.
#[rstest]
fn searches_keep_the_springs(#[values(30, 400)] discs: usize) {
    let mut p = parameters(20.0e3, DENSE);
    p.discs = discs;
    p.grains.rolling_friction = 0.3;
    let start = packing(&p, 1);
    let run = |skin: f64| {
        let mut p = p.clone();
        p.grains.skin = skin;
        let mut element = Element::new(start.clone(), &p, 1e-4).unwrap();
        let mut searches = 0;
        for _ in 0..100 {
            element.advance(&Matrix2::new(-1.0, 5.0, 1.0, -0.5)).unwrap();
            searches += element.state.searches;
        }
        let springs = element.rve.packing.contacts().filter(|c| c.rolling != 0.0).count();
        assert!(springs > discs / 2, "{springs} contacts resist rolling");
        (element.state.stress, searches)
    };
    let ((few, seldom), (many, often)) = (run(0.5), run(0.02));
    assert!(often > seldom + 10, "{often} and {seldom} searches");
    expect("stress", (few - many).norm() / few.norm(), 0.0, 1.0e-6);
}

/// Packings that resisted rolling go on without, and their springs are gone.
#[test]
fn springs_end_with_the_coefficient() {
    let mut p = parameters(20.0e3, DENSE);
    p.discs = 30;
    p.grains.rolling_friction = 0.3;
    let mut element = Element::new(packing(&p, 1), &p, 1e-4).unwrap();
    element.advance(&Matrix2::new(-1.0, 5.0, 1.0, -0.5)).unwrap();
    assert!(element.rve.packing.contacts().any(|c| c.rolling != 0.0));
    element.parameters.grains.rolling_friction = 0.0;
    element.advance(&Matrix2::zeros()).unwrap();
    assert!(element.rve.packing.neighbours.rolling.is_empty());
}
