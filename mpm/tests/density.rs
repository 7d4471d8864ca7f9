//! Points that stand closer together than their volumes allow.

mod common;

use common::*;
use mpm::{Basis, Mat2, Material, MaterialError, Numerics, Points, Vec2, WallContact};
use rstest::rstest;

/// Points that fill their box to its walls overlap nowhere: the correction changes no bit.
#[rstest]
fn an_even_filling_is_left_alone(
    #[values(Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic)] basis: Basis,
    #[values(WallContact::Nodes, WallContact::Points)] wall_contact: WallContact,
) {
    let size = Vec2::new(1.0, 0.5);
    let run = |density_correction| {
        let numerics = Numerics { basis, wall_contact, density_correction, ..Numerics::default() };
        let mut solver = smooth_box(size, 0.1, numerics, Vec2::new(0.0, -GRAVITY));
        let mut points = Points::rectangle(Vec2::zeros(), size, 0.05, 1000.0);
        let mut material = elastic(1.0e6, 0.3);
        for _ in 0..20 {
            solver.advance(&mut points, &mut material, 5.0e-4).unwrap();
        }
        (points.volume, points.stress)
    };
    assert!(run(0.0) == run(100.0));
}

/// A fluid without tension: `p = K (V_0 / V - 1)`, at least 0.
struct Fluid {
    bulk_modulus: f64,
    volume: Vec<f64>,
}

impl Material for Fluid {
    fn update(
        &mut self,
        dt: f64,
        gradient: &[Mat2],
        stress: &mut [Mat2],
        volume: &mut [f64],
    ) -> Result<(), MaterialError> {
        for p in 0..volume.len() {
            volume[p] *= 1.0 + dt * gradient[p].trace();
            let pressure = self.bulk_modulus * (self.volume[p] / volume[p] - 1.0);
            stress[p] = Mat2::identity() * -pressure.max(0.0);
        }
        Ok(())
    }

    fn wave_modulus(&self, _: usize) -> f64 {
        self.bulk_modulus
    }
}

/// The volumes of the points fill the box, but the points stand in its left 70 %: their volumes overlap by a factor of
/// 1 / 0.7. Nothing moves them unless that is corrected; then they fill the box.
#[rstest]
fn crowded_points_make_room(
    #[values(WallContact::Nodes, WallContact::Points)] wall_contact: WallContact,
) {
    const PRESSED: f64 = 0.7;
    let size = Vec2::new(3.0, 0.2);
    let run = |density_correction| {
        let numerics = Numerics { wall_contact, density_correction, ..Numerics::default() };
        let mut solver = smooth_box(size, 0.1, numerics, Vec2::zeros());
        let mut points = Points::rectangle(Vec2::zeros(), size, 0.05, 1000.0);
        for x in &mut points.position {
            x.x *= PRESSED;
        }
        let mut fluid = Fluid { bulk_modulus: 1.0e5, volume: points.volume.clone() };
        for _ in 0..4000 {
            solver.advance(&mut points, &mut fluid, 2.0e-3).unwrap();
        }
        centre_of_mass(&points).x / (0.5 * size.x)
    };
    let (left, corrected) = (run(0.0), run(20.0));
    assert!((left - PRESSED).abs() < 1.0e-12, "{left}");
    // Within the slack of 5 %.
    assert!((corrected - 1.0).abs() < 0.05, "{corrected}");
}
