//! Grains at rest that hold their places.

use dem::Grains;
use dem::assembly::{Assembly, Sleep};
use rstest::rstest;

use crate::common::{
    G, GRAVITY, accurate, advance, assembly, column, column_domain, expect, flat, grain,
};

const DISCS: usize = 5;

/// Sleep without the audit, which would keep some grains awake.
fn sleep(p: &Grains) -> Sleep {
    Sleep { audit: 0.0, ..Sleep::of(p, GRAVITY, 1).unwrap() }
}

/// A stack of discs that has come to rest.
fn stack(p: &Grains) -> Assembly<f64> {
    let r = p.radius_max;
    let start = (0..DISCS).map(|k| grain([0.1, (2 * k + 1) as f64 * r], [0.0; 2], r)).collect();
    let mut stack = assembly::<f64>(p, &flat([0.2, 0.4], 0.5), GRAVITY, start);
    stack.set_drag(1.0e3);
    advance(&mut stack, 0.1);
    stack.set_drag(0.0);
    stack
}

/// As in `stack.rs`: the contacts of sleeping discs carry the weight of all above them.
#[test]
fn a_stack_carries_its_weight_asleep() {
    let p = accurate();
    let mut stack = stack(&p);
    stack.set_sleep(Some(sleep(&p)));
    advance(&mut stack, 0.1);
    assert_eq!(stack.held(), DISCS);
    let (left_out, states) = (stack.skipped(), stack.states());
    let (r, unit) = (p.radius_max, p.disc_mass(p.radius_max) * G / p.normal_stiffness);
    for k in 1..DISCS {
        let overlap = 2.0 * r - (states[k].x[1] - states[k - 1].x[1]);
        expect("overlap", overlap / unit, (DISCS - k) as f64, 1.0e-3);
    }
    let virial = states[0].virial[(1, 1)];
    let expected = p.disc_mass(r) * G * r * (2 * DISCS - 1) as f64;
    expect("virial", virial / expected, 1.0, 1.0e-3);
    // Asleep for good: of these steps none is computed, and nothing changes.
    stack.advance(1000).unwrap();
    assert_eq!(stack.skipped() - left_out, 1000 * DISCS as u64);
    assert_eq!(stack.states(), states);
}

/// A disc that falls on a sleeping stack from 2 cm meets it at 0.63 m/s, and the stack wakes; then all go to sleep
/// again under the larger weight.
#[test]
fn a_projectile_wakes_a_stack() {
    let p = Grains { damping_ratio: 0.9, ..Grains::default() };
    let r = p.radius_max;
    let fall = 0.02;
    let mut start: Vec<_> =
        (0..DISCS).map(|k| grain([0.1, (2 * k + 1) as f64 * r], [0.0; 2], r)).collect();
    start.push(grain([0.1, (2 * DISCS + 1) as f64 * r + fall], [0.0, 1.0], r));
    let mut scene = assembly::<f64>(&p, &flat([0.2, 0.4], 0.5), GRAVITY, start);
    scene.set_sleep(Some(sleep(&p)));
    // Thrown up at 1 m/s, it is back after (1 + sqrt(1 + 2 g h)) / g = 0.223 s.
    advance(&mut scene, 0.2);
    assert_eq!(scene.held(), DISCS);
    advance(&mut scene, 0.04);
    assert_eq!(scene.held(), 0, "all feel the impact");
    advance(&mut scene, 0.5);
    assert_eq!(scene.held(), DISCS + 1);
    let (states, unit) = (scene.states(), p.disc_mass(r) * G / p.normal_stiffness);
    let overlap = r - states[0].x[1];
    expect("overlap of the lowest", overlap / unit, (DISCS + 1) as f64, 0.05);
}

/// The collapse of a column of 700 discs, until it rests.
fn collapse(sleep: Option<Sleep>) -> Assembly<f32> {
    let p = Grains::default();
    let mut scene = Assembly::new(&p, &column_domain(), GRAVITY, p.step(), column()).unwrap();
    scene.set_sleep(sleep);
    advance(&mut scene, 1.5);
    scene
}

/// What grains lose as they are held counts, so that the budget of energy closes as without sleep.
#[test]
fn a_collapse_comes_to_rest_asleep() {
    let p = Grains::default();
    let start = Assembly::<f32>::new(&p, &column_domain(), GRAVITY, p.step(), column()).unwrap();
    let [plain, asleep] = [None, Some(Sleep::of(&p, GRAVITY, 1).unwrap())].map(collapse);
    let drift = asleep.energy().total() - start.energy().total();
    expect("drift over dissipation", drift / asleep.energy().dissipated(), 0.0, 0.01);
    let share = asleep.held() as f64 / asleep.len() as f64;
    assert!(share > 0.9, "{share} are held");
    assert!(asleep.skipped() > 0 && plain.skipped() == 0);
    // Two seeds of such columns differ by a diameter in their centres.
    let centre = |scene: &Assembly<f32>| {
        let states = scene.states();
        [0, 1].map(|k| states.iter().map(|s| s.x[k]).sum::<f64>() / states.len() as f64)
    };
    let (a, b) = (centre(&plain), centre(&asleep));
    for k in 0..2 {
        expect("centre", b[k], a[k], p.mean_diameter());
    }
    // A grain that would have been held moves by less than a hundredth of a diameter.
    assert!(asleep.audit() < 0.01 * p.mean_diameter(), "{} m", asleep.audit());
}

/// Also where grains sleep and wake, for any number of threads and after a restart at any step.
#[rstest]
fn the_same_bits(#[values(7, 12_000)] steps: usize) {
    let p = Grains::default();
    let run = |threads: usize, pause: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut scene =
                Assembly::<f32>::new(&p, &column_domain(), GRAVITY, p.step(), column()).unwrap();
            // More often than is good, so that many wake again.
            let sleep = Sleep { distance: 1.0e-3, time: 0.01, force: 1.0, ..sleep(&p) };
            scene.set_sleep(Some(Sleep { audit: 0.1, ..sleep }));
            scene.advance(steps).unwrap();
            if pause {
                scene = postcard::from_bytes(&postcard::to_stdvec(&scene).unwrap()).unwrap();
            }
            scene.advance(12_000).unwrap();
            assert!(scene.held() > 0 && scene.skipped() > 0 && scene.audit() > 0.0);
            scene
        })
    };
    let one = run(1, false);
    assert_eq!(one, run(2, false));
    assert_eq!(one, run(2, true));
}
