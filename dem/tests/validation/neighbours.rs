//! The neighbour list misses no contact, whatever the motion.

use dem::element::Element;
use dem::{Packing, Real, RveParameters};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

use crate::common::packing;

/// Touching pairs by brute force over images, as sorted `(i, j)` with repetition.
fn touching<R: Real>(packing: &Packing<R>) -> Vec<(usize, usize)> {
    let discs = packing.plain_discs();
    let h = packing.cell.h;
    let mut pairs = Vec::new();
    for (i, a) in discs.iter().enumerate() {
        for (j, b) in discs.iter().enumerate().skip(i) {
            for k in -4..=4 {
                for m in -4..=4 {
                    // Of a disc's own images, k and -k are one contact.
                    if i == j && (k, m) <= (0, 0) {
                        continue;
                    }
                    let shift = h * Vector2::new(f64::from(k), f64::from(m));
                    let branch = Vector2::from(b.x) - Vector2::from(a.x) + shift;
                    if branch.norm() < a.r + b.r - 1e-9 {
                        pairs.push((i, j));
                    }
                }
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

fn check<R: Real>(
    discs: usize,
    seed: u64,
    motion: &[[f64; 4]],
    heat: f64,
) -> Result<(), TestCaseError> {
    let mut p = RveParameters { discs, ..RveParameters::default() };
    p.preparation.pressure = 50.0e3;
    p.grains.overlap_limit = f64::INFINITY;
    p.free_solid_fraction = 0.0;
    p.thin_width = 0.0;
    let mut start: Packing<R> = packing(&p, seed).convert();
    for (k, d) in start.discs.iter_mut().enumerate() {
        let angle = k as f64;
        d.u = [angle.cos() * heat, angle.sin() * heat].map(R::from_f64);
    }
    let mut element = Element::new(start, &p, 1e-4).unwrap();
    for l in motion {
        let l = Matrix2::new(l[0], l[1], l[2], -l[0] + 0.1 * l[3]);
        for _ in 0..40 {
            element.advance(&l).unwrap();
        }
        let mut listed: Vec<_> = element.rve.packing.contacts().map(|c| (c.i, c.j)).collect();
        listed.sort_unstable();
        for pair in touching(&element.rve.packing) {
            let at = listed.iter().position(|l| *l == pair);
            prop_assert!(at.is_some(), "{:?} touch but are not listed", pair);
            listed.remove(at.unwrap());
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// After random shears, stretches and rotations (up to 100/s for 4 ms each) of hot and cold
    /// packings, in narrow (20 discs) and wide cells (80 discs), in both precisions.
    #[test]
    fn every_touching_pair_is_listed(
        wide in any::<bool>(),
        single in any::<bool>(),
        seed in 1..4u64,
        motion in prop::collection::vec(prop::array::uniform4(-100.0..100.0f64), 1..8),
        heat in prop::sample::select(vec![0.0, 0.3, 3.0]),
    ) {
        let discs = if wide { 80 } else { 20 };
        if single {
            check::<f32>(discs, seed, &motion, heat)?;
        } else {
            check::<f64>(discs, seed, &motion, heat)?;
        }
    }
}
